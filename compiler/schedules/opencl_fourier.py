"""OpenCL C 1.2 for the Fourier schedule [emit_fourier.py]."""

from __future__ import annotations

from ..languages.dialect import Parts
from ..languages.fourier_dialect import PLACES, FourierDialect
from ..languages.interface import DENOISE, Interface
from .emit_fourier import fourier_ladder
from .opencl_tiled import ALIGNED, OpenCLTiled


class OpenCLFourier(OpenCLTiled, FourierDialect):
    """The dialect's table for vectors of `lanes` floats."""

    zeros = "(vector)(0.0f)"
    said = {DENOISE: f"{ALIGNED}\nGlobal size: at least (ceil(width / {{columns}}), ceil(height / {{rows}}))"}

    def top(self, kernel: Interface, parts: Parts) -> list[str]:
        """Return the lines above the function."""
        return [self.macros, parts.top, PLACES]

    def guard(self, kernel: Interface) -> list[str]:
        """Return the first pixel of the item's tiles; an item outside of the picture ends."""
        return [
            "    int tile_x = (int)get_global_id(0) * TILES * OUT;",
            "    int tile_y = (int)get_global_id(1) * OUT;",
            "    if (tile_x >= width || tile_y >= height) {",
            "        return;",
            "    }",
        ]


OPENCL_FOURIER = fourier_ladder(OpenCLFourier)
"""The schedules beside the ladder."""
