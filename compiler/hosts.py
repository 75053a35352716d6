"""Fragment shaders inside a host that owns the rest: Shadertoy's tabs and Godot's canvas items.

1. A denoiser reads feature images, and writes the host's colour. Shadertoy has constants alone to hold
   weights [emit_inlined.py]; Godot has a texture.
2. A noisy picture's features come from passes of their own, one feature each, since a pass of either host has
   one colour: a path kernel whose sums stay in variables, then the feature's encoding [host_pass.py].

Rows: what a pass writes into texel row 0 is the picture's top row. Shadertoy shows row 0 at the bottom, so
the tab that is shown turns the picture.
"""

from __future__ import annotations

from .glsl import GLSL
from .glsl_es import ASSUMES, GLSLESInlined
from .profiles import SineContract

CHANNELS = 4
"""Inputs of a Shadertoy tab, iChannel0 to iChannel3, and buffers that feed them: A to D."""

TURNED = "int(iResolution.y) - 1 - int(fragCoord.y)"
"""The picture's row of a pixel that Shadertoy shows."""


class ShadertoyDenoise(GLSLESInlined):
    """The dialect's table: the tab Image."""

    target = "shadertoy"
    language = "Shadertoy (GLSL ES 3.00), tab Image"
    suffix = ".glsl"
    entry = "mainImage"
    first: tuple[str, ...] = ()
    native_sine = SineContract("sin() of GLSL ES 3.00, which promises nothing", None)
    max_output_channels = 4
    image_declaration = "#define image_{image} iChannel{binding} /* Buffer */"
    result_declaration = ""
    result_start = ""
    begin = f"""\
#define PRECISE /* GLSL ES 3.00 has no `precise` */
{{images}}
{{defines}}
void mainImage(out vec4 fragColor, in vec2 fragCoord)
{{{{
    int x = int(fragCoord.x);
    int y = {TURNED};
    vec4 result = vec4(0.0, 0.0, 0.0, 1.0);"""
    end = "    fragColor = result;\n}}"
    arguments = (
        "iChannel0, iChannel1, ...: the buffers of the images in this order, of the size of the view,\n"
        "filter nearest. The result is display-encoded already"
    )


class GodotDenoise(GLSL):
    """The dialect's table: a shader of a canvas item."""

    target = "godot"
    language = "Godot 4 shading language, canvas item"
    suffix = ".gdshader"
    entry = "fragment"
    native_sine = ShadertoyDenoise.native_sine
    assumes = ASSUMES
    unordered = ("", "")
    qualifiers = {}
    max_output_channels = 4
    first = ("shader_type canvas_item;", "render_mode unshaded, blend_disabled;")
    image_declaration = "uniform sampler2D image_{image} : filter_nearest, repeat_disable;"
    result_declaration = ""
    result_start = ""
    indexes_results = False
    begin = """\
{defines}
{images}
uniform sampler2D weight_texture : filter_nearest, repeat_disable;

float weights(int index)
{{
    return texelFetch(weight_texture, ivec2(index % 1024, index / 1024), 0).r;
}}

float channel_of(vec4 texel, int c)
{{
    return c == 0 ? texel.r : c == 1 ? texel.g : c == 2 ? texel.b : texel.a;
}}

void fragment()
{{
    int width = textureSize(image_{image}, 0).x;
    int height = textureSize(image_{image}, 0).y;
    int x = int(UV.x * float(width));
    int y = int(UV.y * float(height));
    vec4 result = vec4(0.0, 0.0, 0.0, 1.0);"""
    end = "    COLOR = result;\n}}"
    pixel = "channel_of(texelFetch(image_{image}, ivec2(column, row), 0), c)"
    arguments = (
        "each image: a texture of 32-bit floats (Image.FORMAT_RGBF), row 0 the picture's top row;\n"
        "weight_texture: Image.FORMAT_RF, 1024 texels wide, as many rows as weights fill, row by row;\n"
        "the item has the images' size in pixels, and a viewport with HDR 2D, or colours keep 8 bits.\n"
        "The result is display-encoded already"
    )
