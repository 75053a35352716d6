"""A picture is a mean of random numbers, and says itself how far it is from the truth.

A pixel's colour is the mean of n samples. The variance of one sample is estimated from the same samples,
divided by n - 1. Welford's recurrence needs no second pass and loses no digits: with S the sum of the n
samples before, the next one, x, adds (n x - S)^2 / (n (n + 1)) to a sum of squares, from n = 1 on. The mean
of n samples has the variance of one divided by n; the root of that is its standard error. Tutorial: page 2.
Clauses: RND-1, RND-4, RND-5, MET-3.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any


def add_sample(n: int, total: Any, squares: Any, x: Any) -> tuple[int, Any, Any]:
    """Return n, sum and sum of squares (...) with one more sample x (...); n samples are in them before."""
    raise NotImplementedError("add_sample")


def variance(n: int, squares: Any) -> Any:
    """Return the variance of one sample (...), from the squares (...) of n samples; zeros for n = 1."""
    raise NotImplementedError("variance")


def picture(radiance: Callable[[Any, Any, int], Any], width: int, height: int, spp: int) -> tuple[Any, Any]:
    """Return the mean (H, W, C) and the variance of one sample (H, W, C) of a picture.

    radiance(x, y, n) gives the colours (P, C) of sample n of the pixels x, y (P,): columns and rows. It is
    called once for each sample n = 0, 1, ..., with all pixels, row by row.
    """
    raise NotImplementedError("picture")


def samples_needed(variance: Any, error: float) -> Any:
    """Return the least numbers of samples (...), at least 1, whose mean has a standard error <= error."""
    raise NotImplementedError("samples_needed")


def mse(image: Any, reference: Any) -> float:
    """Return the mean of (image - reference)^2 over all pixels and channels, computed in float64."""
    raise NotImplementedError("mse")
