"""GLSL 4.30 compute shaders for the grouped schedule [emit_group.py]: images stay textures, weights a buffer.

The result is an image, the weights are a storage buffer of `vec4`: the source states the bindings.
"""

from __future__ import annotations

from ..languages.dialect import Parts
from ..languages.glsl_inlined import GLSLInlined
from ..languages.interface import DENOISE, Interface
from .emit_group import GroupDialect, Grouped
from .schedules import PLAIN

SHADER_VERSION = 430
"""The version of GLSL, and of OpenGL, that has compute shaders."""


class GLSLCompute(GroupDialect, GLSLInlined):
    """The dialect's table."""

    kind = "vec4"
    wait = "barrier();"
    literal_zero = "vec4(0.0f)"
    max_output_channels = 4
    pixel_at = "texelFetch(image_{image}, ivec2(column, row), 0)[{c}]"
    entries = GLSLInlined.entries
    local = ("gl_LocalInvocationID.x", "gl_LocalInvocationID.y")
    group = ("gl_WorkGroupID.x", "gl_WorkGroupID.y")
    stored = (
        ("vec4 color = vec4(0.0, 0.0, 0.0, 1.0);",),
        ("imageStore(result, ivec2(x + {p} * GROUP_WIDTH, y), color);",),
    )
    store = "color[{i}] = {value};"
    said = {
        DENOISE: (
            "each image: a texture of 32-bit floats (half floats void the bound), width x height. Texel\n"
            "row 0 is the TOP row of the picture: flip what OpenGL has rendered, whose row 0 is the\n"
            "bottom, or the window stands on its head;\n"
            "weight_buffer: a storage buffer at binding 0, all weights;\n"
            "result: an image of format RGBA32F at binding 0, width x height, row 0 again the top row. "
            "Dispatch\nceil(width / ({pixels} * GROUP_WIDTH)) x ceil(height / GROUP_HEIGHT) groups of "
            "{group} items"
        )
    }

    def begin(self, kernel: Interface, parts: Parts) -> str:
        """Return the text of a shader up to its first statement."""
        first = kernel.images[0].name
        return "\n".join(
            [
                f"#version {SHADER_VERSION} core",
                "#define PRECISE precise",
                parts.top,
                "layout(local_size_x = GROUP_WIDTH, local_size_y = GROUP_HEIGHT) in;",
                *self.images(kernel),
                "layout(std430, binding = 0) restrict readonly buffer weight_buffer { vec4 w[]; };",
                "layout(rgba32f, binding = 0) restrict writeonly uniform image2D result;",
                "shared float tile[TILE_NUMBERS];",
                "",
                "void main()",
                "{",
                f"    int width = textureSize({first}, 0).x;",
                f"    int height = textureSize({first}, 0).y;",
                *self.item_place(),
            ]
        )


def _compute(name: str, idea: str, pixels: int, instead: str = PLAIN) -> Grouped:
    """Return a rung of the ladder."""
    found = Grouped(name, idea, GLSLCompute(), pixels, instead=instead)
    found.language, found.suffix = f"GLSL {SHADER_VERSION / 100:.2f}, compute shader", ".comp"
    return found


GLSL_COMPUTE = (
    _compute(
        "compute",
        "a tile of the image in memory that a work group shares; layers in registers, one pixel each",
        1,
    ),
    _compute("compute4", "the same with 4 pixels an invocation, which share each weight", 4, "compute"),
)
"""The schedules for graphics processors; none of them has been measured on one."""
