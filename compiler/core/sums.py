"""Sums of products: in which order kernels add them up, and what rounding makes of it.

1. A sum over a window is made of partial sums, one for each image and row of its taps [`parts`]: of the
   products of that row in any order. The partial sums and the bias are added up in any order. Any other sum,
   and one over a window of one row of one image, is one part, which holds the bias: any order of all terms.
2. A sum of B terms has B - 1 additions, in a tree of any shape. The k-th smallest of the numbers of terms
   below its additions is at most k + 1: what has m terms below it holds m - 1 additions, all of at most m
   terms. So with the terms' magnitudes sorted, t_1 >= t_2 >= ..., and M not below any sum of some of the
   terms, the exact values of all additions have magnitudes that add up to at most [`_additions`]

       sum over k = 2 .. B of min(t_1 + ... + t_k, M).

3. Each addition is wrong by u times what it adds exactly, which is its exact value and the errors below:
   less than B gamma(B) (t_1 + ... + t_B) for all of them together. Each product is wrong by u times itself,
   or not at all where it is fused [`rounding`].
4. M is the sum of the positive terms, or of the negative ones, whichever is larger, at their largest. The
   terms of the sum of partial sums are what these may be.

Step 2 halves the usual B u (t_1 + ... + t_B) where terms are alike; partial sums of 36 terms in place of one
sum of 1,728 make it smaller by twenty times, and cost a hundredth of the time.
n rounded operations: gamma(n) = n u / (1 - n u), Higham, "Accuracy and Stability of Numerical Algorithms",
2002, section 3.1; errors of sums in any order by the values of their additions: section 4.2.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .ir import Gather
from .profiles import UNIT_ROUNDOFF

Array = NDArray[np.float64]

MOST_SORTED = 2**8
"""Most terms of each of many pixels that are sorted: beyond, each addition counts as large as M."""


def gamma(n: int) -> float:
    """Return the largest relative error of n rounded operations."""
    return n * UNIT_ROUNDOFF / (1.0 - n * UNIT_ROUNDOFF)


def is_split(gather: Gather) -> bool:
    """Return whether sums over the window are made of several partial sums."""
    return gather.rows * len(gather.groups) > 1


def parts(gather: Gather | None, n: int) -> list[NDArray[np.intp]]:
    """Return the indices of the terms of each partial sum: of n products over a window, or any others."""
    if gather is None:
        return [np.arange(n)]
    rows = np.arange(n).reshape(gather.rows, gather.columns, gather.channels)
    starts = [group[0][1] for group in gather.groups][1:]
    return [part.ravel() for image in np.split(rows, starts, axis=2) for part in image]


def rounding(weight: Array, bias: Array, low: Array, high: Array, blocks: Sequence[Any]) -> Array:
    """Return the error (..., m) of W x + b, for what kernels hold as x (..., n), in [low, high]."""
    if len(blocks) == 1:
        return _part(weight, low, high, bias)[0]
    found = [_part(weight[:, block], low[..., block], high[..., block]) for block in blocks]
    own, least, most = (np.stack(part, axis=-1) for part in zip(*found, strict=True))
    bias = np.broadcast_to(bias, own.shape[:-1])[..., None]
    least, most = np.concatenate([least, bias], axis=-1), np.concatenate([most, bias], axis=-1)
    positive, negative = np.maximum(most, 0.0).sum(axis=-1), np.maximum(-least, 0.0).sum(axis=-1)
    above, errors = np.maximum(np.abs(least), np.abs(most)), own.sum(axis=-1)
    count = len(blocks) + 1
    large = _additions(count, np.maximum(positive, negative), lambda: above)
    # The partial sums that are added are off by `errors` together, in each of the additions.
    more = gamma(count) * (above.sum(axis=-1) + errors) + errors
    found_error: Array = errors + UNIT_ROUNDOFF * (large + count * more)
    return found_error


def _part(weight: Array, low: Array, high: Array, bias: Array | None = None) -> tuple[Array, Array, Array]:
    """Return the error (..., m) of one partial sum, and the least and the largest value that it may have."""
    above, below = np.maximum(high, 0.0), np.maximum(-low, 0.0)
    up, down = np.maximum(weight, 0.0).T, np.maximum(-weight, 0.0).T
    positive, negative = above @ up + below @ down, above @ down + below @ up
    products = np.maximum(above, below) @ (up + down)
    count, total = weight.shape[1], products
    if bias is not None:
        count, total = count + 1, products + np.abs(bias)
        positive, negative = positive + np.maximum(bias, 0.0), negative + np.maximum(-bias, 0.0)

    def terms() -> Array:
        """Return the magnitudes (..., m, count) of all terms."""
        found = np.abs(weight) * np.maximum(above, below)[..., None, :]
        more = [] if bias is None else [np.broadcast_to(np.abs(bias)[:, None], (*found.shape[:-1], 1))]
        return np.concatenate([found, *more], axis=-1)

    large = _additions(count, np.maximum(positive, negative), terms)
    error = UNIT_ROUNDOFF * (large + products + count * gamma(count) * total)
    # float64 rounds both ends; they matter where terms of both signs all but cancel.
    slack = 2.0**-40 * total
    return error, low @ up - high @ down - slack, high @ up - low @ down + slack


def _additions(count: int, cap: Array, terms: Callable[[], Array]) -> Array:
    """Return how large all additions of `count` terms (..., count) are together; none is above cap (...)."""
    if cap.ndim > 1 and cap.shape[-1] * count > MOST_SORTED:
        return (count - 1) * cap
    largest = np.cumsum(-np.sort(-terms(), axis=-1), axis=-1)[..., 1:]
    found: Array = np.minimum(largest, cap[..., None]).sum(axis=-1)
    return found
