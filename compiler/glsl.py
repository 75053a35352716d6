"""GLSL 3.30 fragment shader: one fragment a pixel; images and weights are textures.

`precise` (GL_ARB_gpu_shader5) keeps the compiler from rewriting (x - k P1) - k P2 as x - k (P1 + P2), which
plain GLSL allows and which would undo the sine's range reduction. A kernel with an error bound does not
compile without it.
"""

from __future__ import annotations

from .dialect import Dialect
from .profiles import SineContract

WEIGHT_TEXTURE_WIDTH = 1024
"""Texels in a row of the weight texture: every implementation takes 1024 rows of 1024, a million weights."""


MOST_RESULTS = 8
"""Colour buffers that every implementation of OpenGL 3.3 draws into at once (MAX_DRAW_BUFFERS)."""

ORDER_EXTENSION = "GL_ARB_gpu_shader5"
"""The extension of OpenGL 3.3 that brings `precise`."""

PREAMBLE = f"""\
#version 330 core
#extension {ORDER_EXTENSION} : enable
#if defined({ORDER_EXTENSION}) || __VERSION__ >= 400
#define PRECISE precise
#else
{{unordered}}
#endif"""
"""First lines of a shader: `PRECISE` stands before temporaries, where the compiler knows it."""


class GLSL(Dialect):
    """The dialect's table."""

    target = "opengl"
    language = "GLSL 3.30, fragment shader"
    suffix = ".frag"
    entry = "main"
    image_declaration = "uniform sampler2D image_{image};"
    image_separator = "\n"
    begin = f"""\
{PREAMBLE}
{{defines}}
{{images}}
uniform sampler2D weight_texture;
{{results}}

float weights(int index)
{{{{
    ivec2 texel = ivec2(index % {WEIGHT_TEXTURE_WIDTH}, index / {WEIGHT_TEXTURE_WIDTH});
    return texelFetch(weight_texture, texel, 0).r;
}}}}

void main()
{{{{
    int width = textureSize(image_{{image}}, 0).x;
    int height = textureSize(image_{{image}}, 0).y;
    int x = int(gl_FragCoord.x);
    int y = int(gl_FragCoord.y);
{{starts}}"""
    pixel = "texelFetch(image_{image}, ivec2(column, row), 0)[c]"
    weight = "weights({index})"
    store = "{result}[{i}] = {value};"
    result_declaration = "layout(location = {number}) out vec4 {result};"
    result_start = "    {result} = vec4(0.0, 0.0, 0.0, 1.0);"
    arguments = (
        "each image: a texture of 32-bit floats (half floats void the bound), width x height. Texel\n"
        "row 0 is the TOP row of the picture: flip what OpenGL has rendered, whose row 0 is the\n"
        "bottom, or the window stands on its head;\n"
        f"weight_texture: R32F, {WEIGHT_TEXTURE_WIDTH} texels wide, as many rows as weights fill (the last\n"
        "padded), row by row; it is read with texelFetch alone, so filters do not matter;\n"
        "result: a float colour buffer of width x height, row 0 again the top row; no sRGB conversion by\n"
        "the target, the values are encoded already. Draw one triangle that covers it"
    )
    max_output_channels = 4 * MOST_RESULTS
    channels_per_result = 4
    magnitude = "abs({0})"
    native_sine = SineContract("sin() of GLSL 3.30, which promises nothing", None)
    qualifiers = {"float32": "PRECISE "}
    table = "const {type} {name}[{count}] = {type}[{count}]({values});"
    unordered = (
        "#define PRECISE",
        f"#error the error bound needs `precise`: {ORDER_EXTENSION}, or #version 400",
    )
    operations = {
        **Dialect.operations,
        "absolute": "abs({0})",
        "minimum": "min({0}, {1})",
        "maximum": "max({0}, {1})",
        "convert": "{type}({0})",
    }
