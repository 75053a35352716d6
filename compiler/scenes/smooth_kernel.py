"""Compile the edge-avoiding filter for a target: two kernels, and the encoding of colour behind them.

    layers -> guide -> planes of guides and light -> smooth, once a level -> encode -> feature image

1. Trace the reference's filter [`lower_smooth`], and run the passes of the profile. `guide` is what a pixel's
   layers give once a frame: light that is clipped, and what the filter compares; a factor that is the same at
   all pixels is a constant of the next program, equal ones are one plane. `tap`: the sums of a pixel with one
   more tap of SMO-3. `mean`: what these sums give in the end.
2. `guide` is one statement an operation [`guide_kernel`], `smooth` two loops over taps around those of a tap
   [`smooth_kernel`]; a tap beyond the image reads its nearest pixel.
3. Put both together with manifests, and with the encoding that exists for sums [`compile_smoothing`].

Guides may have any size, so there is no bound over all layers; at given ones the rules of bounds.py, tap by
tap and level by level, give one for every channel of every pixel [tests/support/errors_at.py].
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from ...refimpl.frame import LAYERS
from ...refimpl.network import smoothing
from ...refimpl.network.dataset import Normalization, check_normalization
from ..artifact import Artifact, SmoothKernels
from ..core.ir import Image, Program
from ..core.passes import pipeline
from ..kernel.interface import (
    GUIDE,
    GUIDES,
    IMAGE,
    INTEGERS,
    LIGHT,
    READ,
    RESULT,
    SMOOTH,
    WRITE,
    Interface,
    image_of,
    planes_of,
)
from ..kernel.kernel import (
    FLOAT,
    INT,
    Array,
    Body,
    Expr,
    Kernel,
    Let,
    Statement,
    Store,
    const,
    load,
    name,
    splat,
)
from ..schedules.common import HEIGHT, WIDTH, X, Y, clamp, lets, loop
from ..targets import Language, language_named
from .emit_path import GROUPS
from .encode_kernel import PASSES, compile_encode
from .plane_kernel import check_lanes, compiled, reads
from .values import RGB, XYZ, Given, floats, lowered, names, numbered

SCHEMA = "wamnet-smooth-kernel-1"
"""Name and version of the manifest's form; described in spec/smoothing.md."""

TITLES = {GUIDE: "a frame's light and guides", SMOOTH: "one level of means"}
"""What both kernels do, by role."""

FEATURE = "color"
"""The feature as which light is encoded after the filter, and the name of its image."""

TABLE = "SPLINE"
"""Name of the table of the spline along an axis."""

LIGHT_PLANES = tuple(GROUPS[FEATURE])
"""Planes of light, named as those of sums: the encoding of colour reads them."""

SUMS = tuple(names(floats("total", ends=RGB)))
"""What a pixel's taps add up to, beside their weights."""

WEIGHTS, SPLINE = "weights", "spline"
"""The sum of a pixel's weights, and a tap's share of the spline."""

HERE, THERE = "here_", "there_"
"""What the planes of pixel and tap are called in a program."""

GUIDED = tuple(names(floats(*smoothing.GUIDES, ends=XYZ)))
"""Planes of what is compared."""

LAYERS_READ = tuple(
    Image(each, LAYERS[each].channels, -np.inf, np.inf)
    for each in (FEATURE, *smoothing.GUIDES, smoothing.DEPTH)
)
"""The layers of a frame that are read, not encoded."""


@dataclass(frozen=True)
class SmoothPrograms:
    """The three programs; `guides` are the planes that `guide` writes beside the light, in order."""

    guide: Program
    tap: Program
    mean: Program
    guides: tuple[str, ...]


# ---- programs -----------------------------------------------------------------------------------------


def lower_smooth(normalization: Normalization) -> SmoothPrograms:
    """Return the programs of the filter for a model's scales."""
    check_normalization(normalization)
    light, sums = floats(FEATURE, ends=RGB), {**floats("total", ends=RGB), **floats(WEIGHTS)}
    whole = lowered(
        "filter",
        partial(_guide, normalization.exposure_stops),
        {layer.name: numbered(layer.channels) for layer in LAYERS_READ},
        {**light, **floats("", "factor_", ends=GUIDED)},
        PASSES,
    )
    planes: dict[int, str] = {}
    factors: list[str | float] = []
    for each, index in whole.outputs:
        node = whole.nodes[index]
        constant = each.startswith("factor") and node.op == "constant"
        where = float(node["value"]) if constant else planes.setdefault(index, each)  # type: ignore[arg-type]
        if each.startswith("factor"):
            factors.append(where)
    kept = tuple((each, index) for index, each in planes.items())
    guide = pipeline.run(replace(whole, outputs=kept), ("eliminate_dead",))
    guides = tuple(each for each, _ in kept if each not in LIGHT_PLANES)
    here = floats(*(f"{HERE}{each}" for each in guides))
    there = {**floats(THERE, ends=GUIDED), **light, **floats(SPLINE)}
    tap = lowered("filter", partial(_tap, factors), {**here, **there, **sums}, sums, PASSES)

    def mean(given: Given) -> Given:
        return {FEATURE: smoothing.mean(given["total"], given[WEIGHTS])}

    return SmoothPrograms(guide, tap, lowered("filter", mean, sums, light, PASSES), guides)


def _guide(exposure_stops: float, layers: Given) -> Given:
    """Return the light and the guides of a pixel, with the factors of their differences."""
    compared, factors = smoothing.guides_of(layers)
    return {FEATURE: smoothing.dimmed(layers[FEATURE], exposure_stops), "": compared, "factor_": factors}


def _tap(factors: Sequence[str | float], given: Given) -> Given:
    """Return the sums of a pixel with one more tap."""
    here = np.stack([given[f"{HERE}{each}"] for each in GUIDED], axis=-1)
    known = [given[f"{HERE}{factor}"] if isinstance(factor, str) else factor for factor in factors]
    sums = given["total"], given[WEIGHTS], given[FEATURE], given[SPLINE]
    total, weights = smoothing.added(*sums, here, given[THERE], np.stack(known, axis=-1))
    return {"total": total, WEIGHTS: weights}


def compile_smoothing(
    normalization: Normalization, language: Language | str, lanes: int = 1
) -> SmoothKernels:
    """Return the kernels that make the smoothed features of frames; `lanes` pixels in a work item."""
    chosen = language_named(language)
    check_lanes(chosen, lanes, "the filter", "smooth by refimpl/network/smoothing.py")
    programs = pipeline.run_each(lower_smooth(normalization), chosen.profile.passes)
    facts = {
        "schema": SCHEMA,
        "passes": [*PASSES, *chosen.profile.passes],
        "layers": [layer.name for layer in LAYERS_READ],
        "guides": list(programs.guides),
        "light": list(LIGHT_PLANES),
    }
    notes = dict.fromkeys((f"{IMAGE}{layer.name}" for layer in LAYERS_READ), "not encoded, without NaN")
    several = f", a multiple of {lanes}" if lanes > 1 else ""
    notes |= {"row_stride": "at least width" + several, "gap": "pixels between taps"}
    lists = {GUIDES: programs.guides, LIGHT: LIGHT_PLANES, RESULT: LIGHT_PLANES}

    def made(kernel: Kernel, *used: Program) -> Artifact:
        title = f"edge-avoiding filter: {TITLES[kernel.interface.role]}"
        bound = "at given layers: see the rules for each operation"
        return compiled(title, kernel, used, facts, bound, lists, notes, chosen, programs)

    guide = made(guide_kernel(programs), programs.guide)
    smooth = made(smooth_kernel(programs, lanes), programs.tap, programs.mean)
    encode = compile_encode((FEATURE,), normalization, chosen, LIGHT_PLANES)
    return SmoothKernels(guide, smooth, encode)


# ---- kernels ------------------------------------------------------------------------------------------


def guide_kernel(programs: SmoothPrograms) -> Kernel:
    """Return the kernel of a pixel's light and guides."""
    body: list[Statement] = []
    for layer in LAYERS_READ:
        names = [f"{layer.name}_{c}" for c in range(layer.channels)]
        body += reads(names, lambda c, image=f"{IMAGE}{layer.name}": load(image, Y, X, c))  # type: ignore[misc]
    lines, outputs = lets(programs.guide)
    body += lines
    for array, planes in ((LIGHT, LIGHT_PLANES), (GUIDES, programs.guides)):
        body += [Store(array, (const(i), Y, X), outputs[each]) for i, each in enumerate(planes)]
    layers = (image_of(layer, READ) for layer in LAYERS_READ)
    guides = planes_of(GUIDES, WRITE, len(programs.guides))
    arrays = (*layers, guides, planes_of(LIGHT, WRITE, len(LIGHT_PLANES)))
    return Kernel(Interface(GUIDE, arrays, INTEGERS[GUIDE]), tuple(body))


def smooth_kernel(programs: SmoothPrograms, lanes: int) -> Kernel:
    """Return the kernel of one level, for so many pixels of a row."""
    kind, gap, dy, dx = FLOAT.of(lanes), name("gap"), name("dy"), name("dx")

    def plane(array: str, number: int, row: Expr, column: Expr) -> Expr:
        """Return a plane at some pixels of a row, each within the image."""
        inside = Expr("clamp", (column, const(0), WIDTH - 1), INT.of(lanes))
        return load(array, number, row, inside, kind=kind)

    def there(array: str, number: int) -> Expr:
        """Return a plane at the pixels of a tap."""
        return plane(array, number, name("line"), name("column"))

    half = len(smoothing.SPLINE) // 2
    spline = [Expr("take", (each,), FLOAT, TABLE) for each in (dy, dx)]
    sums, after = lets(programs.tap, lanes=lanes)
    tap: list[Statement] = [
        Let("column", X + gap * (dx - half)),
        *reads(GUIDED, lambda i: there(GUIDES, programs.guides.index(GUIDED[i])), THERE),
        *reads(LIGHT_PLANES, lambda i: there(LIGHT, i)),
        Let(SPLINE, splat(spline[0] * spline[1], lanes)),
        *sums,
        *(Store(each, (), value) for each, value in after.items()),
    ]
    means, mean = lets(programs.mean, lanes=lanes)
    line = Let("line", clamp(Y + gap * (dy - half), HEIGHT))
    body: Body = (
        *reads(programs.guides, lambda i: plane(GUIDES, i, Y, X), HERE),
        *(Array(each, kind, value=splat(const(0.0), lanes)) for each in (*SUMS, WEIGHTS)),
        loop("dy", 2 * half + 1, line, loop("dx", 2 * half + 1, *tap)),
        *means,
        *(Store(RESULT, (const(i), Y, X), mean[each]) for i, each in enumerate(LIGHT_PLANES)),
    )
    light = (planes_of(name, access, len(LIGHT_PLANES)) for name, access in ((LIGHT, READ), (RESULT, WRITE)))
    made = Interface(SMOOTH, (planes_of(GUIDES, READ, len(programs.guides)), *light), INTEGERS[SMOOTH])
    tables = ((TABLE, np.array(smoothing.SPLINE, np.float32)),)
    return Kernel(made, body, step=(const(lanes), const(1)), tables=tables)
