"""Parts of an image in which a kernel is compared with the reference, and the share of its bound there."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Picture = NDArray[np.float32]

ODD = (75, 101)
"""Height and width of the image that is compared as a whole."""

PATCH = (8, 64)
"""Height and width of the parts of the timed image that are compared."""

Patch = tuple[slice, slice]
"""Rows and columns of an image."""


def patches(size: tuple[int, int]) -> list[Patch]:
    """Return what is compared: all of the small image, both corners and the middle of the other."""
    if size == ODD:
        return [(slice(0, size[0]), slice(0, size[1]))]
    least = [min(most, length) for most, length in zip(PATCH, size, strict=True)]
    places = [
        [(length - most) * part // 2 for length, most in zip(size, least, strict=True)] for part in range(3)
    ]
    return [(slice(row, row + least[0]), slice(column, column + least[1])) for row, column in places]


def cropped(images: Mapping[str, Picture], reach: int, patch: Patch) -> tuple[dict[str, Picture], Patch]:
    """Return what the windows of a patch touch, and where the patch is in it."""
    size = next(iter(images.values())).shape
    outer = [
        slice(max(0, s.start - reach), min(n, s.stop + reach)) for s, n in zip(patch, size, strict=False)
    ]
    inner = [slice(s.start - o.start, s.stop - o.start) for s, o in zip(patch, outer, strict=True)]
    return {name: image[outer[0], outer[1]] for name, image in images.items()}, (inner[0], inner[1])


@dataclass(frozen=True)
class Wanted:
    """What a kernel must write: patches of the reference's image, and how far each number may be off."""

    patches: Sequence[Patch]
    value: Sequence[NDArray[np.float64]]
    bound: Sequence[NDArray[np.float64]]

    def share(self, picture: Picture) -> tuple[float, float]:
        """Return the largest error and the largest share of its bound; NaN is infinitely wrong."""
        error = most = 0.0
        for patch, value, bound in zip(self.patches, self.value, self.bound, strict=True):
            off = np.abs(picture[patch].astype(np.float64) - value)
            off = np.where(np.isnan(off), np.inf, off)
            with np.errstate(divide="ignore"):
                shares = np.divide(off, bound, out=np.zeros_like(off), where=off != 0)
            error, most = max(error, float(off.max())), max(most, float(shares.max()))
        return error, most
