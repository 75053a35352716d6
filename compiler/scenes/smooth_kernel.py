"""Compile the edge-avoiding filter for a target: two kernels, and the encoding of colour behind them.

    layers -> guide -> planes of guides and light -> smooth, once a level -> encode -> feature image

1. Trace the filter [lower_smooth.py], and run the passes of the profile.
2. Emit `guide` as one statement an operation, `smooth` as two loops over taps around those of a tap
   [`_smooth_body`].
3. Put both together with manifests, and with the encoding that exists for sums [`compile_smoothing`].

Guides may have any size, so there is no bound over all layers; at given ones the rules of bounds.py, tap by
tap and level by level, give one for every channel of every pixel [`error_at`].
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...refimpl.network import smoothing
from ...refimpl.network.dataset import Normalization
from ..core import profiles
from ..core.ir import Program
from ..core.passes import pipeline
from ..kernel import interface
from ..kernel.interface import GUIDE, LIGHT, RESULT, SMOOTH
from ..languages.dialect import Dialect
from ..plan import sine_contract
from ..proof import bounds
from ..proof.bounds import Enclosure
from . import plane_kernel
from .encode_kernel import EncodeArtifact, compile_encode, statements
from .lower_encode import SAMPLES, channel_name
from .lower_smooth import (
    GUIDED,
    HERE,
    LAYERS_READ,
    PASSES,
    SPLINE,
    SUMS,
    THERE,
    WEIGHTS,
    SmoothPrograms,
    lower_smooth,
)
from .lower_smooth import LIGHT as LIGHT_PLANES
from .plane_kernel import Draft, PlaneArtifact, place_of

SCHEMA = "wamnet-smooth-kernel-1"
"""Name and version of the manifest's form; described in spec/smoothing.md."""

SAID = "the filter", "smooth by refimpl/network/smoothing.py"
"""What is said where a target has no such kernels."""

TITLES = {GUIDE: "a frame's light and guides", SMOOTH: "one level of means"}
"""What both kernels do, by role."""

FEATURE = "color"
"""The feature as which light is encoded after the filter, and the name of its image."""


@dataclass(frozen=True)
class SmoothKernels:
    """What runs one after another: `guide`, `smooth` once a level, `encode`."""

    guide: PlaneArtifact
    smooth: PlaneArtifact
    encode: EncodeArtifact


def compile_smoothing(
    normalization: Normalization, target: str, profile: str = "ieee", lanes: int = 1
) -> SmoothKernels:
    """Return the kernels that make the smoothed features of frames; `lanes` pixels in a work item."""
    promised = profiles.profile_named(profile)
    plane_kernel.dialect_of(target, lanes, *SAID)
    programs = _of_profile(lower_smooth(normalization), promised.passes)
    pair = [_compiled(programs, role, target, profile, lanes) for role in (GUIDE, SMOOTH)]
    encode = compile_encode((FEATURE,), normalization, target, profile, LIGHT_PLANES)
    return SmoothKernels(pair[0], pair[1], encode)


def _of_profile(programs: SmoothPrograms, passes: Sequence[str]) -> SmoothPrograms:
    """Return the programs after the passes of a profile."""
    guide, tap, mean = (pipeline.run(each, passes) for each in (programs.guide, programs.tap, programs.mean))
    return SmoothPrograms(guide, tap, mean, programs.guides)


def _compiled(programs: SmoothPrograms, role: str, target: str, profile: str, lanes: int) -> PlaneArtifact:
    """Return one of both kernels."""
    lanes = lanes if role == SMOOTH else 1
    dialect = plane_kernel.dialect_of(target, lanes, *SAID)
    names, counts = plane_kernel.integers_of(dialect, role), (len(programs.guides), len(LIGHT_PLANES))
    made = (
        interface.smoothing(*counts, names)
        if role == SMOOTH
        else interface.guiding(LAYERS_READ, *counts, names)
    )
    body = _guide_body if role == GUIDE else _smooth_body
    draft = Draft(
        role,
        f"edge-avoiding filter: {TITLES[role]}",
        [programs.guide] if role == GUIDE else [programs.tap, programs.mean],
        programs,
        made,
        body(programs, dialect) if dialect else (),
        _table(dialect) if dialect else "",
        {"guides": programs.guides, "light": LIGHT_PLANES},
        "at given layers: see the rules for each operation",
        {
            "schema": SCHEMA,
            "passes": [*PASSES, *profiles.profile_named(profile).passes],
            "layers": [layer.name for layer in LAYERS_READ],
            "guides": list(programs.guides),
            "light": list(LIGHT_PLANES),
        },
    )
    return plane_kernel.put_together(draft, target, profile, lanes)


# ---- text ---------------------------------------------------------------------------------------------


def _table(dialect: Dialect) -> str:
    """Return the declaration of the spline along an axis."""
    return dialect.table_declaration("SPLINE", np.array(smoothing.SPLINE, np.float32))


def _guide_body(programs: SmoothPrograms, dialect: Any) -> list[str]:
    """Return the statements of `guide`: loads of layers, operations, stores of planes."""
    lines = [
        dialect.load.format(name=f"{layer.name}_{c}", image=layer.name, channels=layer.channels, channel=c)
        for layer in LAYERS_READ
        for c in range(layer.channels)
    ]
    texts = statements(programs.guide, dialect, lines)
    places = {name: (LIGHT, i) for i, name in enumerate(LIGHT_PLANES)}
    places |= {name: (interface.GUIDES, i) for i, name in enumerate(programs.guides)}
    for name, index in programs.guide.outputs:
        array, plane = places[name]
        # Of one pixel, also where a level computes several.
        lines.append(dialect.own_store.format(**place_of(array, plane), value=texts[index]))
    return lines


def _smooth_body(programs: SmoothPrograms, dialect: Any) -> list[str]:
    """Return the statements of `smooth`: the pixel's guides, loops over taps, means."""

    def read(name: str, array: str, plane: int, row: str, column: str) -> str:
        text = dialect.plane_load.format(**place_of(array, plane), row=row, column=column)
        return str(dialect.let("float32", name, text))

    guides = list(enumerate(programs.guides))
    lines = [dialect.own_row]
    lines += [read(f"{HERE}{name}", interface.GUIDES, i, "own", "x") for i, name in guides]
    lines += [dialect.var("float32", name, dialect.number(0.0, "float32")) for name in (*SUMS, WEIGHTS)]
    tap = [
        read(f"{THERE}{name}", interface.GUIDES, i, "line", "column") for i, name in guides if name in GUIDED
    ]
    tap += [read(name, LIGHT, i, "line", "column") for i, name in enumerate(LIGHT_PLANES)]
    share = dialect.splat("SPLINE[dy + 2] * SPLINE[dx + 2]", "float32")
    tap.append(dialect.let("float32", SPLINE, share))
    texts = statements(programs.tap, dialect, tap)
    tap += [f"{name} = {texts[index]};" for name, index in programs.tap.outputs]
    lines += [
        dialect.loop("dy", 3, -2),
        f"    {dialect.tap_row()}",
        f"    {dialect.loop('dx', 3, -2)}",
        f"        {dialect.index('column', 'x + gap * dx')}",
        *(f"        {line}" for line in tap),
        "    }",
        "}",
    ]
    texts = statements(programs.mean, dialect, lines)
    for plane, (_, index) in enumerate(programs.mean.outputs):
        lines.append(dialect.plane_store.format(**place_of(RESULT, plane), value=texts[index]))
    return lines


# ---- errors -------------------------------------------------------------------------------------------


def error_at(kernels: SmoothKernels, layers: Mapping[str, NDArray[Any]]) -> NDArray[np.float64]:
    """Return the bound (H, W, 3) of a feature image's error against float64, at layers (H, W, C) by name."""
    programs = kernels.smooth.programs
    given = {
        f"{layer.name}_{c}": _exactly(layers[layer.name][..., c])
        for layer in LAYERS_READ
        for c in range(layer.channels)
    }
    planes = _enclosed(kernels, programs.guide, given)
    height, width = layers[FEATURE].shape[:2]
    here = {f"{HERE}{name}": planes[name] for name in programs.guides}
    light = {name: planes[name] for name in LIGHT_PLANES}
    for level in range(smoothing.LEVELS):
        sums = dict.fromkeys((*SUMS, WEIGHTS), _exactly(np.zeros((height, width))))
        for spline, rows, columns in smoothing.taps(height, width, 2**level):
            there = np.ix_(rows, columns)
            seen = {f"{THERE}{name}": _moved(planes[name], there) for name in GUIDED}
            lit = {name: _moved(light[name], there) for name in LIGHT_PLANES}
            share = {SPLINE: _exactly(np.full((height, width), spline))}
            sums = _enclosed(kernels, programs.tap, {**here, **seen, **lit, **share, **sums})
        light = _enclosed(kernels, programs.mean, sums)
    one = {SAMPLES: _exactly(np.ones((height, width)))}
    found = _enclosed(kernels, kernels.encode.program, {**light, **one})
    return np.stack([found[channel_name(FEATURE, c)].read for c in range(len(LIGHT_PLANES))], axis=-1)


def _exactly(values: NDArray[Any]) -> Enclosure:
    """Return the enclosure of numbers (H, W) that a kernel is given."""
    exact = np.asarray(values, np.float64)
    return Enclosure(exact, exact, np.zeros_like(exact))


def _moved(found: Enclosure, there: Any) -> Enclosure:
    """Return the enclosures (H, W) of a plane at the pixels of a tap."""
    return Enclosure(found.low[there], found.high[there], found.error[there])


def _enclosed(
    kernels: SmoothKernels, program: Program, given: Mapping[str, Enclosure]
) -> dict[str, Enclosure]:
    """Return the enclosures of a program's outputs, of inputs that have errors."""
    known = {i: given[str(node["name"])] for i, node in enumerate(program.nodes) if node.op == "input"}
    contract = sine_contract(kernels.smooth.profile, kernels.smooth.target)
    found = bounds.enclose(program, {}, contract, known=known, local=False)
    return {name: found[index] for name, index in program.outputs}
