"""The sine as the checkers know it: written from the tables of spec/sine.md, with no line of the compiler's.

A fault in the compiler's own sine [core/sine.py] is in the kernels that it writes, and in nothing here: the
source check runs `sine` on a kernel's unknowns, and the certificate's checker takes errors from `PROMISES`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

U = 2.0**-24
"""float32's rounding."""

DOMAIN = 12800.0
"""SIN-1: the largest argument in radians."""

INVERSE_PI = float.fromhex("0x1.45f306p-2")
"""SIN-1: 1 / pi in float32."""

PI_PARTS = tuple(map(float.fromhex, ("0x1.922p+1", "-0x1.2aep-17", "-0x1.deap-30")))
"""SIN-1: P1, P2 and P3."""

TABLE = """
3  0.00453  0x1.f88ad8p-1 -0x1.23d14cp-3
5  6.88e-05 0x1.ffd7dap-1 -0x1.5348eap-3 0x1.ec490ap-8
7  1.1e-06  0x1p+0 -0x1.55501ep-3 0x1.10601p-7 -0x1.83b822p-13
9  2.08e-07 0x1p+0 -0x1.555548p-3 0x1.110e58p-7 -0x1.9f5ccep-13 0x1.5ccedcp-19
11 2.03e-07 0x1p+0 -0x1.555556p-3 0x1.111132p-7 -0x1.a0221p-13 0x1.72915ap-19 -0x1.b0e154p-26
13 2.03e-07 0x1p+0 -0x1.555556p-3 0x1.111142p-7 -0x1.a02d8ap-13 0x1.7566dep-19 -0x1.2337fep-25 0x1.608abap-30
"""
"""SIN-4 and SIN-6: degree, the proven error of the sine, and the coefficients c1, c3, ..."""

ROWS = [line.split() for line in TABLE.strip().splitlines()]
"""The same, word by word."""

COEFFICIENTS: Mapping[int, Sequence[float]] = {
    int(degree): [*map(float.fromhex, numbers)] for degree, _, *numbers in ROWS
}
"""Coefficients by degree."""


@dataclass(frozen=True)
class Promise:
    """A sine's largest error for arguments up to `domain`, by the name that a certificate gives it."""

    text: str
    error: float
    domain: float = np.inf


PROMISES: Mapping[str, Promise] = {
    promise.text: promise
    for promise in (
        *(Promise(f"emitted, odd polynomial of degree {n}", float(error), DOMAIN) for n, error, *_ in ROWS),
        Promise("sin() of OpenCL 1.2, 4 ulp on all arguments (full profile)", 4 * 2 * U),
        Promise("sinf() of CUDA, 2 ulp on all arguments", 2 * 2 * U),
    )
}
"""What is known of sines, by name: SIN-6, and what the manuals of two languages promise."""


def sine(x: Any, degree: int) -> Any:
    """Return sin(x) by the operations of SIN-1, SIN-4 and SIN-7, of anything that NumPy's functions take."""
    k = np.floor(x * INVERSE_PI + 0.5)
    r = x - k * PI_PARTS[0] - k * PI_PARTS[1] - k * PI_PARTS[2]
    first, *others = COEFFICIENTS[degree]
    z, q = r * r, others[-1]
    for coefficient in others[-2::-1]:
        q = z * q + coefficient
    value = r + r * (z * q) if first == 1.0 else r * (z * q + first)
    value = (1.0 - 2.0 * (k - 2.0 * np.floor(0.5 * k))) * value
    value = np.maximum(np.minimum(value, 1.0), -1.0)
    return np.where(np.absolute(x) <= DOMAIN, value, x - x)
