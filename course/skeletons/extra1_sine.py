"""A sine that promises something, in single precision.

Find the integer k nearest to x / pi and r = x - k pi, then sin(x) = (-1)^k sin(r), and a polynomial is
enough for r in [-pi / 2, pi / 2]. The difficulty is r: k pi rounded to single precision would be off by
more than the result may be. Subtract pi in three parts of 12 bits each, whose products with k are exact
(Cody and Waite, 1980). Tutorial: page 8. Clauses: SIN-1, SIN-3, SIN-4.
"""

from __future__ import annotations

from typing import Any

PI_PARTS = tuple(map(float.fromhex, ("0x1.922p+1", "-0x1.2aep-17", "-0x1.deap-30")))
"""pi in three parts; their sum is pi to 1.3e-13."""

COEFFICIENTS = tuple(
    map(
        float.fromhex,
        ("0x1p+0", "-0x1.555556p-3", "0x1.111132p-7", "-0x1.a0221p-13", "0x1.72915ap-19", "-0x1.b0e154p-26"),
    )
)
"""sin(r) is about the sum of these times r, r^3, r^5, ..., for |r| <= 1.5735, to 2.8e-10."""


def sine(x: Any) -> Any:
    """Return sin(x) (...) for |x| <= 12800, float32 in and out, within [-1, 1].

    Only what a kernel has: +, -, *, np.floor, np.minimum, np.maximum; it is traced.
    """
    raise NotImplementedError("sine")
