"""A feature of a noisy picture in one pass of a host: paths whose sums stay in a variable, then the encoding.

1. The path kernel adds up the planes of the feature's layer, one sample a pixel [`HOSTS`].
2. The statements of the encoding follow in the same text, and the pass writes the image [`feature_pass`].
"""

from __future__ import annotations

from collections.abc import Sequence

from ..refimpl.dataset import Normalization
from .emit_path import emit_path
from .encode_dialect import EncodeDialect, GLSLEncode
from .encode_kernel import encode_source
from .glsl_es import GLSLESPath
from .hosts import GodotDenoise
from .lower_encode import layers_of
from .lower_scene import PathPrograms


class _ShadertoyPath(GLSLESPath):
    """The words of a path whose sums stay in a variable."""

    target = "shadertoy"
    language = "Shadertoy (GLSL ES 3.00), one buffer a feature"
    suffix = ".glsl"
    first: tuple[str, ...] = ()
    max_planes = 4
    path_begin = """\
#define PRECISE /* GLSL ES 3.00 has no `precise` */
#define MAX_DEPTH {max_depth}u /* scatterings of a path */
{tables}
vec4 sums_0;

void wamnet_trace(ivec2 at, int width, int height, uint seed_number)
{{
    const int first_row = 0;
    const int samples = 1;
    const uint first_sample = 0u;
    {counter} x = {column} + {lane_numbers};
    {counter} y = {row};
    {counter} seed = {seed};"""
    output_declaration = ""
    uniforms = {**GLSLESPath.uniforms, "column": "uint(at.x)", "row": "uint(at.y + first_row)"}
    path_arguments = "{planes}"


NUMBERS = (("width", 512), ("height", 512), ("seed_number", 0))
"""What a script of Godot sets, with values to start with."""

UNIFORMS = "".join(f"uniform int {name} = {value};\n" for name, value in NUMBERS)
"""What a script sets: the size of the item in pixels, and a number for each frame."""


class _GodotPath(_ShadertoyPath):
    """The same for Godot, which knows no `precise` either and has words of its own for what is shared."""

    target = "godot"
    language = "Godot 4 shading language, one canvas item a feature"
    suffix = ".gdshader"
    first = GodotDenoise.first
    qualifiers = {}
    path_begin = (
        _ShadertoyPath.path_begin.replace("#define PRECISE /* GLSL ES 3.00 has no `precise` */\n", "")
        .replace("vec4 sums_0;\n\nvoid wamnet_trace(ivec2 at,", "vec4 wamnet_trace(ivec2 at,")
        .replace("{{\n", "{{\n    vec4 sums_0 = vec4(0.0, 0.0, 0.0, 1.0);\n", 1)
        .replace("{tables}", "{tables}\n" + UNIFORMS)
        .replace("int width, int height, uint seed_number", "uint seed_value")
    )
    uniforms = {**_ShadertoyPath.uniforms, "seed": "seed_value"}
    path_end = "    return sums_0;\n}}"


class _HostEncode(GLSLEncode, EncodeDialect):
    """The statements of an encoding, between a host's own lines."""

    encode_begin = ""
    encode_end = ""
    first = ()
    qualifiers = {}
    output_declaration = ""
    load = "float {name} = sums_0[{component}];"
    image_store = "image[{channel}] = {value};"


SHADERTOY_END = """\

void mainImage(out vec4 fragColor, in vec2 fragCoord)
{{
    wamnet_trace(ivec2(fragCoord), int(iResolution.x), int(iResolution.y), uint(iFrame));
    vec4 image = vec4(0.0, 0.0, 0.0, 1.0);
    float samples = 1.0f;
{statements}
    fragColor = image;
}}
"""
"""The end of a buffer's tab: every frame has random numbers of its own."""

GODOT_END = """\

void fragment()
{{
    ivec2 at = ivec2(UV * vec2(float(width), float(height)));
    vec4 sums_0 = wamnet_trace(at, uint(seed_number));
    vec4 image = vec4(0.0, 0.0, 0.0, 1.0);
    float samples = 1.0f;
{statements}
    COLOR = image;
}}
"""
"""The end of a feature's shader."""

HOSTS = {"shadertoy": (_ShadertoyPath(), SHADERTOY_END), "godot": (_GodotPath(), GODOT_END)}
"""By target: the words of a path, and what stands behind it."""


def feature_pass(
    programs: PathPrograms, feature: str, normalization: Normalization, target: str, header: Sequence[str]
) -> str:
    """Return the pass that traces one sample a pixel and writes one encoded feature."""
    dialect, end = HOSTS[target]
    text = emit_path(programs, dialect, layers_of((feature,)), header)
    statements = encode_source((feature,), normalization, _HostEncode())
    return text + end.format(statements=statements)
