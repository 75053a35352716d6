"""Fragment shaders inside a host that owns the rest: Shadertoy's tabs and Godot's canvas items.

1. A denoiser reads feature images, and writes the host's colour. Shadertoy can hold weights only
   in constants [schedules/inlined.py]; Godot has a texture.
2. A noisy picture's features come from passes of their own, one feature each, since a pass of either host has
   one colour: a path kernel that encodes its sums [host_pass.py].

Rows: what a pass writes into texel row 0 is the picture's top row. Shadertoy shows row 0 at the bottom, so
the tab that is shown turns the picture.
"""

from __future__ import annotations

from ..core.profiles import SineContract
from ..kernel.interface import DENOISE, WEIGHTS, Interface
from .dialect import Parts
from .glsl import GLSL
from .glsl_es import ASSUMES, GLSLES

CHANNELS = 4
"""Inputs of a Shadertoy tab, iChannel0 to iChannel3, and buffers that feed them: A to D."""

TURNED = "int(iResolution.y) - 1 - int(fragCoord.y)"
"""The picture's row of a pixel that Shadertoy shows."""


NO_PRECISE = "#define PRECISE /* GLSL ES 3.00 has no `precise` */"
"""The first line of a tab."""

NOTHING_YET = "    vec4 result = vec4(0.0, 0.0, 0.0, 1.0);"
"""What a result starts with."""

NEAREST = "filter_nearest, repeat_disable"
"""How Godot reads a texture."""

FETCH = (
    "float weights(int index)",
    "{",
    "    return texelFetch(weight_texture, ivec2(index % 1024, index / 1024), 0).r;",
    "}",
)
"""The function that reads a weight."""

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
    native_sine = SineContract("sin() of GLSL ES 3.00, which promises nothing", None)
    max_output_channels = 4
    said = {
        DENOISE: (
            "iChannel0, iChannel1, ...: the buffers of the images in this order, of the size of the view,\n"
            "filter nearest. The result is display-encoded already"
        )
    }

    def denoise_begin(self, kernel: Interface, parts: Parts) -> list[str]:
        """Return what follows the first lines of a denoiser."""
        return [
            *(
                f"#define {image.name} iChannel{number} /* Buffer */"
                for number, image in enumerate(kernel.images)
            ),
            parts.top,
            "void mainImage(out vec4 fragColor, in vec2 fragCoord)",
            "{",
            "    int x = int(fragCoord.x);",
            f"    int y = {TURNED};",
            f"    int width = textureSize({kernel.images[0].name}, 0).x;",
            f"    int height = textureSize({kernel.images[0].name}, 0).y;",
            NOTHING_YET,
        ]


class GodotDenoise(GLSL):
    """The dialect's table: a shader of a canvas item."""

    target = "godot"
    language = "Godot 4 shading language, canvas item"
    suffix = ".gdshader"
    entries = {DENOISE: "fragment"}
    ends = {DENOISE: "    COLOR = result;\n}"}
    native_sine = ShadertoyDenoise.native_sine
    assumes = ASSUMES
    unordered = ("", "")
    qualifiers = {}
    max_output_channels = 4
    first = ("shader_type canvas_item;", "render_mode unshaded, blend_disabled;")
    indexes_results = False
    pixel = "channel_of(texelFetch(image_{image}, ivec2({column}, {row}), 0), {c})"
    said = {
        DENOISE: (
            "each image: a texture of 32-bit floats (Image.FORMAT_RGBF), row 0 the picture's top row;\n"
            "weight_texture: Image.FORMAT_RF, 1024 texels wide, as many rows as weights fill, row by row;\n"
            "the item has the images' size in pixels. Colours keep 8 bits. A viewport with HDR 2D keeps 16,\n"
            "but encodes once more what it shows: read from it, and do not show it.\n"
            "The result is display-encoded already"
        )
    }

    def begin(self, kernel: Interface, parts: Parts) -> str:
        """Return the text of a shader up to its first statement."""
        texture = [f"uniform sampler2D weight_texture : {NEAREST};"] if kernel.named(WEIGHTS) else []
        first = kernel.images[0].name
        return "\n".join(
            [
                parts.top,
                *(f"uniform sampler2D {image.name} : {NEAREST};" for image in kernel.images),
                *texture,
                "",
                *(FETCH if texture else ()),
                "",
                *CHANNEL_OF,
                "void fragment()",
                "{",
                f"    int width = textureSize({first}, 0).x;",
                f"    int height = textureSize({first}, 0).y;",
                "    int x = int(UV.x * float(width));",
                "    int y = int(UV.y * float(height));",
                NOTHING_YET,
            ]
        )
