"""How a moving picture flickers: measures over time, beside those of its reference.

All take display-encoded pictures (T, H, W, 3) of T successive frames.

1. A pixel's variance over time is that of the motion and that of the flicker; what it has beyond the
   reference's is flicker, if the picture follows the motion [`excess_variance`].
2. A picture that blurs the motion varies less than its reference, which hides flicker from the first
   measure. The variance of the error does not have this flaw [`error_variance`].
3. What a viewer sees between two successive frames is FLIP of one against the other; motion itself gives
   the reference some [`flip_steps`], [`excess_flip`].

Where nothing moves, the reference has no variance and no FLIP, and all measures are those of the picture.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from wamnet.refimpl.errors import InputError
from wamnet.refimpl.frame import Floats

from .scores import flip

LEAST_FRAMES = 2
"""Fewer frames have no variance over time."""


def temporal_variance(pictures: Floats) -> float:
    """Return the mean over pixels and channels of the unbiased variance over time of (T, H, W, 3)."""
    _check(pictures)
    return float(np.mean(np.var(np.asarray(pictures, np.float64), axis=0, ddof=1)))


def excess_variance(pictures: Floats, references: Floats) -> float:
    """Return the variance over time beyond the references'; negative for pictures that follow no motion."""
    _check_shapes(pictures, references)
    return temporal_variance(pictures) - temporal_variance(references)


def error_variance(pictures: Floats, references: Floats) -> float:
    """Return the variance over time of the error."""
    _check_shapes(pictures, references)
    return temporal_variance(np.asarray(pictures, np.float64) - np.asarray(references, np.float64))


def flip_steps(pictures: Floats) -> NDArray[np.float64]:
    """Return the mean FLIP (T - 1,) of each frame against the one before it."""
    _check(pictures)
    return np.array([flip(after, before) for before, after in pairwise(pictures)])


def excess_flip(pictures: Floats, references: Floats) -> float:
    """Return the mean FLIP between successive frames beyond the references'."""
    _check_shapes(pictures, references)
    return float(np.mean(flip_steps(pictures) - flip_steps(references)))


def slice_over_time(pictures: Floats, row: int, repeat: int = 1) -> Floats:
    """Return a row of all frames, time downwards: (T * repeat, W, 3). What stands still is a column."""
    return np.repeat(np.asarray(pictures)[:, row], repeat, axis=0)


def _check(pictures: Floats) -> None:
    """Refuse what is not a sequence of pictures."""
    shape = np.shape(pictures)
    if len(shape) != 4 or shape[0] < LEAST_FRAMES:
        rule = f"(T, H, W, 3) with T of {LEAST_FRAMES} or more"
        raise InputError("shape of a sequence of pictures", shape, rule, "stack successive frames")


def _check_shapes(pictures: Floats, references: Floats) -> None:
    """Refuse sequences of different shapes."""
    if np.shape(pictures) != np.shape(references):
        rule = f"the references' is {np.shape(references)}"
        raise InputError("shape of the pictures", np.shape(pictures), rule, "compare the same frames")
