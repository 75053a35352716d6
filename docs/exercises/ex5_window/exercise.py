"""The window around a pixel.

The window of pixel (x, y) has size x size taps. For an even size the pixel is not in the middle: size // 2
taps are before it. Outside of the image a tap has the nearest pixel's value (`clamp`) or 0 (`zero`).
Tutorial: page 4. Clauses: DAT-4, DAT-5, DAT-9.
"""

from __future__ import annotations

from typing import Any


def window(image: Any, x: int, y: int, size: int, border: str) -> Any:
    """Return the window vector (size * size * C,) of a pixel of an image (H, W, C): rows, columns, channels.

    Raises ValueError for a size outside 1 to 64 and for a border that is neither clamp nor zero.
    """
    raise NotImplementedError("window")
