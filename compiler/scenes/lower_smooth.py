"""Programs of the edge-avoiding filter, traced from the reference (refimpl/network/smoothing.py).

1. `guide`: what a pixel's layers give once a frame: light that is clipped, and what the filter compares. A
   factor that is the same at all pixels is a constant of the next program, equal ones are one plane.
2. `tap`: the sums of a pixel with one more tap.
3. `mean`: what these sums give in the end.

What surrounds them, in every kernel and in the interpreter [numpy_executor.py]: for each level, for each tap
of SMO-3, the guides and the light of the pixel there.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from ...refimpl.frame import LAYERS
from ...refimpl.network import smoothing
from ...refimpl.network.dataset import Normalization, check_normalization
from ...refimpl.network.smoothing import DEPTH, GUIDES
from ..core.ir import Image, Program, Type
from ..core.passes import pipeline
from ..core.trace import trace
from ..core.verify import verify
from .emit_path import COLOR

PASSES = ("scalarize", "fold", "eliminate_dead")
"""What the programs go through: numbers in place of vectors, constants in float64, rounded when emitted."""

LIGHT = tuple(COLOR)
"""Planes of light, named as those of sums: the encoding of colour reads them."""

SUMS = ("total_r", "total_g", "total_b")
"""What a pixel's taps add up to, beside their weights."""

WEIGHTS = "weights"
"""The sum of a pixel's weights."""

SPLINE = "spline"
"""A tap's share of the spline."""

HERE, THERE = "here_", "there_"
"""What the planes of pixel and tap are called in a program."""

GUIDED = tuple(f"{layer}_{c}" for layer in GUIDES for c in "xyz")
"""Planes of what is compared."""

LAYERS_READ = tuple(Image(name, LAYERS[name].channels, -np.inf, np.inf) for name in ("color", *GUIDES, DEPTH))
"""The layers of a frame that are read, not encoded."""


@dataclass(frozen=True)
class SmoothPrograms:
    """The three programs; `guides` are the planes that `guide` writes beside the light, in order."""

    guide: Program
    tap: Program
    mean: Program
    guides: tuple[str, ...]


def lower_smooth(normalization: Normalization) -> SmoothPrograms:
    """Return the programs of the filter for a model's scales."""
    check_normalization(normalization)
    inputs = [f"{layer.name}_{c}" for layer in LAYERS_READ for c in range(layer.channels)]
    whole = _lowered(partial(_guide, inputs, normalization.exposure_stops), inputs)
    planes: dict[int, str] = {}
    factors: list[str | float] = []
    for name, index in whole.outputs:
        node = whole.nodes[index]
        constant = name.startswith("factor") and node.op == "constant"
        where = float(node["value"]) if constant else planes.setdefault(index, name)  # type: ignore[arg-type]
        if name.startswith("factor"):
            factors.append(where)
    kept = tuple((name, index) for index, name in planes.items())
    guide = pipeline.run(replace(whole, outputs=kept), ("eliminate_dead",))
    guides = tuple(name for name, _ in kept if name not in LIGHT)
    of_here = [f"{HERE}{name}" for name in guides]
    of_tap = [*(f"{THERE}{name}" for name in GUIDED), *LIGHT, SPLINE]
    names = [*of_here, *of_tap, *SUMS, WEIGHTS]
    tap = _lowered(partial(_tap, names, factors), names)
    return SmoothPrograms(guide, tap, _lowered(_mean, [*SUMS, WEIGHTS]), guides)


def _lowered(function: Any, inputs: Sequence[str]) -> Program:
    """Return the program of a function of numbers."""
    program = trace(function, dict.fromkeys(inputs, Type()))
    return pipeline.run(verify(program, "traced filter"), PASSES)


def _guide(inputs: Sequence[str], exposure_stops: float, *numbers: Any) -> dict[str, Any]:
    """Return the light and the guides of a pixel, with the factors of their differences."""
    given = dict(zip(inputs, numbers, strict=True))
    layers = {
        layer.name: np.stack([given[f"{layer.name}_{c}"] for c in range(layer.channels)], axis=-1)
        for layer in LAYERS_READ
        if layer.channels > 1
    }
    layers[DEPTH] = given[f"{DEPTH}_0"]
    compared, factors = smoothing.guides_of(layers)
    light = smoothing.dimmed(layers["color"], exposure_stops)
    named = {f"factor_{name}": factors[..., i] for i, name in enumerate(GUIDED)}
    return {**_apart(LIGHT, light), **_apart(GUIDED, compared), **named}


def _tap(names: Sequence[str], factors: Sequence[str | float], *numbers: Any) -> dict[str, Any]:
    """Return the sums of a pixel with one more tap."""
    given = dict(zip(names, numbers, strict=True))
    here, there = (np.stack([given[f"{at}{name}"] for name in GUIDED], axis=-1) for at in (HERE, THERE))
    known = [given[f"{HERE}{factor}"] if isinstance(factor, str) else factor for factor in factors]
    total, weights = smoothing.added(
        *(np.stack([given[name] for name in SUMS], axis=-1), given[WEIGHTS]),
        *(np.stack([given[name] for name in LIGHT], axis=-1), given[SPLINE]),
        *(here, there, np.stack(known, axis=-1)),
    )
    return {**_apart(SUMS, total), WEIGHTS: weights}


def _mean(*numbers: Any) -> dict[str, Any]:
    """Return the means of a pixel's sums."""
    *total, weights = numbers
    return _apart(LIGHT, smoothing.mean(np.stack(total, axis=-1), weights))


def _apart(names: Sequence[str], vector: Any) -> dict[str, Any]:
    """Return a vector's numbers by name."""
    return {name: vector[..., i] for i, name in enumerate(names)}
