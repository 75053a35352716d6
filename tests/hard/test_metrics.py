"""Metrics where cancellation, tiny pictures and equal pictures lie in wait."""

import math
from fractions import Fraction

import numpy as np
import pytest

from wamnet.refimpl import metrics
from wamnet.refimpl.errors import InputError

U64 = 2.0**-53
"""Unit roundoff of float64."""


@pytest.mark.parametrize("level", [0.0, 1e-3, 0.5, 0.999])
def test_structure_of_faint_noise_on_a_bright_ground(level):
    """SSIM takes E[x^2] - E[x]^2: in float32 noise of 1e-4 would drown, in float64 it keeps 8 digits.

    Against means of squared differences, which do not cancel: |error| <= 3 * 24 u a variance, over c2 = 9e-4.
    """
    random = np.random.default_rng(1)
    a, b = (level + 1e-4 * random.standard_normal((13, 12, 1)).astype(np.float32) for _ in range(2))
    a, b = a.astype(np.float32), b.astype(np.float32)
    expected = ssim_without_cancellation(a.astype(np.float64), b.astype(np.float64))
    assert abs(metrics.ssim(a, b) - expected) <= 4 * 3 * 24 * U64 / 9e-4 * 2


def ssim_without_cancellation(x, r):
    """Return SSIM with variances as weighted means of (x - mean)^2, window by window."""
    bell = np.exp(-0.5 * (np.arange(-5, 6) / 1.5) ** 2)
    weights = np.outer(bell, bell)[..., None] / bell.sum() ** 2
    found = []
    for top in range(x.shape[0] - 10):
        for left in range(x.shape[1] - 10):
            p, q = (image[top : top + 11, left : left + 11] for image in (x, r))
            m, n = (weights * p).sum(), (weights * q).sum()
            var_p, var_q = (weights * (p - m) ** 2).sum(), (weights * (q - n) ** 2).sum()
            both = (weights * (p - m) * (q - n)).sum()
            light = (2 * m * n + 1e-4) / (m * m + n * n + 1e-4)
            found.append(light * (2 * both + 9e-4) / (var_p + var_q + 9e-4))
    return float(np.mean(found))


def test_a_difference_of_one_bit():
    """Of 432 numbers one differs by an ulp: MSE is that, squared, exactly divided; PSNR is finite."""
    a = np.full((12, 12, 3), 0.75, np.float32)
    b = a.copy()
    b[3, 4, 1] = np.nextafter(np.float32(0.75), np.float32(1.0))
    exact = Fraction(2) ** -48 / 432
    assert abs(Fraction(metrics.mse(a, b)) - exact) <= exact * 2 * Fraction(U64)
    # 171 dB carry the ulps of both logarithms and products, and 2 u of the MSE times 10 / ln 10.
    assert abs(metrics.psnr(a, b) + 10 * math.log10(exact)) <= (8 * 171 + 2 * 4.4) * U64
    # The true similarity is below 1 by at most d^2 / c2, d = 2^-24; either may be hidden by the rounding of
    # variances, 3 * 24 u over c2 = 9e-4 in numerator and denominator.
    assert abs(metrics.ssim(a, b) - 1.0) <= 4 * 3 * 24 * U64 / 9e-4 + 2.0**-48 / 9e-4


def test_negative_and_huge_radiance():
    """Linear metrics take what a filter or a firefly leaves: finite numbers, and SMAPE at most 1."""
    a = np.array([[[-5.0, 1e30, 0.0]]])
    b = np.array([[[5.0, -1e30, -0.0]]])
    assert 0.0 <= metrics.smape(a, b) <= 1.0
    assert np.isfinite(metrics.relmse(a, b))
    # 1e30^2 is beyond float32: everything happens in float64.
    assert np.isfinite(metrics.mse(a.astype(np.float32), b.astype(np.float32)))


@pytest.mark.parametrize("shape", [(1, 1, 3), (10, 11, 3), (11, 10, 1), (40, 40)])
def test_pictures_without_a_whole_window(shape):
    """MSE needs a pixel, SSIM a window and channels: it refuses instead of inventing a border."""
    black = np.zeros(shape)
    assert metrics.mse(black, black) == 0.0
    with pytest.raises(InputError, match="at least 11 rows and columns"):
        metrics.ssim(black, black)
