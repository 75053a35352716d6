"""Blocks: how much more a picture's error jumps at the borders of patches than elsewhere.

1. The error of a picture against its reference is taken, so that the scene's own edges do not count.
2. Mean absolute differences of neighbouring pixels, across the borders of patches, and all others [`jumps`].
3. Their ratio [`blockiness`] is 1 where the borders are like any other place, and grows with blocks.

Source: the blockiness B and the activity A of Wang, Sheikh, Bovik, "No-reference Perceptual Quality
Assessment of JPEG Compressed Images", ICIP 2002 (equations 2 to 5), which take the differences of the picture
itself: here they are those of its error, and both directions are taken together.
"""

from collections.abc import Sequence

import numpy as np

from wamnet.refimpl.errors import InputError
from wamnet.refimpl.frame import Floats


def jumps(error: Floats, size: int) -> tuple[float, float, int, int]:
    """Return sums of absolute differences of (H, W, 3) across borders and elsewhere, and their numbers."""
    across, inside, n_across, n_inside = 0.0, 0.0, 0, 0
    for axis in (0, 1):
        steps = np.abs(np.diff(error.astype(np.float64), axis=axis))
        at = np.arange(1, error.shape[axis]) % size == 0
        border = np.compress(at, steps, axis=axis)
        rest = np.compress(~at, steps, axis=axis)
        across, inside = across + float(border.sum()), inside + float(rest.sum())
        n_across, n_inside = n_across + border.size, n_inside + rest.size
    return across, inside, n_across, n_inside


def blockiness(pictures: Sequence[tuple[Floats, Floats]], size: int) -> float:
    """Return the ratio over (picture, reference) pairs (H, W, 3), for patches of size x size pixels."""
    found = [jumps(np.asarray(image, np.float64) - target, size) for image, target in pictures]
    across, inside, n_across, n_inside = (sum(numbers) for numbers in zip(*found, strict=True))
    if not n_across:
        rule = f"a picture needs borders of patches of {size} pixels"
        raise InputError("pictures for the measure of blocks", len(pictures), rule, "use larger ones")
    if inside == 0.0:
        return 1.0 if across == 0.0 else float("inf")
    return (across / n_across) / (inside / n_inside)
