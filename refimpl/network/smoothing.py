"""Colour smoothed by an edge-avoiding à-trous filter: means of what neighbours on the same surface got.

1. Light far brighter than white is clipped [`dimmed`].
2. Guides are layers of the same frame: normal, albedo, position, and depth, which says how far apart
   positions may be [`guides_of`].
3. A level takes, for each pixel, the mean of 5 x 5 pixels with gaps between them, weighted by a B3 spline and
   by how alike the guides are [`smooth_once`], [`weight`], [`added`].
4. Gaps double from level to level: three levels reach 14 pixels away with 75 taps [`smooth`].

The filter is that of Dammertz, Sewtz, Hanika, Lensch, "Edge-Avoiding À-Trous Wavelet Transform for fast
Global Illumination Filtering", High Performance Graphics 2010. Its weights for positions are relative to
depth here, so that no scale of the scene is needed.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]

SPLINE = (0.0625, 0.25, 0.375, 0.25, 0.0625)
"""The B3 spline at -2, -1, 0, 1, 2: weights of the taps along an axis."""

GUIDES: Mapping[str, float] = {"normal": 0.5, "albedo": 0.2, "position": 0.08}
"""Standard deviations of the weights by layer: those of unit normals and of reflectances, and, for positions,
as a share of the pixel's depth. Noise of 16 camera rays differs by less, edges by more."""

LEVELS = 3
"""Levels of the features: gaps of 1, 2 and 4 pixels."""

DEPTH = "depth"
"""The layer that positions are compared by."""

LEAST_DEPTH = 1e-6
"""Depths are at least this: a miss is at 0, and nothing else is near it."""

FARTHEST = 1e9
"""Depths, and the magnitudes of other guides, are at most this: no square overflows float32."""

WHITES = 16.0
"""Light is clipped to so many times white first, as bright as `highlights` shows. Of one path a pixel, some
are thousands of times brighter, and a mean over a hundred pixels would show nothing else."""


def dimmed(color: Array, exposure_stops: float) -> Array:
    """Return radiance (...) clipped to what is from 0 to [`WHITES`] times white at an exposure."""
    return np.clip(color, 0.0, WHITES * 2.0**-exposure_stops)


def guides_of(layers: Mapping[str, Array]) -> tuple[Array, Array]:
    """Return what is compared, (H, W, 9), and the factors (H, W, 9) of its differences.

    `layers` has normal, albedo, position (H, W, 3) and depth (H, W, 1), without NaN.
    """
    depth = np.clip(layers[DEPTH], LEAST_DEPTH, FARTHEST)
    one = np.ones_like(layers["normal"])
    compared = [np.clip(layers[name], -FARTHEST, FARTHEST) for name in GUIDES]
    factors = [one / (sigma * depth if name == "position" else sigma) for name, sigma in GUIDES.items()]
    return np.concatenate(compared, axis=-1), np.concatenate(factors, axis=-1)


def weight(here: Array, there: Array, factors: Array) -> Array:
    """Return exp(-d^2 / 2) (..., 1), d being the distance of guides (..., 9) times the factors of `here`."""
    apart = (there - here) * factors
    squares: Array = np.exp(-0.5 * np.sum(apart * apart, axis=-1, keepdims=True))
    return squares


def added(
    total: Array, weights: Array, color: Array, spline: Any, here: Array, there: Array, factors: Array
) -> tuple[Array, Array]:
    """Return sums (..., 3) and (..., 1) with one more tap: its colour times its weight, and the weight.

    `here` and `there` are the guides (..., 9) of pixel and tap; may be traced.
    """
    alike = spline * weight(here, there, factors)
    return total + alike * color, weights + alike


def mean(total: Array, weights: Array) -> Array:
    """Return the mean (..., 3) of a sum (..., 3) and its weights (..., 1); may be traced."""
    return total / weights


def taps(height: int, width: int, gap: int) -> Iterator[tuple[float, Array, Array]]:
    """Yield the spline's weight and the rows (H) and columns (W) of each tap; pixels at the border repeat."""
    for dy, vertical in enumerate(SPLINE, -2):
        for dx, horizontal in enumerate(SPLINE, -2):
            rows = np.clip(np.arange(height) + gap * dy, 0, height - 1)
            columns = np.clip(np.arange(width) + gap * dx, 0, width - 1)
            yield vertical * horizontal, rows, columns


def smooth_once(color: Array, guides: Array, factors: Array, gap: int) -> Array:
    """Return the weighted means (H, W, 3) of 25 pixels `gap` apart."""
    total, weights = np.zeros_like(color), np.zeros_like(color[..., :1])
    height, width = color.shape[:2]
    for spline, rows, columns in taps(height, width, gap):
        there = np.ix_(rows, columns)
        total, weights = added(total, weights, color[there], spline, guides, guides[there], factors)
    return mean(total, weights)


def smooth(color: Array, layers: Mapping[str, Array], levels: int) -> Array:
    """Return colour (H, W, 3) smoothed by so many levels, guided by layers [`guides_of`]."""
    guides, factors = guides_of(layers)
    for level in range(levels):
        color = smooth_once(color, guides, factors, 2**level)
    return color
