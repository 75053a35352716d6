"""How far an image is from its reference: numbers, each with all of its conventions stated.

1. Both images are checked (one shape, every value finite) and taken to float64 [`_pair`].
2. On display-encoded colour: the mean squared error [`mse`], the same in decibels [`psnr`] and structural
   similarity [`ssim`] of Wang, Bovik, Sheikh and Simoncelli, "Image Quality Assessment: From Error Visibility
   to Structural Similarity", IEEE Transactions on Image Processing 13(4), 2004.
3. On linear radiance, where a few bright pixels would decide a plain mean: the relative squared error
   [`relmse`], in the form of Rousselle, Knaus and Zwicker, "Adaptive Sampling and Reconstruction using Greedy
   Error Minimization", ACM Transactions on Graphics 30(6), 2011, and the symmetric absolute error [`smape`],
   in the form of Vogels et al., "Denoising with Kernel Prediction and Asymmetric Loss Functions", ACM
   Transactions on Graphics 37(4), 2018.
4. What a person sees first and means over pixels hide: the error after a blur, which noise does not have and
   a missing shadow has [`blurred`], and the error where lamps are partly hidden [`penumbra`, `inside`].

The paper's table gives PSNR as 10 times the *natural* logarithm; here it is in decibels, as everywhere else.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .errors import NO_VALUE, InputError
from .frame import Floats

Float64 = NDArray[np.float64]

WINDOW_SIGMA_PX = 1.5
"""Standard deviation of SSIM's Gaussian window, in pixels (Wang et al. 2004, section III.C)."""

WINDOW_SIZE_PX = 11
"""Side of SSIM's square window, in pixels (Wang et al. 2004, section III.C)."""

K1 = 0.01
"""SSIM's constant of the luminance term, relative to the data range (Wang et al. 2004)."""

K2 = 0.03
"""SSIM's constant of the contrast-structure term, relative to the data range (Wang et al. 2004)."""

RELMSE_EPSILON = 1e-2
"""Added to the squared reference radiance: black pixels count and do not rule; 0.01 is a radiance of 0.1."""

SMAPE_EPSILON = 1e-2
"""Added to the sum of both radiances, so that two black pixels have error 0 rather than 0 / 0."""


BLUR_SIGMA_PX = 8.0
"""Standard deviation of the blur, in pixels: noise of single pixels falls to 1/28, a penumbra stays."""

BLUR_RADIUS_PX = 24
"""Radius of the blur's window, in pixels: three standard deviations."""

PENUMBRA = (0.05, 0.95)
"""Least and largest share of the lamps' light in a penumbra: less is shadow, more is full light."""


def mse(image: Floats, reference: Floats) -> float:
    """Mean of the squared differences of two images (...)."""
    x, r = _pair(image, reference)
    return float(np.mean((x - r) ** 2))


def psnr(image: Floats, reference: Floats) -> float:
    """Peak signal-to-noise ratio of two images (...): 10 log10(1 / MSE) dB; equal images: inf."""
    error = mse(image, reference)
    return 10.0 * math.log10(1.0 / error) if error > 0.0 else math.inf


def ssim(image: Floats, reference: Floats) -> float:
    """Mean structural similarity of two images (H, W, C), over the windows inside and the channels.

    The window is Gaussian, its weights sum to 1; variances and covariance are the population's.
    """
    x, r = _pair(image, reference)
    if x.ndim != 3 or min(x.shape[:2]) < WINDOW_SIZE_PX:
        rule = f"SSIM needs (height, width, channels) with at least {WINDOW_SIZE_PX} rows and columns"
        raise InputError("shape of the images", x.shape, rule, "compare larger images or use another metric")
    c1, c2 = K1**2, K2**2

    # Local means, variances and covariance (H - 10, W - 10, C).
    mean_x, mean_r = _window_mean(x), _window_mean(r)
    variance_x = _window_mean(x * x) - mean_x * mean_x
    variance_r = _window_mean(r * r) - mean_r * mean_r
    covariance = _window_mean(x * r) - mean_x * mean_r

    # Luminance times contrast and structure (Wang et al. 2004, equation 13), averaged.
    luminance = (2.0 * mean_x * mean_r + c1) / (mean_x * mean_x + mean_r * mean_r + c1)
    structure = (2.0 * covariance + c2) / (variance_x + variance_r + c2)
    return float(np.mean(luminance * structure))


def relmse(image: Floats, reference: Floats) -> float:
    """Mean of the squared differences of linear radiance (...), each over its squared reference + epsilon."""
    x, r = _pair(image, reference)
    return float(np.mean((x - r) ** 2 / (r**2 + RELMSE_EPSILON)))


def smape(image: Floats, reference: Floats) -> float:
    """Mean absolute difference of linear radiance (...), each over |image| + |reference| + epsilon."""
    x, r = _pair(image, reference)
    return float(np.mean(np.abs(x - r) / (np.abs(x) + np.abs(r) + SMAPE_EPSILON)))


def blurred(image: Floats, reference: Floats) -> float:
    """Root of the mean squared difference of two images (H, W, C) after a Gaussian blur of 8 pixels.

    At the border the window is what is inside of the image, its weights divided by their sum.
    """
    x, r = _pair(image, reference)
    if x.ndim != 3:
        rule = "a blur needs (height, width, channels)"
        raise InputError("shape of the images", x.shape, rule, "compare images")
    return float(np.sqrt(np.mean(_blur(x - r) ** 2)))


def _blur(values: Float64) -> Float64:
    """Return values (H, W, C) blurred down the columns, then along the rows."""
    for axis in (0, 1):
        at = np.arange(values.shape[axis])
        distance = at[:, np.newaxis] - at
        weights = np.exp(-0.5 * (distance / BLUR_SIGMA_PX) ** 2) * (np.abs(distance) <= BLUR_RADIUS_PX)
        weights /= weights.sum(axis=1, keepdims=True)
        values = np.moveaxis(np.tensordot(weights, values, (1, axis)), 0, axis)
    return values


def penumbra(direct: Floats, unshadowed: Floats) -> NDArray[np.bool_]:
    """Tell (H, W) where the lamps' light, a reference's layer `direct`, is partly hidden.

    Both layers (H, W, 3) are added over their channels; where no lamp would shine there is no penumbra.
    """
    light, most = (values.sum(axis=-1) for values in _pair(direct, unshadowed))
    low, high = PENUMBRA
    found: NDArray[np.bool_] = (light > low * most) & (light < high * most)
    return found


def inside(mask: NDArray[np.bool_], image: Floats, reference: Floats) -> float:
    """Root of the mean squared difference of two images (H, W, C) at the pixels of a mask (H, W)."""
    x, r = _pair(image, reference)
    if mask.shape != x.shape[:2] or not mask.any():
        rule = "must have a pixel at least, and the images' height and width"
        raise InputError("mask of pixels", int(mask.sum()), rule, "choose another one")
    return float(np.sqrt(np.mean((x[mask] - r[mask]) ** 2)))


def largest_error(image: Floats, reference: Floats) -> float:
    """Largest absolute difference of two images (...): what an error bound speaks of."""
    x, r = _pair(image, reference)
    return float(np.max(np.abs(x - r)))


def error_map(image: Floats, reference: Floats) -> Float64:
    """Absolute difference (H, W) of two images (H, W, C) at each pixel, the mean of its channels."""
    x, r = _pair(image, reference)
    means: Float64 = np.mean(np.abs(x - r), axis=-1)
    return means


@dataclass(frozen=True)
class Metric:
    """A metric, the colour it is meant for ("display" or "linear"), its unit and whether more is better."""

    name: str
    function: Callable[[Floats, Floats], float]
    domain: str
    unit: str
    higher_is_better: bool


METRICS: Mapping[str, Metric] = {
    metric.name: metric
    for metric in (
        Metric("MSE", mse, "display", "", higher_is_better=False),
        Metric("PSNR", psnr, "display", "dB", higher_is_better=True),
        Metric("SSIM", ssim, "display", "", higher_is_better=True),
        Metric("blurred RMSE", blurred, "display", "", higher_is_better=False),
        Metric("relMSE", relmse, "linear", "", higher_is_better=False),
        Metric("SMAPE", smape, "linear", "", higher_is_better=False),
    )
}
"""Every metric, in the order of tables; a new one is one function and one line here."""


def _pair(image: Floats, reference: Floats) -> tuple[Float64, Float64]:
    """Return both arrays (...) in float64, or refuse different shapes, no value, NaN and infinity."""
    try:
        x, r = np.asarray(image, np.float64), np.asarray(reference, np.float64)
    except (TypeError, ValueError):
        rule = "must be arrays of numbers, with rows of one length"
        raise InputError("images", NO_VALUE, rule, "give a matching pair") from None
    if x.shape != r.shape or x.size == 0:
        shapes = f"{x.shape} against {r.shape}"
        raise InputError(
            "shape of the images", shapes, "must be equal, and not empty", "give a matching pair"
        )
    for what, values in (("the image", x), ("the reference", r)):
        bad = int(np.count_nonzero(~np.isfinite(values)))
        if bad:
            value: Any = values[~np.isfinite(values)][0]
            rule = f"every value must be finite, and {bad} of {values.size} are not"
            raise InputError(f"value of {what}", float(value), rule, "repair or leave out these pixels")
    return x, r


def _window_mean(values: Float64) -> Float64:
    """Return Gaussian-weighted means of (H, W, C) around pixels whose window fits: (H - 10, W - 10, C)."""
    radius = WINDOW_SIZE_PX // 2
    bell = np.exp(-0.5 * (np.arange(-radius, radius + 1) / WINDOW_SIGMA_PX) ** 2)
    weights = bell / bell.sum()
    height, width = values.shape[0] - 2 * radius, values.shape[1] - 2 * radius

    # The window is a product of a column and a row: average down the columns, then along the rows.
    down = sum((w * values[i : i + height] for i, w in enumerate(weights)), np.zeros(()))
    return sum((w * down[:, i : i + width] for i, w in enumerate(weights)), np.zeros(()))
