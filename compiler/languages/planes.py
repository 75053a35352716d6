"""Dialects of kernels on planes, which the filter and the history are: in OpenCL C, in C99, and in GLSL.

1. In OpenCL C and in C planes are parts of a buffer, tables and images are buffers [`BufferedPlanes`].
2. On processors a level of the filter has several pixels of a row in a work item of OpenCL. It reads whole
   vectors of a row at any column; where these reach beyond the row's ends they are gathered, number by
   number. The branch is in each read: one around all of them took half as long again on PoCL.
3. In C there is a function for one pixel, and one that does all of them.
4. In GLSL planes are textures, four to each, and tables are textures; what is written are colour buffers of
   one framebuffer. A picture's row 0 is row 0 of all of them.

A tap beyond the picture reads the nearest pixel of it.
"""

from __future__ import annotations

from ..kernel.instructions import PRAGMAS
from ..kernel.interface import FOLLOW, GUIDE, SMOOTH, WRITE, Array, Interface
from .c import POPPED, C, includes, loops
from .dialect import Parts
from .glsl import GLSL
from .opencl import OpenCL
from .opencl_path import OpenCLPath, OpenCLVectorPath
from .openings import IMAGES

PLANES = "float, one plane of height rows of row_stride numbers for each of"
"""What the filter's planes are."""

SAID_OF_HISTORY = (
    f"first: {PLANES}:\n{{first}};\n"
    f"past, result: the same of:\n{{past}};\n"
    "image_color: width * height * 3 floats, finite;\n"
    'motions: a row for each primitive by its number, and one for "nothing", of:\n{motion};\n'
    "cameras: one number for each of:\n{cameras};\n"
    "width; height; row_stride: at least width.\n"
    'A first picture has a past of primitive "nothing", and of zeros.\n'
)
"""What the arguments of a history are; how it is called follows."""


class BufferedPlanes:
    """How kernels on planes read and write where planes, tables and images are buffers."""

    load = "float {name} = image_{image}[pixel * {channels} + {channel}];"
    plane_at = "{array}[{plane} * plane + {where}]"
    plane_store = "{array}[{plane} * plane + at] = {value};"
    own_store = plane_store
    table_at = "{array}[{row} * {columns} + {column}]"
    own_row = "size_t own = (size_t)y * stride;"

    def pixel_place(self, name: str, row: str, column: str) -> str:
        """Return the declaration of the place of a pixel in a plane."""
        return f"size_t {name} = (size_t)({row}) * stride + (size_t)({column});"


# ---- OpenCL C ---------------------------------------------------------------------------------------------

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


class _Opening(BufferedPlanes, OpenCL):
    """How the filter's kernels open, and what is said of them; `lanes` pixels in a work item."""

    reach = " * LANES"
    plane_load = "row_at({array} + {plane} * plane + {row}, {column}, width)"
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
        FOLLOW: f"{SAID_OF_HISTORY}Global size: at least (width, height)",
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


# ---- C99 --------------------------------------------------------------------------------------------------

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


class CPlanes(BufferedPlanes, C):
    """The dialect's table."""

    plane_load = "{array}[{plane} * plane + {row} + (size_t)wamnet_tap({column}, width)]"
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
            f"{SAID_OF_HISTORY}"
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
        calls = loops(("x", "y"), ("width", "height"), self.steps, f"{name}({given});")
        return self.around("One pixel (x, y).", one, self.signature(OF_ALL[kernel.role], listed), calls)

    def opening(self, kernel: Interface) -> list[str]:
        """Return the first statements: places in planes and images."""
        places = [
            "    const size_t stride = (size_t)row_stride;",
            "    const size_t plane = (size_t)height * stride;",
            "    const size_t at = (size_t)y * stride + (size_t)x;",
        ]
        pixel = "    const size_t pixel = (size_t)y * (size_t)width + (size_t)x;"
        return places if kernel.role == SMOOTH else [*places, pixel]

    def tap_row(self) -> str:
        """Return the declaration of the first place of a tap's row."""
        return "size_t line = (size_t)wamnet_tap(y + gap * dy, height) * stride;"


# ---- GLSL -------------------------------------------------------------------------------------------------

FOUR = "RGBA textures of 32-bit floats; component c of number k is number 4 k + c of"
"""What planes are."""

WRITTEN = "RGBA float colour buffers in the same order"
"""What written planes are."""

DRAWN = "Draw one triangle that covers them: row 0 is the TOP row of the picture everywhere"
"""How all of them are called."""


class GLSLPlanes(GLSL):
    """The dialect's table."""

    entries = dict.fromkeys((GUIDE, SMOOTH, FOLLOW), "main")
    ends = dict.fromkeys((GUIDE, SMOOTH, FOLLOW), "}")
    integers = {
        GUIDE: (),
        SMOOTH: ("width", "height", "gap"),
        FOLLOW: ("width", "height"),
    }
    load = "PRECISE float {name} = texelFetch(image_{image}, at, 0)[{channel}];"
    plane_at = "texelFetch({array}_{buffer}, {where}, 0)[{component}]"
    plane_load = "texelFetch({array}_{buffer}, ivec2(clamp({column}, 0, width - 1), {row}), 0)[{component}]"
    plane_store = own_store = "{array}_{buffer}[{component}] = {value};"
    table_at = "texelFetch({array}, ivec2({column}, {row}), 0).r"
    own_row = "int own = y;"
    said = {
        GUIDE: (
            "each image: a texture of 32-bit floats, not encoded, without NaN;\n"
            f"guides_0, guides_1, ...: {WRITTEN}, of:\n{{guides}};\n"
            f"light_0: the same of:\n{{light}}.\n{DRAWN}"
        ),
        SMOOTH: (
            f"guides_0, guides_1, ...: {FOUR}\n{{guides}};\n"
            f"light_0: the same of:\n{{light}};\nresult_0: {WRITTEN};\n"
            f"width; height; gap: pixels between taps.\n{DRAWN}"
        ),
        FOLLOW: (
            f"first_0, first_1, ...: {FOUR}\n{{first}};\n"
            f"past_0, past_1: the same of:\n{{past}};\nresult_0, result_1: {WRITTEN};\n"
            "image_color: a texture of 32-bit floats, finite;\n"
            'motions: an R32F texture, a row for each primitive by its number, and one for "nothing", of:\n'
            "{motion};\n"
            "cameras: an R32F texture of one row, of:\n{cameras};\n"
            "width; height.\n"
            f'A first picture has a past of primitive "nothing", and of zeros.\n{DRAWN}'
        ),
    }

    def pixel_place(self, name: str, row: str, column: str) -> str:
        """Return the declaration of the place of a pixel in a plane."""
        return f"ivec2 {name} = ivec2({column}, {row});"

    def tap_row(self) -> str:
        """Return the declaration of a tap's row."""
        return "int line = clamp(y + gap * dy, 0, height - 1);"

    def begin(self, kernel: Interface, parts: Parts) -> str:
        """Return the text of a shader up to its first statement."""
        read = [name for array in kernel.arrays if array.access != WRITE for name in self._names(array)]
        written = [name for array in kernel.arrays if array.access == WRITE for name in self._names(array)]
        return "\n".join(
            [
                self.preamble.format(unordered=self.unordered[parts.bounded]),
                *([parts.top] if parts.top else []),
                *(f"uniform sampler2D {name};" for name in read),
                *(f"layout(location = {number}) out vec4 {name};" for number, name in enumerate(written)),
                *self.uniforms(kernel),
                "",
                "void main()",
                "{",
                "    ivec2 at = ivec2(gl_FragCoord.xy);",
                *(["    int x = at.x;", "    int y = at.y;"] if kernel.integers else []),
                *(f"    {name} = vec4(0.0);" for name in written),
            ]
        )

    def _names(self, array: Array) -> list[str]:
        """Return the names of an array's textures."""
        if not array.planes:
            return [array.name]
        return [f"{array.name}_{number}" for number in range(-(-array.planes // self.planes_per_buffer))]
