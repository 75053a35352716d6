"""Welch's test: are two noisy pictures estimates of one and the same?

1. Per pixel and channel two means, their variances and counts give a statistic t and degrees of freedom
   [`welch_p`]: Welch, "The Generalization of 'Student's' Problem when Several Different Population Variances
   are Involved", Biometrika 34, 1947.
2. Student's distribution says how likely one is as far out as that [`student_p`].
3. With m comparisons each is tested at Sidak's level, so that the chance of a false alarm over all of them
   is the stated significance [`sidak`].

The method for pictures: Jung, Hanika and Dachsbacher, "Detecting Bias in Monte Carlo Renderers using Welch's
t-test", JCGT 9(2), 2020.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


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
    from scipy.special import stdtr  # which the base install has not

    return np.asarray(2 * stdtr(freedom, -np.abs(t)))
