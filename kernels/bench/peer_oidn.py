"""Intel Open Image Denoise as a peer: another denoiser, made for all scenes, with a quality and no error.

It is given linear colour, albedo and normal; these two have no noise ("clean"). Source: its documentation,
filter `RT`, parameters `hdr`, `cleanAux` and `quality`.
"""

from __future__ import annotations

from functools import partial

import numpy as np
from numpy.typing import NDArray

from ...refimpl.denoise import Model
from ...refimpl.encoding import to_display
from .contender import Contender, Opened, Tools, told_as_missing
from .workload import Given

LAYERS = ("color", "albedo", "normal")
"""Layers that it is given, in the order of its arguments."""


def _open(quality: str, tools: Tools, model: Model, size: int) -> Opened:
    """Return its filter with a quality."""
    with told_as_missing("pyoidn"):
        import pyoidn

    def run(given: Given) -> NDArray[np.float32]:
        images = [np.ascontiguousarray(given.frame[name], np.float32) for name in LAYERS]
        found: NDArray[np.float32] = pyoidn.denoise(*images, hdr=True, clean_aux=True, quality=quality)
        return found

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
