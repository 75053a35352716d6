"""Stateless random numbers: a hash of (seed, pixel, sample, block), the same bits on every executor.

1. Four 32-bit counters name a block of random numbers: the run's seed, the pixel, the sample within the
   pixel and the block along the path [`random_block`].
2. PCG4D mixes them [`pcg4d`]: Jarzynski and Olano, "Hash Functions for GPU Rendering", Journal of Computer
   Graphics Techniques 9(3), 2020. It needs only 32-bit multiplication, addition, shift and exclusive or,
   which all shading languages have with the same result, and it has no state, so lanes, tiles and processes
   may work in any order.
3. The upper 24 bits of a word become a float in [0, 1) [`uniform_floats`]: every float32 of the form n /
   2**24 is exact, so float32 and float64 see the same number.

No function in this project owns a generator: random numbers are arguments.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

Uint32 = NDArray[np.uint32]
Block = tuple[Any, Any, Any, Any]

LCG_MULTIPLIER = np.uint32(1664525)
"""Multiplier of the linear congruential step (Numerical Recipes' constants, as PCG4D uses them)."""

LCG_INCREMENT = np.uint32(1013904223)
"""Increment of the linear congruential step; with [`LCG_MULTIPLIER`] the step has the full period 2**32."""

MANTISSA_BITS = 24
"""Random bits in a uniform float: the width of float32's significand, so that conversion is exact."""

_SHIFT = np.uint32(16)
"""Right shift of PCG4D's exclusive or: it brings the well mixed upper half into the lower half."""


def pcg4d(v0: Any, v1: Any, v2: Any, v3: Any) -> Block:
    """Mix four uint32 counters (...) into four uint32 random words (...); arithmetic is modulo 2**32."""
    # Scramble each counter by itself.
    v0 = v0 * LCG_MULTIPLIER + LCG_INCREMENT
    v1 = v1 * LCG_MULTIPLIER + LCG_INCREMENT
    v2 = v2 * LCG_MULTIPLIER + LCG_INCREMENT
    v3 = v3 * LCG_MULTIPLIER + LCG_INCREMENT
    # Let each word depend on the others, bring high bits down, and do it once more.
    v0, v1, v2, v3 = _entangle(v0, v1, v2, v3)
    v0 = v0 ^ (v0 >> _SHIFT)
    v1 = v1 ^ (v1 >> _SHIFT)
    v2 = v2 ^ (v2 >> _SHIFT)
    v3 = v3 ^ (v3 >> _SHIFT)
    return _entangle(v0, v1, v2, v3)


def _entangle(v0: Any, v1: Any, v2: Any, v3: Any) -> Block:
    """Add to each word the product of two others; the order matters, each line sees the lines before it."""
    v0 = v0 + v1 * v3
    v1 = v1 + v2 * v0
    v2 = v2 + v0 * v1
    v3 = v3 + v1 * v2
    return v0, v1, v2, v3


def random_block(seed: Any, pixel: Any, sample: Any, block: Any) -> Block:
    """Return the four random words named by the four uint32 counters (which broadcast)."""
    return pcg4d(pixel, sample, block, seed)


def uniform_floats(bits: Any, dtype: DTypeLike = np.float32) -> Any:
    """Turn uint32 words (...) into floats n / 2**24 in [0, 1), exact in float32 and float64."""
    return (bits >> np.uint32(32 - MANTISSA_BITS)).astype(dtype) * 2.0**-MANTISSA_BITS


def uniforms(seed: Any, pixel: Any, sample: Any, block: Any, dtype: DTypeLike = np.float32) -> Block:
    """Return the block's four uniform floats in [0, 1)."""
    w0, w1, w2, w3 = random_block(seed, pixel, sample, block)
    return (
        uniform_floats(w0, dtype),
        uniform_floats(w1, dtype),
        uniform_floats(w2, dtype),
        uniform_floats(w3, dtype),
    )


def counter(values: Any) -> Uint32:
    """Return integers as uint32 counters, modulo 2**32, in an array: NumPy warns of overflow in scalars."""
    return np.atleast_1d(np.asarray(np.asarray(values, dtype=np.int64) & 0xFFFFFFFF, dtype=np.uint32))
