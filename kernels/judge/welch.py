"""Welch's test, in NumPy only: are two noisy pictures estimates of one and the same?

1. Per pixel and channel two means, their variances and counts give a statistic t and degrees of freedom
   [`welch_p`]: Welch, "The Generalization of 'Student's' Problem when Several Different Population Variances
   are Involved", Biometrika 34, 1947.
2. Student's distribution says how likely one is as far out as that [`student_p`], through the regularised
   incomplete beta function [`incomplete_beta`]: DLMF (dlmf.nist.gov) 8.17.4 and the continued fraction
   8.17.22, evaluated by Lentz's method (Thompson and Barnett, "Coulomb and Bessel functions of complex
   arguments and order", Journal of Computational Physics 64, 1986).
3. With m comparisons each is tested at Sidak's level, so that the chance of a false alarm over all of them
   is the stated significance [`sidak`].

The method for pictures: Jung, Hanika and Dachsbacher, "Detecting Bias in Monte Carlo Renderers using Welch's
t-test", JCGT 9(2), 2020.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

FRACTION_STEPS = 4000
"""Most steps of the continued fraction: it needs about the root of the degrees of freedom, below 2**23."""

LEAST_TERM = 1e-300
"""Stands in for a zero in Lentz's method."""


def sidak(significance: float, comparisons: int) -> float:
    """Return the level of each of several comparisons that together have the given significance."""
    return float(-np.expm1(np.log1p(-significance) / comparisons))


def welch_p(mean_a: Any, variance_a: Any, count_a: int, mean_b: Any, variance_b: Any, count_b: int) -> Array:
    """Return p-values (...) for equal means (...); variances (...) are those of single samples.

    Without any variance equal means have p = 1 and others p = 0.
    """
    error_a, error_b = variance_a / count_a, variance_b / count_b
    error = np.asarray(error_a + error_b, np.float64)
    noisy = error > 0
    safe = np.where(noisy, error, 1.0)
    share = error_a / safe, error_b / safe
    spread = share[0] ** 2 / (count_a - 1) + share[1] ** 2 / (count_b - 1)
    freedom = 1.0 / np.where(noisy, spread, 1.0)
    difference = np.abs(np.asarray(mean_a, np.float64) - mean_b)
    p = student_p(difference / np.sqrt(safe), freedom)
    return np.where(noisy, p, np.where(difference == 0, 1.0, np.where(difference > 0, 0.0, np.nan)))


def student_p(t: Array, freedom: Array) -> Array:
    """Return the chance (...) that Student's t (...) with degrees of freedom (...) is as far from 0."""
    below, above = freedom / (freedom + t * t), t * t / (freedom + t * t)
    return incomplete_beta(freedom / 2, 0.5, below, above)


def incomplete_beta(a: Any, b: float, x: Any, rest: Any = None) -> Array:
    """Return the regularised incomplete beta function I_x(a, b) (...): a (...), b > 0, x (...) in [0, 1].

    `rest` is 1 - x, for callers that know it where x is rounded to 1.
    """
    a, x = np.broadcast_arrays(np.asarray(a, np.float64), np.asarray(x, np.float64))
    rest = 1 - x if rest is None else rest
    # The fraction converges quickly below the mean; above it, I_x(a, b) = 1 - I_1-x(b, a).
    below = x <= (a + 1) / (a + b + 2)
    first, second = np.where(below, a, b), np.where(below, b, a)
    at = np.where(below, x, rest)
    part = _front(first, second, at) / (first * _fraction(first, second, at))
    return np.where(below, part, 1 - part)


def _front(a: Array, b: Array, x: Array) -> Array:
    """Return x^a (1 - x)^b / B(a, b)."""
    log_gamma = np.vectorize(math.lgamma, otypes=[np.float64])
    with np.errstate(divide="ignore"):
        log_beta = log_gamma(a) + log_gamma(b) - log_gamma(a + b)
        return np.asarray(np.exp(a * np.log(x) + b * np.log1p(-x) - log_beta))


def _fraction(a: Array, b: Array, x: Array) -> Array:
    """Return 1 + d1 / (1 + d2 / (1 + ...)), the inverse of DLMF 8.17.22's fraction."""
    value = np.ones_like(x)
    c, d = np.ones_like(x), np.zeros_like(x)
    for step in range(1, FRACTION_STEPS):
        m = step // 2
        if step % 2 == 0:
            term = m * (b - m) * x / ((a + 2 * m - 1) * (a + 2 * m))
        else:
            term = -(a + m) * (a + b + m) * x / ((a + 2 * m) * (a + 2 * m + 1))
        d = 1 / _not_zero(1 + term * d)
        c = _not_zero(1 + term / c)
        value = value * c * d
        if np.all(np.abs(c * d - 1) <= np.finfo(np.float64).eps):
            break
    return value


def _not_zero(x: Array) -> Array:
    """Return x (...) with a tiny number instead of 0."""
    return np.where(x == 0, LEAST_TERM, x)
