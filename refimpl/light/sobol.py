"""Sobol points with Owen's scrambling, as a second source of a path's random numbers.

1. [`sobol`] is the sequence itself, in four dimensions: the exclusive or of direction numbers where the index
   has bits. Sobol, 1967; direction numbers of Joe and Kuo, "Constructing Sobol Sequences with Better
   Two-Dimensional Projections", SIAM Journal on Scientific Computing 30(5), 2008 [`DIRECTIONS`].
2. [`scramble`] permutes [0, 1) so that halves, quarters, ... keep together (Owen, "Randomly Permuted
   (t,m,s)-Nets and (t,s)-Sequences", 1995), by a hash that carries bits only upwards: Laine and Karras,
   "Stratified Sampling for Stochastic Transparency", 2011, on reversed bits.
3. [`uniforms`] takes the place of rng.py's function of the same arguments: each block of each pixel has its
   own scrambling, and its own order of the same points, so that blocks are independent of each other.
   Burley, "Practical Hash-based Owen Scrambling", JCGT 9(4), 2020.
4. [`net_uniforms`] is a cheaper source for what is spread over two numbers only, camera rays: the points of
   the first two dimensions [`net`], scrambled, and moved by an exclusive or so that point 0 is rng.py's
   sample 0: both sources begin with the same ray. Halves, quarters, ... keep together under a move as well.

Within a block, any 2^m samples numbered from a multiple of 2^m on are evenly spread; integrals of smooth
functions then err less. Samples of a pixel are not independent, so a variance taken from them is too large.
All arithmetic is on 32-bit integers, the same to the bit everywhere.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import DTypeLike

from .. import rng

JOE_KUO: Sequence[tuple[int, int, tuple[int, ...]]] = ((1, 0, (1,)), (2, 1, (1, 3)), (3, 1, (1, 3, 1)))
"""Degree, coefficients and initial numbers of the second to fourth dimension; from the authors' published
table, new-joe-kuo-6.21201."""

BITS = 32
"""Bits of an index and of a point's coordinate."""

ORDER_KEY, SCRAMBLE_KEY = 0xFFFFFFFF, 0xFFFFFFFE
"""What replaces the sample when rng.py's hash makes the keys of a block: of its order, of its scramblings."""

MULTIPLIERS = (0x6C50B47C, 0xB82F1E52, 0xC7AFE638, 0x8D22F6E6)
"""Multipliers of Laine and Karras. They are even, so that a bit changes only with lower bits."""

SWAPS = ((8, 0x00FF00FF), (4, 0x0F0F0F0F), (2, 0x33333333), (1, 0x55555555))
"""Distance and mask of the swaps that reverse the bits of a word, after its halves."""


def _directions(degree: int, coefficients: int, initial: tuple[int, ...]) -> tuple[int, ...]:
    """Return the direction numbers of one dimension, for the bits of the index from the lowest on."""
    m = list(initial)
    for k in range(degree, BITS):
        new = m[k - degree] ^ (m[k - degree] << degree)
        for j in range(1, degree):
            if coefficients >> (degree - 1 - j) & 1:
                new ^= m[k - j] << j
        m.append(new)
    return tuple(number << (BITS - 1 - k) for k, number in enumerate(m))


DIRECTIONS = (
    tuple(1 << (BITS - 1 - k) for k in range(BITS)),
    *(_directions(*row) for row in JOE_KUO),
)
"""Direction numbers of the four dimensions; the first is van der Corput's: the index with its bits
reversed."""


HALVES = ((16, 0x0000FFFF), *SWAPS)
"""Distance and mask of the halves of a polynomial over GF(2), of those halves, and so on [`net`]."""


def reverse_bits(x: Any) -> Any:
    """Return uint32 words (...) with their bits in the opposite order."""
    x = (x >> np.uint32(16)) + x * np.uint32(1 << 16)
    for distance, mask in SWAPS:
        low = x & np.uint32(mask)
        high = (x >> np.uint32(distance)) & np.uint32(mask)
        x = high + low * np.uint32(1 << distance)
    return x


def sobol(index: Any, dimension: int) -> Any:
    """Return one coordinate (...), as a fraction of 2^32, of the points with the uint32 indices (...)."""
    point = np.zeros_like(index)
    for k, direction in enumerate(DIRECTIONS[dimension]):
        point = point ^ (((index >> np.uint32(k)) & np.uint32(1)) * np.uint32(direction))
    return point


def scramble(x: Any, key: Any) -> Any:
    """Return fractions of 2^32 x (...) under the nested permutation that key (...) names."""
    return reverse_bits(_carried_up(reverse_bits(x) + key))


def _carried_up(x: Any) -> Any:
    """Return words (...) of which each bit is changed by the bits below it."""
    for multiplier in MULTIPLIERS:
        x = x ^ (x * np.uint32(multiplier))
    return x


def uniforms(seed: Any, pixel: Any, sample: Any, block: Any, dtype: DTypeLike = np.float32) -> rng.Block:
    """Return four uniform floats in [0, 1): the point of a block that the uint32 counters (...) name."""
    order, _, _, _ = rng.random_block(seed, pixel, np.full_like(pixel, ORDER_KEY), block)
    keys = rng.random_block(seed, pixel, np.full_like(pixel, SCRAMBLE_KEY), block)
    index = scramble(sample, order)
    point = (scramble(sobol(index, dimension), key) for dimension, key in enumerate(keys))
    u0, u1, u2, u3 = (rng.uniform_floats(word, dtype) for word in point)
    return u0, u1, u2, u3


def net_uniforms(seed: Any, pixel: Any, sample: Any, block: Any, dtype: DTypeLike = np.float32) -> rng.Block:
    """Return four uniform floats in [0, 1), the first two of them a pixel's scrambled point.

    With the words w0 to w3 that rng.py has for sample 0, its point n is scrambled with the keys w2 and w3,
    and moved by an exclusive or so that point 0 becomes (w0, w1). The last two floats, which no camera
    asks for, are those of sample 0. Blocks of a pixel have one order: a path must not take its numbers here.
    """
    w0, w1, w2, w3 = rng.random_block(seed, pixel, np.zeros_like(pixel), block)
    moved = (
        word ^ reverse_bits(_carried_up(point + key) ^ _carried_up(key))
        for word, point, key in zip((w0, w1), net(sample), (w2, w3), strict=True)
    )
    u0, u1, u2, u3 = (rng.uniform_floats(word, dtype) for word in (*moved, w2, w3))
    return u0, u1, u2, u3


def net(index: Any) -> tuple[Any, Any]:
    """Return the first two coordinates (...) of the points with uint32 indices (...), their bits reversed.

    They are those of [`sobol`] in fewer steps. The direction numbers of dimension 1 are the powers of 1 + x
    over GF(2), so its coordinate is the index as a polynomial at 1 + x; a polynomial low + x^s high there is
    low + high + x^s high of the same halves there, as (1 + x)^s = 1 + x^s for s = 2^j.
    """
    at_next = index
    for distance, mask in HALVES:
        at_next = at_next ^ ((at_next >> np.uint32(distance)) & np.uint32(mask))
    return index, at_next
