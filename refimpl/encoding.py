"""From linear light to what a screen shows, and back.

1. Exposure scales linear radiance by a power of two: one stop doubles it [`expose`].
2. The result is clipped to [0, 1], because a screen has a white [`to_display`].
3. The sRGB transfer function of IEC 61966-2-1 encodes it [`srgb_encode`], and its inverse decodes it
   [`srgb_decode`], [`from_display`].
4. For files of 8 bits a channel the encoded value is rounded to the nearest of 256 levels [`to_8bit`]; a
   level stands for one encoded value [`from_8bit`].

Only the transfer function is taken from sRGB: no colour space is converted, the three channels stay what the
scene says they are. The clip is the one step that loses information, so `from_display` inverts `to_display`
only on [0, 2**-exposure_stops].
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .frame import Floats

LINEAR_LIMIT = 0.0031308
"""Linear values up to this one are encoded by a straight line (IEC 61966-2-1)."""

ENCODED_LIMIT = 0.04045
"""Encoded values up to this one lie on that line; the standard rounds 12.92 * 0.0031308 to it."""

SLOPE = 12.92
"""Slope of the line at black (IEC 61966-2-1)."""

OFFSET = 0.055
"""Offset that joins the power curve to the line (IEC 61966-2-1)."""

GAMMA = 2.4
"""Exponent of the power curve (IEC 61966-2-1); the curve as a whole is close to an exponent of 2.2."""

LEVELS = 255
"""Largest 8-bit level; level k stands for k / 255."""


def srgb_encode(linear: Floats) -> Floats:
    """Encode linear values (...) in [0, 1] with sRGB's transfer function; negative values follow the line."""
    # Keep the argument of the power away from the branch that is not taken, where it might be negative.
    curve = (1.0 + OFFSET) * np.maximum(linear, LINEAR_LIMIT) ** (1.0 / GAMMA) - OFFSET
    return np.where(linear <= LINEAR_LIMIT, SLOPE * linear, curve)


def srgb_decode(encoded: Floats) -> Floats:
    """Decode sRGB-encoded values (...) in [0, 1] to linear ones; negative values follow the line."""
    curve = ((np.maximum(encoded, ENCODED_LIMIT) + OFFSET) / (1.0 + OFFSET)) ** GAMMA
    return np.where(encoded <= ENCODED_LIMIT, encoded / SLOPE, curve)


def expose(linear: Floats, exposure_stops: float) -> Floats:
    """Scale linear radiance (...) by 2**exposure_stops."""
    return linear * float(2.0**exposure_stops)


def to_display(linear: Floats, exposure_stops: float = 0.0) -> Floats:
    """Turn linear radiance (...) into display-encoded colour in [0, 1]: expose, clip, encode."""
    return srgb_encode(np.clip(expose(linear, exposure_stops), 0.0, 1.0))


def from_display(encoded: Floats, exposure_stops: float = 0.0) -> Floats:
    """Turn display-encoded colour (...) in [0, 1] back into linear radiance: decode, undo the exposure."""
    return expose(srgb_decode(encoded), -exposure_stops)


def to_8bit(encoded: Floats) -> NDArray[np.uint8]:
    """Round finite encoded values (...), clipped to [0, 1], to levels 0 ... 255, halves up."""
    # Round in float64, so that float32 and float64 images of the same values give the same file.
    levels: Any = np.floor(LEVELS * np.clip(np.asarray(encoded, np.float64), 0.0, 1.0) + 0.5)
    return np.asarray(levels, np.uint8)


def from_8bit(levels: NDArray[np.uint8]) -> NDArray[np.float64]:
    """Return the encoded values (...) in [0, 1] that levels 0 ... 255 stand for."""
    return levels / float(LEVELS)


def normal_to_display(normal: Floats) -> Floats:
    """Map normals (..., 3) from [-1, 1] to [0, 1] for viewing; no normal (0) becomes mid grey."""
    return np.clip(0.5 * normal + 0.5, 0.0, 1.0)
