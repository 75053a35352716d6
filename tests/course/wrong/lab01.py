"""Wrong answers to lab 1: by the old text the new one, the mistake, and words of the explanation."""

WRONG = {
    "np.where(near > 0, near, far)": [
        ("near", "the near root also from inside", "behind the ray"),
        ("far", "the far root also from outside", "the exit"),
        ("np.abs(near)", "a magnitude of the near root", "near one is below 0"),
        ("np.where(near > 1e-3, near, far)", "a least distance", "not t > a"),
    ],
    "(far > 0), np.where": [("(near > 0), np.where", "from inside a miss", "always an exit")],
    "(square > 0) & (far > 0)": [
        ("square > 0", "a sphere behind the ray is met", "behind the ray"),
        ("far > 0", "a ray beside the sphere meets it", "below 0"),
        ("(square > 0.2) & (far > 0)", "a threshold", "threshold"),
        ("(square > 0) & (far > 2.5)", "a nearest distance", "a threshold"),
        ("(square > 1e-6) & (far > 0)", "a small threshold", "threshold other"),
        ("(square >= 0) & (far > 0)", "a touch is a hit", "only touches"),
        ("(square > 0) & (far > 1e-3)", "a least distance", "not t > a threshold"),
    ],
    "return np.where((square": [
        ("return near, far\n    return np.where((square", "both roots", "nearer root"),
        ("np.where((square", "no return", "no `return`"),
    ],
    "b = -np.sum(f * direction, axis=-1)": [("b = np.sum(f * direction, axis=-1)", "the sign of b", "sign")],
    "f = origin - center": [
        ("f = origin + center", "a sum of points", "other sign|sign of b"),
        ("f = origin", "the centre is left out", "centre is not subtracted"),
        ("f = center - origin", "f points the other way", "sign of b|discriminant"),
        ("origin -= center\n    f = origin", "a changed argument", "an argument is"),
    ],
    "np.sum(f * direction, axis=-1)": [
        ("np.sum(f * direction)", "a sum over all rays", "broadcast|axis=-1|transposed"),
        ("np.sum(f * direction, axis=1)", "the second axis", "axis=-1, not axis=1"),
    ],
    "radius * radius - np.sum(nearest * nearest, axis=-1)": [
        ("b * b - (np.sum(f * f, axis=-1) - radius * radius)", "the discriminant of the schoolbook",
         "loses the radius"),
    ],
    "square = radius * radius -": [
        ("square = radius -", "the radius without its square", "not its square"),
        ("square = radius * radius +", "a sum in the discriminant", "wrong discriminant|not subtracted"),
    ],
    "root = np.sqrt(np.maximum(square, 0))": [
        ("root = np.maximum(square, 0)", "no root", "not its root"),
        ("root = 0 * square", "no root at all", "root of the discriminant is missing"),
    ],
    "miss = np.full_like(near, MISS)": [
        ("miss = np.full_like(near, -1.0)", "-1 for a miss", "MISS then"),
        ("miss = np.full_like(near, np.inf)", "inf for a miss", "MISS then"),
        ("miss = np.full(near.shape, MISS, np.float64)", "float64 misses", "among the operands"),
    ],
    "    miss = np.full_like(near, MISS)\n"
    "    return np.where((square > 0) & (far > 0), np.where(near > 0, near, far), miss)": [
        ("    found = np.full(origin.shape[:-1], MISS, origin.dtype)\n    hit = (square > 0) & (far > 0)\n"
         "    found[hit] = np.where(near > 0, near, far)[hit]\n    return found", "the origin's shape",
         "a mask of another shape"),
    ],
    "b[..., None] * direction": [("b * direction", "axes that do not fit", "t\\[..., None\\]|axis")],
    "np.where((square > 0) & (far > 0)": [
        ("np.where((square > 0) and (far > 0)", "`and` of arrays", "np.where, &"),
    ],
    "import numpy as np\n": [("", "no import", "import numpy as np")],
    "def meet_sphere(": [("def meetsphere(", "another name", "gone or renamed")],
    "nearest = f + b[..., None] * direction": [
        ("nearest = f", "the origin, not the nearest point", "discriminant is wrong"),
    ],
}  # fmt: skip
"""New text, the mistake in words, and a pattern of the explanation, by the old text."""
