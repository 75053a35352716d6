"""Wrong answers to lab 5: by the old text the new one, the mistake, and words of the explanation."""

WRONG = {
    "np.ceil(variance / error**2)": [
        ("np.floor(variance / error**2) + 1", "one too many", "one too many"),
        ("np.ceil((variance / error**2).astype(np.float32))", "numbers in float32", "single precision"),
        ("np.ceil(variance / error)", "error without square", "counts as its square"),
        ("np.floor(variance / error**2)", "rounded down", "round up"),
        ("np.ceil(np.sqrt(variance) / error**2)", "a root", "no root"),
        ("np.ceil(variance**2 / error**2)", "a square", "squared already"),
    ],
    "        n, total, squares = add_sample(n, total, squares, radiance(x, y, sample))\n": [
        ("        value = radiance(x, y, sample)\n"
         "        n, total, squares = n + 1, total + value, squares + value**2\n"
         "    squares = squares - total**2 / n\n", "the school's formula", "loses all digits|recurrence"),
    ],
    "np.asarray(image, np.float64)": [
        ("np.asarray(image, np.float32)", "an image in float32", "before subtracting"),
    ],
    "np.asarray(reference, np.float64)": [
        ("np.asarray(reference, np.float32)", "a reference in float32", "before subtracting"),
    ],
    "(n * x - total) ** 2 / (n * (n + 1))": [
        ("x * x", "squares of samples", "first|begins|squares of the samples"),
        ("(n * x - total) ** 2 / n", "another divisor", "not n$|not n\\b"),
        ("(n * x - total) ** 2 / n**2", "n squared", "not n\\^2"),
        ("(n * x - total) ** 2 / (n + 1)", "another divisor", "not n \\+ 1"),
        ("(n * x - total) ** 2", "not divided", "divided by n \\(n \\+ 1\\)"),
        ("(x - total) ** 2 / (n * (n + 1))", "x without n", "n times x"),
        ("(n * x - total - x) ** 2 / (n * (n + 1))", "the sum with x", "before x"),
        ("(n * x - total) / (n * (n + 1))", "no square", "square is missing"),
    ],
    " if n > 0 else 0.0": [("", "0 / 0 at the first sample", "second sample")],
    "return n + 1, total + x": [
        ("return n, total + x", "n is not counted", "not counted"),
        ("return n + 1, total", "the sum is not summed", "sum \\+ x"),
        ("return n + 1, (n * total + x) / (n + 1)", "a mean for the sum", "not the mean|sum"),
    ],
    "squares + more": [("more", "squares are not summed", "are summed|axes")],
    "squares / max(n - 1, 1)": [
        ("squares / n", "divided by n", "divided by n: n - 1"),
        ("squares / (n + 1)", "divided by n + 1", "n \\+ 1"),
        ("squares / (n - 1)", "0 / 0 for one sample", "max\\(n - 1, 1\\)|guard"),
        ("np.sqrt(squares / max(n - 1, 1))", "a standard deviation", "standard deviation"),
        ("squares / max(n - 1, 1) / n", "the mean's variance", "variance of the mean"),
    ],
    "mean = total / n": [
        ("mean = total", "a sum", "not divided"),
        ("mean = total / max(n - 1, 1)", "n - 1 for a mean", "the mean divides by n"),
    ],
    "range(spp)": [
        ("range(1, spp + 1)", "samples from 1", "0 to spp - 1"),
        ("range(spp - 1)", "one sample too few", "0 to spp - 1"),
    ],
    "radiance(x, y, sample)": [
        ("radiance(x, y, 0)", "the same sample", "0 to spp - 1"),
        ("radiance(y, x, sample)", "x and y exchanged", "exchanged"),
    ],
    "shape = (height, width, -1)": [("shape = (width, height, -1)", "transposed", "transposed|axis")],
    "y, x = (v.ravel() for v in np.mgrid[0:height, 0:width])": [
        ("x, y = (v.ravel() for v in np.mgrid[0:width, 0:height])", "column by column", "row by row"),
        ("y, x = np.mgrid[0:height, 0:width]", "not flat", "ravel"),
    ],
    "mean.reshape(shape),": [("mean.reshape(shape)[::-1],", "upside down", "at the top")],
    "np.maximum(np.ceil(variance / error**2), 1)": [
        ("np.ceil(variance / error**2)", "no sample at all", "at least one"),
    ],
    "np.mean(difference**2)": [
        ("np.sum(difference**2)", "a sum", "a sum"),
        ("np.sqrt(np.mean(difference**2))", "a root", "root is not taken"),
        ("np.mean(np.abs(difference))", "magnitudes", "not magnitudes"),
        ("np.mean(difference) ** 2", "a square of a mean", "mean of the squares"),
        ("np.mean(np.sum(difference**2, axis=-1))", "a sum of channels", "channels"),
    ],
    "np.asarray(image, np.float64) - np.asarray(reference, np.float64)": [
        ("image - reference", "bytes that wrap", "wrap"),
    ],
}  # fmt: skip
"""New text, the mistake in words, and a pattern of the explanation, by the old text."""
