"""C99 for kernels on planes, of the filter and the history: one pixel a call, and a function that does all.

A tap beyond the picture reads the nearest pixel of it: rows and columns are clamped where they are read.
"""

from __future__ import annotations

from .c import ALL_PIXELS, POPPED, PRAGMAS, C, includes, loops
from .dialect import Parts
from .interface import FOLLOW, GUIDE, SMOOTH, Interface
from .openings import IMAGES, PLANES

CLAMP = """\
/* The nearest of `count` places to one that may be outside. */
static inline int wamnet_tap(int place, int count)
{
    return place < 0 ? 0 : place < count ? place : count - 1;
}
"""
"""The function that keeps taps inside of the picture."""

OF_ALL = {GUIDE: "wamnet_guide", SMOOTH: "wamnet_smooth", FOLLOW: "wamnet_follow"}
"""The functions of all pixels."""


class CPlanes(C):
    """The dialect's table."""

    load = "float {name} = image_{image}[pixel * {channels} + {channel}];"
    plane_load = "{array}[{plane} * plane + {row} + (size_t)wamnet_tap({column}, width)]"
    plane_store = "{array}[{plane} * plane + at] = {value};"
    entries = {role: f"{name}_pixel" for role, name in OF_ALL.items()}
    ends = dict.fromkeys(OF_ALL, POPPED)
    said = {
        GUIDE: (
            f"{IMAGES}, not encoded, without NaN;\nguides: {PLANES}:\n{{guides}};\n"
            f"light: the same of:\n{{light}};\nwidth; height; row_stride: at least width.\n"
            "wamnet_guide does all pixels, wamnet_guide_pixel one: call that from your own loops"
        ),
        SMOOTH: (
            f"guides: {PLANES}:\n{{guides}};\n"
            f"light, result: the same of:\n{{light}};\n"
            "width; height; row_stride: at least width; gap: pixels between taps.\n"
            "wamnet_smooth does all pixels, wamnet_smooth_pixel one: call that from your own loops"
        ),
        FOLLOW: (
            f"first: {PLANES}:\n{{first}};\n"
            f"past, result: the same of:\n{{past}};\n"
            "image_color: width * height * 3 floats, finite;\n"
            'motions: a row for each primitive by its number, and one for "nothing", of:\n{motion};\n'
            "cameras: one number for each of:\n{cameras};\n"
            "width; height; row_stride: at least width.\n"
            'A first picture has a past of primitive "nothing", and of zeros.\n'
            "wamnet_follow does all pixels, wamnet_follow_pixel one: call that from your own loops"
        ),
    }

    def top(self, kernel: Interface, parts: Parts) -> list[str]:
        """Return the lines above the functions."""
        head = includes(kernel.role, "float", "math", "stdbool", "stddef", "stdint")
        own = [parts.top, CLAMP] if kernel.role == SMOOTH else [""]
        return [*head, self.unordered[parts.bounded], PRAGMAS, *own]

    def head(self, kernel: Interface) -> list[str]:
        """Return the functions up to the statements of a pixel: one for a pixel, one for all of them."""
        name, listed = self.entries[kernel.role], self.listed(kernel)
        one = self.signature(name, [*listed, "int x", "int y"])
        given = ", ".join([*(array.name for array in kernel.arrays), *kernel.integers, "x", "y"])
        return [
            "/* One pixel (x, y). */",
            *one[:-1],
            f"{one[-1]};",
            "",
            ALL_PIXELS,
            *self.signature(OF_ALL[kernel.role], listed),
            "{",
            *loops(("x", "y"), ("width", "height"), self.steps, f"{name}({given});"),
            "}",
            "",
            *one,
            "{",
        ]

    def opening(self, kernel: Interface) -> list[str]:
        """Return the first statements: places in planes and images."""
        places = [
            "    const size_t stride = (size_t)row_stride;",
            "    const size_t plane = (size_t)height * stride;",
            "    const size_t at = (size_t)y * stride + (size_t)x;",
        ]
        pixel = "    const size_t pixel = (size_t)y * (size_t)width + (size_t)x;"
        return places if kernel.role == SMOOTH else [*places, pixel]

    def place_of(self, row: str, column: str) -> str:
        """Return the place of a pixel in a plane."""
        return f"(size_t){row} * stride + (size_t){column}"

    def tap_row(self) -> str:
        """Return the declaration of the first place of a tap's row."""
        return "size_t line = (size_t)wamnet_tap(y + gap * dy, height) * stride;"
