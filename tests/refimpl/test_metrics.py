"""Tests of the metrics: worked examples, scikit-image as oracle, edge cases, refusals."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from wamnet.refimpl import metrics
from wamnet.refimpl.errors import InputError

ALL = [metric.function for metric in metrics.METRICS.values()] + [metrics.largest_error]
U64 = 2.0**-53
"""Unit roundoff of float64."""


def picture(seed: int, shape: tuple[int, ...] = (17, 23, 3)) -> np.ndarray:
    """Return a smooth picture with noise, values in [0, 1]."""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[0 : shape[0], 0 : shape[1]]
    smooth = 0.5 + 0.3 * np.sin(0.4 * x + 0.3 * y)[..., None]
    return np.clip(smooth + 0.15 * rng.standard_normal(shape), 0.0, 1.0)


@pytest.fixture(scope="module")
def oracle(needs: Callable[[str], None]) -> Any:
    """Give scikit-image's metrics."""
    needs("packages")
    from skimage import metrics

    return metrics


def test_mse_and_psnr_by_hand() -> None:
    """Differences 0, 1/4, 1/2, 0: mean (1/16 + 1/4) / 4 = 5/64, 10 log10(64/5) = 11.0720996964787 dB."""
    a, b = np.array([0.0, 0.25, 1.0, 0.5]), np.array([0.0, 0.5, 0.5, 0.5])
    assert metrics.mse(a, b) == 5 / 64
    assert abs(metrics.psnr(a, b) - 11.0720996964787) <= 1e-13  # digits of the worked value
    # Another range: 20 log10(255) = 48.1308036086791 dB more.
    assert abs(metrics.psnr(a / 255.0, b / 255.0) - 59.2029033051578) <= 1e-12  # digits of the worked value


def test_relmse_and_smape_by_hand() -> None:
    """One pixel 0.3 against 0.1, one 0 against 0: 0.04 / 0.02 and 0; 0.2 / 0.41 and 0."""
    a, b = np.array([0.3, 0.0]), np.array([0.1, 0.0])
    assert abs(metrics.relmse(a, b) - 1.0) <= 16 * U64  # at most 8 rounded operations on numbers up to 2
    assert abs(metrics.smape(a, b) - 0.2 / 0.41 / 2) <= 16 * U64


def test_the_papers_psnr_is_a_natural_logarithm() -> None:
    """Its Table 1 pairs MSE 82.93 (of 255) with 66.67: 10 ln(255**2 / MSE); in decibels 28.94."""
    a = np.zeros(1)
    b = np.full(1, math.sqrt(82.93) / 255.0)
    assert abs(metrics.psnr(a, b) - 28.94) <= 0.005  # the table's digits
    assert abs(math.log(10.0) * metrics.psnr(a, b) - 66.67) <= 0.07  # the table's inner consistency


@pytest.mark.parametrize("shape", [(11, 11, 1), (17, 23, 3), (64, 12, 3)])
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_against_scikit_image(oracle: Any, shape: tuple[int, ...], dtype: type) -> None:
    """The same conventions, another program.

    A window mean takes 24 rounded operations on numbers in [0, 1], so a variance is off by at most 3 * 24 u
    in both programs; divided by c2 = 9e-4, with a factor 4 for numerator and denominator of both: 4e-11.
    """
    a: np.ndarray = picture(1, shape).astype(dtype)
    b: np.ndarray = picture(2, shape).astype(dtype)
    wide_a, wide_b = a.astype(np.float64), b.astype(np.float64)
    want = oracle.structural_similarity(
        wide_a,
        wide_b,
        data_range=1.0,
        gaussian_weights=True,
        sigma=1.5,
        use_sample_covariance=False,
        channel_axis=-1,
    )
    assert abs(metrics.ssim(a, b) - want) <= 4 * 3 * 24 * U64 / 9e-4 * 2
    # Means of n terms: at most n + 4 rounded operations of a value below 1, relative to itself.
    slack = 2 * (a.size + 4) * U64
    assert abs(metrics.mse(a, b) - oracle.mean_squared_error(wide_a, wide_b)) <= slack
    assert (
        abs(metrics.psnr(a, b) - oracle.peak_signal_noise_ratio(wide_a, wide_b, data_range=1.0)) <= 10 * slack
    )


def test_ssim_of_constant_images_by_hand() -> None:
    """Variances vanish: what is left is the luminance term (2 a b + c1) / (a a + b b + c1)."""
    a, b, c1 = 0.25, 0.75, 1e-4
    got = metrics.ssim(np.full((11, 11, 3), a), np.full((11, 11, 3), b))
    # The vanishing variances leave rounding of 3 * 24 u each over c2 = 9e-4.
    assert abs(got - (2 * a * b + c1) / (a * a + b * b + c1)) <= 4 * 3 * 24 * U64 / 9e-4


def test_ssim_of_one_bright_pixel_by_hand() -> None:
    """An 11x11 picture has one window; a lone pixel at its centre has the weight w = g0 * g0.

    Against black: mean w, variance w - w w, covariance 0: c1 / (w w + c1) * c2 / (w - w w + c2).
    """
    g = np.exp(-0.5 * (np.arange(-5, 6) / 1.5) ** 2)
    w = float(g[5] / g.sum()) ** 2
    dot, black = np.zeros((11, 11, 1)), np.zeros((11, 11, 1))
    dot[5, 5, 0] = 1.0
    want = 1e-4 / (w * w + 1e-4) * 9e-4 / (w - w * w + 9e-4)
    # Only a handful of roundings of w matter: no cancellation, the other products are zero.
    assert abs(metrics.ssim(dot, black) - want) <= 64 * U64


@pytest.mark.parametrize("value", [None, 0.0, 0.5, 1.0])
def test_identical_images(value: float | None) -> None:
    """Exactly no error, exactly similarity 1, infinite PSNR: also for constant and black images."""
    a = picture(3) if value is None else np.full((12, 12, 3), value)
    assert metrics.mse(a, a) == 0.0
    assert metrics.psnr(a, a) == math.inf
    assert metrics.ssim(a, a) == 1.0
    assert metrics.relmse(a, a) == 0.0
    assert metrics.smape(a, a) == 0.0


def test_largest_error_and_error_map_by_hand() -> None:
    """One pixel off by 1/4, 1/2 and 0: at most 1/2, on average 1/4."""
    a, b = np.zeros((1, 2, 3)), np.zeros((1, 2, 3))
    a[0, 1] = (0.25, -0.5, 0.0)
    assert metrics.largest_error(a, b) == 0.5
    assert (metrics.error_map(a, b) == [[0.0, 0.25]]).all()


def test_float64_inside() -> None:
    """A float32 sum of many small squares would lose digits; the result is that of float64 copies."""
    a, b = picture(4, (300, 300, 3)).astype(np.float32), picture(5, (300, 300, 3)).astype(np.float32)
    for metric in ALL:
        assert metric(a, b) == metric(a.astype(np.float64), b.astype(np.float64))


@pytest.mark.parametrize("metric", ALL)
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_values_that_are_not_finite_are_refused(metric: Callable[..., float], value: float) -> None:
    """On either side, with their number."""
    good, bad = picture(6), picture(6)
    bad[2, 3, 1] = bad[4, 5, 2] = value
    with pytest.raises(
        InputError, match=rf"value of the image {value}: every value .* and 2 of 1173 are not"
    ):
        metric(bad, good)
    with pytest.raises(InputError, match=f"value of the reference {value}"):
        metric(good, bad)


@pytest.mark.parametrize("metric", ALL)
def test_shapes_that_do_not_match_are_refused(metric: Callable[..., float]) -> None:
    """Nothing is broadcast silently; an empty pair has no mean."""
    with pytest.raises(
        InputError, match=r"shape of the images '\(17, 23, 3\) against \(17, 23, 1\)': must be equal"
    ):
        metric(picture(7), picture(7)[..., :1])
    with pytest.raises(InputError, match="must be equal, and not empty"):
        metric(np.zeros((0, 3, 3)), np.zeros((0, 3, 3)))


def test_rows_of_two_lengths_are_refused():
    """NumPy's own error went through."""
    with pytest.raises(InputError, match="must be arrays of numbers, with rows of one length"):
        metrics.mse([[1.0], [1.0, 2.0]], [[1.0], [1.0, 2.0]])


def test_a_blur_leaves_what_is_even_and_takes_noise_away() -> None:
    """MET-10: a difference that is the same everywhere stays, at the border too; a checkerboard vanishes."""
    flat, (y, x) = np.zeros((40, 50, 3)), np.mgrid[0:40, 0:50]
    assert abs(metrics.blurred(flat + 0.25, flat) - 0.25) <= 64 * U64
    board = flat + np.where((x + y) % 2, 0.25, -0.25)[..., None]
    assert metrics.blurred(board, flat) <= 0.002 < metrics.mse(board, flat)
    # One pixel among dark ones: the sum of squares of a Gaussian of unit sum is 1 / (4 pi sigma^2).
    dot = np.zeros((97, 97, 1))
    dot[48, 48] = 1.0
    expected = math.sqrt(1.0 / (4.0 * math.pi * 64.0)) / 97
    # Cut at three standard deviations: 0.0027 of the weight is missing in each direction.
    assert abs(metrics.blurred(dot, 0.0 * dot) / expected - 1.0) <= 0.01
    with pytest.raises(InputError, match="a blur needs"):
        metrics.blurred(flat[..., 0], flat[..., 0])


def test_a_penumbra_is_where_lamps_are_partly_hidden() -> None:
    """MET-11: shares of 0, 1/20, 1/2, 19/20 and 1 of the light, and no light at all; then the error there."""
    most = np.ones((1, 6, 3)) * [0.5, 0.25, 0.25]
    most[0, 5] = 0.0
    share = np.array([0.0, 0.0499, 0.5, 0.9501, 1.0, 0.0])[None, :, None]
    mask = metrics.penumbra(share * most, most)
    assert mask.tolist() == [[False, False, True, False, False, False]]
    assert metrics.inside(mask, most + share, most) == 0.5
    for wrong in (mask & False, mask[:, :5]):
        with pytest.raises(InputError, match=r"mask of pixels .*: must have a pixel at least, and"):
            metrics.inside(wrong, most, most)
