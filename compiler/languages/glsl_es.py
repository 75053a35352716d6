"""GLSL ES 3.00, fragment shaders as WebGL 2 and OpenGL ES 3.0 run them: denoiser, paths and encoding.

They are those of GLSL 3.30 with three exceptions. The version is in the first line, before any comment. A
picture is drawn into at most four buffers at once. There is no `precise`, so a bound rests on a compiler that
keeps the order of operations [`ASSUMES`].
"""

from __future__ import annotations

from ..core.profiles import SineContract
from .glsl import GLSL

VERSION = "#version 300 es"
"""The first line of a shader: the language allows nothing before it."""

MOST_BUFFERS = 4
"""Colour buffers that every implementation draws into at once (MAX_DRAW_BUFFERS)."""

NO_PRECISE = "#define PRECISE /* GLSL ES 3.00 has no `precise` */"
"""What stands for a word that the language lacks."""

ES_PREAMBLE = f"""\
precision highp float;
precision highp int;
precision highp sampler2D;
{NO_PRECISE}"""
"""What replaces the first lines of GLSL 3.30: numbers of 32 bits everywhere."""

ASSUMES = (
    "the compiler keeps the order of the operations of an expression, fused or not, and rounds to nearest: "
    "the language has no word to demand it. Run the check pair on a new device before you rely on the bound"
)
"""What a bound rests on in a language without `precise`."""

TEXTURES = "float textures to draw into need EXT_color_buffer_float in OpenGL ES 3.0 and WebGL 2"
"""What callers of all these shaders must know."""


class GLSLES(GLSL):
    """The dialect's table."""

    target = "glsl-es"
    language = "GLSL ES 3.00, fragment shader"
    native_sine = SineContract("sin() of GLSL ES 3.00, which promises nothing", None)
    assumes = ASSUMES
    unordered = ("", "")
    first: tuple[str, ...] = (VERSION,)
    preamble = ES_PREAMBLE
    indexes_results = False
    max_output_channels = 4 * MOST_BUFFERS
    max_planes = 4 * MOST_BUFFERS
    covered = f"{GLSL.covered}.\n{TEXTURES}"
