"""How far the colours of a picture are off, whatever its noise: errors of means.

A picture is cut into tiles; the error of a tile is the length of the difference of mean colours, so that
noise and blur, which keep means, hardly count. One tile compares the pictures' mean colours.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wamnet.refimpl.errors import InputError
from wamnet.refimpl.frame import Floats

TILES = 8
"""Tiles along each side: large enough that noise is averaged out, small enough for each wall to have some."""


def tile_means(picture: Floats, tiles: int = TILES) -> NDArray[np.float64]:
    """Return the mean colours (tiles, tiles, 3) of a picture (H, W, 3)."""
    height, width = picture.shape[:2]
    if not 1 <= tiles <= min(height, width):
        raise InputError("tiles", tiles, f"from 1 to {min(height, width)}, the picture's side", "take fewer")
    rows, columns = (np.linspace(0, side, tiles + 1).astype(int)[:-1] for side in (height, width))
    sums = np.add.reduceat(np.add.reduceat(np.asarray(picture, np.float64), rows, axis=0), columns, axis=1)
    sizes = np.diff([*rows, height])[:, None] * np.diff([*columns, width])
    means: NDArray[np.float64] = sums / sizes[..., None]
    return means


def color_error(picture: Floats, target: Floats, tiles: int = TILES) -> float:
    """Return the mean length of the difference of mean colours over tiles of two pictures (H, W, 3)."""
    if picture.shape != target.shape:
        raise InputError("shape of the picture", picture.shape, f"the target's is {target.shape}", "crop one")
    difference = tile_means(picture, tiles) - tile_means(target, tiles)
    return float(np.mean(np.sqrt(np.sum(difference**2, axis=-1))))
