"""Intervals of means over test poses and seeds, by the bootstrap.

1. Values form a table of seeds by poses: every network is judged on the same poses, so rows and columns are
   two samples that cross [`interval`].
2. A resample draws seeds and poses with replacement, each independently of the other, and takes the mean of
   the table that they pick [`resampled_means`]: Owen, "The pigeonhole bootstrap", Annals of Applied
   Statistics 1(2), 2007. So the variance has the part of the poses in full; a bootstrap that draws other
   poses for each seed, though all seeds share them, makes it too small.
3. The interval lies between the percentiles of these means: Efron and Tibshirani, *An Introduction to the
   Bootstrap*, 1993, chapter 13.
4. Two methods are compared by their difference on the same poses [`paired`], by the ratio of their means
   [`ratio`], or, where each has poses of its own, by the difference of their means [`apart`].

A sample of n has a bootstrap variance (n - 1) / n times the unbiased one: with three seeds the part of the
seeds is too narrow by a factor of 0.82, which a table with few seeds should say. Of three values in all the
ends are the least and the largest.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wamnet.refimpl.errors import InputError

LEVEL = 0.95
"""How often an interval is to hold the mean of all poses and seeds that there could be."""

RESAMPLES = 10_000
"""Resamples of the bootstrap: an end's own noise is then about a fortieth of the interval's half width."""

SEED = 20_231
"""The seed of the resampling: the same values have the same interval."""


@dataclass(frozen=True)
class Interval:
    """A mean, the ends of its interval, and of how many seeds and poses it is."""

    mean: float
    low: float
    high: float
    seeds: int
    poses: int

    def scaled(self, factor: float) -> Interval:
        """Return the interval in another unit, `factor` of which are one of this."""
        return replace(self, mean=self.mean * factor, low=self.low * factor, high=self.high * factor)

    def text(self, digits: int = 2) -> str:
        """Return `mean [low, high]` with so many digits after the point; one value has no interval."""
        if self.seeds * self.poses == 1:
            return f"{self.mean:.{digits}f}"
        return f"{self.mean:.{digits}f} [{self.low:.{digits}f}, {self.high:.{digits}f}]"


def interval(values: ArrayLike, level: float = LEVEL, resamples: int = RESAMPLES) -> Interval:
    """Return the mean of values (seeds, poses) and its percentile bootstrap interval of this level.

    A list (poses,) is of one seed. For the difference of two methods pass the differences, pose by pose:
    what both share then cancels. Refuses rows of different lengths, no values, and what is not finite.
    """
    table = _table(values)
    if not 0.0 < level < 1.0:
        raise InputError("level", level, "must lie between 0 and 1", "0.95 is usual")
    return _between(resampled_means(table, resamples), float(table.mean()), table.shape, level)


def resampled_means(table: NDArray[np.float64], resamples: int = RESAMPLES) -> NDArray[np.float64]:
    """Return the means (resamples,) of a table (seeds, poses) whose rows and columns are drawn again.

    Tables of one shape have the same rows and columns drawn.
    """
    generator = np.random.default_rng(SEED)
    rows, columns = (_weights(generator, n, resamples) for n in table.shape)
    means: NDArray[np.float64] = np.einsum("ri,ij,rj->r", rows, table, columns, optimize=True)
    return means


def _weights(generator: np.random.Generator, count: int, resamples: int) -> NDArray[np.float64]:
    """Return how large a part of each resample each of so many values is, (resamples, count)."""
    drawn: NDArray[np.float64] = generator.multinomial(count, np.full(count, 1.0 / count), resamples) / count
    return drawn


def paired(first: ArrayLike, second: ArrayLike, level: float = LEVEL) -> Interval:
    """Return the interval of the mean of first - second, both (seeds, poses) of the same poses.

    Seeds are matched by their order; a method that has no seed is one row, taken from each row of the other.
    """
    one, other = _table(first), _table(second)
    if one.shape[1] != other.shape[1] or (one.shape[0] != other.shape[0] and 1 not in (len(one), len(other))):
        raise _unlike(one, other, "must have the same seeds and poses")
    return interval(one - other, level)


def ratio(first: ArrayLike, second: ArrayLike, level: float = LEVEL) -> Interval:
    """Return the interval of mean(first) / mean(second), positive and both (seeds, poses) of the same poses.

    A resample draws the same seeds and poses for both.
    """
    one, other = _table(first), _table(second)
    if one.shape != other.shape:
        raise _unlike(one, other, "must have the same seeds and poses")
    if not (np.all(one > 0.0) and np.all(other > 0.0)):
        low = float(min(one.min(), other.min()))
        raise InputError("values of a ratio", low, "must be positive", "compare by a difference")
    ratios = resampled_means(one) / resampled_means(other)
    return _between(ratios, float(one.mean() / other.mean()), one.shape, level)


def apart(first: ArrayLike, second: ArrayLike, level: float = LEVEL) -> Interval:
    """Return the interval of mean(first) - mean(second), of the same seeds, each with poses of its own.

    A resample draws the same seeds for both, and poses of each. `poses` is the smaller number.
    """
    one, other = _table(first), _table(second)
    if len(one) != len(other):
        raise _unlike(one, other, "must have the same seeds")
    generator = np.random.default_rng(SEED)
    rows = _weights(generator, len(one), RESAMPLES)
    means = [
        np.einsum("ri,ij,rj->r", rows, t, _weights(generator, t.shape[1], RESAMPLES), optimize=True)
        for t in (one, other)
    ]
    shape = len(one), min(one.shape[1], other.shape[1])
    return _between(means[0] - means[1], float(one.mean() - other.mean()), shape, level)


def _between(found: NDArray[np.float64], mean: float, shape: tuple[int, ...], level: float) -> Interval:
    """Return the interval between the percentiles of resampled numbers."""
    low, high = np.quantile(found, [0.5 - level / 2.0, 0.5 + level / 2.0])
    return Interval(mean, float(low), float(high), *shape)


def _unlike(one: NDArray[np.float64], other: NDArray[np.float64], rule: str) -> InputError:
    """Return the refusal of values whose shapes do not fit."""
    return InputError("values to compare", f"{one.shape} and {other.shape}", rule, "measure both again")


def _table(values: ArrayLike) -> NDArray[np.float64]:
    """Return values as (seeds, poses), or refuse them."""
    try:
        table = np.atleast_2d(np.asarray(values, np.float64))
    except ValueError:
        table = np.zeros((0, 0))
    if table.ndim != 2 or table.size == 0 or not np.all(np.isfinite(table)):
        rule = "must be finite numbers, seeds by poses, as many poses for each seed"
        raise InputError("values of an interval", repr(values)[:60], rule, "measure what is missing")
    return table
