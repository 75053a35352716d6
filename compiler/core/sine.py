"""The emitted sines: additions, multiplications, floor and a selection, with proven absolute errors.

For |x| <= DOMAIN, u = 2**-24:

1. k = floor(x / pi + 1/2). x * (1/pi) has two relative roundings, of the constant and of the product: at most
   2 u * 4075 < 4.9e-4; the sum, below 4096, has half an ulp, 2**-13. So |x / pi - k| < 1/2 + 6.1e-4,
   |k| < 2**12 and |x - k pi| < R_MAX = 1.5735.
2. r = ((x - k P1) - k P2) - k P3, where P1 + P2 + P3 is pi to 1.3e-13 and each part has 12 bits (Cody and
   Waite, 1980). With 12 bits of k the three products are exact, so a fused multiply-add gives the same
   result. The first difference is exact too: if k is not 0, x and k P1 are multiples of 2**-23 and the
   difference is below 2. The others are rounded, the second being r + k P3, the third r: r is off by at
   most u (2 |r| + 4096 |P3|) + 4096 * 1.3e-13, which sin passes on times |cos r|; |r cos r| <= 0.5611 on
   the range.
3. sin(x) = (-1)**k sin(r); the sign is 1 - 2 (k - 2 floor(k / 2)), exact.
4. sin(r) ~ r + r (z q(z)), z = r r: odd, of degree 3 to 13, with float32 coefficients; approximation error
   `approximation_error` (proven by experiments/sine_errors.py). Its rounding is bounded by the
   compiler's own rules (bounds.py), which hold with and without fused multiply-add. Below degree 7 the first
   coefficient is not 1, which makes the absolute error smaller and gives up the relative one near 0.
5. The result is clamped to [-1, 1], which cannot move it away from sin(x).
6. Beyond the domain both functions are +0, of infinities and NaN they are NaN: step 2 would mean nothing
   there, and differ where products are fused. The sine of a zero of either sign is +0: with k = 0 the
   differences of step 2 turn -0 into +0.

The sum is below `error`; the script adds it up over small intervals of r, and tests/compiler/test_sine.py
compares. Results below 2**-126 may be flushed to zero, which adds at most that.

The cosine, for |x| <= COSINE_DOMAIN: k = floor(x / pi + 1), h = k - 1/2, x = h pi + r and cos(x) = (-1)**k
sin(r). The steps are the same with h for k: h has 12 bits for |k| < 2**11, and |x / pi - h| < 1/2 + 6.1e-4
since the sum is smaller. One thing differs: h is never 0, so where |x| < 1 the first difference is rounded
too, to 2**-24 at most (|r| < 2); there |cos r| = |sin(x)| <= 0.842. Its bound is `cosine_error`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

DOMAIN = 12800.0
"""Largest |x| for which the proof holds, in radians: k needs 12 bits; beyond it the sine is 0."""

R_MAX = 1.5735
"""Largest |reduced argument|, in radians: pi / 2 and the error of choosing k (step 1)."""

COSINE_DOMAIN = 6400.0
"""Largest |x| for which the cosine's proof holds, in radians: k - 1/2 needs 12 bits."""

INVERSE_PI = float.fromhex("0x1.45f306p-2")
"""1 / pi, rounded to float32."""

PI_PARTS = (
    float.fromhex("0x1.922p+1"),
    float.fromhex("-0x1.2aep-17"),
    float.fromhex("-0x1.deap-30"),
)
"""pi in three parts of 12 bits (step 2)."""

PI_REST = 1.3e-13
"""|pi - sum of PI_PARTS|, rounded up."""


@dataclass(frozen=True)
class Polynomial:
    """sin(r) on [-R_MAX, R_MAX]: `coefficients` of r, r^3, ..., all float32.

    `approximation_error` bounds |p - sin| in exact arithmetic, `error` the whole emitted sine (steps 1 to 5),
    `cosine_error` the whole emitted cosine.
    """

    coefficients: tuple[float, ...]
    approximation_error: float
    error: float
    cosine_error: float


POLYNOMIALS: Mapping[int, Polynomial] = {
    degree: Polynomial(tuple(map(float.fromhex, coefficients.split())), *errors)
    for degree, (coefficients, errors) in {
        3: ("0x1.f88ad8p-1 -0x1.23d14cp-3", (0.00453, 0.00453, 0.00453)),
        5: ("0x1.ffd7dap-1 -0x1.5348eap-3 0x1.ec490ap-8", (6.86e-05, 6.88e-05, 6.88e-05)),
        7: ("0x1p+0 -0x1.55501ep-3 0x1.10601p-7 -0x1.83b822p-13", (8.95e-07, 1.1e-06, 1.1e-06)),
        9: (
            "0x1p+0 -0x1.555548p-3 0x1.110e58p-7 -0x1.9f5ccep-13 0x1.5ccedcp-19",
            (4.92e-09, 2.08e-07, 2.08e-07),
        ),
        11: (
            "0x1p+0 -0x1.555556p-3 0x1.111132p-7 -0x1.a0221p-13 0x1.72915ap-19 -0x1.b0e154p-26",
            (2.75e-10, 2.03e-07, 2.03e-07),
        ),
        13: (
            "0x1p+0 -0x1.555556p-3 0x1.111142p-7 -0x1.a02d8ap-13 0x1.7566dep-19 -0x1.2337fep-25 "
            "0x1.608abap-30",
            (1.61e-10, 2.03e-07, 2.03e-07),
        ),
    }.items()
}
"""Polynomials by degree; the errors (approximation, sine, cosine) are the script's, rounded up."""

DEGREE = 11
"""The degree in use unless another is requested: its approximation error is far below one rounding."""


def sine(x: Any, degree: int = DEGREE) -> Any:
    """Return sin(x) for x (...) in [-DOMAIN, DOMAIN], as the kernels compute it; may be traced."""
    # Reduce to r in [-R_MAX, R_MAX], x = k pi + r.
    k = np.floor(x * INVERSE_PI + 0.5)
    return _within(DOMAIN, x, _signed(k, reduce(x, k), degree))


def cosine(x: Any, degree: int = DEGREE) -> Any:
    """Return cos(x) for x (...) in [-COSINE_DOMAIN, COSINE_DOMAIN], as the kernels compute it."""
    # Reduce to r in [-R_MAX, R_MAX], x = (k - 1/2) pi + r.
    k = np.floor(x * INVERSE_PI + 1.0)
    return _within(COSINE_DOMAIN, x, _signed(k, reduce(x, k - 0.5), degree))


def _within(domain: float, x: Any, value: Any) -> Any:
    """Return `value` (...) where |x| <= domain, else +0 for a number x and NaN for an infinity or NaN."""
    return np.where(np.absolute(x) <= domain, value, x - x)


def _signed(k: Any, r: Any, degree: int) -> Any:
    """Return (-1)**k sin(r), clamped: an odd k turns the sign."""
    sign = 1.0 - 2.0 * (k - 2.0 * np.floor(0.5 * k))
    return np.maximum(np.minimum(sign * polynomial(r, degree), 1.0), -1.0)


def reduce(x: Any, k: Any) -> Any:
    """Return x - k pi (...)."""
    for part in PI_PARTS:
        x = x - k * part
    return x


def polynomial(r: Any, degree: int = DEGREE) -> Any:
    """Return the polynomial near sin(r), r (...)."""
    return horner(r, POLYNOMIALS[degree].coefficients)


def horner(r: Any, coefficients: Sequence[float]) -> Any:
    """Return c1 r + c3 r^3 + ..., r (...), by Horner's rule in z = r r.

    A first coefficient of 1 is kept out of the sum: r (1 + z q) would round 1 + z q, where r + r (z q) rounds
    the small term and the result.
    """
    first, *others = coefficients
    z = r * r
    q = others[-1]
    for coefficient in reversed(others[:-1]):
        q = z * q + coefficient
    return r + r * (z * q) if first == 1.0 else r * (z * q + first)
