"""The picture that a host shows of the check pair, as the reference draws it, as PNG."""

from __future__ import annotations

import struct
import zlib

import numpy as np
from numpy.typing import NDArray

ENLARGED = 12
"""How many times as large each pixel is: the pair has few."""


def png(picture: NDArray[np.uint8]) -> bytes:
    """Return a picture (H, W, 3) as a file."""
    height, width, _ = picture.shape
    rows = b"".join(b"\0" + row.tobytes() for row in picture)
    head = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    parts = ((b"IHDR", head), (b"IDAT", zlib.compress(rows, 9)), (b"IEND", b""))
    return b"\x89PNG\r\n\x1a\n" + b"".join(_chunk(*part) for part in parts)


def _chunk(kind: bytes, data: bytes) -> bytes:
    """Return a part of such a file."""
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def beside(noisy: NDArray[np.float32], output: NDArray[np.float32]) -> bytes:
    """Return the pair's colour (H, W, 3) and the reference's output beside it, enlarged, as a file."""
    both = np.concatenate([noisy, output], axis=1).clip(0, 1)
    large = both.repeat(ENLARGED, axis=0).repeat(ENLARGED, axis=1)
    return png((255 * large + 0.5).astype(np.uint8))
