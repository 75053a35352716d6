"""The picture that a host shows of the check pair, as the reference draws it, as PNG."""

from __future__ import annotations

import io

import numpy as np
from numpy.typing import NDArray

from ....refimpl.errors import ExecutorUnavailable

ENLARGED = 12
"""How many times as large each pixel is: the pair has few."""


def beside(noisy: NDArray[np.float32], output: NDArray[np.float32]) -> bytes:
    """Return the pair's colour (H, W, 3) and the reference's output beside it, enlarged, as a file.

    Raises `ExecutorUnavailable` where Pillow is not installed.
    """
    try:
        from PIL import Image
    except ImportError:
        raise ExecutorUnavailable("Pillow is not installed: pip install 'wamnet[full]'") from None
    both = np.concatenate([noisy, output], axis=1).clip(0, 1)
    large = both.repeat(ENLARGED, axis=0).repeat(ENLARGED, axis=1)
    file = io.BytesIO()
    Image.fromarray((255 * large + 0.5).astype(np.uint8)).save(file, format="PNG", optimize=True)
    return file.getvalue()
