"""The image of a box: the least and the largest value of an operation between the ends of its operands.

Each is the operation's definition [ops.py] on intervals of real numbers, in float64, whose own rounding its
readers widen: bounds.py, of what the reference computes, and ranges.py, of what executors may. Booleans are
ordered, false before true, which makes "and" and "or" Kleene's. Where nothing holds the values, (-inf, inf).

Interval arithmetic: Moore, "Interval Analysis", 1966, chapter 3; three-valued logic: Kleene, "Introduction to
Metamathematics", 1952, section 64.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

Ends = tuple[Any, Any]
"""The least and the largest value (...), (...)."""

Image = Callable[..., Ends]
"""From the ends of each operand to those of the result."""

RANGE_OUTWARD = 2.0**-40
"""Relative widening of every range: float64's rounding of one operation, or sin; of a sum: bounds.py."""

SURE_TURNS = 2.0**30
"""Largest argument, in radians, for which float64 finds a sine's crests: they are off by less than 2**-20."""


def hull(*values: Any) -> Ends:
    """Return the least and the largest of values (...); NaN where one is."""
    together = np.broadcast_arrays(*values)
    return np.minimum.reduce(together), np.maximum.reduce(together)


def monotone(function: Callable[..., Any]) -> Image:
    """Return the image of a function that falls nowhere, in none of its operands."""
    return lambda *operands: (function(*(o[0] for o in operands)), function(*(o[1] for o in operands)))


def subtract(a: Ends, b: Ends) -> Ends:
    """[a, b] - [c, d] = [a - d, b - c]."""
    return a[0] - b[1], a[1] - b[0]


def multiply(a: Ends, b: Ends) -> Ends:
    """The least and the largest product of ends; of one operand with itself: [`square`]."""
    return hull(a[0] * b[0], a[0] * b[1], a[1] * b[0], a[1] * b[1])


def square(a: Ends) -> Ends:
    """A square is not negative."""
    low, high = multiply(a, a)
    return np.where((a[0] <= 0) & (a[1] >= 0), 0.0, low), high


def divide(a: Ends, b: Ends) -> Ends:
    """The least and the largest quotient of ends, where 0 is not among the divisors."""
    with np.errstate(divide="ignore", invalid="ignore"):
        low, high = hull(a[0] / b[0], a[0] / b[1], a[1] / b[0], a[1] / b[1])
    safe = (b[0] > 0) | (b[1] < 0)
    return np.where(safe, low, -np.inf), np.where(safe, high, np.inf)


def reciprocal(a: Ends) -> Ends:
    """1 / a."""
    return divide((1.0, 1.0), a)


def negative(a: Ends) -> Ends:
    """The ends change places."""
    return -a[1], -a[0]


def absolute(a: Ends) -> Ends:
    """0 where the ends have unlike signs."""
    low, high = hull(np.abs(a[0]), np.abs(a[1]))
    return np.where((a[0] <= 0) & (a[1] >= 0), 0.0, low), high


def sqrt(a: Ends) -> Ends:
    """Of what is not negative."""
    return np.sqrt(np.maximum(a[0], 0.0)), np.sqrt(np.maximum(a[1], 0.0))


def power(x: Ends, y: Ends) -> Ends:
    """Monotone in both, for positive x."""
    with np.errstate(all="ignore"):
        return hull(x[0] ** y[0], x[0] ** y[1], x[1] ** y[0], x[1] ** y[1])


def exponential(a: Ends) -> Ends:
    """Monotone; infinite where float64 ends."""
    with np.errstate(over="ignore"):
        return np.exp(a[0]), np.exp(a[1])


def sine(a: Ends) -> Ends:
    """At the ends, or 1 and -1 at crests between."""
    sure = np.maximum(np.abs(a[0]), np.abs(a[1])) <= SURE_TURNS
    low, high = np.where(sure, a[0], -np.pi), np.where(sure, a[1], np.pi)
    turn = 2 * np.pi
    at_low, at_high = np.sin(low), np.sin(high)
    # A crest that rounding hides here is so near an end that the sine there is 1 up to RANGE_OUTWARD.
    crest = np.floor((high - np.pi / 2) / turn) >= np.ceil((low - np.pi / 2) / turn)
    trough = np.floor((high + np.pi / 2) / turn) >= np.ceil((low + np.pi / 2) / turn)
    least = np.where(trough, -1.0, np.minimum(at_low, at_high))
    most = np.where(crest, 1.0, np.maximum(at_low, at_high))
    return np.maximum(least - RANGE_OUTWARD, -1.0), np.minimum(most + RANGE_OUTWARD, 1.0)


def cosine(a: Ends) -> Ends:
    """cos(a) = sin(a + pi/2); float64 rounds a + pi/2, which moves the sine by less than the slack."""
    slack = 2.0**-51 * (np.maximum(np.abs(a[0]), np.abs(a[1])) + 2.0)
    return sine((a[0] + np.pi / 2 - slack, a[1] + np.pi / 2 + slack))


def less(a: Ends, b: Ends) -> Ends:
    """True where the ranges do not meet, false where they do not meet the other way round."""
    return a[1] < b[0], ~(a[0] >= b[1])


def equal(a: Ends, b: Ends) -> Ends:
    """True of one number on both sides, false where the ranges do not meet."""
    return (a[0] == a[1]) & (b[0] == b[1]) & (a[0] == b[0]), ~((a[1] < b[0]) | (a[0] > b[1]))


def greater(a: Ends, b: Ends) -> Ends:
    """a > b is b < a."""
    return less(b, a)


def opposite(image: Image) -> Image:
    """Return the image of what is true where a comparison is false."""
    return lambda a, b: logical_not(image(a, b))


def logical_not(a: Ends) -> Ends:
    """Kleene's."""
    return ~a[1], ~a[0]


def select(condition: Ends, a: Ends, b: Ends) -> Ends:
    """The branch that is chosen, or the hull of both."""
    first, maybe = condition
    least, most = np.minimum(a[0], b[0]), np.maximum(a[1], b[1])
    low = np.where(first, a[0], np.where(maybe, least, b[0]))
    return low, np.where(first, a[1], np.where(maybe, most, b[1]))
