"""Windows around the pixels of images (H, W, C): which taps they have, and what lies outside an image.

1. The image is padded by the border rule [`pad`], so that every pixel has a full window.
2. The window of a pixel is the network's input vector: of some pixels [`windows_at`, `gathered`], of all
   [`all_windows`].

The window's size is the paper's (*WAMnet for Image Denoising*); which of its pixels is the centre and the
border rule are decisions, explained in the chapter of this module.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError, choice

Array = NDArray[Any]

LARGEST_WINDOW_PX = 64
"""Largest window: 64 x 64 pixels of 16 channels are 65,536 numbers a pixel, far beyond any use. A typing
error is refused before it takes all memory."""

BORDERS: Mapping[str, str] = {"clamp": "edge", "zero": "constant"}
"""Border rules, by name, as NumPy's padding modes: repeat the nearest pixel, or see zeros."""


@dataclass(frozen=True)
class Window:
    """The pixels that the network sees: `size` x `size` around a pixel, `border` outside the image."""

    size: int = 12
    border: str = "clamp"

    @property
    def before(self) -> int:
        """Taps above (and left of) the pixel; as many less one are below when the size is even."""
        return self.size // 2

    @property
    def after(self) -> int:
        """Taps below (and right of) the pixel."""
        return self.size - self.size // 2 - 1


def check_window(window: Window) -> None:
    """Refuse a size or a border rule that means nothing."""
    if not isinstance(window.size, int) or not 1 <= window.size <= LARGEST_WINDOW_PX:
        rule = f"must be an integer from 1 to {LARGEST_WINDOW_PX}"
        raise InputError("window size", window.size, rule, "the paper's is 12")
    if window.border not in BORDERS:
        raise InputError("window border", window.border, "unknown", choice(window.border, BORDERS))


def pad(image: Array, window: Window, axes: tuple[int, ...] = (0, 1)) -> Array:
    """Extend (H, W, C) by the border rule to (H + size - 1, W + size - 1, C), or along some `axes` only."""
    margins = [(window.before, window.after) if axis in axes else (0, 0) for axis in range(3)]
    mode: Any = BORDERS[window.border]
    padded: Array = np.pad(image, margins, mode=mode)
    return padded


def windows_at(image: Array, y: Any, x: Any, window: Window) -> Array:
    """Return the window vectors (N, size * size * C) of the pixels y (N,), x (N,) of image (H, W, C).

    Element (dy, dx, c) in C order is channel c of the pixel at (y + dy - size // 2, x + dx - size // 2).
    """
    padded = pad(image, window)
    corner = np.asarray(y, np.int64) * padded.shape[1] + np.asarray(x, np.int64)
    return gathered(padded.reshape(-1), corner, padded.shape[1], image.shape[2], window.size)


def all_windows(padded: Array, window: Window, axes: tuple[int, ...] = (0, 1)) -> Array:
    """Return the windows (H, W, size * size * C) of all pixels of the image that was padded to `padded`.

    Along one of the `axes` only, they are a column (0) or a row (1) of `size` pixels.
    """
    sizes = (window.size,) * len(axes)
    views = np.lib.stride_tricks.sliding_window_view(padded, sizes, axis=axes)
    height, width = views.shape[:2]
    # NumPy puts the window's axes last, (H, W, C, dy, dx); a window vector has the channel last.
    return np.moveaxis(views, 2, -1).reshape(height, width, -1)


def gathered(values: Array, corner: NDArray[np.int64], row_px: Any, channels: int, size: int) -> Array:
    """Return windows (N, size * size * channels) of padded images, laid out flat in `values` (P * channels,).

    `corner` (N,) is the flat pixel index of each window's first tap, `row_px` the pixels from row to row. The
    taps of one window row are neighbours in memory: a run of size * channels numbers.
    """
    runs = np.lib.stride_tricks.sliding_window_view(values, size * channels)[::channels]
    rows = corner[:, None] + np.arange(size) * np.reshape(row_px, (-1, 1))
    windows: Array = runs[rows].reshape(len(corner), -1)
    return windows
