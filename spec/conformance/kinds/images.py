"""Kinds of images: features, the edge-avoiding filter, windows at borders, draws of pixels, metrics.

Features and metrics are computed in float64 (DAT-3, MET-1): their bounds are roundings of float64, and of the
one rounding to float32. u = 2^-53 and gamma(n) = n u / (1 - n u) for n roundings, Higham, "Accuracy and
Stability of Numerical Algorithms", 2002, section 3.1.

Of the filter: an exponent has 24 roundings at most: the difference and its factor three, squared, nine
squares added, in any order. A weight exp(-E) is then off by (24 E + 8) u, 4 of them the exponential's own and
2 its product with the spline's number, and moves a mean by its share of the distance to it. Two sums of 25
terms, a product of each and the quotient add 54 u of the largest colour. What the level before was off by,
the next takes the mean of [`_bound_of`].
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ....refimpl import metrics
from ....refimpl.errors import InputError
from ....refimpl.frame import LAYERS, Frame, validate
from ....refimpl.network import dataset, smoothing
from ....refimpl.network.dataset import Normalization
from ....refimpl.network.window import Window, check_window, windows_at
from ..case import Kind, within
from .tables import kind

Array = NDArray[Any]

ENCODED = "one rounding to float32 after float64, whose own errors may turn it: one ulp of numbers up to 1"
"""Where the bounds of features come from."""

ULP = 2.0**-23
"""One ulp of float32 numbers up to 1, and more of smaller ones."""


UNIT = 2.0**-53
"""Unit roundoff of float64."""


# ---- features ---------------------------------------------------------------------------------------------


def frame_of(inputs: Mapping[str, Any]) -> Frame:
    """Return the frame of a case, whose layers came as JSON numbers."""
    return Frame({name: np.asarray(inputs[name], np.float64) for name in LAYERS if name in inputs})


def normalization_of(inputs: Mapping[str, Any]) -> Normalization:
    """Return the scales of a case."""
    x, y, z = (float(value) for value in inputs["position_center"])
    stops, depth, position = (
        float(inputs[name]) for name in ("exposure_stops", "depth_scale", "position_scale")
    )
    return Normalization(stops, depth, (x, y, z), position)


def _features(inputs: Mapping[str, Any]) -> dict[str, Any]:
    """Return the feature image."""
    frame = frame_of(inputs)
    validate(frame, finite=False)
    names = tuple(str(inputs["features"]).split(","))
    return {"image": dataset.feature_image(frame, names, normalization_of(inputs))}


# ---- the filter -------------------------------------------------------------------------------------------


def _smoothed(inputs: Mapping[str, Any]) -> dict[str, Any]:
    """Return colour after some levels."""
    frame = frame_of(inputs)
    validate(frame, finite=False)
    guides = {name: frame[name] for name in (*smoothing.GUIDES, smoothing.DEPTH)}
    return {"color": smoothing.smooth(frame["color"], guides, int(inputs["levels"]))}


def _bound_of(inputs: Mapping[str, Any], _value: Any) -> Any:
    """Return how far off colours (H, W, 3) may be after some levels."""
    color, levels = inputs["color"], int(inputs["levels"])
    guides, factors = smoothing.guides_of(inputs)
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


# ---- windows ----------------------------------------------------------------------------------------------


def _window(inputs: Mapping[str, Any]) -> dict[str, Any]:
    """Return the window vector of a pixel; the reference's own function leaves its place to the caller."""
    window, image = Window(int(inputs["size"]), str(inputs["border"])), inputs["image"]
    check_window(window)
    if not isinstance(image, np.ndarray) or image.ndim != 3 or image.dtype.kind != "i" or not image.size:
        rule = "must be integers [H][W][C], none of the three 0"
        raise InputError("image", getattr(image, "shape", image), rule, "see the format page of this kind")
    for name, sides in (("x", image.shape[1]), ("y", image.shape[0])):
        if not 0 <= inputs[name] < sides:
            rule = f"the image has the pixels 0 to {sides - 1} on this axis"
            raise InputError(name, int(inputs[name]), rule, "ask for a pixel of the image")
    x, y = (np.array([int(inputs[name])]) for name in ("x", "y"))
    return {"window": windows_at(image, y, x, window)[0]}


# ---- draws ------------------------------------------------------------------------------------------------


def _draws(inputs: Mapping[str, Any]) -> dict[str, Any]:
    """Return frame, row and column of draws."""
    shapes = [(int(h), int(w)) for h, w in np.asarray(inputs["shapes"])]
    seed, stream, count = (int(inputs[name]) for name in ("seed", "stream", "count"))
    found = dataset.sample_pixels(seed, stream, count, shapes)
    return dict(zip(("frame", "y", "x"), found, strict=True))


# ---- metrics ----------------------------------------------------------------------------------------------


def gamma(n: int) -> float:
    """Return the largest relative error of n roundings in float64."""
    return n * UNIT / (1.0 - n * UNIT)


MOST_NUMBERS = 13 * 12 * 3
"""Numbers of the largest pictures that are compared."""

_TERMS = gamma(MOST_NUMBERS + 8)
"""Terms of one sign: each has at most 8 roundings, their mean as many more as there are numbers."""

_SSIM = 16.0 * gamma(32) / metrics.K2**2 + _TERMS
"""Means of 121 products lose gamma(32) of the squares' size; the least denominator is c2 = 9e-4. Numerator
and denominator of the structure each are off by 4 gamma(32), and the quotient by the sum of both over c2; the
luminance by less. Windows are averaged."""

METRICS: Mapping[str, tuple[Callable[[Array, Array], float], Callable[[float], float]]] = {
    "mse": (metrics.mse, lambda value: _TERMS * value),
    # 10 / ln 10 times the relative error of the MSE; logarithm and product to 4 ulp.
    "psnr": (
        metrics.psnr,
        lambda value: (
            0.0
            if math.isinf(value)
            else 10.0 / math.log(10.0) * gamma(MOST_NUMBERS + 10) + 8.0 * UNIT * abs(value)
        ),
    ),
    "ssim": (metrics.ssim, lambda value: _SSIM),
    "relmse": (metrics.relmse, lambda value: _TERMS * value),
    "smape": (metrics.smape, lambda value: _TERMS * value),
    # A root of a mean: differences of numbers up to 4 after two blurs, 49 taps each.
    "blurred": (metrics.blurred, lambda value: 4.0 * gamma(MOST_NUMBERS + 2 * 60)),
}
"""Function and bound of each metric."""


def _metric(name: str) -> Kind:
    """Return the kind of a metric."""
    function, bound = METRICS[name]
    return kind(
        f"metric.{name}",
        lambda inputs: {"value": function(inputs["image"], inputs["reference"])},
        within(lambda inputs, value: bound(value), "roundings of float64, any order"),
    )


KINDS = (
    kind("image.features", _features, within(lambda inputs, value: ULP, ENCODED)),
    kind("image.window", _window),
    kind("image.draws", _draws),
    *map(_metric, METRICS),
    kind("image.smoothed", _smoothed, within(_bound_of, "roundings of float64, level by level (DAT-3)")),
)
"""The kinds of this module."""
