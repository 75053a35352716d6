"""The emitted sines' coefficients, made and proven: `python experiments/sine_coefficients.py`.

1. Remez' exchange finds the odd polynomial c1 r + c3 r^3 + ... that is closest to sin on [0, R_MAX] in the
   maximum norm, the first coefficients being held [`remez`]. From degree 7 on c1 is 1, so that the sine of a
   small number is that number; below, only the absolute error counts, and c1 is free [`held`].
2. A search makes the coefficients float32, one after the other, and fits the rest again after each. What the
   rest could still reach with real coefficients is a lower bound for all that follow: a branch that cannot
   beat the best one found is cut off [`search`]. Where the search ends by itself, no float32 coefficients
   are better on the grid; it does up to degree 11. At degree 13, far below one rounding, it is stopped.
3. The error of the rounded polynomial is bounded in exact rational arithmetic [`proven_error`]: sin is
   replaced by its Taylor polynomial (remainder below r^27 / 27!), and in each cell of a grid the difference
   is at most what it is in the middle, and its slope there times half a cell, and its largest curvature times
   half the square of that.
4. pi is cut into three constants of 12 bits, so that their products with an integer of 12 bits are exact
   [`pi_parts`] (Cody and Waite, "Software Manual for the Elementary Functions", 1980, chapter 8).
5. The whole error, by the steps of compiler/core/sine.py, is added up over small intervals of r
   [`whole_error`].

Remez' exchange: Cheney, "Introduction to Approximation Theory", 1966, chapter 3. A search over float32
coefficients: Brisebarre, Muller and Tisserand, "Computing machine-efficient polynomial approximations", 2006;
theirs walks the points of a polytope, this one a tree.

The printed tables are what compiler/core/sine.py holds; tests/compiler/test_sine.py compares the two.
"""

from __future__ import annotations

import json
from fractions import Fraction
from math import ceil, factorial
from typing import Any

import mpmath as mp
import numpy as np

from wamnet.compiler.core import sine
from wamnet.compiler.core.ir import Type
from wamnet.compiler.core.profiles import SineContract
from wamnet.compiler.core.trace import trace
from wamnet.compiler.proof import bounds

R_MAX = 1.5735
"""Largest reduced argument, in radians: pi / 2 and the error of choosing k (compiler/core/sine.py)."""

PART_BITS = 12
"""Significant bits of each part of pi: 12 + 12 bits of k fill float32's significand exactly."""

DEGREES = (3, 5, 7, 9, 11, 13)
"""All degrees."""

FIRST_HELD = 7
"""Least degree whose first coefficient is 1."""

POINTS = 1000
"""Points of the grid on which the exchange and the search compare."""

EXCHANGES = 40
"""Most exchanges; a grid of 1,000 points is settled after about five."""

MOST_FITS = 2000
"""Fits after which the search stops: a few seconds."""

CELLS = 2048
"""Cells of the proof's grid."""

INTERVALS = 4000
"""Intervals of r over which the whole error is added up."""

TAYLOR_TERMS = 13
"""Terms of sin's Taylor polynomial in the proof: up to r^25."""

GRID = R_MAX * np.arange(1, POINTS + 1) / POINTS
"""The points (POINTS,); every odd polynomial is right at 0."""

with mp.workprec(120):
    SIN = np.array([float(mp.sin(mp.mpf(float(r)))) for r in GRID])
    """Sines of the points (POINTS,), rounded to float64 from 120 bits."""


def held(degree: int) -> list[float]:
    """Return the coefficients that are not fitted."""
    return [1.0] if degree >= FIRST_HELD else []


def remez(fixed: list[float], degree: int) -> tuple[list[float], float]:
    """Return the best coefficients after the `fixed` ones up to r^degree, and the error that they level."""
    target = SIN - sum((c * GRID ** (2 * j + 1) for j, c in enumerate(fixed)), np.zeros(POINTS))
    powers = [2 * j + 1 for j in range(len(fixed), (degree + 1) // 2)]
    if not powers:
        return [], float(np.max(np.abs(target)))
    count = len(powers) + 1
    basis = np.stack([GRID**power for power in powers], axis=1)
    signs = (-1.0) ** np.arange(count)[:, None]
    peaks = [round(POINTS * np.sin(np.pi * (i + 1) / (2 * count))) - 1 for i in range(count)]
    for _ in range(EXCHANGES):
        *found, level = np.linalg.solve(np.concatenate([basis[peaks], signs], axis=1), target[peaks])
        error = target - sum(c * column for c, column in zip(found, basis.T, strict=True))
        moved = _alternation(error, count)
        if len(moved) < count or moved == peaks:
            break
        peaks = moved
    return [float(c) for c in found], float(abs(level))


def _alternation(error: Any, count: int) -> list[int]:
    """Return where `error` (POINTS,) has its extrema, alternating in sign, the `count` largest of them."""
    negative = error < 0
    starts = [0, *(np.flatnonzero(negative[1:] != negative[:-1]) + 1)]
    size = np.abs(error)
    found = [
        int(start + np.argmax(size[start:end]))
        for start, end in zip(starts, [*starts[1:], POINTS], strict=True)
    ]
    while len(found) > count:
        found.pop(0 if size[found[0]] < size[found[-1]] else -1)
    return found


class Search:
    """The best float32 coefficients of r, r^3, ..., r^degree that a bounded search finds.

    `ended`: it looked everywhere, `fits` how often it fitted.
    """

    def __init__(self, degree: int) -> None:
        """Search."""
        self.degree = degree
        self.coefficients: list[float] = []
        self.error = np.inf
        self.fits = 0
        self.ended = True
        self._visit(held(degree))

    def _visit(self, fixed: list[float]) -> bool:
        """Look at all that begins with `fixed`; tell whether it could have held something better."""
        if self.fits >= MOST_FITS:
            self.ended = False
            return False
        self.fits += 1
        rest, level = remez(fixed, self.degree)
        if level >= self.error:
            return False
        if not rest:
            self.coefficients, self.error = fixed, level
            return True
        # Walk away from the real optimum on both sides, nearest first, until nothing better can follow.
        nearest = np.float32(rest[0])
        other = np.nextafter(nearest, np.float32(np.inf if nearest < rest[0] else -np.inf))
        sides = {np.float32(np.copysign(np.inf, nearest - other)): nearest}
        sides[np.float32(np.copysign(np.inf, other - nearest))] = other
        while sides:
            for direction, candidate in list(sides.items()):
                if self._visit([*fixed, float(candidate)]):
                    sides[direction] = np.nextafter(candidate, direction)
                else:
                    del sides[direction]
        return True


def proven_error(coefficients: list[float]) -> float:
    """Return an upper bound of |p(r) - sin(r)| on [-R_MAX, R_MAX], by exact arithmetic."""
    # Dyadic ends keep the numbers short.
    top = Fraction(ceil(R_MAX * 2**16), 2**16)
    taylor = [Fraction((-1) ** j, factorial(2 * j + 1)) for j in range(TAYLOR_TERMS)]
    given = [Fraction(c) for c in coefficients] + [Fraction(0)] * (TAYLOR_TERMS - len(coefficients))
    difference = [a - b for a, b in zip(given, taylor, strict=True)]
    slopes = [d * (2 * j + 1) for j, d in enumerate(difference)]
    curvature = sum(abs(s) * 2 * j * top ** (2 * j - 1) for j, s in enumerate(slopes) if j)
    half = top / (2 * CELLS)
    largest = Fraction(0)
    for cell in range(CELLS):
        r = (2 * cell + 1) * half
        at_middle = abs(_even(difference, r) * r) + half * abs(_even(slopes, r))
        largest = max(largest, at_middle)
    remainder = top ** (2 * TAYLOR_TERMS + 1) / factorial(2 * TAYLOR_TERMS + 1)
    return float(largest + half * half / 2 * curvature + remainder) * (1 + 2.0**-50)


def _even(coefficients: list[Fraction], r: Fraction) -> Fraction:
    """Return sum of coefficients[j] r^(2 j)."""
    total = Fraction(0)
    for c in reversed(coefficients):
        total = total * r * r + c
    return total


def reduction_error(r: Any) -> Any:
    """Return how far step 2 moves sin(r), |r| (...) <= R_MAX: the error of r times |cos|, and its square."""
    rounded = 2.0 * np.abs(r) + 2.0**12 * abs(sine.PI_PARTS[2])
    moved = 2.0**-24 * (1 + 2.0**-20) * rounded + 2.0**12 * sine.PI_REST
    return moved * np.abs(np.cos(r)) + moved * moved


def whole_error(coefficients: list[float], cosine: bool = False) -> float:
    """Return an upper bound of the emitted sine's error, or the cosine's, with and without fusing.

    Of rounding, by the compiler's rules, of the reduction, of the approximation. Between the ends of an
    interval |r cos r| moves by less than 2 |dr|, times 2 u. Where |r| > 1 the cosine's first difference may
    be rounded too, by 2^-24, passed on times |cos r|.
    """
    edges = np.linspace(-R_MAX, R_MAX, INTERVALS + 1)
    low, high = edges[:-1], edges[1:]
    program = trace(lambda r: sine.horner(r, coefficients), {"r": Type()})
    (rounding,) = bounds.over_box(program, {"r": (low, high)}, SineContract("none", None)).values()
    total = rounding + np.maximum(reduction_error(low), reduction_error(high))
    total = total + 4 * 2.0**-24 * np.diff(edges)
    if cosine:
        slope = np.maximum(np.abs(np.cos(low)), np.abs(np.cos(high)))
        total += np.where(np.maximum(np.abs(low), np.abs(high)) > 1.0, 2.0**-24 * (slope + 2.0**-12), 0.0)
    return float(total.max()) + proven_error(coefficients)


def pi_parts() -> list[float]:
    """Return three floats of PART_BITS bits each whose sum is pi to about 2**-41."""
    rest, parts = mp.pi, []
    for _ in range(3):
        unit = mp.mpf(2) ** (mp.floor(mp.log(abs(rest), 2)) + 1 - PART_BITS)
        parts.append(float(mp.nint(rest / unit) * unit))
        rest = rest - mp.mpf(parts[-1])
    return parts


def reduction() -> dict[str, Any]:
    """Return what compiler/core/sine.py states about the reduction; mpmath's precision 160 bits."""
    return {
        "r_max": R_MAX,
        "pi_parts": [c.hex() for c in pi_parts()],
        "pi_rest": float(abs(mp.pi - sum(mp.mpf(c) for c in pi_parts()))),
        "inverse_pi": float(np.float32(float(1 / mp.pi))).hex(),
    }


def table(degree: int) -> dict[str, Any]:
    """Return what compiler/core/sine.py states about one degree, and how near to the best it is."""
    found = Search(degree)
    return {
        "degree": degree,
        "coefficients": [c.hex() for c in found.coefficients],
        "approximation_error": proven_error(found.coefficients),
        "error": whole_error(found.coefficients),
        "cosine_error": whole_error(found.coefficients, cosine=True),
        "best_real": remez(held(degree), degree)[1],
        "best_float32": found.ended,
        "fits": found.fits,
    }


if __name__ == "__main__":
    with mp.workprec(160):
        print(json.dumps([reduction(), *map(table, DEGREES)], indent=2))
