"""OpenCL C 1.2 for kernels on planes: the history, and the filter, of several pixels of a row in a work item.

A level reads whole vectors of a row at any column. Where these reach beyond the row's ends they are gathered,
number by number. The branch is in each read: one around all of them took half as long again on PoCL.
"""

from __future__ import annotations

from .dialect import Parts
from .interface import FOLLOW, GUIDE, SMOOTH, Interface
from .opencl import OpenCL
from .opencl_path import OpenCLPath, OpenCLVectorPath
from .openings import IMAGES, PLANES

READS = """\
/* Numbers of a row from a column on; beyond the row's ends they are those at its ends. */
{type} row_at(__global const float *restrict row, int column, int width)
{{
{body}
}}
"""
"""The function that reads a plane."""

OF_ONE = "    return row[clamp(column, 0, width - 1)];"
"""Its statements where a work item computes one pixel."""

OF_VECTORS = """\
    if (column >= 0 && column + LANES <= width) {{
        return vload{lanes}(0, row + column);
    }}
    float all[LANES];
    for (int i = 0; i < LANES; ++i) {{
        all[i] = row[clamp(column + i, 0, width - 1)];
    }}
    return vload{lanes}(0, all);"""
"""Its statements where a work item computes several."""


class _Opening(OpenCL):
    """How the filter's kernels open, and what is said of them; `lanes` pixels in a work item."""

    reach = " * LANES"
    load = "float {name} = image_{image}[pixel * {channels} + {channel}];"
    plane_load = "row_at({array} + {plane} * plane + {row}, {column}, width)"
    plane_store = "{array}[{plane} * plane + at] = {value};"
    entries = {GUIDE: "wamnet_guide", SMOOTH: "wamnet_smooth", FOLLOW: "wamnet_follow"}
    ends = dict.fromkeys((GUIDE, SMOOTH, FOLLOW), "}")
    said = {
        GUIDE: (
            f"{IMAGES}, not encoded, without NaN;\nguides: {PLANES}:\n{{guides}};\n"
            f"light: the same of:\n{{light}};\nwidth; height; row_stride: at least width.\n"
            "Global size: at least (width, height)"
        ),
        SMOOTH: (
            f"guides: {PLANES}:\n{{guides}};\n"
            f"light, result: the same of:\n{{light}};\n"
            "width; height; row_stride: at least width, a multiple of {lanes}; gap: pixels between taps.\n"
            "Work item (i, j) computes {lanes} pixels from {lanes} * i of row j on:\n"
            "global size at least (ceil(width / {lanes}), height)"
        ),
        FOLLOW: (
            f"first: {PLANES}:\n{{first}};\n"
            f"past, result: the same of:\n{{past}};\n"
            "image_color: width * height * 3 floats, finite;\n"
            'motions: a row for each primitive by its number, and one for "nothing", of:\n{motion};\n'
            "cameras: one number for each of:\n{cameras};\n"
            "width; height; row_stride: at least width.\n"
            'A first picture has a past of primitive "nothing", and of zeros.\n'
            "Global size: at least (width, height)"
        ),
    }

    def top(self, kernel: Interface, parts: Parts) -> list[str]:
        """Return the lines above the function."""
        defined = [f"#define LANES {self.lanes}"]
        return [*defined, parts.top, self.reader()] if kernel.role == SMOOTH else defined

    def reader(self) -> str:
        """Return the function that reads a plane."""
        body = OF_ONE if self.lanes == 1 else OF_VECTORS.format(lanes=self.lanes)
        return READS.format(type=self.types["float32"], body=body)

    def start(self, kernel: Interface) -> list[str]:
        """Return the first statements: places in planes and images."""
        pixel = ["    size_t pixel = (size_t)y * (size_t)width + (size_t)x;"] * (kernel.role != SMOOTH)
        return [
            "    size_t stride = (size_t)row_stride;",
            "    size_t plane = (size_t)height * stride;",
            "    size_t at = (size_t)y * stride + (size_t)x;",
            *pixel,
        ]

    def offset(self, name: str, value: str) -> str:
        """Return the declaration of a place in memory."""
        return f"size_t {name} = {value};"

    def place_of(self, row: str, column: str) -> str:
        """Return the place of a pixel in a plane."""
        return f"(size_t){row} * stride + (size_t){column}"

    def tap_row(self) -> str:
        """Return the declaration of the first place of a tap's row."""
        return "size_t line = (size_t)clamp(y + gap * dy, 0, height - 1) * stride;"


class OpenCLPlanes(_Opening, OpenCLPath):
    """The dialect's table for one pixel in a work item."""


class OpenCLVectorPlanes(_Opening, OpenCLVectorPath):
    """The dialect's table for 4, 8 or 16 pixels in a work item."""

    def __init__(self, lanes: int) -> None:
        super().__init__(lanes)
        self.plane_store = f"vstore{lanes}({{value}}, 0, {{array}} + {{plane}} * plane + at);"


def of_lanes(lanes: int) -> OpenCLPlanes | OpenCLVectorPlanes:
    """Return the dialect for a number of pixels in a work item."""
    return OpenCLPlanes() if lanes == 1 else OpenCLVectorPlanes(lanes)
