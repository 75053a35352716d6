"""Random numbers without a state, and directions over a hemisphere, more of them where the cosine is large.

PCG4D mixes four counters into four words. First each v becomes v * 1664525 + 1013904223. Then, line after
line, each with what the lines before have changed:

    v0 += v1 * v3,  v1 += v2 * v0,  v2 += v0 * v1,  v3 += v1 * v2.

Then each v becomes v ^ (v >> 16), and the four lines come once more. All of it is modulo 2^32.

A distribution is three functions that belong together: a sample from two uniform numbers, the density of a
sample, and the way back. Any map is right whose density is cos(theta) / pi; Malley's lifts the points of a
disk, for which SMP-1 is one map and polar coordinates are another. Arguments are not changed. Tutorial: page
3. Clauses: RNG-1, RNG-2, RNG-5, SMP-2.
"""

from __future__ import annotations

from typing import Any


def mix(v0: Any, v1: Any, v2: Any, v3: Any) -> tuple[Any, Any, Any, Any]:
    """Mix four counters (...), uint32, into four random words (...), uint32."""
    raise NotImplementedError("mix")


def uniform(words: Any) -> Any:
    """Return the upper 24 bits of words (...), uint32, as float64 n / 2^24 in [0, 1)."""
    raise NotImplementedError("uniform")


def sample_hemisphere(u0: Any, u1: Any) -> Any:
    """Map uniform numbers u0, u1 (...) in [0, 1) to unit directions (..., 3) around +z."""
    raise NotImplementedError("sample_hemisphere")


def hemisphere_pdf(direction: Any) -> Any:
    """Return the density (...), in 1/sr, of directions (..., 3): cos(theta) / pi, and 0 below the horizon."""
    raise NotImplementedError("hemisphere_pdf")


def invert_hemisphere_sample(direction: Any) -> tuple[Any, Any]:
    """Return the u0, u1 (...) that sample_hemisphere maps to directions (..., 3)."""
    raise NotImplementedError("invert_hemisphere_sample")
