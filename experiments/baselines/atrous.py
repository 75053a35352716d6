"""The spatial filter of SVGF: an edge-avoiding wavelet transform that albedo, normals and depth guide.

1. Colour is divided by albedo where there is one, so that textures need not be kept apart [`demodulated`].
2. The variance of its luminance is estimated over neighbours on the same surface [`local_variance`], for
   there is one frame only and no history.
3. Five passes of a 5x5 kernel, the cubic B-spline's weights (1, 4, 6, 4, 1)/16 in each direction, whose taps
   are 1, 2, 4, 8, 16 pixels apart ("with holes", a trous) [`pass_over`]. Each tap counts the less, the more
   its depth, normal and luminance differ; the variance is filtered with the squared weights.
4. The result times albedo is the picture [`denoise`].

Sources: Schied et al., "Spatiotemporal Variance-Guided Filtering: Real-Time Reconstruction for Path-Traced
Global Illumination", High Performance Graphics 2017 (section 4.3, equations 1 to 5, its constants); Dammertz,
Sewtz, Hanika, Lensch, "Edge-Avoiding A-Trous Wavelet Transform for fast Global Illumination Filtering", High
Performance Graphics 2010. Without the temporal half of SVGF: its input is a single frame.

Departures: depth here is the distance along the ray; its gradient is the smaller of the differences to both
sides. The luminance is that of Rec. 709.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wamnet.refimpl.frame import Frame

Array = NDArray[np.float64]

SPLINE = (1.0 / 16.0, 1.0 / 4.0, 3.0 / 8.0, 1.0 / 4.0, 1.0 / 16.0)
"""The kernel along one axis: (1, 4, 6, 4, 1)/16 (Dammertz et al. 2010, section 3)."""

LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
"""Weights of linear red, green and blue (Rec. ITU-R BT.709)."""

ALBEDO_EPSILON = 1e-3
"""Reflectance below this one counts as zero: the colour is emitted, or there is no surface."""

DEPTH_EPSILON = 1e-3
"""Depth, in scene units, by which neighbours of a surface that faces the camera may differ."""

VARIANCE_RADIUS_PX = 3
"""Half the 7x7 window from which variance is estimated (Schied et al. 2017, section 4.2)."""


@dataclass(frozen=True)
class Settings:
    """Passes, and how much depth, normal and luminance may differ (Schied et al. 2017, section 4.3)."""

    passes: int = 5
    sigma_depth: float = 1.0
    sigma_normal: float = 128.0
    sigma_luminance: float = 4.0


@dataclass(frozen=True)
class Guides:
    """depth (H, W), its gradient (H, W, 2) in units per pixel, normal (H, W, 3)."""

    depth: Array
    gradient: Array
    normal: Array


def denoise(frame: Frame, settings: Settings | None = None) -> Array:
    """Return the filtered radiance (H, W, 3) of a frame with colour, albedo, normal and depth."""
    chosen = settings or Settings()
    light, albedo = demodulated(frame)
    guides = guides_of(frame)
    variance = local_variance(light, guides, chosen)
    for number in range(chosen.passes):
        light, variance = pass_over(light, variance, guides, 2**number, chosen)
    return light * albedo


def demodulated(frame: Frame) -> tuple[Array, Array]:
    """Return colour over albedo, and albedo, both (H, W, 3); albedo is 1 where there is hardly any."""
    albedo = frame["albedo"].astype(np.float64)
    albedo = np.where(albedo.max(axis=-1, keepdims=True) > ALBEDO_EPSILON, albedo, 1.0)
    albedo = np.maximum(albedo, ALBEDO_EPSILON)
    return frame["color"].astype(np.float64) / albedo, albedo


def guides_of(frame: Frame) -> Guides:
    """Return depth, its gradient and the normals of a frame; a mean normal is brought to unit length."""
    depth = frame["depth"][..., 0].astype(np.float64)
    normal = frame["normal"].astype(np.float64)
    length = np.linalg.norm(normal, axis=-1, keepdims=True)
    slopes = np.stack([slope(depth, axis) for axis in (0, 1)], axis=-1)
    return Guides(depth, slopes, normal / np.maximum(length, 1e-12))


def slope(depth: Array, axis: int) -> Array:
    """Return the smaller difference (H, W) to the pixels before and after: an edge is not a slope."""
    steps = np.diff(depth, axis=axis)
    first, last = np.take(steps, [0], axis), np.take(steps, [-1], axis)
    before, after = np.concatenate([first, steps], axis), np.concatenate([steps, last], axis)
    return np.where(np.abs(before) < np.abs(after), before, after)


def local_variance(light: Array, guides: Guides, settings: Settings) -> Array:
    """Return the variance (H, W) of luminance over 7x7 neighbours, weighted by depth and normal."""
    luminance = light @ LUMINANCE
    total, first, second = (np.zeros_like(luminance) for _ in range(3))
    for dy in range(-VARIANCE_RADIUS_PX, VARIANCE_RADIUS_PX + 1):
        for dx in range(-VARIANCE_RADIUS_PX, VARIANCE_RADIUS_PX + 1):
            weight = geometry_weight(guides, dy, dx, settings)
            value = shifted(luminance, dy, dx)
            total += weight
            first += weight * value
            second += weight * value * value
    # The centre's weight is 1, so no total is 0.
    found: Array = np.maximum(second / total - (first / total) ** 2, 0.0)
    return found


def pass_over(
    light: Array, variance: Array, guides: Guides, step: int, settings: Settings
) -> tuple[Array, Array]:
    """Return light (H, W, 3) and variance (H, W) after one pass with taps `step` pixels apart."""
    luminance = light @ LUMINANCE
    deviation = np.sqrt(gaussian3(variance))
    scale = settings.sigma_luminance * deviation + 1e-8
    total, sums, squares = np.zeros_like(variance), np.zeros_like(light), np.zeros_like(variance)
    for i, row in enumerate(SPLINE):
        for j, column in enumerate(SPLINE):
            dy, dx = step * (i - 2), step * (j - 2)
            weight = row * column * geometry_weight(guides, dy, dx, settings)
            weight = weight * np.exp(-np.abs(luminance - shifted(luminance, dy, dx)) / scale)
            total += weight
            sums += weight[..., None] * shifted(light, dy, dx)
            squares += weight**2 * shifted(variance, dy, dx)
    return sums / total[..., None], squares / total**2


def geometry_weight(guides: Guides, dy: int, dx: int, settings: Settings) -> Array:
    """Return the weights (H, W) of the neighbours at (dy, dx): 0 outside the picture and of another kind.

    Depth: exp(-|z(p) - z(q)| / (sigma |gradient z(p) . (p - q)| + epsilon)). Normal: max(0, n(p) . n(q)) to
    the power sigma. Two pixels without a surface are alike.
    """
    inside = shifted(np.ones_like(guides.depth), dy, dx, outside=0.0)
    far = np.abs(guides.depth - shifted(guides.depth, dy, dx))
    allowed = settings.sigma_depth * np.abs(guides.gradient @ np.array([dy, dx], np.float64)) + DEPTH_EPSILON
    cosine = (guides.normal * shifted(guides.normal, dy, dx)).sum(axis=-1)
    alike = np.clip(cosine, 0.0, 1.0) ** settings.sigma_normal
    nothing = (guides.depth == 0.0) & (shifted(guides.depth, dy, dx) == 0.0)
    weights: Array = inside * np.where(nothing, 1.0, alike * np.exp(-far / allowed))
    return weights


def gaussian3(values: Array) -> Array:
    """Return values (H, W) after a 3x3 Gaussian, (1, 2, 1)/4 in each direction; borders are repeated."""
    bell = (0.25, 0.5, 0.25)
    return sum(
        (bell[i] * bell[j] * shifted(values, i - 1, j - 1) for i in range(3) for j in range(3)),
        np.zeros_like(values),
    )


def shifted(values: NDArray[Any], dy: int, dx: int, outside: float | None = None) -> NDArray[Any]:
    """Return the neighbours (H, W, ...) at (dy, dx); where none is, the nearest pixel, or `outside`."""
    height, width = values.shape[:2]
    rows, columns = np.arange(height) + dy, np.arange(width) + dx
    found = values[np.clip(rows, 0, height - 1)[:, None], np.clip(columns, 0, width - 1)]
    if outside is None:
        return found
    inside = ((rows >= 0) & (rows < height))[:, None] & ((columns >= 0) & (columns < width))
    return np.where(inside, found, outside)
