"""Wrong answers to lab 12: by the old text the new one, the mistake, and words of the explanation."""

WRONG = {
    "most * np.sum(np.abs(weights), axis=1)": [
        ("most * np.abs(np.sum(weights, axis=1))", "a magnitude of the sum", "not the magnitude of the sum"),
        ("most * np.sum(weights, axis=1)", "no magnitudes", "both signs"),
        ("np.sum(np.abs(weights), axis=1)", "no inputs", "largest input"),
        ("most * np.max(np.abs(weights), axis=1)", "one weight", "sum over the row"),
        ("most * np.sum(np.abs(weights))", "a sum over all rows", "axis=-1"),
        ("most * np.sum(np.abs(weights), axis=0)", "the other axis", "axis"),
        ("most * np.sum(np.maximum(weights, 0), axis=1)", "only positive weights",
         "sum of \\|weights\\||both signs"),
    ],
    "sums.astype(np.int32).astype(np.uint32)": [
        ("np.maximum(sums, 0).astype(np.int32).astype(np.uint32)", "no negative sums", "by way of int32"),
        ("np.abs(sums).astype(np.int32).astype(np.uint32)", "magnitudes", "keep their sign"),
    ],
    "words * factor.astype(np.uint32) + bias.astype(np.uint32)": [
        ("words * factor.astype(np.uint32)", "no bias", "bias is missing"),
        ("words * factor.astype(np.uint32) - bias.astype(np.uint32)", "a difference", "bias is added"),
        ("(words + bias.astype(np.uint32)) * factor.astype(np.uint32)", "the bias first", "added last"),
        ("(sums * factor + bias).astype(np.int64).astype(np.uint32)", "a product in float32",
         "convert first|words first"),
        ("words + bias.astype(np.uint32)", "no factor", "factor is missing"),
        ("(words * factor.astype(np.uint32) + bias.astype(np.uint32)).astype(np.float32)", "floats",
         "uint32"),
    ],
    "return size * (1.0 - 2.0 * half)": [
        ("return size", "no sign", "second half turn"),
        ("return size * (2.0 * half - 1.0)", "the other sign", "first half turn is positive"),
        ("return size * (1.0 - 2.0 * half) / amplitude", "in [-1, 1]", "not numbers in|is an integer"),
    ],
    "back = (phases >> 22) & 1": [
        ("back = (phases >> 23) & 1", "another bit", "not bit 23"),
        ("back = 1 - ((phases >> 22) & 1)", "the other quarters", "fold by bit 22"),
    ],
    "half = ((phases >> 23)": [("half = ((phases >> 22)", "the sign of a quarter", "that of bit 23")],
    "(phases ^ (0 - back))": [("(phases * (1 - 2 * back))", "a negative phase", "complement of all bits")],
    "& 0xFFFF": [("& 0x7FFF", "fifteen bits", "16 bits")],
    "(1 << (shift - 1))": [("(1 << shift)", "a whole step", "not 1 << shift")],
    "x = ((phases ^ (0 - back)) >> 6) & 0xFFFF": [
        ("x = (np.where(back == 1, phases ^ 0xFFFFFFFF, phases) >> 6) & 0xFFFF", "np.where, without a rule",
         "no rule for"),
        ("x = ((phases ^ (0 - back)) >> 6) % 65536", "a remainder", "cannot be traced"),
        ("x = (phases >> 6) & 0xFFFF", "no way back", "run backwards"),
        ("x = (phases ^ (0 - back)) >> 6", "no mask", "mask|backwards"),
    ],
    "x * q + (1 << (shift - 1))": [("x * q", "rounded down", "half of the last place, .* missing")],
    "np.minimum((x * q + (1 << (shift - 1))) >> shift, amplitude).astype(np.float32)": [
        ("np.floor((x * q + (1 << (shift - 1))).astype(np.float32) / 2**shift)", "a division in floats",
         "words have 32 bits|half of the last|coefficient|no rule"),
    ],
    "((z * (c3 - ((z * c5) >> 16))) >> 16)": [
        ("((z * (c3 + ((z * c5) >> 16))) >> 16)", "a sign in the polynomial", "alternate"),
    ],
    "return sine(phase(np.matmul(numbers, weights.T), factor, bias), amplitude)": [
        ("return np.matmul(numbers, weights.T)", "no sine", "sine is missing"),
    ],
    "factor, bias), amplitude)": [
        ("factor, 0 * bias), amplitude)", "no bias in the layer", "bias is missing"),
        ("0 * factor + 1, bias), amplitude)", "no factor in the layer", "factor is missing"),
    ],
    "np.matmul(numbers, weights.T)": [("np.matmul(numbers, weights)", "no transpose", "x @ W.T")],
}  # fmt: skip
"""New text, the mistake in words, and a pattern of the explanation, by the old text."""
