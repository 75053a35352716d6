"""The emitted sine's coefficients, made and proven: `python experiments/sine_coefficients.py`.

1. Remez' exchange finds the odd polynomial r + c3 r^3 + ... that is closest to sin on [0, R_MAX], in the
   maximum norm and with the first coefficient held at one [`remez`].
2. The coefficients become float32 one after the other, the rest being fitted again after each
   [`rounded_fit`], so that later ones repair what rounding the earlier ones has cost.
3. The error of the rounded polynomial is bounded in exact rational arithmetic [`proven_error`]: sin is
   replaced by its Taylor polynomial (remainder below r^27 / 27!), the difference is sampled on a grid, and
   between two points of the grid it cannot move further than its Lipschitz constant allows.
4. pi is cut into three constants of 12 bits, so that their products with an integer of 12 bits are exact
   [`pi_parts`] (Cody and Waite, "Software Manual for the Elementary Functions", 1980, chapter 8).

The printed table is what compiler/sine.py holds; tests/compiler/test_sine.py compares the two.
"""

from __future__ import annotations

import json
from fractions import Fraction
from math import factorial
from typing import Any

import mpmath as mp
import numpy as np

R_MAX = 1.5735
"""Largest reduced argument, in radians: pi / 2 and the error of choosing k (compiler/sine.py)."""

PART_BITS = 12
"""Significant bits of each part of pi: 12 + 12 bits of k fill float32's significand exactly."""

GRID = 4000
"""Points of the proof's grid."""

TAYLOR_TERMS = 13
"""Terms of sin's Taylor polynomial in the proof: up to r^25."""


def remez(fixed: list[float], degree: int) -> list[Any]:
    """Return the coefficients of r, r^3, ..., r^degree, the first ones `fixed`, the others the best."""
    free = [2 * j + 1 for j in range(len(fixed), (degree + 1) // 2)]

    def target(r: Any) -> Any:
        return mp.sin(r) - sum(mp.mpf(c) * r ** (2 * j + 1) for j, c in enumerate(fixed))

    count = len(free) + 1
    points = [mp.mpf(R_MAX) * mp.sin(mp.pi * (i + 1) / (2 * count)) for i in range(count)]
    for _ in range(12):
        system = mp.matrix(count, count)
        for i, r in enumerate(points):
            for j, power in enumerate(free):
                system[i, j] = r**power
            system[i, count - 1] = (-1) ** i
        solution = mp.lu_solve(system, mp.matrix([target(r) for r in points]))
        best = [solution[j] for j in range(count - 1)]
        points = _alternation(
            lambda r, c=best: target(r) - sum(a * r**p for a, p in zip(c, free, strict=True)), count
        )
    return [mp.mpf(c) for c in fixed] + best


def _alternation(error: Any, count: int) -> list[Any]:
    """Return the `count` largest local extrema of `error` on (0, R_MAX], which alternate in sign."""
    grid = [mp.mpf(R_MAX) * (i + 1) / 1000 for i in range(1000)]
    values = [error(r) for r in grid]
    groups: list[tuple[Any, Any]] = []
    for r, value in zip(grid, values, strict=True):
        if groups and groups[-1][1] * value > 0:
            groups[-1] = max(groups[-1], (r, value), key=lambda item: abs(item[1]))
        else:
            groups.append((r, value))
    while len(groups) > count:
        groups.pop(0 if abs(groups[0][1]) < abs(groups[-1][1]) else -1)
    return [r for r, _ in groups]


def rounded_fit(degree: int) -> list[float]:
    """Return float32 coefficients of r, r^3, ..., r^degree."""
    coefficients = [1.0]
    while len(coefficients) < (degree + 1) // 2:
        coefficients.append(float(np.float32(float(remez(coefficients, degree)[len(coefficients)]))))
    return coefficients


def proven_error(coefficients: list[float]) -> float:
    """Return an upper bound of |p(r) - sin(r)| on [-R_MAX, R_MAX], by exact arithmetic."""
    top = Fraction(R_MAX)
    taylor = [Fraction((-1) ** j, factorial(2 * j + 1)) for j in range(TAYLOR_TERMS)]
    given = [Fraction(c) for c in coefficients] + [Fraction(0)] * (TAYLOR_TERMS - len(coefficients))
    difference = [a - b for a, b in zip(given, taylor, strict=True)]
    lipschitz = sum(abs(d) * (2 * j + 1) * top ** (2 * j) for j, d in enumerate(difference))
    largest = max(abs(_odd(difference, top * i / GRID)) for i in range(GRID + 1))
    remainder = top ** (2 * TAYLOR_TERMS + 1) / factorial(2 * TAYLOR_TERMS + 1)
    return float(largest + lipschitz * (top / (2 * GRID) + Fraction(1, 2**40)) + remainder) * (1 + 2.0**-50)


def _odd(coefficients: list[Fraction], r: Fraction) -> Fraction:
    """Return sum of coefficients[j] r^(2 j + 1), for r cut to 40 bits so that the numbers stay short."""
    r = Fraction(round(r * 2**40), 2**40)
    total = Fraction(0)
    for c in reversed(coefficients):
        total = total * r * r + c
    return total * r


def pi_parts() -> list[float]:
    """Return three floats of PART_BITS bits each whose sum is pi to about 2**-41."""
    rest, parts = mp.pi, []
    for _ in range(3):
        unit = mp.mpf(2) ** (mp.floor(mp.log(abs(rest), 2)) + 1 - PART_BITS)
        parts.append(float(mp.nint(rest / unit) * unit))
        rest = rest - mp.mpf(parts[-1])
    return parts


def table(degree: int = 11) -> dict[str, Any]:
    """Return everything that compiler/sine.py states about one degree."""
    coefficients = rounded_fit(degree)
    return {
        "degree": degree,
        "r_max": R_MAX,
        "coefficients": [c.hex() for c in coefficients],
        "approximation_error": proven_error(coefficients),
        "pi_parts": [c.hex() for c in pi_parts()],
        "pi_rest": float(abs(mp.pi - sum(mp.mpf(c) for c in pi_parts()))),
        "inverse_pi": float(np.float32(float(1 / mp.pi))).hex(),
    }


if __name__ == "__main__":
    mp.mp.prec = 160
    print(json.dumps(table(), indent=2))
