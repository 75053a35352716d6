"""Compute shaders whose images, weights, sums and results are storage buffers: GLSL 4.50 for Vulkan, 4.30.

One invocation computes one pixel, in straight copies of the kernels for OpenCL: rows from the top, channels
interleaved. Sizes stand in a uniform block. Translators make SPIR-V, HLSL and Metal from the first one
(kernels/export/tools.py), so that its text uses numbers and arrays alone.
"""

from __future__ import annotations

from .dialect import Dialect
from .encode_dialect import EncodeDialect
from .glsl import GLSL
from .path_dialect import PathDialect
from .profiles import SineContract

GROUP = (8, 8)
"""Invocations (x, y) in a work group: 64, which every implementation of Vulkan and of OpenGL 4.3 takes."""

FIRST_IMAGE = 3
"""Binding of the first image that is read or encoded: 0 are the sizes, 1 and 2 what is read and written."""

INVOCATION = f"layout(local_size_x = {GROUP[0]}, local_size_y = {GROUP[1]}) in;"
"""The size of a work group."""

SIZE = """\
layout(std140, binding = 0) uniform Size {{
    int width;
    int height;
{more}}};
"""
"""The uniform block of the sizes; an invocation outside of them ends."""

PIXEL = """\
void main()
{{
    int x = int(gl_GlobalInvocationID.x);
    int y = int(gl_GlobalInvocationID.y);
    if (x >= width || y >= height) {{
        return;
    }}"""
"""The start of the denoiser and of the encoding."""

BUFFERS = (
    "Storage buffers of floats, rows from the top, channels interleaved; binding 0 is a uniform block of\n"
    "32-bit integers: {sizes}.\n"
)
"""How all these kernels are called."""

GROUPS = f"Groups of {GROUP[0]} x {GROUP[1]}: ceil(width / {GROUP[0]}) x ceil({{rows}} / {GROUP[1]})"
"""What is dispatched."""


def storage(binding: str, access: str, block: str, name: str, of: str = "float") -> str:
    """Return the declaration of a storage buffer; naga knows none that is only written."""
    access = "readonly " if access == "readonly" else ""
    return f"layout(std430, binding = {binding}) restrict {access}buffer {block} {{{{ {of} {name}[]; }}}};"


def sized(*more: str) -> str:
    """Return the uniform block with further numbers."""
    return SIZE.replace("{more}", "".join(f"    {text};\n" for text in more))


class _Vulkan(Dialect):
    """What the three kernels have in common."""

    target = "glsl-vulkan"
    language = "GLSL 4.50 for Vulkan, compute shader"
    suffix = ".comp"
    first: tuple[str, ...] = ("#version 450", "#define PRECISE precise")
    native_sine = SineContract(
        "sin() of Vulkan, which promises 2^-11 on [-pi, pi] alone, and that absolutely", None
    )
    qualifiers = GLSL.qualifiers
    magnitude = GLSL.magnitude
    max_output_channels = 2**16
    table = GLSL.table
    operations = GLSL.operations


class VulkanDenoise(_Vulkan):
    """The dialect's table for denoisers."""

    entry = "main"
    first_binding = FIRST_IMAGE
    image_declaration = storage("{binding}", "readonly", "Image_{image}", "image_{image}")
    image_separator = "\n"
    begin = f"""\
{{defines}}
{INVOCATION}
{sized()}{storage("1", "readonly", "Weights", "weights")}
{storage("2", "writeonly", "Result", "result")}
{{images}}

{PIXEL}"""
    pixel = "image_{image}[(row * width + column) * {channels} + c]"
    weight = "weights[{index}]"
    store = "result[(y * width + x) * {channels} + {i}] = {value};"
    arguments = (
        f"{BUFFERS.format(sizes='width, height')}"
        "1 the weights, 2 the result (width * height * {channels} floats, encoded as `output` says), 3 and\n"
        f"on the images in this order. {GROUPS.format(rows='height')}"
    )


class VulkanPath(_Vulkan, PathDialect):
    """The dialect's table for paths."""

    entry = "main"
    lane_numbers = "0u"
    path_begin = f"""\
#define MAX_DEPTH {{max_depth}}u /* scatterings of a path */
{INVOCATION}
{sized("int first_row", "int rows", "uint first_sample", "int samples", "uint seed_number")}\
{storage("2", "writeonly", "Sums", "sums")}
{{tables}}

void main()
{{{{
    int column = int(gl_GlobalInvocationID.x);
    int row = int(gl_GlobalInvocationID.y);
    if (column >= width || row >= rows) {{{{
        return;
    }}}}
    int plane = rows * width;
    int at = row * width + column;
    {{counter}} x = {{column}} + {{lane_numbers}};
    {{counter}} y = {{row}};
    {{counter}} seed = {{seed}};"""
    path_end = "}}"
    uniforms = {
        "column": "uint(column)",
        "row": "uint(row + first_row)",
        "seed": "seed_number",
        "width": "float(width)",
        "height": "float(height)",
        "sample": "first_sample + uint(n)",
    }
    scalar_float = "float({0})"
    output_declaration = ""
    sum_store = "sums[{plane} * plane + at] = {value};"
    max_planes = 2**16
    path_arguments = (
        f"{BUFFERS.format(sizes='width, height, first_row, rows, first_sample, samples, seed_number')}"
        "2 the sums, one plane of rows * width floats for each of:\n"
        "{planes}.\n"
        f"{GROUPS.format(rows='rows')}; invocation (x, y) follows pixel x of row first_row + y"
    )


class VulkanEncode(_Vulkan, EncodeDialect):
    """The dialect's table for encodings."""

    entry = "main"
    encode_begin = f"""\
{INVOCATION}
{sized("int sample_count")}\
{storage("1", "readonly", "Sums", "sums")}
{{outputs}}

{PIXEL}
    int plane = width * height;
    int at = y * width + x;
    precise float samples = float(sample_count);"""
    encode_end = "}}"
    input_declaration = ""
    output_declaration = storage("{binding}", "writeonly", "Image_{image}", "image_{image}")
    output_separator = "\n"
    load = "precise float {name} = sums[{plane} * plane + at];"
    image_store = "image_{image}[at * {channels} + {channel}] = {value};"
    planes_per_input = 1
    encode_arguments = (
        f"{BUFFERS.format(sizes='width, height, sample_count')}"
        "1 the sums, one plane of width * height floats for each of:\n"
        "{planes};\n"
        f"3 and on the images in this order. {GROUPS.format(rows='height')}"
    )


class _Compute(_Vulkan):
    """The same for OpenGL 4.3."""

    target = "glsl-compute"
    language = "GLSL 4.30, compute shader"
    first: tuple[str, ...] = ("#version 430 core", "#define PRECISE precise")
    native_sine = SineContract("sin() of GLSL 4.30, which promises nothing", None)


class ComputeDenoise(_Compute, VulkanDenoise):
    """The dialect's table for denoisers."""


class ComputePath(_Compute, VulkanPath):
    """The dialect's table for paths."""


class ComputeEncode(_Compute, VulkanEncode):
    """The dialect's table for encodings."""
