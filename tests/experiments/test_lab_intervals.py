"""Bootstrap intervals: against exact distributions of resampled means, and against a known coverage."""

import math
from collections import Counter

import numpy as np
import pytest
from lab.intervals import RESAMPLES, interval, paired
from statistical import stats

from wamnet.refimpl.errors import InputError

ALPHA = 1e-6
"""Significance of each statistical test here."""

EPS = float(np.finfo(np.float64).eps)
"""One rounding of numbers near one."""

DKW = math.sqrt(math.log(2.0 / ALPHA) / (2.0 * RESAMPLES))
"""How far the distribution of so many draws may be from the true one (inequality of Dvoretzky, Kiefer and
Wolfowitz with the constant of Massart)."""


def assert_is_quantile(at: float, level: float, distribution: dict[float, float]) -> None:
    """Check that a value is the quantile of a discrete distribution, within the bound of so many draws."""
    below = sum(p for value, p in distribution.items() if value < at - 1e-9)
    up_to = sum(p for value, p in distribution.items() if value <= at + 1e-9)
    assert below - DKW <= level <= up_to + DKW


def binomial_means(zeros: int, ones: int) -> dict[float, float]:
    """Return the exact distribution of the mean of a resample of zeros and ones."""
    n = zeros + ones
    return {k / n: float(stats.binom.pmf(k, n, ones / n)) for k in range(n + 1)}


def test_seeds_and_poses_are_drawn_independently():
    seeds, poses = np.array([0.0, 0.0, 1.0]), np.array([0.0] * 5 + [10.0] * 3)
    found = interval(seeds[:, None] + poses)
    exact: Counter[float] = Counter()
    for a, p in binomial_means(2, 1).items():
        for b, q in binomial_means(5, 3).items():
            exact[round(a + 10.0 * b, 9)] += p * q
    assert_is_quantile(found.low, 0.025, exact)
    assert_is_quantile(found.high, 0.975, exact)


def test_what_methods_share_cancels_in_their_difference():
    poses = np.random.default_rng(5).normal(30.0, 3.0, 8)
    mine, other = np.array([[1.0], [1.2], [0.8]]) + poses, poses[None]
    found = paired(mine, other)
    assert (found.seeds, found.poses) == (3, 8)
    # Values near 30 and their differences are rounded.
    assert 0.8 - 100 * EPS <= found.low <= found.mean <= found.high <= 1.2 + 100 * EPS
    assert interval(mine).low - poses.mean() < found.low


@pytest.mark.parametrize("values", [[], [[]], [[1.0], [1.0, 2.0]], [math.nan], [[[1.0]]]])
def test_what_has_no_interval_is_refused(values):
    with pytest.raises(InputError, match="must be finite numbers, seeds by poses"):
        interval(values)
