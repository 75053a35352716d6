"""Wrong answers to lab 3: by the old text the new one, the mistake, and words of the explanation."""

WRONG = {
    "def mix(v0, v1, v2, v3):\n": [
        ("def mix(v0, v1, v2, v3):\n    v0 *= np.uint32(1)\n", "a changed argument", "an argument is"),
    ],
    "return lines(*[v ^ (v >> np.uint32(16)) for v in words])": [
        ("return lines(*[v ^ (v >> np.uint32(16)) for v in words])[::-1]", "words backwards",
         "in their order"),
        ("return [v ^ (v >> np.uint32(16)) for v in words]", "no second round", "once more after"),
    ],
    ".astype(np.float64) / 2.0**24": [
        ("// 2**24", "a whole division", "not // 2"),
        (".astype(np.float32) / np.float32(2.0**24)", "single precision", "make it float64"),
    ],
    "np.sqrt(u0), 2 * np.pi * u1": [
        ("u0**0.49, 2 * np.pi * u1\n    u0 = radius * radius", "nearly a root", "uniform in the disk"),
    ],
    "np.maximum(direction[..., 2], 0.0)": [
        ("np.cos(np.maximum(direction[..., 2], 0.0))", "a cosine of a cosine", "already"),
        ("np.maximum(direction[..., 1], 0.0)", "another component", "third component"),
        ("direction[..., 2]", "negative densities", "below the horizon"),
        ("np.abs(direction[..., 2])", "densities below", "below the horizon"),
        ("np.maximum(direction[2], 0.0)", "an index of rays", "transposed|shape|axis"),
    ],
    "direction[..., 2]": [("direction[:, 2]", "one axis only", "take components with")],
    "return x * x + y * y,": [("return 1 - direction[..., 2],", "u0 from z", "u0 from 1 - z")],
    "np.mod(np.arctan2(y, x) / (2 * np.pi), 1.0)": [
        ("np.mod(np.arctan2(y, x), 1.0)", "radians", "makes turns"),
        ("np.arctan2(y, x) / (2 * np.pi)", "negative turns", "np.mod"),
        ("np.mod(np.arctan2(y, x) / np.pi, 1.0)", "half a turn", "divide by 2 pi"),
    ],
    "np.arctan2(y, x)": [
        ("np.arctan(y / x)", "half a turn only", "half a turn only"),
        ("np.arctan2(x, y)", "x before y", "takes y first"),
    ],
    "    words = lines(*words)\n": [("", "one round", "come twice|order of the lines")],
    "(v >> np.uint32(16))": [("(v >> np.uint32(8))", "another shift", "order of the lines|shift|16")],
    "lines(*[v ^ (v >> np.uint32(16)) for v in words])": [
        ("lines(*words)", "no shift", "v \\^ \\(v >> 16\\)"),
    ],
    "words = [v * np.uint32(1664525) + np.uint32(1013904223) for v in (v0, v1, v2, v3)]": [
        ("words = [v0, v1, v2, v3]", "no first step", "at the beginning"),
    ],
    "v1 = v1 + v2 * v0": [("v1 = v1 + v2 * v3", "another operand", "operand of one")],
    "v3 = v3 + v1 * v2": [("v3 = v3 + v0 * v2", "another operand", "operand of one")],
    "    v0 = v0 + v1 * v3\n    v1 = v1 + v2 * v0\n    v2 = v2 + v0 * v1\n    v3 = v3 + v1 * v2\n"
    "    return v0, v1, v2, v3": [
        ("    return v0 + v1 * v3, v1 + v2 * v0, v2 + v0 * v1, v3 + v1 * v2", "old words in each line",
         "not the old ones"),
    ],
    "np.uint32(1013904223)": [("np.uint32(1013904224)", "another constant", "order of the lines")],
    "(words >> np.uint32(8)).astype(np.float64) / 2.0**24": [("words / 2.0**32", "all bits", "upper 24")],
    "/ 2.0**24": [
        ("/ (2.0**24 - 1)", "divided by one less", "2\\^24 - 1"),
        ("/ 2.0**32", "shifted and divided", "divide by 2\\^24"),
    ],
    "(words >> np.uint32(8)).astype": [
        ("(words & np.uint32(0xFFFFFF)).astype", "lower bits", "lower 24 bits"),
    ],
    "radius, angle = np.sqrt(u0), 2 * np.pi * u1": [
        ("radius, angle = u0, 2 * np.pi * u1", "radius without root", "do not belong together"),
    ],
    "radius, angle = np.sqrt(u0), 2 * np.pi * u1\n": [
        ("radius, angle, u0 = u0, 2 * np.pi * u1, u0 * u0\n", "radius without root, on the sphere",
         "has to be sqrt"),
        ("radius, angle, u0 = np.sqrt(1 - (1 - u0) ** 2), 2 * np.pi * u1, 1 - (1 - u0) ** 2\n", "uniform",
         "uniform over the hemisphere"),
    ],
    "2 * np.pi * u1\n": [("np.pi * u1\n", "half a turn", "does not go around")],
    "np.sqrt(1 - u0)], axis=-1)": [
        ("-np.sqrt(1 - u0)], axis=-1)", "below the horizon", "other sign"),
        ("1 - u0], axis=-1)", "z without root", "do not belong together"),
        ("np.sqrt(1 - u0)])", "the first axis", "transposed"),
    ],
    "/ np.pi\n\n\ndef invert": [
        ("\n\n\ndef invert", "no pi", "1 / pi is missing"),
        ("/ 2\n\n\ndef invert", "2 for pi", "not 1 / 2"),
        ("/ (2 * np.pi)\n\n\ndef invert", "2 pi", "1 / \\(2 pi\\)"),
    ],
    "np.maximum(direction[..., 2], 0.0) / np.pi": [
        ("np.ones(direction.shape[:-1]) / np.pi", "no cosine", "cosine is missing"),
    ],
    "return x * x + y * y, np.mod": [
        ("return np.sqrt(x * x + y * y), np.mod", "a root", "square of the radius"),
    ],
    "return x * x + y * y, np.mod(np.arctan2(y, x) / (2 * np.pi), 1.0)": [
        ("return np.mod(np.arctan2(y, x) / (2 * np.pi), 1.0), x * x + y * y", "exchanged", "are exchanged"),
    ],
}  # fmt: skip
"""New text, the mistake in words, and a pattern of the explanation, by the old text."""
