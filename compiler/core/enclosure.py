"""What is known of a value: the range of the reference's, and the largest distance of the kernel's from it.

float64, in which all of it is computed, rounds too: errors are widened by more than that [`OUTWARD`], and
ranges too [`intervals.RANGE_OUTWARD`].
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from decimal import ROUND_CEILING, Decimal
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .profiles import FLUSH

Array = NDArray[np.float64]

OUTWARD = 2.0**-20
"""Relative widening of every error bound: covers float64's rounding in rules and reference (step 5)."""

OVERFLOW = float(np.finfo(np.float32).max) * (1 - OUTWARD)
"""What a number on the way must stay below: the largest float32, less float64's rounding in the rules."""


@dataclass(frozen=True)
class Enclosure:
    """The reference's value lies in [low, high] (..., n), the kernel's at most `error` (..., n) from it.

    `size` (..., n): no number that the operation rounds is larger; 0 for operations that round nothing.
    `own` (..., n): what of the error the operation adds itself; None where that is not known apart.
    """

    low: Array
    high: Array
    error: Array
    size: Any = 0.0
    own: Any = None

    @property
    def overflows(self) -> bool:
        """Return whether float32 may be too small for what the operation rounds from bounded operands."""
        return bool(np.any((self.size >= OVERFLOW) & np.isfinite(self.size)))

    @property
    def largest(self) -> Array:
        """Return the largest magnitude of the reference's value."""
        return np.maximum(np.abs(self.low), np.abs(self.high))

    @property
    def seen(self) -> Array:
        """Return the largest magnitude of the kernel's value."""
        return self.largest + self.error

    @property
    def read(self) -> Array:
        """Return the error of the kernel's value when it is read, and perhaps flushed to zero."""
        return self.error + FLUSH


def round_up(value: float, digits: int = 3) -> float:
    """Return the smallest number of so many significant decimal digits that is not below `value`."""
    if value == 0 or not math.isfinite(value):
        return value
    # Decimals hold every float64 exactly, and the float64 nearest to one above `value` is not below it.
    exact = Decimal(value)
    unit = Decimal(1).scaleb(exact.adjusted() - digits + 1)
    return float(exact.quantize(unit, ROUND_CEILING))
