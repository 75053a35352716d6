"""Directions over a hemisphere, more of them where the cosine is large.

A distribution is three functions that belong together: a sample from two uniform numbers, the density of a
sample, and the way back. Any map is right whose density is cos(theta) / pi; Malley's lifts the points of a
disk. Tutorial: page 3. Clause: SMP-2.
"""

from __future__ import annotations

from typing import Any


def sample_hemisphere(u0: Any, u1: Any) -> Any:
    """Map uniform numbers u0, u1 (...) in [0, 1) to unit directions (..., 3) around +z."""
    raise NotImplementedError("sample_hemisphere")


def hemisphere_pdf(direction: Any) -> Any:
    """Return the density (...), in 1/sr, of directions (..., 3): cos(theta) / pi, and 0 below the horizon."""
    raise NotImplementedError("hemisphere_pdf")


def invert_hemisphere_sample(direction: Any) -> tuple[Any, Any]:
    """Return the u0, u1 (...) that sample_hemisphere maps to directions (..., 3)."""
    raise NotImplementedError("invert_hemisphere_sample")
