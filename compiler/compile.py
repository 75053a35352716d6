"""Compile a plan: header, source, weights and manifest become one artifact [`compile_plan`].

1. The plan has run the passes, picked the schedule and bounded the output [plan.py].
2. The schedule emits the source below a comment that says what the kernel is and promises [`_header`].
3. The manifest says the same as data, and a certificate has the steps of the bound's proof [`_assemble`].
"""

from __future__ import annotations

import json
import math
import textwrap
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, replace
from typing import Any

import numpy as np

from ..refimpl.errors import InputError
from ..refimpl.reading import SIZES, parse_json
from . import artifact
from .artifact import Artifact, schedule_text
from .core import ir
from .core.enclosure import round_up as round_up
from .core.ir import OUTPUT_ENCODING, Gather, Program
from .core.passes import pipeline
from .core.profiles import SineContract
from .core.sums import is_split
from .plan import Bound, Plan, plan_program
from .proof import bounds, certificate
from .proof.whole import has_one_zero
from .schedules.common import kernel_gather, output_channels
from .schedules.factor import HORIZONTAL, Cut, left
from .schedules.schedules import PLAIN, Schedule

KEPT_INFO = ("normalization", "recipe", "steps_done", "data_digest", "trained_on_scene")
"""What of a model's info a manifest repeats: how to encode images, and where the weights come from."""


JSON_INFO = ("normalization", "recipe")
"""Which of them are JSON texts."""


AGAINST = "float64 reference, same float32 weights and images"
"""What a bound compares a kernel with."""

AGAINST_WHOLE = "reference in integers, the same bits"
"""The same for a kernel in which nothing rounds."""

WHOLE_SINE = "a polynomial of degree 5 in products and shifts of words"
"""What a header says of the sine of integers."""

SUMS = "sums      over the window: a partial sum for each image and row of taps, in any order; then these"
"""What a header says where the bound rests on partial sums [sums.py]."""


def compile_program(
    program: Program, target: str, profile: str = "ieee", schedule: str = PLAIN, rank: int = 0
) -> Artifact:
    """Return the kernel of a program that reads a window and writes one output [`plan_program`]."""
    return compile_plan(plan_program(program, target, profile, schedule, rank))


def compile_plan(plan: Plan) -> Artifact:
    """Return the kernel of a plan, or both of a first layer that is cut to a rank.

    Another schedule replaces one that cannot hold the program; the manifest says so.
    """
    found = _of_one_pass(plan, plan.bound) if plan.cut is None else _of_two_passes(plan, plan.cut)
    variant = plan.variation
    return replace(found, manifest={**found.manifest, "variant": variant}) if variant else found


def _of_two_passes(plan: Plan, cut: Cut) -> Artifact:
    """Return the kernel along the columns, with the one along the rows before it."""
    horizontal, vertical = plan.passes
    bound, alone = plan.bound, horizontal.bound
    widest = plan.target.widest
    notes = (
        f"pass      1 of 2: sums along the rows, of a first layer of rank {cut.rank}"
        + ("" if widest is None else f"; {widest} in each colour buffer,\n          in order"),
        f"pass      2 of 2: sums along the columns of the first pass's image, and the layers after it; the\n"
        f"          bound is that of both passes, against program {ir.digest(plan.analysed)[:32]}",
    )
    before = _of_one_pass(horizontal, alone, notes[0].split("\n"), HORIZONTAL)
    found = _of_one_pass(vertical, bound, notes[1].split("\n"))
    return replace(_joined(before, found, _report(plan, cut)), plan=plan)


def _report(plan: Plan, cut: Cut) -> Mapping[str, Any]:
    """Return what a manifest says about a cut: its own error in the layer, and that of rounding by itself."""
    weights = left(cut)
    low, high = bounds.window_box(kernel_gather(cut.whole))
    largest = np.maximum(np.abs(low), np.abs(high))
    whole = np.abs(cut.whole.parameters[str(cut.whole.nodes[cut.layer]["weight"])].astype(np.float64))
    layer, reach = (round_up(float((w @ largest).max())) for w in (weights, whole))
    rounding = bounds.output_errors(cut.whole, plan.enclosures(of_cut=False))[cut.whole.outputs[0][0]]
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
    sizes = {f"{artifact.FIRST_PASS}{name}": size for name, size in before.manifest[SIZES].items()}
    own = {"digest": digest, "files": files, SIZES: {**sizes, **found.manifest[SIZES]}, "bound": bound}
    own["factored"] = factored
    manifest = {**found.manifest, **own}
    return replace(found, manifest=manifest, before=before)


def _of_one_pass(plan: Plan, bound: Bound, notes: Sequence[str] = (), part: str = "") -> Artifact:
    """Return the kernel of a plan without a cut; `notes` are further lines of its header.

    `part`: what a language calls it whose hosts join it with the denoiser's other kernel.
    """
    header = [*_header(plan, bound), *notes, *_weight_lines(plan.emitted, plan.schedule)]
    # Where nothing rounds, a language need not keep the order of operations.
    is_ordered = bound.output is not None and not bound.exact
    source, entry, dialect = (
        plan.schedule.emit(plan.emitted, header, is_ordered),
        plan.target.entry,
        plan.target.dialect,
    )
    if part and dialect is not None:
        source, entry = dialect.apart(source, part), dialect.apart(entry, part)
    return _assemble(plan, bound, source, entry)


def _header(plan: Plan, bound: Bound) -> list[str]:
    """Return the lines of the comment at the top of the source."""
    program, target, picked = plan.analysed, plan.target, plan.picked
    gather, channels = kernel_gather(program), output_channels(program)
    images = [
        f"{i.name}: {i.channels} channels in {i.range_text}" + (f", {i.encoding}" if i.encoding else "")
        for i in gather.images
    ]
    encoding = dict(program.info).get(OUTPUT_ENCODING)
    arguments = _arguments(plan).split("\n")
    rows, columns = gather.rows, gather.columns
    tap = f"{rows // 2}" if rows == columns else f"({rows // 2}, {columns // 2})"
    language = plan.language.language if plan.language else target.language
    return [
        f"wamnet denoiser, {language}. Generated: change the compiler, not this text.",
        f"program   {ir.digest(program)[:32]}",
        f"images    {images[0]}",
        *(f"          {line}" for line in images[1:]),
        f"window    {rows} x {columns} pixels, the pixel itself is tap {tap}",
        f"border    {gather.window.border}",
        f"output    {channels} channels" + (f", {encoding}" if encoding else ""),
        f"profile   {plan.profile.name}: {plan.profile.text}",
        f"sine      {WHOLE_SINE if bound.exact else plan.sine.text}",
        f"bound     {_bound_text(bound, program)}",
        *(_wrapped("assumes", plan.assumes) if plan.assumes and bound.output else []),
        *([SUMS] if is_split(gather) and plan.shares_bound else []),
        *([] if picked.schedule.name == PLAIN else [f"schedule  {schedule_text(picked.manifest())}"]),
        f"arguments {arguments[0]}",
        *(f"          {line}" for line in arguments[1:]),
    ]


def _arguments(plan: Plan) -> str:
    """Return how a kernel is called."""
    return plan.schedule.arguments(plan.emitted)


def _weight_lines(program: Program, schedule: Schedule) -> list[str]:
    """Return the lines of the header that say where each parameter is, wrapped."""
    places = schedule.layout(program).values()
    slots = [f"{s.name} ({' x '.join(map(str, s.shape))}) at {s.offset}" for s in places]
    text = f"{', '.join(slots) or 'none'}; {schedule.order}"
    return _wrapped("weights", text)


def _wrapped(name: str, text: str) -> list[str]:
    """Return the lines of a header's entry."""
    return textwrap.wrap(text, 98, initial_indent=f"{name:10}", subsequent_indent=" " * 10)


def _bound_text(bound: Bound, program: Program) -> str:
    """Return the bound as a reader wants it, rounded up."""
    if bound.exact:
        same = "the same bits" if has_one_zero(program) else "the same numbers; a zero may have either sign"
        return f"0: no operation rounds, so that every device and compiler computes {same}"
    if bound.output is None:
        return "none: for some images an operation of this program promises nothing on this target"
    return f"|output - float64 reference| <= {round_up(max(bound.output)):g} for all images in these ranges"


def _assemble(plan: Plan, bound: Bound, source: str, entry: str) -> Artifact:
    """Return the artifact with its manifest."""
    emitted, target, schedule = plan.emitted, plan.target, plan.schedule
    gather, profile = kernel_gather(emitted), plan.profile
    weights, slots = schedule.pack(emitted), schedule.layout(emitted).values()
    raw = weights.astype("<f4").tobytes()
    suffix = plan.language.suffix if plan.language else target.suffix
    source_name = f"denoise{suffix}"
    manifest: dict[str, Any] = {
        "schema": artifact.SCHEMA,
        "digest": ir.sha256(source.encode(), raw),
        "program": ir.digest(plan.analysed),
        "target": target.name,
        "language": plan.language.language if plan.language else target.language,
        "entry_point": entry,
        "profile": {"name": profile.name, "text": profile.text},
        "sine": asdict_finite(plan.sine),
        "passes": [*pipeline.COMMON, *profile.passes],
        "window": _window(gather),
        "images": [image.facts for image in gather.images],
        "output": {
            "name": emitted.outputs[0][0],
            "channels": output_channels(emitted),
            "encoding": dict(emitted.info).get(OUTPUT_ENCODING, ""),
        },
        "arguments": _arguments(plan),
        "bound": {
            "output": bound.output and [round_up(error) for error in bound.output],
            "against": AGAINST_WHOLE if bound.exact else AGAINST,
        },
        "certificate": artifact.CERTIFICATE_NAME if bound.proof or bound.exact else None,
        "sine_arguments": [[_finite(-round_up(-low)), _finite(round_up(high))] for low, high in bound.sines],
        "info": {name: _info_value(name, text) for name, text in emitted.info if name in KEPT_INFO},
        "files": {
            source_name: ir.sha256(source.encode()),
            artifact.WEIGHTS_NAME: ir.sha256(raw),
        },
        SIZES: {source_name: len(source.encode()), artifact.WEIGHTS_NAME: len(raw)},
        "private_bytes": schedule.private_bytes(emitted),
        "schedule": plan.picked.manifest(),
        "weights": {
            "count": int(weights.size),
            "layout": [asdict(slot) for slot in slots],
            "order": schedule.order,
        },
    }
    manifest = json.loads(json.dumps(manifest, allow_nan=False))
    proven = None
    if bound.exact:
        proven = certificate.integers(plan.analysed, schedule, emitted, manifest)
    elif bound.proof:
        proven = certificate.certificate(plan.analysed, bound.proof, plan.sine, schedule, emitted, manifest)
    return Artifact(plan, source, source_name, emitted, weights, manifest, certificate=proven)


def _window(gather: Gather) -> dict[str, Any]:
    """Return what a manifest says about the window; of one along an axis also its rows and columns."""
    oblong = {} if gather.rows == gather.columns else {"rows": gather.rows, "columns": gather.columns}
    return {**asdict(gather.window), "centre": gather.window.size // 2, **oblong}


def _info_value(name: str, text: str) -> Any:
    """Return a text of a model's info, or its value where it is JSON: an untrusted text may be anything."""
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
