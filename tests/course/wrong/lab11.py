"""Wrong answers to lab 11: by the old text the new one, the mistake, and words of the explanation."""

WRONG = {
    "U, TINY, WIDER = 2.0**-24": [
        ("U, TINY, WIDER = 2.0**-53", "float64's rounding", "not float64's"),
        ("U, TINY, WIDER = 2.0**-23", "a whole last place", "half a unit"),
    ],
    "return n * U / (1 - n * U)": [
        ("return n * U", "no divisor", "divided by 1 - n U"),
        ("return n * U / (1 + n * U)", "the sign below", "1 - n U below"),
        ("return U / (1 - n * U)", "one rounding", "n U above"),
    ],
    "np.abs(weight) @ largest + np.abs(bias)": [
        ("weight @ largest + bias", "no magnitudes", "magnitudes"),
        ("np.abs(weight) @ largest", "no bias", "the bias is one of the terms"),
    ],
    "np.maximum(np.abs(low), np.abs(high))": [("np.abs(high)", "only the upper end", "both ends")],
    "argument = omega * (size + rounding)": [
        ("argument = size + rounding", "no omega in the argument", "term is missing|omega"),
    ],
    "added = omega * rounding": [("added = rounding", "no omega in the error", "omega multiplies")],
    "rounding = gamma(weight.shape[1] + 2) * size + TINY\n": [
        ("rounding = gamma(weight.shape[1] + 1) * size + TINY\n    U = 0\n", "no rounding of the product",
         "rounds too"),
    ],
    "gamma(weight.shape[1] + 2)": [
        ("gamma(weight.shape[1])", "a rounding too few", "gamma\\(n \\+ 1\\)"),
        ("gamma(weight.shape[1] - 1)", "n numbers", "gamma\\(n \\+ 1\\)"),
    ],
    "omega * (size + rounding)": [("omega * size", "an argument without its error", "by its own error")],
    "TINY, WIDER = 2.0**-24, 2.0**-110": [("TINY, WIDER = 2.0**-24, 0.0", "nothing for 0", "TINY")],
    "np.stack(found, axis=1) * WIDER": [("np.stack(found, axis=1)", "float64's rounding", "WIDER")],
    "np.full(len(bias), 1 + sine_error)": [
        ("np.ones(len(bias))", "a box of exact sines", "off by sine_error"),
    ],
    "error = added + (sine_error or 0.0) + TINY": [
        ("error = added + TINY", "no error of the sine", "adds its own error"),
        ("error = added + (sine_error or 4e-7) + TINY", "a sine at the end", "last layer has no sine"),
    ],
    "return argument * WIDER, added * WIDER, error * WIDER": [
        ("return argument * WIDER, error * WIDER, added * WIDER", "exchanged", "the order is"),
    ],
    "            high = np.full(len(bias), 1 + sine_error)\n": [
        ("            high = np.full(len(bias), 0.5)\n", "a box that is too small",
         "inputs of later layers|small"),
    ],
    "            low = -high\n": [
        ("            low = 0 * high\n            high = 0 * high\n", "a box of nothing",
         "inputs of later|small"),
    ],
    "omegas[min(number, 1)], low": [
        ("omegas[0], low", "the first omega", "omegas\\[0\\] is the first|small"),
    ],
    "1.0, low, high, None))": [("1.0, low, high, sine_error))", "a sine at the end", "no sine")],
    "reach = reach @ (omegas[min(number, 1)] * np.abs(weights[number]))": [
        ("reach = reach @ np.abs(weights[number])", "no omega on the way", "multiplied by omega"),
        ("reach = reach @ (omegas[min(number, 1)] * weights[number])", "signs on the way",
         "do not cancel|from the output backwards"),
        ("reach = reach @ (omegas[0] * np.abs(weights[number]))", "the first omega", "own omega"),
    ],
    "[errors[-1]], np.abs(weights[-1])": [
        ("[errors[-1]], weights[-1]", "signs of the last layer", "do not cancel|from the output backwards"),
    ],
    "found[0] = np.asarray(errors[-1])": [
        ("found[0] = 0 * np.asarray(errors[-1])", "no error of the last layer", "own error counts"),
    ],
    "return np.stack(found, axis=1)": [
        ("return np.stack(found[::-1], axis=1)", "the order of layers", "first column"),
        ("return np.stack(found, axis=0)", "transposed", "transposed"),
    ],
}  # fmt: skip
"""New text, the mistake in words, and a pattern of the explanation, by the old text."""
