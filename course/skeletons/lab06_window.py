"""The window around a pixel, and the features in it.

The window of pixel (x, y) has size x size taps. For an even size the pixel is not in the middle: size // 2
taps are before it. Outside of the image a tap has the nearest pixel's value (`clamp`) or 0 (`zero`).

What a network sees is bounded: albedo is clipped to [0, 1], a normal to [-1, 1], and depth becomes
clip(depth / depth_scale, 0, 1). The features are computed in float64 and rounded once to float32. Tutorial:
page 4. Clauses: DAT-1, DAT-3, DAT-4, DAT-5, DAT-6, DAT-9.
"""

from __future__ import annotations

from typing import Any


def feature_image(albedo: Any, normal: Any, depth: Any, depth_scale: float) -> Any:
    """Return the image (H, W, 7), float32, of albedo and normal (H, W, 3) and depth (H, W, 1), in this order.

    Raises ValueError for a depth_scale that is not above 0.
    """
    raise NotImplementedError("feature_image")


def window(image: Any, x: int, y: int, size: int, border: str) -> Any:
    """Return the window vector (size * size * C,) of a pixel of an image (H, W, C): rows, columns, channels.

    Raises ValueError for a size outside 1 to 64, for a border that is neither clamp nor zero, and for a pixel
    that the image does not have.
    """
    raise NotImplementedError("window")
