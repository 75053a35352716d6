"""A right answer to this lab, for the tests of its grader."""

import numpy as np

from wamnet.compiler.core.sine import PI_PARTS, POLYNOMIALS

ONE_OVER_PI = float.fromhex("0x1.45f306p-2")


def sine(x):
    k = np.floor(x * ONE_OVER_PI + 0.5)
    r = x
    for part in PI_PARTS:
        r = r - k * part
    z = r * r
    first, *others = POLYNOMIALS[11].coefficients
    q = others[-1]
    for coefficient in others[-2::-1]:
        q = coefficient + z * q
    p = r + r * (z * q)
    sign = 1.0 - 2.0 * (k - 2.0 * np.floor(k * 0.5))
    return np.minimum(np.maximum(sign * p, -1.0), first)
