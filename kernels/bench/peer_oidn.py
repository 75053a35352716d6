"""Intel Open Image Denoise as a peer: another denoiser, made for all scenes, with a quality and no error.

It is given linear colour, albedo and normal; in the benchmark these two have no noise ("clean"). Source: its
documentation, filter `RT`, parameters `hdr`, `cleanAux` and `quality`.
"""

from __future__ import annotations

from functools import partial

import numpy as np
from numpy.typing import NDArray

from ...refimpl.denoise import Model
from ...refimpl.encoding import to_display
from ...refimpl.frame import Frame
from .contender import Contender, Opened, Tools, told_as_missing
from .workload import Given

LAYERS = ("color", "albedo", "normal")
"""Layers that it is given, in the order of its arguments."""


QUALITIES = ("fast", "balanced", "high")
"""Its qualities, worst first."""


def filtered(
    color: Frame, aux: Frame | None = None, clean: bool = False, quality: str = "high"
) -> NDArray[np.float32]:
    """Return the denoised radiance (H, W, 3) of a frame's colour; `aux` is where albedo and normal come from.

    `clean`: albedo and normal have no noise, and are not smoothed.
    """
    with told_as_missing("pyoidn"):
        import pyoidn
    frames = [color] if aux is None else [color, aux, aux]
    images = [
        np.ascontiguousarray(frame[name], np.float32) for frame, name in zip(frames, LAYERS, strict=False)
    ]
    found: NDArray[np.float32] = pyoidn.denoise(*images, hdr=True, clean_aux=clean, quality=quality)
    return found


def _open(quality: str, tools: Tools, model: Model, size: int) -> Opened:
    """Return its filter with a quality."""
    with told_as_missing("pyoidn"):
        import pyoidn  # noqa: F401

    def run(given: Given) -> NDArray[np.float32]:
        return filtered(given.frame, given.frame, True, quality)

    stops = model.normalization.exposure_stops
    return Opened(
        run, "Open Image Denoise, CPU device", display=lambda color: np.asarray(to_display(color, stops))
    )


CONTENDERS = tuple(
    Contender(
        f"oidn:{quality}",
        f"Open Image Denoise, quality {quality}; another denoiser",
        partial(_open, quality),
        variant=None,
        packages=("pyoidn",),
    )
    for quality in ("fast", "high")
)
"""Two of its qualities."""
