"""Wrong answers to the extra on the sine: old text, new text, the mistake, words of the explanation."""

WRONG = {
    "np.floor(x * ONE_OVER_PI + 0.5)": [("np.floor(x * ONE_OVER_PI)", "not the nearest", "nearest integer")],
    "return np.minimum(np.maximum(sign * p, -1.0), first)": [
        ("return np.minimum(np.maximum(p, -1.0), first)", "no sign", "sign of odd k"),
    ],
    "sign = 1.0 - 2.0": [("sign = -1.0 + 2.0", "the other sign", "even k is positive")],
    "for part in PI_PARTS:": [
        ("for part in (np.float32(np.pi),):", "pi in one part", "three parts"),
        ("for part in PI_PARTS[:2]:", "pi in two parts", "three parts"),
    ],
    "    k = np.floor(x * ONE_OVER_PI + 0.5)\n": [
        ("    return np.sin(x)\n    k = 0\n", "NumPy's sine", "no sine of its own"),
    ],
    "POLYNOMIALS[11].coefficients": [
        ("POLYNOMIALS[7].coefficients", "a shorter polynomial", "all six coefficients|the polynomial"),
    ],
    "p = r + r * (z * q)": [("p = r * (z * q)", "the first term", "the polynomial")],
    "q = coefficient + z * q": [("q = coefficient + r * q", "r for its square", "the polynomial")],
}  # fmt: skip
"""New text, the mistake in words, and a pattern of the explanation, by the old text."""
