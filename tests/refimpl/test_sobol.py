"""Sobol points: the published sequence, even spread, and scrambling that keeps it."""

from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from statistical import SIGNIFICANCE, assert_all_plausible, assert_same_image, chi_square_p, sidak, stats

from wamnet.refimpl import rng
from wamnet.refimpl.light import render as R
from wamnet.refimpl.light import scenes, sobol
from wamnet.refimpl.light.transport import Settings

WORD = st.integers(0, 2**32 - 1)


def words(*values):
    return np.array(values, np.uint32)


def points(count, first=0, seed=None, block=3):
    """Return the points (count, 4) as fractions of 2^32; scrambled as pixel 7 of a seed has them, in
    float64.
    """
    index = np.arange(first, first + count).astype(np.uint32)
    if seed is None:
        return np.stack([sobol.sobol(index, d) for d in range(4)], axis=-1) / 2.0**32
    numbers = sobol.uniforms(
        rng.counter(seed), rng.counter([7] * count), index, rng.counter(block), np.float64
    )
    return np.stack(numbers, axis=-1)


def test_points_are_the_published_sequence():
    """SciPy has the same direction numbers, in Gray code's order: its n-th point is ours of n ^ (n >> 1)."""
    n = np.arange(1 << 10)
    gray = (n ^ (n >> 1)).astype(np.uint32)
    expected = stats.qmc.Sobol(4, scramble=False, bits=32).random(1 << 10)
    found = np.stack([sobol.sobol(gray, d) for d in range(4)], axis=-1) / 2.0**32
    assert np.array_equal(found, expected)


@given(WORD)
def test_reversed_bits(x):
    assert sobol.reverse_bits(words(x))[0] == int(f"{x:032b}"[::-1], 2)


@given(WORD, WORD, WORD)
def test_scrambling_is_nested(a, b, key):
    """Two numbers that share their k highest bits do so afterwards, and differ in the next bit as before."""
    both = sobol.scramble(words(a, b), words(key, key))
    before, after = a ^ b, int(both[0] ^ both[1])
    assert before.bit_length() == after.bit_length()


def counts_in(boxes, found):
    """Return how many of the points (N, D) lie in each of the boxes, 2^k_d to an axis."""
    cell = np.zeros(len(found), int)
    for k, axis in zip(boxes, found.T, strict=True):
        cell = cell * 2**k + (axis * 2**k).astype(int)
    return np.bincount(cell, minlength=2 ** sum(boxes))


@pytest.mark.parametrize("seed", [None, 0, 1, 12345])
@pytest.mark.parametrize("first", [0, 64, 3 * 64])
def test_every_elementary_interval_has_its_share(seed, first):
    """64 points from a multiple of 64 on. The first two dimensions: one in each box of area 1/64. All four:
    quality t = 0 + 0 + 1 + 2, the sum of the polynomials' degrees less one, so 2^3 in each box of volume
    8/64.
    """
    found = points(64, first, seed)
    for d in range(4):
        assert np.all(counts_in((6,), found[:, d : d + 1]) == 1)
    for k in range(7):
        assert np.all(counts_in((k, 6 - k), found[:, :2]) == 1)
    for boxes in product(range(4), repeat=4):
        if sum(boxes) == 3:
            assert np.all(counts_in(boxes, found) == 8)


def test_scrambled_points_are_uniform():
    """The same sample of 65536 pixels: chi-square over 16 x 16 cells of each pair of neighbouring
    dimensions.
    """
    pixels = rng.counter(np.arange(1 << 16))
    numbers = sobol.uniforms(rng.counter(1), pixels, rng.counter(5), rng.counter(2), np.float64)
    for a, b in ((0, 1), (1, 2), (2, 3)):
        observed, _, _ = np.histogram2d(numbers[a], numbers[b], bins=16, range=((0, 1), (0, 1)))
        assert chi_square_p(observed, np.full((16, 16), 256.0)) >= sidak(SIGNIFICANCE, 3)


def test_blocks_and_pixels_are_independent():
    """Correlations of 4096 samples between two blocks, and between two pixels: z-tests, 1 / sqrt(N) each."""
    a, b = points(4096, seed=3, block=1), points(4096, seed=3, block=2)
    index = np.arange(4096).astype(np.uint32)
    c = np.stack(
        sobol.uniforms(rng.counter(3), rng.counter([8] * 4096), index, rng.counter(1), np.float64), -1
    )
    r = [np.corrcoef(a[:, i], other[:, j])[0, 1] for other in (b, c) for i in range(4) for j in range(4)]
    assert_all_plausible(2 * stats.norm.sf(np.abs(r) * np.sqrt(4096)))


def error(numbers, count):
    """Return the root mean square error, over 64 pixels, of the mean of x y z w, which is 1/16."""
    pixels, index = np.divmod(np.arange(64 * count), count)
    given = rng.counter(4), rng.counter(pixels), rng.counter(index), rng.counter(0), np.float64
    means = np.prod(np.stack(numbers(*given)), axis=0).reshape(64, count).mean(axis=1)
    return np.sqrt(np.mean((means - 1 / 16) ** 2))


def test_errors_fall_faster_than_random_ones():
    """16 times as many points: random errors fall by 4, those of scrambled nets by up to 64 (n^-3/2, for a
    smooth integrand). Errors are known to 1 part in sqrt(128): a ratio of 10 is far from both.
    """
    assert error(rng.uniforms, 32) / error(rng.uniforms, 512) <= 4 * 1.5
    assert error(sobol.uniforms, 32) / error(sobol.uniforms, 512) >= 10
    assert error(sobol.uniforms, 512) <= 0.1 * error(rng.uniforms, 512)


@pytest.mark.parametrize("name", ["cornell", "daylight"])
def test_both_samplers_estimate_the_same_image(name):
    """Variances are those of one sample and too large for Sobol's mean: the test errs on the safe side."""
    scene = scenes.canonical(name)
    a = R.render(scene, R.Job(32, 32, 16, 1, Settings(max_depth=2)))
    b = R.render(scene, R.Job(32, 32, 16, 2, Settings(max_depth=2, sampler="sobol")))
    assert_same_image(a, b)


def test_samples_go_on_where_others_stopped():
    """Samples 0 to 3 and 4 to 7 of two jobs are those of one job of 8."""
    scene, settings = scenes.canonical("cornell"), Settings(max_depth=1, sampler="sobol")
    whole = R.render(scene, R.Job(6, 5, 8, 3, settings, "float64")).frame["color"]
    halves = [
        R.render(scene, R.Job(6, 5, 4, 3, settings, "float64", first_sample=k)).frame["color"] for k in (0, 4)
    ]
    assert np.max(np.abs((halves[0] + halves[1]) / 2 - whole)) <= 16 * 2.0**-52 * np.max(whole)


def test_the_sampler_is_told_where_it_is_not_the_usual_one():
    scene = scenes.canonical("empty")
    assert "sampler" not in R.render(scene, R.Job(1, 1)).frame.info
    assert R.render(scene, R.Job(1, 1, settings=Settings(sampler="sobol"))).frame.info["sampler"] == "sobol"
    assert "sampler" not in Settings().facts()
    assert Settings(sampler="sobol").facts()["sampler"] == "sobol"


@given(st.lists(WORD, min_size=1, max_size=32))
def test_points_of_two_dimensions_in_fewer_steps(index):
    """SOB-5: the same points as by direction numbers, to the bit."""
    index = words(*index)
    for dimension, found in enumerate(sobol.net(index)):
        assert np.array_equal(sobol.reverse_bits(found), sobol.sobol(index, dimension))


@given(WORD, WORD, st.integers(0, 12))
def test_moved_points_stay_a_net(seed, pixel, m):
    """SOB-5: of 2^m samples each elementary interval of area 2^-m has one; 24 bits of a float keep that."""
    sample, count = np.arange(2**m, dtype=np.uint32), 2**m
    key = [np.full(count, value, np.uint32) for value in (seed, pixel)]
    u, v, _, _ = sobol.net_uniforms(*key, sample, np.uint32(0), np.float64)
    for bits in range(m + 1):
        cell = np.floor(u * 2**bits) * 2 ** (m - bits) + np.floor(v * 2 ** (m - bits))
        assert len(set(cell.tolist())) == count
