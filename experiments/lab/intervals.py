"""Intervals of means over test poses and seeds, by the bootstrap.

1. Values form a table of seeds by poses: every network is judged on the same poses, so rows and columns are
   two samples that cross [`interval`].
2. A resample draws seeds and poses with replacement, each independently of the other, and takes the mean of
   the table that they pick [`resampled_means`]: Owen, "The pigeonhole bootstrap", Annals of Applied
   Statistics 1(2), 2007. So the variance has the part of the poses in full; a bootstrap that draws other
   poses for each seed, though all seeds share them, makes it too small.
3. The interval lies between the percentiles of these means: Efron and Tibshirani, *An Introduction to the
   Bootstrap*, 1993, chapter 13.
4. Two methods are compared by their difference on the same poses [`paired`].

A sample of n has a bootstrap variance (n - 1) / n times the unbiased one: with three seeds the part of the
seeds is too narrow by a factor of 0.82, which a table with few seeds should say. Of three values in all the
ends are the least and the largest.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

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
    low, high = np.quantile(resampled_means(table, resamples), [0.5 - level / 2.0, 0.5 + level / 2.0])
    return Interval(float(table.mean()), float(low), float(high), *table.shape)


def resampled_means(table: NDArray[np.float64], resamples: int = RESAMPLES) -> NDArray[np.float64]:
    """Return the means (resamples,) of a table (seeds, poses) whose rows and columns are drawn again."""
    rows, columns = _parts(table.shape, resamples)
    means: NDArray[np.float64] = np.einsum("ri,ij,rj->r", rows, table, columns, optimize=True)
    return means


@cache
def _parts(shape: tuple[int, ...], resamples: int) -> list[NDArray[np.float64]]:
    """Return how large a part of each resample (resamples, n) each row and each column of a table is."""
    generator = np.random.default_rng(SEED)
    return [generator.multinomial(n, np.full(n, 1.0 / n), resamples) / n for n in shape]


def paired(first: ArrayLike, second: ArrayLike, level: float = LEVEL) -> Interval:
    """Return the interval of the mean of first - second, both (seeds, poses) of the same poses.

    Seeds are matched by their order; a method that has no seed is one row, taken from each row of the other.
    """
    one, other = _table(first), _table(second)
    if one.shape[1] != other.shape[1] or (one.shape[0] != other.shape[0] and 1 not in (len(one), len(other))):
        rule = "must have the same seeds and poses"
        raise InputError("values to compare", f"{one.shape} and {other.shape}", rule, "measure both again")
    return interval(one - other, level)


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
