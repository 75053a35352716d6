"""Compile a program for a target: passes, error bound, source, artifact.

1. Run the common passes [`pipeline.COMMON`].
2. Bound the output over all inputs that the images can hold, and refuse a program whose sines may leave the
   domain on which their error is known, or whose numbers may leave float32 [`bound_over_images`].
3. Run the profile's passes and emit the source with the target's dialect.
4. Put source, weights and manifest together [`compile_program`].
"""

from __future__ import annotations

import json
import math
import textwrap
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from ..refimpl.errors import CompileError, InputError
from ..refimpl.reading import parse_json
from . import artifact, bounds, certificate, ir, profiles, schedules
from .artifact import Artifact
from .c import C
from .cuda import CUDA
from .dialect import Dialect
from .emit import kernel_gather, output_channels
from .emit_inlined import Inlined
from .emit_packed import Packed
from .enclosure import round_up as round_up
from .factor import HORIZONTAL, Cut, factor, left, over_images
from .glsl import GLSL
from .glsl_buffers import ComputeDenoise, VulkanDenoise
from .glsl_compute import GLSL_COMPUTE
from .glsl_es import GLSLES, GLSLESInlined, GLSLESPacked
from .glsl_inlined import GLSL_LADDER
from .hosts import GodotDenoise, ShadertoyDenoise
from .ir import LEAST, OUTPUT_ENCODING, Gather, Program
from .metal import Metal
from .opencl import OpenCL
from .opencl_fourier import OPENCL_FOURIER
from .opencl_group import OPENCL_GROUPS
from .opencl_tiled import OPENCL_LADDER
from .passes import pipeline
from .profiles import Profile, SineContract
from .schedules import PLAIN, Pick, Plain, Printed, Schedule, pick
from .sums import is_split
from .weight_homes import HOMES
from .wgsl import WGSL


@dataclass(frozen=True)
class Target:
    """Something that runs kernels: how its source is made, and what its own sine promises.

    `widest`: most channels of an image that a kernel reads, `most` of all that it writes; None: any number.
    `assumes`: what a bound rests on that the language does not promise.
    """

    name: str
    language: str
    suffix: str
    entry: str
    native_sine: SineContract
    schedules: tuple[Schedule, ...]
    widest: int | None = None
    most: int | None = None
    assumes: str = ""


def _dialect_target(dialect: Dialect, *ladder: Schedule) -> Target:
    """Return the target whose source a dialect makes, with its schedules besides the plain one."""
    return Target(
        dialect.target,
        dialect.language,
        dialect.suffix,
        dialect.entry,
        dialect.native_sine,
        (Plain(dialect), *ladder),
        widest=dialect.channels_per_result,
        most=dialect.max_output_channels,
        assumes=dialect.assumes,
    )


TARGETS: Mapping[str, Target] = {
    target.name: target
    for target in (
        Target(
            "numpy",
            "wamnet IR",
            ".ir.txt",
            "program",
            SineContract("np.sin, whose documentation promises nothing", None),
            (Printed(),),
        ),
        _dialect_target(OpenCL(), *OPENCL_LADDER, *OPENCL_FOURIER, *OPENCL_GROUPS),
        _dialect_target(GLSL(), *GLSL_LADDER, *GLSL_COMPUTE),
    )
}
"""All targets of paths, encodings and denoisers, by the name of the executor that runs them."""

DENOISERS: Mapping[str, Target] = {**TARGETS, "c": _dialect_target(C())}
"""All targets that an executor of the registry runs: those, and C, whose executor denoises alone."""

EXPORTED: Mapping[str, Target] = {
    target.name: target
    for target in (
        _dialect_target(GLSLES(), Inlined(GLSLESInlined()), Packed(GLSLESPacked())),
        _dialect_target(ComputeDenoise(), *GLSL_COMPUTE),
        _dialect_target(VulkanDenoise()),
        _dialect_target(WGSL()),
        _dialect_target(CUDA()),
        _dialect_target(Metal()),
        replace(_dialect_target(ShadertoyDenoise()), schedules=(Inlined(ShadertoyDenoise()),)),
        _dialect_target(GodotDenoise()),
    )
} | {name: _dialect_target(dialect) for name, dialect in HOMES.items()}
"""Targets that are written for other programs to run: kernels/export has what runs them in tests."""


KEPT_INFO = ("normalization", "recipe", "steps_done", "data_digest", "trained_on_scene")
"""What of a model's info a manifest repeats: how to encode images, and where the weights come from."""


JSON_INFO = ("normalization", "recipe")
"""Which of them are JSON texts."""


AGAINST = "float64 reference, same float32 weights and images"
"""What a bound compares a kernel with."""

AGAINST_PINNED = f"{AGAINST}, where weights below {LEAST!r} are 0"
"""The same for an exact kernel."""

SUMS = "sums      over the window: a partial sum for each image and row of taps, in any order; then these"
"""What a header says where the bound rests on partial sums [sums.py]."""


@dataclass(frozen=True)
class Bound:
    """A-priori promise: `output` bounds each channel's error, None where an operation promises nothing.

    `sines` holds the range of each sine's argument; `proof` the steps of a certificate, if it has one.
    """

    output: tuple[float, ...] | None
    sines: tuple[tuple[float, float], ...]
    proof: certificate.Proof | None = None


def analysed(program: Program, profile: str = "ieee") -> Program:
    """Return the program that bounds speak about: after the common passes, each sine one node."""
    return pipeline.run(program, (*pipeline.COMMON, *profiles.profile_named(profile).common))


def sine_contract(profile: str, target: str) -> SineContract:
    """Return what is promised of a sine under this profile on this target."""
    return profiles.profile_named(profile).sine or target_named(target).native_sine


def bound_over_images(
    program: Program, profile: str, target: str, cut: Cut | None = None, schedule: Schedule | None = None
) -> Bound:
    """Return the bound of an analysed program over all that its images can hold, or refuse it.

    `cut`: it is run as these two passes; `schedule`: not the plain one.
    """
    contract = sine_contract(profile, target)
    chosen = schedule or target_named(target).schedules[0]
    found = over_images(cut, contract) if cut else chosen.enclosures(program, contract)
    if profiles.profile_named(profile).sine is not None:
        _check_sizes(program, found)
    sines = [index for index, node in enumerate(program.nodes) if node.op == "sin"]
    ranges = []
    for number, index in enumerate(sines):
        argument = found[program.nodes[index].args[0]]
        ranges.append((float(argument.low.min()), float(argument.high.max())))
        # What a sine without a contract passes on is unknown: there is no domain to check against.
        if contract.error is not None and not bounds.argument_reach(argument).max() <= contract.domain:
            _refuse_domain(number + 1, len(sines), index, ranges[-1], contract)
    errors = bounds.output_errors(program, found)[program.outputs[0][0]]
    if not all(math.isfinite(error) for error in errors):
        return Bound(None, tuple(ranges))
    proof = None if cut else certificate.prove(program, found, contract)
    return Bound(proof.bound if proof else tuple(float(e) for e in errors), tuple(ranges), proof)


def _check_sizes(program: Program, found: Sequence[bounds.Enclosure]) -> None:
    """Refuse a program whose numbers may overflow, which would leave it without a bound."""
    layer = -1
    for index, (node, enclosure) in enumerate(zip(program.nodes, found, strict=True)):
        layer += node.op == "affine"
        if enclosure.overflows:
            place = f"layer {layer}, %{index}" if layer >= 0 else f"%{index}"
            raise CompileError(
                f"{node.op} ({place}) may hold numbers up to {np.nanmax(enclosure.size):.3g}: float32 ends "
                f"at {np.finfo(np.float32).max:.3g}; use smaller weights, a smaller omega_0 or features of a "
                "smaller range, or profile native, which then promises nothing"
            )


def _refuse_domain(
    number: int, count: int, index: int, found: tuple[float, float], contract: SineContract
) -> None:
    """Raise: a sine may be given an argument for which nothing is proven."""
    raise CompileError(
        f"sine {number} of {count} (layer {number - 1}, %{index}) may be given arguments from {found[0]:.6g} "
        f"to {found[1]:.6g}: the sine ({contract.text}) is proven for |x| <= {contract.domain:g}; "
        "use a smaller omega_0, smaller weights or features of a smaller range, or profile native, which "
        "promises less"
    )


def target_named(name: str) -> Target:
    """Return the target, or say which ones there are."""
    known = {**DENOISERS, **EXPORTED}
    if name not in known:
        raise CompileError(f"target {name!r} does not exist; there are: {', '.join(known)}")
    return known[name]


def compile_program(
    program: Program, target: str, profile: str = "ieee", schedule: str = PLAIN, rank: int = 0
) -> Artifact:
    """Return the kernel of a program that reads a window and writes one output.

    A schedule that cannot hold the program gives way to the plain one; the manifest says so. With a `rank`
    the first layer is cut to it, and there are two kernels [factor.py].
    """
    chosen = target_named(target)
    kernel_gather(program)
    common = analysed(program, profile)
    if common.exact and chosen.assumes:
        raise CompileError(
            f"profile {profile}: {chosen.language} has no word that keeps operations in order; use profile "
            "ieee, or a target that has one"
        )
    if not rank:
        picked = _picked(common, chosen, profile, schedule).schedule
        bound = bound_over_images(common, profile, target, schedule=picked)
        return _compiled(common, chosen, profile, schedule, bound)
    if chosen.most is not None and rank > chosen.most:
        raise CompileError(
            f"rank {rank}: the image between both passes has as many channels, and {chosen.language} "
            f"writes at most {chosen.most}; use a smaller rank, or OpenCL or C, which have no such limit"
        )
    cut = factor(common, rank, chosen.widest)
    bound = bound_over_images(common, profile, target, cut)
    alone = bound_over_images(cut.horizontal, profile, target)
    notes = (
        f"pass      1 of 2: sums along the rows, of a first layer of rank {rank}"
        + ("" if chosen.widest is None else f"; {chosen.widest} in each colour buffer,\n          in order"),
        f"pass      2 of 2: sums along the columns of the first pass's image, and the layers after it; the\n"
        f"          bound is that of both passes, against program {ir.digest(common)[:32]}",
    )
    before = _compiled(cut.horizontal, chosen, profile, schedule, alone, notes[0].split("\n"))
    found = _compiled(cut.vertical, chosen, profile, schedule, bound, notes[1].split("\n"))
    return _joined(before, found, _report(cut, profile, target))


def _report(cut: Cut, profile: str, target: str) -> Mapping[str, Any]:
    """Return what a manifest says about a cut: its own error in the layer, and that of rounding alone."""
    weights = left(cut)
    low, high = bounds.window_box(kernel_gather(cut.whole))
    largest = np.maximum(np.abs(low), np.abs(high))
    whole = np.abs(cut.whole.parameters[str(cut.whole.nodes[cut.layer]["weight"])].astype(np.float64))
    layer, reach = (round_up(float((w @ largest).max())) for w in (weights, whole))
    found = over_images(cut, sine_contract(profile, target), of_cut=False)
    rounding = bounds.output_errors(cut.whole, found)[cut.whole.outputs[0][0]]
    finite = bool(np.isfinite(rounding).all())
    return {
        "rank": cut.rank,
        "program": ir.digest(cut.whole),
        "cut": {"first_layer": layer, "of": reach, "against": "the first layer's sums, before its sine"},
        "rounding": {
            "output": [round_up(float(error)) for error in rounding] if finite else None,
            "against": "float64 reference with the weights that the factors' product is",
        },
    }


def _joined(before: Artifact, found: Artifact, report: Mapping[str, Any]) -> Artifact:
    """Return both passes as one artifact, whose manifest holds the first one's."""
    digest = ir.sha256(f"{before.digest} {found.digest}".encode())
    factored = {**report, HORIZONTAL: before.manifest}
    files = {f"{artifact.FIRST_PASS}{name}": value for name, value in before.manifest["files"].items()}
    files = {**files, **found.manifest["files"]}
    bound = {**found.manifest["bound"], "against": "float64 reference of the program that was cut"}
    own = {"digest": digest, "files": files, "bound": bound, "factored": factored}
    manifest = {**found.manifest, **own}
    return replace(found, manifest=manifest, before=before)


def _compiled(
    common: Program, chosen: Target, profile: str, schedule: str, bound: Bound, notes: Sequence[str] = ()
) -> Artifact:
    """Return the kernel of an analysed program; `notes` are further lines of its header."""
    promised = profiles.profile_named(profile)
    emitted = pipeline.run(common, promised.passes)
    picked = pick(chosen.schedules, schedule, emitted)
    header = [*_header(common, chosen, promised, bound, picked), *notes]
    header += _weight_lines(emitted, picked.schedule)
    source = picked.schedule.emit(emitted, header, bound.output is not None)
    return _assemble(common, emitted, chosen, promised, bound, picked, source)


def schedule_named(target: str, name: str) -> Schedule:
    """Return the schedule of this name of a target."""
    return {schedule.name: schedule for schedule in target_named(target).schedules}[name]


def _picked(common: Program, chosen: Target, profile: str, schedule: str) -> Pick:
    """Return the schedule of an analysed program."""
    emitted = pipeline.run(common, profiles.profile_named(profile).passes)
    return pick(chosen.schedules, schedule, emitted)


def _header(program: Program, target: Target, profile: Profile, bound: Bound, picked: Pick) -> list[str]:
    """Return the lines of the comment at the top of the source."""
    gather, channels = kernel_gather(program), output_channels(program)
    images = [
        f"{i.name}: {i.channels} channels in {i.range_text}" + (f", {i.encoding}" if i.encoding else "")
        for i in gather.images
    ]
    encoding = dict(program.info).get(OUTPUT_ENCODING)
    arguments = _arguments(picked, channels).split("\n")
    rows, columns = gather.rows, gather.columns
    tap = f"{rows // 2}" if rows == columns else f"({rows // 2}, {columns // 2})"
    language = picked.schedule.language or target.language
    return [
        f"wamnet denoiser, {language}. Generated: change the compiler, not this text.",
        f"program   {ir.digest(program)[:32]}",
        f"images    {images[0]}",
        *(f"          {line}" for line in images[1:]),
        f"window    {rows} x {columns} pixels, the pixel itself is tap {tap}",
        f"border    {gather.window.border}",
        f"output    {channels} channels" + (f", {encoding}" if encoding else ""),
        f"profile   {profile.name}: {profile.text}",
        f"sine      {sine_contract(profile.name, target.name).text}",
        f"bound     {_bound_text(bound)}",
        *(_wrapped("assumes", target.assumes) if target.assumes and bound.output else []),
        *([SUMS] if is_split(gather) and type(picked.schedule).enclosures is Schedule.enclosures else []),
        *([] if picked.schedule.name == PLAIN else [f"schedule  {schedules.text(picked.manifest())}"]),
        f"arguments {arguments[0]}",
        *(f"          {line}" for line in arguments[1:]),
    ]


def _arguments(picked: Pick, channels: int) -> str:
    """Return how a kernel is called."""
    columns, rows = picked.extent
    return picked.schedule.arguments.format(channels=channels, columns=columns, rows=rows)


def _weight_lines(program: Program, schedule: Schedule) -> list[str]:
    """Return the lines of the header that say where each parameter lies, wrapped."""
    places = schedule.layout(program).values()
    slots = [f"{s.name} ({' x '.join(map(str, s.shape))}) at {s.offset}" for s in places]
    text = f"{', '.join(slots) or 'none'}; {schedule.order}"
    return _wrapped("weights", text)


def _wrapped(name: str, text: str) -> list[str]:
    """Return the lines of a header's entry."""
    return textwrap.wrap(text, 98, initial_indent=f"{name:10}", subsequent_indent=" " * 10)


def _bound_text(bound: Bound) -> str:
    """Return the bound as a reader wants it, rounded up."""
    if bound.output is None:
        return "none: for some images an operation of this program promises nothing on this target"
    return f"|output - float64 reference| <= {round_up(max(bound.output)):g} for all images in these ranges"


def _assemble(
    common: Program,
    emitted: Program,
    target: Target,
    profile: Profile,
    bound: Bound,
    picked: Pick,
    source: str,
) -> Artifact:
    """Return the artifact with its manifest."""
    gather, schedule = kernel_gather(emitted), picked.schedule
    weights, slots = schedule.pack(emitted), schedule.layout(emitted).values()
    raw = weights.astype("<f4").tobytes()
    source_name = f"denoise{schedule.suffix or target.suffix}"
    manifest: dict[str, Any] = {
        "schema": artifact.SCHEMA,
        "digest": ir.sha256(source.encode(), raw),
        "program": ir.digest(common),
        "target": target.name,
        "language": schedule.language or target.language,
        "entry_point": target.entry,
        "profile": {"name": profile.name, "text": profile.text},
        "sine": asdict_finite(sine_contract(profile.name, target.name)),
        "passes": [*pipeline.COMMON, *profile.common, *profile.passes],
        "window": _window(gather),
        "images": [asdict(image) for image in gather.images],
        "output": {
            "name": emitted.outputs[0][0],
            "channels": output_channels(emitted),
            "encoding": dict(emitted.info).get(OUTPUT_ENCODING, ""),
        },
        "arguments": _arguments(picked, output_channels(emitted)),
        "bound": {
            "output": bound.output and [round_up(error) for error in bound.output],
            "against": AGAINST_PINNED if emitted.exact else AGAINST,
        },
        "certificate": artifact.CERTIFICATE_NAME if bound.proof else None,
        "sine_arguments": [[_finite(-round_up(-low)), _finite(round_up(high))] for low, high in bound.sines],
        "info": {name: _info_value(name, text) for name, text in emitted.info if name in KEPT_INFO},
        "files": {
            source_name: ir.sha256(source.encode()),
            artifact.WEIGHTS_NAME: ir.sha256(raw),
        },
        "private_bytes": schedule.private_bytes(emitted),
        "schedule": picked.manifest(),
        "weights": {
            "count": int(weights.size),
            "layout": [asdict(slot) for slot in slots],
            "order": schedule.order,
        },
    }
    manifest = json.loads(json.dumps(manifest, allow_nan=False))
    proven = None
    if bound.proof:
        sine = sine_contract(profile.name, target.name)
        proven = certificate.certificate(common, bound.proof, sine, schedule, emitted, manifest)
    names = (target.name, profile.name, target.entry)
    return Artifact(*names, source, source_name, emitted, weights, manifest, certificate=proven)


def _window(gather: Gather) -> dict[str, Any]:
    """Return what a manifest says about the window; of one along an axis also its rows and columns."""
    oblong = {} if gather.rows == gather.columns else {"rows": gather.rows, "columns": gather.columns}
    return {**asdict(gather.window), "centre": gather.window.size // 2, **oblong}


def _info_value(name: str, text: str) -> Any:
    """Return a text of a model's info, or what it holds where it is JSON: strangers write what they like."""
    with suppress(InputError):
        return parse_json(text, name, "train again") if name in JSON_INFO else text
    return text


def asdict_finite(contract: SineContract) -> dict[str, Any]:
    """Return a contract for JSON, which has no infinity: null means everywhere."""
    found = asdict(contract)
    return {**found, "domain": _finite(found["domain"])}


def _finite(value: float) -> float | None:
    """Return the value for JSON, None for an infinity."""
    return value if math.isfinite(value) else None
