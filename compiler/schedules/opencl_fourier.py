"""OpenCL C 1.2 for the Fourier schedule [emit_fourier.py].

`PLACE` and `SPECTRUM` are the places of a number among a row's and a column's: lanes beyond the first vector
lie in further ones. Functions take arrays of the work item's own.
"""

from __future__ import annotations

from ..languages.dialect import Parts
from ..languages.interface import DENOISE, Interface
from .emit_fourier import Fourier
from .opencl_tiled import ALIGNED, OpenCLTiled

PLACES = """\
#define PLACE(lane, i) (((lane) / LANES * POINTS * 2 + (i)) * LANES + (lane) % LANES)
#define SPECTRUM(lane, f) (((lane) / LANES * POINTS + (f)) * 4 * LANES + (lane) % LANES)"""
"""Where numbers of a row and of a column are."""


class OpenCLFourier(OpenCLTiled):
    """The dialect's table for vectors of `lanes` floats."""

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


def fourier_schedule(name: str, points: int, tiles: int, lanes: int = 16, pixels: int = 14) -> Fourier:
    """Return a schedule with tiles of `points` x `points`, `tiles` side by side."""
    idea = f"products of spectra in place of sums over the window, in tiles of {points} x {points} pixels"
    return Fourier(name, idea, OpenCLFourier(lanes), lanes, pixels, points, tiles)


OPENCL_FOURIER = (fourier_schedule("fft32", 32, 2),)
"""The schedule beside the ladder. Two tiles of 32 points side by side are as fast as four and take half the
memory; one takes a third more time: the weights pass by twice as often."""
