"""Compile a plan: header, source, weights and manifest become one artifact [`compile_plan`].

1. The plan has run the passes, picked the schedule and bounded the output [plan.py].
2. One function makes artifacts of kernels of all roles: a comment says what a kernel is and promises, its
   source is below it, and the manifest says the same as data [`assemble`].
3. A certificate has the steps of the proof of a network's bound.
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
from numpy.typing import NDArray

from ..refimpl.errors import InputError
from ..refimpl.reading import SIZES, parse_json
from . import artifact
from .artifact import Artifact, schedule_text
from .core import ir
from .core.enclosure import round_up as round_up
from .core.ir import OUTPUT_ENCODING, Image, Program
from .core.passes import pipeline
from .core.profiles import SineContract
from .core.sums import is_split
from .languages.dialect import NOTHING, Dialect
from .languages.listing import listed
from .languages.renderer import Renderer
from .plan import Bound, Plan, plan_program
from .proof import bounds, certificate
from .proof.evidence import AGAINST
from .proof.whole import has_one_zero
from .schedules.common import kernel_gather, output_channels
from .schedules.factor import HORIZONTAL, Cut, left
from .schedules.schedules import PLAIN
from .targets import Language
from .variants import variation

KEPT_INFO = ("normalization", "recipe", "steps_done", "data_digest", "trained_on_scene")
"""What of a model's info a manifest repeats: how to encode images, and where the weights come from."""


WHOLE_SINE = "a polynomial of degree 5 in products and shifts of words"
"""What a header says of the sine of integers."""

SUMS = "over the window: a partial sum for each image and row of taps, in any order; then these"
"""What a header says where the bound rests on partial sums [sums.py]."""

WIDE = 88
"""Characters of a line of a header's entry."""

Entry = tuple[str, Sequence[str]]
"""An entry of a header: its title and its lines."""

CALLED = "arguments"
"""Title of the entry that says how a kernel is called."""


def assemble(
    title: str,
    language: Language,
    renderer: Renderer,
    programs_by_name: Sequence[tuple[str, Program]],
    entries: Sequence[Entry],
    facts: Mapping[str, Any],
    programs: Any,
    images: Sequence[Image] = (),
    weights: NDArray[np.float32] | None = None,
    part: str = "",
    lists: Mapping[str, Sequence[str]] = NOTHING,
    notes: Mapping[str, str] = NOTHING,
) -> Artifact:
    """Return a kernel with its source and its manifest, of what is particular to it.

    `renderer` prints it, or where no language is its programs by name are listed; `entries` are those of its
    header, of which one may be CALLED, `facts` those of its manifest; `programs` are kept for an interpreter.
    `part`: what a language calls it whose hosts join it with the denoiser's other kernel; `lists`, `notes`:
    what else there is to say of its arguments [languages/dialect.py: Dialect.arguments].
    """
    dialect, kernel = renderer.dialect, renderer.kernel
    arguments, role = dialect.arguments(kernel, lists, notes), kernel.interface.role
    called = [(t, arguments.split("\n") if t == CALLED else texts) for t, texts in entries]
    lines = header(title, dialect, called)
    is_listed, entry = dialect.is_listing, dialect.entries[role]
    source = listed(lines, programs_by_name) if is_listed else renderer.source(lines)
    if part:
        source, entry = dialect.apart(source, part), dialect.apart(entry, part)
    files = {f"{role}{dialect.suffix}": source.encode()}
    if weights is not None:
        files[artifact.WEIGHTS_NAME] = weights.astype("<f4").tobytes()
    manifest = {
        "digest": ir.sha256(*files.values()),
        "target": dialect.target,
        "language": dialect.language,
        "entry_point": entry,
        "profile": language.profile.facts,
        "arguments": arguments,
        "bound": None,
        "files": {name: ir.sha256(data) for name, data in files.items()},
        SIZES: {name: len(data) for name, data in files.items()},
        **facts,
    }
    manifest = json.loads(json.dumps(manifest, allow_nan=False))
    held = artifact.NONE if weights is None else weights
    return Artifact(source, manifest, kernel.interface, tuple(images), programs, kernel, held)


def header(title: str, dialect: Dialect, entries: Sequence[Entry]) -> list[str]:
    """Return the lines of the comment at the top of a source: each entry's title is before its first line."""
    lines = [f"wamnet {title}, {dialect.language}. Generated: change the compiler, not this text."]
    for name, texts in entries:
        lines += [f"{'' if number else name:10}{text}" for number, text in enumerate(texts)]
    return lines


def compile_program(
    program: Program, language: Language | str, schedule: str = PLAIN, rank: int = 0
) -> Artifact:
    """Return the kernel of a program that reads a window and writes one output [`plan_program`]."""
    return compile_plan(plan_program(program, language, schedule, rank))


def compile_plan(plan: Plan) -> Artifact:
    """Return the kernel of a plan, or both of a first layer that is cut to a rank.

    Another schedule replaces one that cannot hold the program; the manifest says so.
    """
    found = _of_one_pass(plan, plan.bound) if plan.cut is None else _of_two_passes(plan, plan.cut)
    variant = variation(plan)
    return replace(found, manifest={**found.manifest, "variant": variant}) if variant else found


def _of_two_passes(plan: Plan, cut: Cut) -> Artifact:
    """Return the kernel along the columns, with the one along the rows before it."""
    horizontal, vertical = plan.passes
    bound, alone = plan.bound, horizontal.bound
    widest = plan.target.dialect.channels_per_result
    notes = (
        f"1 of 2: sums along the rows, of a first layer of rank {cut.rank}"
        + ("" if widest is None else f"; {widest} in each colour buffer,\nin order"),
        f"2 of 2: sums along the columns of the first pass's image, and the layers after it; the\n"
        f"bound is that of both passes, against program {ir.digest(plan.analysed)[:32]}",
    )
    before = _of_one_pass(horizontal, alone, [("pass", notes[0].split("\n"))], HORIZONTAL)
    found = _of_one_pass(vertical, bound, [("pass", notes[1].split("\n"))])
    return replace(_joined(before, found, _report(cut), cut), plan=plan)


def _report(cut: Cut) -> Mapping[str, Any]:
    """Return what a manifest says about a cut: its own error in the layer."""
    weights = left(cut)
    low, high = bounds.window_box(kernel_gather(cut.whole))
    largest = np.maximum(np.abs(low), np.abs(high))
    whole = np.abs(cut.whole.parameters[str(cut.whole.nodes[cut.layer]["weight"])].astype(np.float64))
    layer, reach = (round_up(float((w @ largest).max())) for w in (weights, whole))
    return {
        "rank": cut.rank,
        "program": ir.digest(cut.whole),
        "cut": {"first_layer": layer, "of": reach, "against": "the first layer's sums, before its sine"},
    }


def _joined(before: Artifact, found: Artifact, report: Mapping[str, Any], cut: Cut) -> Artifact:
    """Return both passes as one artifact, whose manifest holds the first one's."""
    bound = {**found.manifest["bound"], "against": AGAINST[2]}
    proven = found.certificate
    if proven:
        total = {**proven["bound"], "against": bound["against"]}
        proven = {**proven, "factored": certificate.factored(cut.whole), "bound": total}
    own = {
        "digest": ir.sha256(f"{before.digest} {found.digest}".encode()),
        "bound": bound,
        "factored": {**report, HORIZONTAL: before.manifest},
    }
    for key in ("files", SIZES):
        first = {f"{artifact.FIRST_PASS}{name}": value for name, value in before.manifest[key].items()}
        own[key] = {**first, **found.manifest[key]}
    return replace(found, manifest={**found.manifest, **own}, before=before, certificate=proven)


def _of_one_pass(plan: Plan, bound: Bound, notes: Sequence[Entry] = (), part: str = "") -> Artifact:
    """Return the kernel of a plan without a cut; `notes` are further entries of its header."""
    emitted, schedule = plan.emitted, plan.schedule
    weights = schedule.pack(emitted)
    held = schedule.layout(emitted).values()
    slots = (f"{s.name} ({' x '.join(map(str, s.shape))}) at {s.offset}" for s in held)
    places = f"{', '.join(slots) or 'none'}; {schedule.order}"
    # Where nothing rounds, a language need not keep the order of operations.
    is_ordered = bound.output is not None and not bound.exact
    found = assemble(
        "denoiser",
        plan.target,
        schedule.renderer(emitted, is_ordered),
        [("", emitted)],
        [*_entries(plan, bound), *notes, ("weights", textwrap.wrap(places, WIDE))],
        _facts(plan, bound, weights),
        emitted,
        images=kernel_gather(emitted).images,
        weights=weights,
        part=part,
    )
    proven = None
    if bound.exact:
        proven = certificate.integers(plan.analysed, schedule, emitted, found.manifest)
    elif bound.proof:
        of = plan.analysed, bound.proof, plan.sine, schedule, emitted, found.manifest
        proven = certificate.certificate(*of)
    return replace(found, plan=plan, kernel=None, certificate=proven)


def _entries(plan: Plan, bound: Bound) -> list[Entry]:
    """Return the entries of the header, but for the weights."""
    program = plan.analysed
    gather, channels = kernel_gather(program), output_channels(program)
    images = [
        f"{i.name}: {i.channels} channels in {i.range_text}" + (f", {i.encoding}" if i.encoding else "")
        for i in gather.images
    ]
    encoding = dict(program.info).get(OUTPUT_ENCODING)
    rows, columns = gather.rows, gather.columns
    tap = f"{rows // 2}" if rows == columns else f"({rows // 2}, {columns // 2})"
    assumes = textwrap.wrap(plan.assumes, WIDE) if bound.output else []
    return [
        ("program", [ir.digest(program)[:32]]),
        ("images", images),
        ("window", [f"{rows} x {columns} pixels, the pixel itself is tap {tap}"]),
        ("border", [gather.window.border]),
        ("output", [f"{channels} channels" + (f", {encoding}" if encoding else "")]),
        ("profile", [": ".join(plan.profile.facts.values())]),
        ("sine", [WHOLE_SINE if bound.exact else plan.sine.text]),
        ("bound", [_bound_text(bound, program)]),
        ("assumes", assumes),
        ("sums", [SUMS] if is_split(gather) and plan.shares_bound else []),
        ("schedule", [] if plan.schedule.name == PLAIN else [schedule_text(plan.schedule_facts)]),
        (CALLED, []),
    ]


def _bound_text(bound: Bound, program: Program) -> str:
    """Return the bound as a reader wants it, rounded up."""
    if bound.exact:
        same = "the same bits" if has_one_zero(program) else "the same numbers; a zero may have either sign"
        return f"0: no operation rounds, so that every device and compiler computes {same}"
    if bound.output is None:
        return "none: for some images an operation of this program promises nothing on this target"
    return f"|output - float64 reference| <= {round_up(max(bound.output)):g} for all images in these ranges"


def _facts(plan: Plan, bound: Bound, weights: NDArray[np.float32]) -> dict[str, Any]:
    """Return what only the manifest of a network's kernel says."""
    emitted, schedule, gather = plan.emitted, plan.schedule, kernel_gather(plan.emitted)
    # Of a window along an axis.
    oblong = {} if gather.rows == gather.columns else {"rows": gather.rows, "columns": gather.columns}
    return {
        "schema": artifact.SCHEMA,
        "program": ir.digest(plan.analysed),
        "sine": asdict_finite(plan.sine),
        "passes": [*pipeline.COMMON, *plan.profile.passes],
        "window": {**asdict(gather.window), "centre": gather.window.size // 2, **oblong},
        "images": [image.facts for image in gather.images],
        "output": {
            "name": emitted.outputs[0][0],
            "channels": output_channels(emitted),
            "encoding": dict(emitted.info).get(OUTPUT_ENCODING, ""),
        },
        "bound": {
            "output": bound.output and [round_up(error) for error in bound.output],
            "against": AGAINST[bound.exact],
        },
        "certificate": artifact.CERTIFICATE_NAME if bound.proof or bound.exact else None,
        "sine_arguments": [[_finite(-round_up(-low)), _finite(round_up(high))] for low, high in bound.sines],
        "info": {name: _info_value(name, text) for name, text in emitted.info if name in KEPT_INFO},
        "private_bytes": schedule.private_bytes(emitted),
        "schedule": plan.schedule_facts,
        "weights": {
            "count": int(weights.size),
            "layout": [asdict(slot) for slot in schedule.layout(emitted).values()],
            "order": schedule.order,
        },
    }


def _info_value(name: str, text: str) -> Any:
    """Return a text of a model's info, or its value where it is JSON: an untrusted text may be anything."""
    with suppress(InputError):
        return parse_json(text, name, "train again") if name in ("normalization", "recipe") else text
    return text


def asdict_finite(contract: SineContract) -> dict[str, Any]:
    """Return a contract for JSON, which has no infinity: null means everywhere."""
    found = asdict(contract)
    return {**found, "domain": _finite(found["domain"])}


def _finite(value: float) -> float | None:
    """Return the value for JSON, None for an infinity."""
    return value if math.isfinite(value) else None
