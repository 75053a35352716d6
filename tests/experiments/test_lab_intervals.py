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


def test_coverage_is_that_of_student_s_statistic():
    """The ends are mean -+ z s sqrt((n - 1) / n) / sqrt(n): Student's t says how often the mean is inside."""
    n, trials = 30, 600
    samples = np.random.default_rng(3).normal(5.0, 2.0, (trials, n))
    found = [interval(sample, resamples=1000) for sample in samples]
    held = sum(one.low <= 5.0 <= one.high for one in found)
    # An end from 1000 draws is that of another level: three standard deviations of a binomial share.
    slack = 3.0 * math.sqrt(0.025 * 0.975 / 1000.0)
    z = stats.norm.isf(0.025)
    coverage = 1.0 - 2.0 * stats.t.sf(z * math.sqrt((n - 1) / n), n - 1)
    low = stats.binom.ppf(ALPHA / 2, trials, coverage - 2.0 * slack)
    high = stats.binom.ppf(1.0 - ALPHA / 2, trials, min(coverage + 2.0 * slack, 1.0))
    assert 0.93 <= coverage <= 0.95
    assert low <= held <= high


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
