"""Wrong answers to lab 6: by the old text the new one, the mistake, and words of the explanation."""

WRONG = {
    "np.clip(depth / depth_scale, 0, 1)": [
        ("np.minimum(depth / depth_scale, 1)", "no lower end", "clip|concatenate"),
        ("depth / depth_scale", "depth as it is", "depth / depth_scale is clipped"),
        ("np.clip(depth, 0, 1)", "no scale", "divided by depth_scale"),
        ("np.clip(depth, 0, 1) / depth_scale", "clipped before", "divided by depth_scale first"),
        ("np.clip(depth * depth_scale, 0, 1)", "multiplied", "not multiplied"),
    ],
    "    parts = [np.clip(albedo, 0, 1)": [
        ("    depth /= depth_scale\n    depth_scale = 1.0\n    parts = [np.clip(albedo, 0, 1)",
         "a changed argument", "an argument is"),
    ],
    "if not depth_scale > 0:": [
        ("if not depth_scale > 1:", "scales below 1 are refused", "any scale above 0"),
        ("if depth_scale < 0:", "a scale of 0", "raise ValueError"),
        ("if depth_scale <= 0:", "a scale of NaN", "refuses NaN"),
    ],
    "np.clip(albedo, 0, 1)": [
        ("albedo", "albedo as it is", "albedo is clipped"),
        ("np.clip(albedo, -1, 1)", "albedo below 0", "not to \\[-1, 1\\]"),
    ],
    "np.clip(normal, -1, 1)": [
        ("np.clip(normal, 0, 1)", "normals above 0", "both signs"),
        ("normal", "normals as they are", "clipped to \\[-1, 1\\]"),
        ("(np.clip(normal, -1, 1) + 1) / 2", "normals as colours", "keeps its range"),
    ],
    "np.concatenate(parts, axis=-1)": [
        ("np.concatenate(parts[::-1], axis=-1)", "another order", "the order"),
        ("np.concatenate([parts[1], parts[0], parts[2]], axis=-1)", "another order", "the order"),
    ],
    "np.concatenate(parts, axis=-1).astype(np.float32)": [
        ("np.concatenate(parts, axis=-1)", "float64", "float64"),
    ],
    "np.asarray(a, np.float64) for a in": [("np.asarray(a, np.float32) for a in", "in float32", "float64")],
    "image[min(max(row, 0), height - 1), min(max(column, 0), width - 1)]": [
        ("image[min(max(column, 0), height - 1), min(max(row, 0), width - 1)]", "x and y exchanged",
         "image\\[y, x\\]"),
        ("image[row % height, column % width]", "a torus", "reach the other end|outside a tap is 0"),
    ],
    "row, column = y + dy - size // 2, x + dx - size // 2": [
        ("row, column = x + dy - size // 2, y + dx - size // 2", "x and y exchanged", "image\\[y, x\\]"),
        ("row, column = y + dy - (size - 1) // 2, x + dx - (size - 1) // 2", "the other centre",
         "also where size is even"),
        ("row, column = y + dy, x + dx", "begins at the pixel", "not at it"),
        ("row, column = y - dy + size // 2, x - dx + size // 2", "mirrored", "mirrored"),
        ("row, column = y + dx - size // 2, x + dy - size // 2", "column by column", "runs fastest"),
    ],
    "np.concatenate(taps)": [
        ("np.array(taps).T.ravel()", "channel by channel", "channels of a tap"),
        ("np.array(taps)", "not flat", "one vector"),
    ],
    'if inside or border == "clamp" else 0 * pixel': [("", "no zeros", "outside a tap is 0")],
    'pixel if inside or border == "clamp" else 0 * pixel': [
        ("pixel if inside else 0 * pixel", "zeros for clamp", "nearest pixel"),
    ],
    "min(max(row, 0), height - 1)": [("max(row, 0)", "beyond the end", "beyond the end|an index")],
    "min(max(column, 0), width - 1)": [
        ("min(column, width - 1)", "negative columns", "reach the other end|tap"),
    ],
    "1 <= size <= 64": [
        ("1 <= size <= 65", "65 is accepted", "outside 1 to 64"),
        ("1 <= size < 64", "64 is refused", "1 and 64 are sizes"),
    ],
    '    if border not in ("clamp", "zero"):\n        raise ValueError(f"border {border}")\n': [
        ("", "any border", "unknown border"),
    ],
    'raise ValueError(f"border {border}")': [("raise KeyError(border)", "another error", "raise ValueError")],
    "taps.append(pixel if": [
        ("pixel *= 0 if not inside and border == 'zero' else 1\n            taps.append(pixel if",
         "the image is changed", "zeros were written|tap"),
    ],
}  # fmt: skip
"""New text, the mistake in words, and a pattern of the explanation, by the old text."""
