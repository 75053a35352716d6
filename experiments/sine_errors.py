"""The emitted sines' errors, proven: `python experiments/sine_errors.py`.

1. The error of a polynomial with float32 coefficients is bounded in exact rational arithmetic
   [`proven_error`]: sin is replaced by its Taylor polynomial (remainder below r^27 / 27!), and in each cell
   of a grid the difference is at most what it is in the middle, and its slope there times half a cell, and
   its largest curvature times half the square of that.
2. pi is cut into three constants of 12 bits, so that their products with an integer of 12 bits are exact
   [`pi_parts`] (Cody and Waite, "Software Manual for the Elementary Functions", 1980, chapter 8).
3. The whole error, by the steps of compiler/core/sine.py, is added up over small intervals of r
   [`whole_error`].

Remez' exchange and a search over float32 coefficients found these, the best ones up to degree 11:
`git show aaba3a6a:experiments/sine_coefficients.py`. tests/compiler/test_sine.py compares the printed errors
with those of compiler/core/sine.py.
"""

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

CELLS = 2048
"""Cells of the proof's grid."""

INTERVALS = 4000
"""Intervals of r over which the whole error is added up."""

TAYLOR_TERMS = 13
"""Terms of sin's Taylor polynomial in the proof: up to r^25."""


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


def errors(degree: int) -> dict[str, float]:
    """Return what compiler/core/sine.py states about the errors of one degree."""
    coefficients = [*sine.POLYNOMIALS[degree].coefficients]
    return {
        "approximation_error": proven_error(coefficients),
        "error": whole_error(coefficients),
        "cosine_error": whole_error(coefficients, cosine=True),
    }


if __name__ == "__main__":
    with mp.workprec(160):
        print(json.dumps([reduction(), {degree: errors(degree) for degree in sine.POLYNOMIALS}], indent=2))
