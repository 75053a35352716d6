"""Blocks of pixels: their means are nearly normal, which single pixels of a path tracer are not."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Numbers = NDArray[Any]


def mean_and_variance(mean: Numbers, variance: Numbers, size: int) -> tuple[Numbers, Numbers]:
    """Return block means (H / size, W / size, C) and the variances of one sample of a block.

    A sample of a block is one of each of its pixels, which are independent: variances are averaged, and
    divided by the number of pixels.
    """
    return _averaged(mean, size), _averaged(variance, size) / size**2


def _averaged(image: Numbers, size: int) -> Numbers:
    """Return the means of blocks of an image (H, W, C)."""
    height, width, channels = image.shape
    parts = image.reshape(height // size, size, width // size, size, channels)
    means: Numbers = np.mean(parts, axis=(1, 3))
    return means
