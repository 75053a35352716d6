"""Scores of a picture: each against its definition, FLIP against what its authors publish."""

import math

import numpy as np
import pytest
from lab import scores

from wamnet.refimpl import encoding, metrics
from wamnet.refimpl.errors import InputError

pytest.importorskip("flip_evaluator", reason="flip-evaluator is not installed")

RNG = np.random.default_rng(1)
REFERENCE = RNG.uniform(0.0, 1.5, (16, 16, 3))
PICTURE = RNG.uniform(0.0, 1.0, (16, 16, 3))


ULP = float(np.finfo(np.float32).eps)
"""FLIP computes in float32."""


def test_scores_are_those_of_the_metrics():
    found = scores.score(PICTURE, REFERENCE)
    target = encoding.to_display(REFERENCE)
    assert found["mse"] == metrics.mse(PICTURE, target)
    assert found["psnr"] == metrics.psnr(PICTURE, target)
    assert found["ssim"] == metrics.ssim(PICTURE, target)
    assert found["relmse"] == metrics.relmse(encoding.from_display(PICTURE), REFERENCE)
    assert found["smape"] == metrics.smape(encoding.from_display(PICTURE), REFERENCE)
    # One rounding in each of the two products.
    assert abs(found["mse255"] - 65025.0 * found["mse"]) <= 2.0**-51 * found["mse255"]


def test_squares_of_eight_bits_wrap_around():
    target = np.zeros((12, 12, 3))
    for levels, square in ((3, 9), (16, 0), (20, 400 - 256), (255, 65025 % 256)):
        assert scores.wrapped_mse(target + levels / 255.0, target) == square
    a, b = (np.random.default_rng(7).integers(0, 256, (8, 8, 3)).astype(np.uint8) for _ in range(2))
    b = b[::-1]
    assert scores.wrapped_mse(a / 255.0, b / 255.0) == np.mean((a - b) ** 2)  # NumPy's own 8 bits


def lab_of(srgb):
    """A colour in CIELAB after Hunt's adjustment: Andersson et al. 2020, sections 4.1.2, 4.1.3."""
    # sRGB's primaries and white of IEC 61966-2-1.
    to_xyz = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])
    xyz = to_xyz @ encoding.srgb_decode(np.asarray(srgb, float))
    ratio = xyz / (to_xyz @ np.ones(3))
    delta = 6.0 / 29.0
    f = np.where(ratio > delta**3, np.cbrt(ratio), ratio / (3.0 * delta**2) + 4.0 / 29.0)
    lightness = 116.0 * f[1] - 16.0
    return np.array([lightness, *(0.01 * lightness * np.array([500.0, 200.0]) * (f[:2] - f[1:]))])


def hyab(a, b):
    """The distance of two such colours."""
    difference = lab_of(a) - lab_of(b)
    return abs(difference[0]) + np.hypot(*difference[1:])


def flip_of_constants(a, b):
    """FLIP of two pictures of one colour each: no filter changes them, and there is neither edge nor point.

    Section 4.1.3: the distance to the power 0.7, up to 0.4 of that of green and blue mapped to [0, 0.95], the
    rest to [0.95, 1].
    """
    largest = hyab((0.0, 1.0, 0.0), (0.0, 0.0, 1.0)) ** 0.7
    error, knee = hyab(a, b) ** 0.7, 0.4 * largest
    if error < knee:
        return 0.95 * error / knee
    return 0.95 + (error - knee) / (largest - knee) * 0.05


COLOURS = [((0, 0, 0), (1, 1, 1)), ((0.5, 0.5, 0.5), (0.55, 0.5, 0.5)), ((0.9, 0.2, 0.1), (0.3, 0.4, 0.8))]


@pytest.mark.parametrize(("a", "b"), COLOURS, ids=str)
def test_flip_of_constant_pictures_is_the_published_formula(a, b):
    pictures = [np.broadcast_to(np.float32(c), (24, 24, 3)) for c in (a, b)]
    # FLIP filters in float32 with windows of up to 41 x 41 weights twice: sums of 82 terms, each off by an
    # ulp, of colours of up to 2 in a space whose distances are a hundred times as large, then the power. The
    # matrix above has four digits: a hundredth of that.
    assert abs(scores.flip(*pictures) - flip_of_constants(a, b)) <= 200 * 82 * ULP


# ---- FLIP ------------------------------------------------------------------------------------------------


def test_flip_has_its_published_ends():
    """No error, and the largest distance, of green and blue (Andersson et al. 2020, section 4.1.3)."""
    green, blue = (np.broadcast_to(np.float32(c), (24, 24, 3)) for c in ((0, 1, 0), (0, 0, 1)))
    assert scores.flip(green, green) == 0.0
    # Two filters of up to 41 weights in float32, in a space whose distances are a hundred times as large.
    assert abs(scores.flip(green, blue) - 1.0) <= 2 * 82 * 100 * np.finfo(np.float32).eps


def test_flip_refuses_what_is_not_encoded():
    with pytest.raises(InputError, match=r"range of the picture '0.* to 1.*': FLIP takes display-encoded"):
        scores.flip(REFERENCE, PICTURE)
    with pytest.raises(InputError, match="range of its reference"):
        scores.flip(PICTURE, REFERENCE)
    with pytest.raises(InputError, match="every value must be finite"):
        scores.flip(np.full_like(PICTURE, np.nan), PICTURE)


# ---- what a score is worth in samples ---------------------------------------------------------------------


def test_a_ladder_of_one_over_n_is_exact():
    ladder = scores.Ladder((4, 8, 32), (0.25, 0.125, 1.0 / 32))
    for spp in (1.0, 4.0, 5.0, 8.0, 20.0, 32.0, 128.0):
        # A handful of roundings of exp and log.
        assert abs(ladder.spp_of(1.0 / spp) - spp) <= 32 * 2.0**-52 * spp
    assert ladder.spp_of(0.0) == math.inf


def test_a_ladder_is_measured_and_must_fall():
    clean = np.full((4, 4, 3), 0.5)
    renders = {spp: [(clean + 0.4 / spp, clean)] for spp in (2, 8)}
    found = scores.ladder(renders)
    assert found.spp == (2, 8)
    assert found.mse[1] == metrics.mse(encoding.to_display(clean + 0.05), encoding.to_display(clean))
    with pytest.raises(InputError, match=r"errors of renders .* must fall as the samples rise"):
        scores.ladder({2: renders[8], 8: renders[2]})
