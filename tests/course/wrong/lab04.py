"""Wrong answers to lab 4: by the old text the new one, the mistake, and words of the explanation."""

WRONG = {
    "reflectance * np.ones_like(z), z / np.pi": [
        ("z / np.pi, reflectance * np.ones_like(z)", "exchanged", "the order is"),
    ],
    "np.maximum(pdf, 1e-15)": [("(pdf + 1e-15)", "a sum in place of a maximum", "not a sum")],
    "1e-15), 1e15)": [("1e-15), 1e3)", "a ratio that is cut early", "not sooner")],
    "radius, angle = np.sqrt(u0), 2 * np.pi * u1": [
        ("u0, u1 = np.random.random((2, *np.shape(u0)))\n    radius, angle = np.sqrt(u0), 2 * np.pi * u1",
         "numbers of its own", "nothing else"),
    ],
    "2 * np.pi * u1": [
        ("3 * np.pi * u1", "more than a turn", "2 pi u1"),
        ("2 * np.pi / np.maximum(u1, 1e-3)", "divided by u1", "2 pi u1"),
    ],
    "reflectance * np.ones_like(z)": [
        ("reflectance * z / np.pi", "not divided by the density", "not divided"),
        ("reflectance / np.pi * np.ones_like(z)", "one pi too many", "they cancel"),
        ("reflectance * z", "one cosine too many", "cancels"),
        ("np.ones_like(z)", "no reflectance", "reflectance is missing"),
        ("reflectance", "one number for all", "axis|all axes"),
        ("2 * reflectance * np.ones_like(z)", "a factor of 2", "factor of 2"),
    ],
    "np.ones_like(z), z / np.pi": [
        ("np.ones_like(z), z", "a density without pi", "1 / pi is missing"),
        ("np.ones_like(z), np.full_like(z, 1 / (2 * np.pi))", "uniform density", "uniform density"),
        ("np.ones_like(z), reflectance * z / np.pi", "reflectance in the density", "does not belong"),
    ],
    "radius, angle = np.sqrt(u0), 2 * np.pi * u1\n    z = np.sqrt(1 - u0)": [
        ("radius, angle = np.sqrt(1 - u0 * u0), 2 * np.pi * u1\n    z = u0", "uniform directions",
         "uniform over the hemisphere"),
    ],
    "z = np.sqrt(1 - u0)": [("z = 1 - u0", "z without root", "do not belong together")],
    "ratio = np.minimum(other / np.maximum(pdf, 1e-15), 1e15)\n    return 1 / (1 + ratio * ratio)": [
        ("return pdf / (pdf + other)", "balance heuristic", "balance heuristic"),
    ],
    "return 1 / (1 + ratio * ratio)": [
        ("return ratio * ratio / (1 + ratio * ratio)", "the other's weight", "exchanged"),
        ("return 1 / (1 + ratio)", "no squares", "takes squares"),
        ("return 1 / (1 + ratio) ** 2", "a square of a sum", "squares of the sum"),
        ("return 1 / (1 + ratio**3)", "another exponent", "exponent is 2"),
        ("return 0.5 + 0 * ratio", "half each", "does not depend"),
        ("return 1 / (ratio * ratio)", "no sum", "sum of both squares"),
    ],
    "1 / (1 + ratio * ratio)": [
        ("(p := np.maximum(pdf, 1e-15)) * p / (p * p + other**2)", "an overflow", "beyond float32"),
    ],
    "np.minimum(other / np.maximum(pdf, 1e-15), 1e15)": [("other / pdf", "0 / 0", "0 / 0")],
    "pdf = square / (4 * half * half * cos)": [
        ("pdf = square / (half * half * cos)", "a quarter of the area", "4 half\\^2"),
        ("pdf = 1 / (4 * half * half) + 0 * square", "a density per area", "density per area"),
        ("pdf = square / (4 * half * half)", "no cosine of the lamp", "cosine at the light is missing"),
        ("pdf = 1 / (4 * half * half * cos)", "no distance", "squared distance is missing"),
        ("pdf = cos / (4 * half * half * square)", "upside down", "upside down"),
        ("pdf = square * cos / (4 * half * half)", "times the cosine", "divides"),
        ("pdf = np.sqrt(square) / (4 * half * half * cos)", "the distance itself", "counts as its square"),
    ],
    "reflectance / np.pi * cos / pdf, pdf": [
        ("reflectance / np.pi * cos, pdf", "not divided", "not divided by the density"),
        ("reflectance * cos / pdf, pdf", "f without pi", "reflectance / pi"),
        ("reflectance / np.pi / pdf, pdf", "no cosine", "cosine at the surface"),
        ("reflectance / np.pi * cos * cos / pdf, pdf", "both cosines", "cosine twice"),
        ("1 / np.pi * cos / pdf, pdf", "no reflectance", "reflectance is missing"),
    ],
    "pdf, cos / np.pi": [
        ("pdf, pdf", "the lamp's density twice", "third result"),
        ("pdf, 1 / np.pi + 0 * cos", "no cosine", "cosine is missing"),
    ],
    "(2 * u0 - 1) * half, (2 * u1 - 1) * half": [
        ("u0 * half, u1 * half", "a quarter of the lamp", "distance|density"),
    ],
}  # fmt: skip
"""New text, the mistake in words, and a pattern of the explanation, by the old text."""
