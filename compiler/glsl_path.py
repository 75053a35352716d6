"""GLSL 3.30 for path kernels: one fragment a pixel; the sums are the colour buffers of one framebuffer."""

from __future__ import annotations

from .glsl import GLSL, PREAMBLE
from .path_dialect import PathDialect


class GLSLPath(GLSL, PathDialect):
    """The dialect's table."""

    entry = "main"
    lanes = 1
    lane_numbers = "0u"
    path_begin = f"""\
{PREAMBLE}
#define MAX_DEPTH {{max_depth}}u /* scatterings of a path */
{{tables}}
{{outputs}}
uniform int width;
uniform int height;
uniform int first_row;
uniform uint first_sample;
uniform int samples;
uniform uint seed_number;
{{scene}}
void main()
{{{{
    {{counter}} x = {{column}} + {{lane_numbers}};
    {{counter}} y = {{row}};
    {{counter}} seed = {{seed}};"""
    path_end = "}}"
    uniforms = {
        "column": "uint(gl_FragCoord.x)",
        "row": "uint(int(gl_FragCoord.y) + first_row)",
        "seed": "seed_number",
        "width": "float(width)",
        "height": "float(height)",
        "sample": "first_sample + uint(n)",
    }
    scalar_float = "float({0})"
    output_declaration = "layout(location = {output}) out vec4 sums_{output};"
    planes_per_output = 4
    max_planes = 32
    sum_store = "sums_{output}[{component}] = {value};"
    path_arguments = (
        "uniforms width, height of the image; first_row; first_sample; samples to add up; seed_number.\n"
        "sums_0, sums_1, ...: RGBA float colour buffers as wide as the image; number 4 k + c is component c\n"
        "of sums_k:\n"
        "{planes}.\n"
        "Draw one triangle that covers them: fragment (x, y) follows pixel x of row first_row + y"
    )
