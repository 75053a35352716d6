"""GLSL ES 3.00, fragment shaders as WebGL 2 and OpenGL ES 3.0 run them: denoiser, paths and encoding.

They are those of GLSL 3.30 with three exceptions. The version is in the first line, before any comment. A
picture is drawn into at most four buffers at once. There is no `precise`, so a bound rests on a compiler that
keeps the order of operations [`ASSUMES`].

Two hosts own the rest of a fragment shader, Shadertoy's tabs and Godot's canvas items:

1. A denoiser reads feature images, and writes the host's colour. Shadertoy can hold weights only
   in constants [schedules/straight.py]; Godot has a texture.
2. A noisy picture's features come from passes of their own, one feature each, since a pass of either host has
   one colour: a path kernel that encodes its sums [path_kernel.py].

Rows: what a pass writes into texel row 0 is the picture's top row. Shadertoy shows row 0 at the bottom, so
the tab that is shown turns the picture.
"""

from __future__ import annotations

from ..core.profiles import SineContract
from ..kernel.interface import DENOISE
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


# ---- hosts that own the rest ------------------------------------------------------------------------------

CHANNEL_OF = (
    "float channel_of(vec4 texel, int c)",
    "{",
    "    return c == 0 ? texel.r : c == 1 ? texel.g : c == 2 ? texel.b : texel.a;",
    "}",
    "",
)
"""The function that picks a channel: the language has no index into a vector."""


class ShadertoyDenoise(GLSLES):
    """The dialect's table: the tab Image."""

    target = "shadertoy"
    language = "Shadertoy (GLSL ES 3.00), tab Image"
    suffix = ".glsl"
    entries = {DENOISE: "mainImage"}
    ends = {DENOISE: "    fragColor = result;\n}"}
    first: tuple[str, ...] = ()
    preamble = NO_PRECISE
    sampler, colour, started = "#define {name} iChannel{number} /* Buffer */", "", "vec4 "
    main = "void mainImage(out vec4 fragColor, in vec2 fragCoord)"
    fragment = ("int(fragCoord.x)", "int(iResolution.y) - 1 - int(fragCoord.y)")
    max_output_channels = 4
    called = (
        "iChannel0, iChannel1, ...: the buffers of the images in this order, of the size of the view,\n"
        "filter nearest. The result is display-encoded already"
    )


class GodotDenoise(GLSLES):
    """The dialect's table: a shader of a canvas item."""

    target = "godot"
    language = "Godot 4 shading language, canvas item"
    suffix = ".gdshader"
    entries = {DENOISE: "fragment"}
    ends = {DENOISE: "    COLOR = result;\n}"}
    qualifiers = {}
    max_output_channels = 4
    first = ("shader_type canvas_item;", "render_mode unshaded, blend_disabled;")
    preamble = ""
    sampler, colour, started = "uniform sampler2D {name} : filter_nearest, repeat_disable;", "", "vec4 "
    main = "void fragment()"
    fragment = ("int(UV.x * float(width))", "int(UV.y * float(height))")
    above = CHANNEL_OF
    pixel = "channel_of(texelFetch(image_{image}, ivec2({column}, {row}), 0), {c})"
    called = (
        "each image: a texture of 32-bit floats (Image.FORMAT_RGBF), row 0 the picture's top row;\n"
        "weight_texture: Image.FORMAT_RF, 1024 texels wide, as many rows as weights fill, row by row;\n"
        "the item has the images' size in pixels. Colours keep 8 bits. A viewport with HDR 2D keeps 16,\n"
        "but encodes once more what it shows: read from it, and do not show it.\n"
        "The result is display-encoded already"
    )
