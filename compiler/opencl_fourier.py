"""OpenCL C 1.2 for the Fourier schedule [emit_fourier.py].

`PLACE` and `SPECTRUM` are the places of a number among a row's and a column's: lanes beyond the first vector
lie in further ones. Functions take arrays of the work item's own.
"""

from __future__ import annotations

from .emit_fourier import Fourier
from .opencl_tiled import BEGIN, OpenCLTiled

VECTORS, ENTRY = BEGIN.replace("{defines}\n", "").split("__kernel", 1)
ARGUMENTS, _ = ENTRY.split("    int x = ", 1)

START = f"""\
{VECTORS}{{defines}}
#define PLACE(lane, i) (((lane) / LANES * POINTS * 2 + (i)) * LANES + (lane) % LANES)
#define SPECTRUM(lane, f) (((lane) / LANES * POINTS + (f)) * 4 * LANES + (lane) % LANES)
__kernel{ARGUMENTS}    int tile_x = (int)get_global_id(0) * TILES * OUT;
    int tile_y = (int)get_global_id(1) * OUT;
    if (tile_x >= width || tile_y >= height) {{{{
        return;
    }}}}"""
"""What stands before the statements; `@lanes@` is the length of a vector."""


class OpenCLFourier(OpenCLTiled):
    """The dialect's table for vectors of `lanes` floats."""

    arguments = OpenCLTiled.arguments.replace(
        "(ceil(width / {pixels}), height)", "(ceil(width / {columns}), ceil(height / {rows}))"
    )

    def __init__(self, lanes: int) -> None:
        super().__init__(lanes)
        self.begin = START.replace("@lanes@", str(lanes))


def fourier_schedule(name: str, points: int, tiles: int, lanes: int = 16, pixels: int = 14) -> Fourier:
    """Return a schedule with tiles of `points` x `points`, `tiles` side by side."""
    idea = f"products of spectra in place of sums over the window, in tiles of {points} x {points} pixels"
    return Fourier(name, idea, OpenCLFourier(lanes), lanes, pixels, points, tiles)


OPENCL_FOURIER = (fourier_schedule("fft32", 32, 2),)
"""The schedule beside the ladder. Two tiles of 32 points side by side are as fast as four and take half the
memory; one takes a third more time: the weights pass by twice as often."""
