"""Kinds of the edge-avoiding filter: each guide by itself, borders, gaps, limits; features made of it.

Bounds are roundings of float64 (DAT-3), with u = 2^-53. An exponent has 24 of them at most: the difference
and its factor three, squared, nine squares added, in any order. A weight exp(-E) is then off by (24 E + 8) u,
4 of them the exponential's own and 2 its product with the spline's number, and moves a mean by its share of
the distance to it. Two sums of 25 terms, a product of each and the quotient add 54 u of the largest colour.
What the level before was off by, the next takes the mean of [`bound_of`].
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ....refimpl.frame import FIRST_HIT, LAYERS, Frame, validate
from ....refimpl.network import smoothing
from ....refimpl.network.smoothing import DEPTH, FARTHEST, GUIDES
from ..case import Case, Output
from ..functions import drawn
from .tables import kind

Array = NDArray[Any]
Layers = dict[str, Array]

UNIT = 2.0**-53
"""Unit roundoff of float64."""

SOURCE = "roundings of float64, level by level (DAT-3)"
"""Where these bounds come from."""

GUIDE_LAYERS = (*GUIDES, DEPTH)
"""The layers that guide the filter."""


def bound_of(color: Array, layers: Mapping[str, Array], levels: int) -> Array:
    """Return how far off colours (H, W, 3) may be after some levels."""
    guides, factors = smoothing.guides_of(layers)
    height, width = color.shape[:2]
    error = np.zeros_like(color)
    for level in range(levels):
        mean = smoothing.smooth_once(color, guides, factors, 2**level)
        moved, total, largest = np.zeros_like(color), np.zeros_like(color[..., :1]), np.zeros_like(color)
        for spline, rows, columns in smoothing.taps(height, width, 2**level):
            there = np.ix_(rows, columns)
            apart = (guides[there] - guides) * factors
            exponent = 0.5 * np.sum(apart * apart, axis=-1, keepdims=True)
            weight = spline * np.exp(-exponent)
            of_weight = weight * (24.0 * exponent + 8.0) * UNIT
            moved += of_weight * np.abs(color[there] - mean) + weight * error[there]
            total, largest = total + weight, np.maximum(largest, np.abs(color[there]))
        error = 1.001 * (moved / total + 54.0 * UNIT * largest)
        color = mean
    return error


# ---- the filter -------------------------------------------------------------------------------------------


def _smoothed(inputs: Mapping[str, Any]) -> dict[str, Any]:
    """Return colour after some levels."""
    layers = {name: np.asarray(inputs[name], np.float64) for name in ("color", *GUIDE_LAYERS)}
    validate(Frame(layers), finite=False)
    return {"color": smoothing.smooth(layers.pop("color"), layers, int(inputs["levels"]))}


def alike(height: int, width: int, depth: float = 2.0) -> Layers:
    """Return guides that are the same everywhere."""
    shape = height, width
    layers = {name: np.full((*shape, LAYERS[name].channels), 0.25) for name in GUIDES}
    return {**layers, DEPTH: np.full((*shape, 1), depth)}


def uneven(index: int, height: int, width: int, *spreads: tuple[str, float]) -> Layers:
    """Return guides of which some are spread by so much around what they are elsewhere."""
    layers = alike(height, width)
    for number, (name, spread) in enumerate(spreads):
        some = drawn(f"smoothing {name}", 10 * index + number, layers[name].size).reshape(layers[name].shape)
        layers[name] = single(layers[name] + spread * (2.0 * some - 1.0))
    return layers


def single(values: Any) -> Array:
    """Return numbers (...) rounded to float32, in float64."""
    return np.asarray(values, np.float32).astype(np.float64)


def colors(index: int, height: int, width: int) -> Array:
    """Return colours (H, W, 3), other ones in each channel."""
    found: Array = 2.0 * drawn("smoothing color", index, 3 * height * width).reshape(height, width, 3)
    return single(found)


def one_bright(height: int, width: int, y: int, x: int) -> Array:
    """Return black with one pixel of another number in each channel."""
    found = np.zeros((height, width, 3))
    found[y, x] = (1.0, 4.0, -2.0)
    return found


def changed(layers: Layers, name: str, *values: tuple[tuple[int, ...], float]) -> Layers:
    """Return guides with some numbers of one of them changed."""
    found = {key: layer.copy() for key, layer in layers.items()}
    for place, value in values:
        found[name][place] = value
    return found


ALL = (("normal", 0.5), ("albedo", 0.25), ("position", 0.25), (DEPTH, 1.5))
"""All guides and how far they are spread: by some of the filter's standard deviations."""

Row = tuple[str, Array, Layers, int]


def _rows() -> Iterator[Row]:
    """Yield note, colour, guides and levels of the cases."""
    for levels, width in ((1, 7), (2, 15), (3, 31)):
        middle = width // 2
        yield (
            f"a row, level {levels}: the spline and its gap",
            one_bright(1, width, 0, middle),
            alike(1, width),
            levels,
        )
        yield f"a column, level {levels}", one_bright(width, 1, middle, 0), alike(width, 1), levels
    yield "rows and columns: products of the spline's numbers", one_bright(5, 6, 2, 2), alike(5, 6), 1
    for y, x in ((0, 0), (2, 3), (0, 3), (2, 0)):
        yield f"from the corner ({x}, {y}): taps beyond it repeat it", one_bright(3, 4, y, x), alike(3, 4), 1
    yield "a picture smaller than the gap", one_bright(2, 3, 1, 0), alike(2, 3), 3
    yield "a picture of one pixel", one_bright(1, 1, 0, 0), alike(1, 1), 3
    yield "large colours of either sign", 1e6 * (colors(0, 3, 3) - 1.0), alike(3, 3), 1
    for index, (name, spread) in enumerate(ALL):
        yield (
            f"{name} differs, all else is alike",
            colors(index, 3, 4),
            uneven(index, 3, 4, (name, spread)),
            1,
        )
    yield from _sigmas()
    yield from _depths()
    yield from _ends()
    for levels in (1, 2, 3):
        yield f"all differ, {levels} levels", colors(20, 5, 6), uneven(20, 5, 6, *ALL), levels
    yield "all differ, a wide picture", colors(21, 2, 17), uneven(21, 2, 17, *ALL), 3
    yield "all differ, a high picture", colors(22, 17, 2), uneven(22, 17, 2, *ALL), 3


def _sigmas() -> Iterator[Row]:
    """Yield two pixels of which each component of a guide differs by one and by two standard deviations."""
    for name, sigma in GUIDES.items():
        for channel in range(3):
            for times in (1.0, -2.0):
                length = sigma * (2.0 if name == "position" else 1.0)
                other = ((0, 1, channel), 0.25 + times * length)
                note = f"component {channel} of {name}: {times:g} standard deviations"
                yield note, one_bright(1, 2, 0, 1), changed(alike(1, 2), name, other), 1


def _depths() -> Iterator[Row]:
    """Yield pictures at whose pixels positions are compared by other depths."""
    apart = changed(alike(1, 2), "position", ((0, 1, 0), 0.5))
    deep = changed(apart, DEPTH, ((0, 0, 0), 1.0), ((0, 1, 0), 4.0))
    yield "two depths: each pixel compares by its own", one_bright(1, 2, 0, 1), deep, 1
    yield "two depths, the other one bright", one_bright(1, 2, 0, 0), deep, 1
    for depth in (0.0, -1.0, 1e-7, 2e-6):
        near = changed(alike(1, 2, depth), "position", ((0, 0, 0), 0.0), ((0, 1, 0), 1e-7))
        yield f"a depth of {depth:g}, at least 1e-6", one_bright(1, 2, 0, 1), near, 1
    for depth in (1e9, 1e12, np.inf):
        far = changed(alike(1, 2, depth), "position", ((0, 0, 1), 0.0), ((0, 1, 1), 1.25e8))
        yield f"a depth of {depth:g}, at most 1e9", one_bright(1, 2, 0, 1), far, 1
    layers = uneven(30, 3, 4, *ALL)
    for name in GUIDE_LAYERS:
        layers[name][1:, 2:] = 0.0
    yield "misses beside hits: all guides are 0 there", colors(30, 3, 4), layers, 3


def _ends() -> Iterator[Row]:
    """Yield guides that are clipped at either end."""
    for name in GUIDES:
        for sign in (1.0, -1.0):
            ends = [((0, 0, 1), sign * 1e9), ((0, 1, 1), sign * 2e9), ((0, 2, 1), sign * np.inf)]
            note = f"{name} clipped to {sign * FARTHEST:g}: all alike"
            yield note, one_bright(1, 4, 0, 1), changed(alike(1, 4), name, *ends, ((0, 3, 1), sign * 3e38)), 1
        opposite = changed(alike(1, 3), name, ((0, 0, 2), -np.inf), ((0, 2, 2), np.inf))
        yield f"{name} of both infinities", one_bright(1, 3, 0, 1), opposite, 2


def _smoothed_cases() -> list[Case]:
    """Return colours after the filter, and layers of different size, which are refused."""
    cases: list[Case] = []
    for note, color, layers, levels in _rows():
        inputs = {"color": color, **layers, "levels": levels}
        value = _smoothed(inputs)["color"]
        expected = {"color": Output(value, bound_of(color, layers, levels), SOURCE)}
        cases.append(Case("SMO-3", inputs, expected, note, "FRM-5"))
    for name in GUIDE_LAYERS:
        inputs = {"color": colors(0, 3, 2), **alike(3, 2), "levels": 1, name: alike(2, 3)[name]}
        cases.append(Case("FRM-5", inputs, None, f"{name} of another size"))
    return cases


# ---- features ---------------------------------------------------------------------------------------------


def past(layers: Layers) -> Layers:
    """Return guides under the names of what is seen past mirrors and glass."""
    return {seen: layers[first] for seen, first in FIRST_HIT.items()}


def feature_rows() -> Iterator[tuple[str, str, str, Layers, float]]:
    """Yield clause, note, features, layers and exposure of feature images."""
    some = {"color": colors(45, 3, 4), **uneven(45, 3, 4, *ALL), **past(uneven(46, 3, 4, *ALL))}
    yield "SMO-1", "guided by the first hit, and past mirrors and glass", "smoothed,seen_smoothed", some, -0.5
    others = {name: some[name] for name in ("color", *FIRST_HIT)}
    yield "SMO-1", "guided past mirrors and glass", "seen_smoothed", others, 0.5
    first = {name: some[name] for name in ("color", *GUIDE_LAYERS)}
    yield (
        "SMO-1",
        "after its own guides, which stay as they are",
        "depth,normal,smoothed,color,position",
        first,
        0.0,
    )
    # The filter reaches 14 pixels: somewhere on the way what is left of a clipped number is neither 0 nor 1.
    bright = np.full((1, 15, 3), 0.015625)
    bright[0, 0] = (1e6, 15.0, -8.0)
    for stops in (-2.0, 0.0, 3.5):
        note = f"light is clipped to 16 times white at {stops:g} stops, and at 0"
        yield "SMO-2", note, "smoothed", {"color": bright, **alike(1, 15)}, stops
    ends = np.full((2, 3, 3), 0.125)
    ends[0, 0], ends[1, 2] = (np.nan, np.inf, -np.inf), (np.inf, np.nan, np.nan)
    yield (
        "DAT-10",
        "NaN is 0, infinities are clipped before the filter",
        "smoothed",
        {"color": ends, **alike(2, 3)},
        0.0,
    )
    for index, name in enumerate(GUIDE_LAYERS):
        layers = uneven(40, 2, 3, *ALL)
        layers[name][0, 1] = np.nan
        yield "DAT-10", f"NaN in {name} is 0", "smoothed", {"color": colors(40 + index, 2, 3), **layers}, -1.0


def missing_rows() -> Iterator[tuple[str, str, Layers]]:
    """Yield notes, features and layers of frames that lack a guide."""
    layers = {"color": colors(50, 2, 2), **alike(2, 2)}
    for name in ("color", *GUIDE_LAYERS):
        yield f"{name} is missing", "smoothed", {key: some for key, some in layers.items() if key != name}
    yield "only guides of the first hit", "seen_smoothed", layers
    yield "only guides past mirrors and glass", "smoothed", {"color": layers["color"], **past(alike(2, 2))}


KINDS = (kind("image.smoothed", _smoothed_cases, _smoothed),)
"""The kinds of this module."""
