"""Metal Shading Language: kernels of one pixel a thread on device buffers, bound as those for Vulkan.

Metal's compiler relaxes arithmetic unless it is told not to: `MTLCompileOptions.mathMode = .safe`, or
`fastMathEnabled = false` before macOS 15, or `-fno-fast-math` on its command line.
"""

from __future__ import annotations

from .c import C
from .cuda import CUDA, CUDAEncode, CUDAPath
from .dialect import Dialect
from .encode_dialect import EncodeDialect
from .glsl_buffers import FIRST_IMAGE
from .path_dialect import PathDialect
from .profiles import SineContract

ASSUMES = (
    "the library is compiled with MTLCompileOptions.mathMode = .safe (fastMathEnabled = false before macOS "
    "15, -fno-fast-math offline): the default relaxes arithmetic. Products may be fused with sums"
)
"""What the source cannot check by itself."""

TOP = """\
#include <metal_stdlib>
using namespace metal;
"""
"""The first lines."""

THREAD = "uint2 thread_place [[thread_position_in_grid]]"
"""The place of a thread."""

CALLED = (
    "Buffer 0 are the sizes, 32-bit integers: {sizes}; then buffers of floats, rows from the top,\n"
    "channels interleaved: {buffers}.\n"
    "Dispatch {width} x {height} threads, or more, in groups of any size"
)
"""How all these kernels are called."""


def sized(*numbers: str) -> str:
    """Return the structure of the sizes."""
    return "struct Size {{\n" + "".join(f"    {number};\n" for number in numbers) + "}};\n"


def _outside(column: str, row: str, rows: str) -> str:
    """Return the start of a kernel: a thread outside of the picture ends."""
    return f"""\
    int width = size.width;
    int {column} = int(thread_place.x);
    int {row} = int(thread_place.y);
    if ({column} >= width || {row} >= {rows}) {{{{
        return;
    }}}}"""


class _Metal(Dialect):
    """What the three kernels have in common."""

    target = "metal"
    language = "Metal Shading Language"
    suffix = ".metal"
    native_sine = SineContract("sin() of Metal, 4 ulp in safe mode, less in others", None)
    assumes = ASSUMES
    types = Dialect.types
    max_output_channels = 2**16
    table = "constant {type} {name}[{count}] = {{{values}}};"
    operations = {
        **C.operations,
        "absolute": "fabs({0})",
        "floor": "floor({0})",
        "sqrt": "sqrt({0})",
        "power": "pow({0}, {1})",
        "sin": "sin({0})",
        "cos": "cos({0})",
        "minimum": "min({0}, {1})",
        "maximum": "max({0}, {1})",
    }


class Metal(_Metal):
    """The dialect's table for denoisers."""

    entry = "wamnet_denoise"
    first_binding = FIRST_IMAGE
    image_declaration = "    device const float *image_{image} [[buffer({binding})]]"
    image_separator = ",\n"
    begin = f"""\
{TOP}
{{defines}}
{sized("int width", "int height")}
kernel void {{entry}}(
    constant Size &size [[buffer(0)]],
    device const float *weights [[buffer(1)]],
    device float *result [[buffer(2)]],
{{images}},
    {THREAD})
{{{{
{_outside("x", "y", "size.height")}
    int height = size.height;"""
    pixel = CUDA.pixel
    weight = CUDA.weight
    store = CUDA.store
    arguments = CALLED.format(
        sizes="width, height",
        buffers="1 the weights, 2 the result (width *\n"
        "height * {channels} floats, encoded as `output` says), 3 and on the images in this order",
        width="width",
        height="height",
    )


class MetalPath(_Metal, PathDialect):
    """The dialect's table for paths."""

    entry = PathDialect.entry
    lane_numbers = "0u"
    path_begin = f"""\
#define MAX_DEPTH {{max_depth}}u /* scatterings of a path */
{TOP}
{
        sized(
            "int width",
            "int height",
            "int first_row",
            "int rows",
            "uint first_sample",
            "int samples",
            "uint seed_number",
        )
    }
{{tables}}
kernel void {{entry}}(
    constant Size &size [[buffer(0)]],
    device float *sums [[buffer(2)]],
    {THREAD})
{{{{
{_outside("column", "row", "size.rows")}
    int samples = size.samples;
    int plane = size.rows * width;
    int at = row * width + column;
    {{counter}} x = {{column}} + {{lane_numbers}};
    {{counter}} y = {{row}};
    {{counter}} seed = {{seed}};"""
    path_end = "}}"
    uniforms = {
        "column": "uint(column)",
        "row": "uint(row + size.first_row)",
        "seed": "size.seed_number",
        "width": "float(width)",
        "height": "float(size.height)",
        "sample": "size.first_sample + uint(n)",
    }
    scalar_float = "float({0})"
    output_declaration = ""
    sum_store = CUDAPath.sum_store
    max_planes = 2**16
    path_arguments = (
        CALLED.format(
            sizes="width, height, first_row, rows, first_sample, samples,\nseed_number",
            buffers="2 the sums, one plane of rows * width floats for each of:\n{planes}",
            width="width",
            height="rows",
        )
        + "; thread (x, y) follows pixel x of row first_row + y"
    )


class MetalEncode(_Metal, EncodeDialect):
    """The dialect's table for encodings."""

    entry = EncodeDialect.entry
    encode_begin = f"""\
{TOP}
{sized("int width", "int height", "int sample_count")}
kernel void {{entry}}(
    constant Size &size [[buffer(0)]],
    device const float *sums [[buffer(1)]],
{{outputs}},
    {THREAD})
{{{{
{_outside("x", "y", "size.height")}
    int plane = width * size.height;
    int at = y * width + x;
    float samples = float(size.sample_count);"""
    encode_end = "}}"
    input_declaration = ""
    output_declaration = "    device float *image_{image} [[buffer({binding})]]"
    output_separator = ",\n"
    load = CUDAEncode.load
    image_store = CUDAEncode.image_store
    planes_per_input = 1
    encode_arguments = CALLED.format(
        sizes="width, height, sample_count",
        buffers="1 the sums, one plane of\nwidth * height floats for each of:\n"
        "{planes};\n3 and on the images in this order",
        width="width",
        height="height",
    )
