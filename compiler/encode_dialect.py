"""What a target's language looks like in an encoding kernel: the words of its skeleton.

encode_kernel.py fills the templates in. Names in braces: `entry`, `inputs`, `outputs` and `unordered` of the
whole kernel; `plane` the number of a plane of sums and `name` its variable, `buffer` and `component` its
place where a texture holds several; `image`, `channels`, `channel`, `value` and `location` of an image.
"""

from __future__ import annotations

from .dialect import Dialect
from .glsl import GLSL, PREAMBLE
from .opencl import OpenCL


class EncodeDialect(Dialect):
    """One language; a subclass sets every attribute that has no value here."""

    entry = "wamnet_encode"
    encode_begin: str
    encode_end = "}}"
    input_declaration: str
    output_declaration: str
    output_separator: str
    load: str
    image_store: str
    encode_arguments: str
    planes_per_input: int


class OpenCLEncode(OpenCL, EncodeDialect):
    """OpenCL C 1.2: one work item a pixel; the sums are one buffer, each image one of its own."""

    entry = EncodeDialect.entry
    encode_begin = """\
__kernel void {entry}(
    __global const float *restrict sums,
{outputs},
    int width,
    int height,
    int row_stride,
    int plane_stride,
    int sample_count)
{{
    int x = (int)get_global_id(0);
    int y = (int)get_global_id(1);
    if (x >= width || y >= height) {{
        return;
    }}
    size_t at = (size_t)y * (size_t)row_stride + (size_t)x;
    size_t plane = (size_t)plane_stride;
    size_t pixel = (size_t)y * (size_t)width + (size_t)x;
    float samples = (float)sample_count;"""
    encode_end = "}}"
    input_declaration = ""
    output_declaration = "    __global float *restrict image_{image}"
    output_separator = ",\n"
    load = "float {name} = sums[{plane} * plane + at];"
    image_store = "image_{image}[pixel * {channels} + {channel}] = {value};"
    encode_arguments = (
        "sums: float, one plane of plane_stride numbers for each of:\n"
        "{planes};\n"
        "each image: width * height * channels floats, rows from the top, channels interleaved;\n"
        "width; height; row_stride: numbers from row to row of a plane; plane_stride; sample_count.\n"
        "Global size: at least (width, height)"
    )
    planes_per_input = 1


class GLSLEncode(GLSL, EncodeDialect):
    """GLSL 3.30, fragment shader: one fragment a pixel; an image is one colour buffer of the framebuffer."""

    entry = "main"
    encode_begin = f"""\
{PREAMBLE}
{{inputs}}
{{outputs}}
uniform int sample_count;

void main()
{{{{
    ivec2 at = ivec2(gl_FragCoord.xy);
    PRECISE float samples = float(sample_count);"""
    encode_end = "}}"
    input_declaration = "uniform sampler2D sums_{buffer};"
    output_declaration = "layout(location = {location}) out vec4 image_{image};"
    output_separator = "\n"
    load = "PRECISE float {name} = texelFetch(sums_{buffer}, at, 0)[{component}];"
    image_store = "image_{image}[{channel}] = {value};"
    encode_arguments = (
        "sums_0, sums_1, ...: RGBA textures of 32-bit floats; component c of sums_k is number 4 k + c of\n"
        "{planes};\n"
        "sample_count;\n"
        "each image: a float colour buffer of the same size (RGBA; channels that a feature lacks mean\n"
        "nothing). Draw one triangle that covers them: row 0 stays row 0"
    )
    planes_per_input = 4
