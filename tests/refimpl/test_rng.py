"""The random generator: known bits, uniformity, independence across its counters."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from statistical import assert_all_plausible, chi_square_p, stats

from wamnet.refimpl import rng

WORDS = st.integers(0, 2**32 - 1)


def pcg4d_integers(v: tuple[int, int, int, int]) -> tuple[int, int, int, int]:
    """PCG4D as the paper's listing states it, in integers modulo 2**32: x += y*w; y += z*x; z += x*y; w +=
    y*z."""
    x, y, z, w = ((n * 1664525 + 1013904223) % 2**32 for n in v)
    for last in (False, True):
        x = (x + y * w) % 2**32
        y = (y + z * x) % 2**32
        z = (z + x * y) % 2**32
        w = (w + y * z) % 2**32
        if not last:
            x, y, z, w = (n ^ (n >> 16) for n in (x, y, z, w))
    return x, y, z, w


def words(v: tuple[int, int, int, int]) -> tuple[int, ...]:
    return tuple(int(word[0]) for word in rng.pcg4d(*(rng.counter(n) for n in v)))


@given(st.tuples(WORDS, WORDS, WORDS, WORDS))
def test_equals_integer_arithmetic(counters):
    assert words(counters) == pcg4d_integers(counters)


def test_block_puts_each_counter_in_its_own_word():
    """The order (pixel, sample, block, seed) is part of the definition: other engines must follow it."""
    got = rng.random_block(*(rng.counter(n) for n in (9, 10, 11, 12)))
    assert tuple(int(w[0]) for w in got) == pcg4d_integers((10, 11, 12, 9))


@given(WORDS)
def test_floats_are_24_bits_and_below_one_in_both_types(word):
    bits = rng.counter(word)
    exact = (word >> 8) / 2**24
    for dtype in (np.float32, np.float64):
        value = rng.uniform_floats(bits, dtype)
        assert value.dtype == dtype
        assert value[0] == exact
        assert 0.0 <= value[0] < 1.0


def test_counter_wraps_modulo_2_to_the_32():
    assert rng.counter([0, 2**32, 2**32 + 5, -1]).tolist() == [0, 0, 5, 2**32 - 1]


AXES = ("seed", "pixel", "sample", "block")
"""The counters; each test below moves one (or two) of them as renders do: by small steps from zero."""


def stream(axis: str, count: int, **fixed: int) -> np.ndarray:
    """Return (4, count) uniform floats along one counter, the others fixed."""
    counters = {name: rng.counter(fixed.get(name, 7)) for name in AXES}
    counters[axis] = rng.counter(np.arange(count))
    return np.stack(rng.uniforms(**counters, dtype=np.float64))


@pytest.mark.parametrize("axis", AXES)
def test_neighbours_along_each_counter_are_independent(axis):
    """Pairs (u_n, u_n+1) fill 32 x 32 cells evenly; significance 0.01 for the four words together."""
    n, cells = 1 << 17, 32
    p = []
    for u in stream(axis, n):
        pairs = (u[0::2] * cells).astype(int) * cells + (u[1::2] * cells).astype(int)
        p.append(chi_square_p(np.bincount(pairs, minlength=cells**2), np.full(cells**2, n / 2 / cells**2)))
    assert_all_plausible(np.array(p))


def test_words_of_a_block_are_independent():
    """All six pairs of words in a block fill 32 x 32 cells evenly; significance 0.01 together."""
    n, cells = 1 << 16, 32
    words = (stream("pixel", n) * cells).astype(int)
    p = [
        chi_square_p(
            np.bincount(words[i] * cells + words[j], minlength=cells**2), np.full(cells**2, n / cells**2)
        )
        for i in range(4)
        for j in range(i)
    ]
    assert_all_plausible(np.array(p))


def test_streams_are_uncorrelated():
    """Correlation between streams that differ in one counter by 1 is that of independent numbers.

    For n independent pairs the correlation times sqrt(n) is standard normal; 4 counters x 4 words,
    significance 0.01.
    """
    n, p = 1 << 15, []
    for axis in AXES:
        along = "pixel" if axis != "pixel" else "sample"
        a, b = stream(along, n, **{axis: 3}), stream(along, n, **{axis: 4})
        p += [2 * stats.norm.sf(abs(np.corrcoef(u, v)[0, 1]) * np.sqrt(n)) for u, v in zip(a, b, strict=True)]
    assert_all_plausible(np.array(p))
