"""Wrong answers to the extra on the suite: old text, new text, the mistake, words of the explanation."""

WRONG = {
    " & (behind < 1e30)": [("", "too much is broken", "break less")],
    "normal=-surface.normal": [("normal=surface.normal", "nothing is broken", "break them there")],
    "np.where(depth > 0, 1 / np.maximum(depth, 1e-9), 0)": [
        ("1 / depth", "infinities", "where nothing is met depth is 0"),
    ],
    "1 / np.maximum(depth, 1e-9)": [("2 * depth", "another number", "one over the distance")],
    " & (linear < 0.8)": [("", "a case sees it", "where no case is")],
    "found + 0.02": [("found + 0.002", "too small a fault", "larger fault")],
    "0.6": [("0.9", "a case beside it", "range of hide")],
}  # fmt: skip
"""New text, the mistake in words, and a pattern of the explanation, by the old text."""
