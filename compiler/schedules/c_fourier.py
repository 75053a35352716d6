"""C for the Fourier schedule [emit_fourier.py], with the vectors of GCC and clang.

C99 has no vector type with operators, and structures would need a function call for every sum of a transform.
Other compilers stop at an error that names the tiled schedules, which are plain C99 there [c_tiled.py].
"""

from __future__ import annotations

from ..languages.c import STACK, includes
from ..languages.dialect import Parts
from ..languages.fourier_dialect import PLACES, FourierDialect
from ..languages.interface import DENOISE, Interface
from ..languages.openings import IMAGES, WEIGHTS_RESULT
from .c_tiled import FUSED, STRAIGHT, CTiled, from_weights, gnu_vectors
from .emit_fourier import fourier_ladder

REFUSED = """\
#if !defined(__GNUC__)
#error this schedule needs the vectors of GCC or clang: export a schedule of tiles for other compilers
#endif"""
"""What other compilers say."""


class CFourier(CTiled, FourierDialect):
    """The dialect's table for vectors of `lanes` floats."""

    zeros = "(wamnet_vector){0}"
    functions = "static void"
    own = "wamnet_"
    spectrum = "spectrum"
    pixels = (
        "TILES * OUT x OUT pixels from (tile_x, tile_y) on, or to the picture's end: their channels are "
        "written\n   to `result`, the whole picture's array."
    )
    first_pixel = ("tile_x", "tile_y")
    steps = ("x += TILES * OUT", "y += OUT")
    said = {
        DENOISE: (
            f"{IMAGES};\n{WEIGHTS_RESULT};\nwidth; height: fewer than 2^31 numbers an image.\n"
            "wamnet_image does the whole picture, wamnet_pixel {columns} x {rows} pixels from (x, y) on:\n"
            "call that from your own loops, for each x that is a multiple of {columns} and each y of {rows}\n"
            f"{STACK}"
        )
    }

    def __init__(self, lanes: int) -> None:
        self.lanes_of_type = lanes

    def top(self, kernel: Interface, parts: Parts) -> list[str]:
        """Return the lines above the functions."""
        head = includes(DENOISE, "float", "math", "stdbool", "stdint")
        vectors = gnu_vectors(str(self.lanes_of_type))
        return [*head, self.unordered[parts.bounded], REFUSED, FUSED, STRAIGHT, vectors, parts.top, PLACES]

    def hold(self, name: str, index: str, total: str) -> str:
        """Return the statement that puts a vector into an array of numbers, as vector `index`."""
        return f"*(wamnet_vector *)({name} + ({index}) * LANES) = {total};"

    def least(self, a: str, b: str) -> str:
        """Return the text of the smaller one of two integers."""
        return f"{a} < {b} ? {a} : {b}"

    def weights_at(self, offset: int, index: str = "") -> str:
        """Return the text of a vector of the weights from `offset` on."""
        return f"*(const wamnet_vector *)({from_weights(offset)} + {index or 0} * LANES)"


C_FOURIER = fourier_ladder(CFourier)
"""The schedules beside the ladder."""
