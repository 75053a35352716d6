"""GLSL ES 3.00, fragment shaders as WebGL 2 and OpenGL ES 3.0 run them: denoiser, paths and encoding.

They are those of GLSL 3.30 but for three things: the version stands in the first line, before any comment; a
picture is drawn into at most four buffers at once; and there is no `precise`, so that a bound rests on a
compiler that keeps the order of operations [`ASSUMES`].
"""

from __future__ import annotations

from .dialect import Dialect
from .encode_dialect import GLSLEncode
from .glsl import GLSL, PREAMBLE, WEIGHT_TEXTURE_WIDTH
from .glsl_inlined import GLSLInlined
from .glsl_path import GLSLPath
from .profiles import SineContract

VERSION = "#version 300 es"
"""The first line of a shader: the language allows nothing before it."""

MOST_BUFFERS = 4
"""Colour buffers that every implementation draws into at once (MAX_DRAW_BUFFERS)."""

ES_PREAMBLE = """\
precision highp float;
precision highp int;
precision highp sampler2D;
#define PRECISE /* GLSL ES 3.00 has no `precise` */"""
"""What stands in the place of the first lines of GLSL 3.30: numbers of 32 bits everywhere."""

ASSUMES = (
    "the compiler keeps the order of the operations of an expression, fused or not: the language has no word "
    "to demand it. Run the check pair on a new device before you rely on the bound"
)
"""What a bound rests on in a language without `precise`."""

NATIVE_SINE = SineContract("sin() of GLSL ES 3.00, which promises nothing", None)
"""The target's own sine."""

TEXTURES = "float textures to draw into need EXT_color_buffer_float in OpenGL ES 3.0 and WebGL 2"
"""What callers of all these shaders must know."""


WEIGHTS = f"""\
{{images}}
uniform sampler2D weight_texture;

vec4 weights(int texel)
{{{{
    ivec2 place = ivec2(texel % {WEIGHT_TEXTURE_WIDTH}, texel / {WEIGHT_TEXTURE_WIDTH});
    return texelFetch(weight_texture, place, 0);
}}}}
"""
"""What a packed kernel declares besides the images."""


class _ES(Dialect):
    """What the shaders have in common."""

    target = "glsl-es"
    language = "GLSL ES 3.00, fragment shader"
    native_sine = NATIVE_SINE
    assumes = ASSUMES
    unordered = ("", "")
    first: tuple[str, ...] = (VERSION,)
    indexes_results = False


class GLSLES(_ES, GLSL):
    """The dialect's table."""

    begin = GLSL.begin.replace(PREAMBLE, ES_PREAMBLE)
    max_output_channels = 4 * MOST_BUFFERS
    arguments = f"{GLSL.arguments}.\n{TEXTURES}"


class GLSLESInlined(_ES, GLSLInlined):
    """The dialect's table for weights in the source."""

    begin = GLSLInlined.begin.replace(PREAMBLE, ES_PREAMBLE)
    max_output_channels = 4 * MOST_BUFFERS
    arguments = f"{GLSLInlined.arguments}.\n{TEXTURES}"


class GLSLESPacked(_ES, GLSLInlined):
    """The dialect's table for weights in a texture of four floats a texel."""

    begin = GLSLInlined.begin.replace(PREAMBLE, ES_PREAMBLE).replace("{images}", WEIGHTS)
    max_output_channels = 4 * MOST_BUFFERS
    arguments = GLSL.arguments.replace("R32F", "RGBA32F") + f".\n{TEXTURES}"


class GLSLESPath(_ES, GLSLPath):
    """The dialect's table for paths."""

    path_begin = GLSLPath.path_begin.replace(PREAMBLE, ES_PREAMBLE)
    path_arguments = f"{GLSLPath.path_arguments}.\n{TEXTURES}"
    max_planes = 4 * MOST_BUFFERS
    scene_numbers = "uniform vec4 scene_numbers[{vectors}];\n"
    scene_number = "scene_numbers[{vector}].{component}"


class GLSLESEncode(_ES, GLSLEncode):
    """The dialect's table for encodings."""

    encode_begin = GLSLEncode.encode_begin.replace(PREAMBLE, ES_PREAMBLE)
    encode_arguments = f"{GLSLEncode.encode_arguments}.\n{TEXTURES}"
