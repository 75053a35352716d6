"""A feature of a noisy picture in one pass of a host: paths whose sums stay in a variable, then the encoding.

1. The path kernel adds up the planes of the feature's layer, one sample a pixel [`HOSTS`].
2. The statements of the encoding follow in the same text, and the pass writes the image [`feature_pass`].
"""

from __future__ import annotations

from collections.abc import Sequence

from ...refimpl.network.dataset import Normalization
from ..kernel.interface import PATH, Array, Interface
from ..languages.dialect import Parts
from ..languages.glsl_es import GLSLES
from ..languages.hosts import NO_PRECISE, GodotDenoise
from .emit_path import emit_path
from .encode_kernel import encode_source
from .lower_encode import layers_of
from .lower_scene import PathPrograms


class _ShadertoyPath(GLSLES):
    """The words of a path whose sums stay in a variable, and of the encoding that follows it."""

    target = "shadertoy"
    language = "Shadertoy (GLSL ES 3.00), one buffer a feature"
    suffix = ".glsl"
    first: tuple[str, ...] = ()
    preamble = NO_PRECISE
    max_planes = 4
    most_numbers = 0
    said = {PATH: "{planes}"}

    def read(self, array: Array, index: Sequence[str], lanes: int) -> str:
        """Return a plane of the sums, or a channel of the image."""
        return f"sums_0[{index[0]}]" if array.planes else f"image[{index[-1]}]"

    def path_begin(self, kernel: Interface, parts: Parts) -> list[str]:
        """Return what follows the first lines of a path kernel."""
        return [
            self.depth(parts),
            parts.top,
            "vec4 sums_0;",
            "",
            "void wamnet_trace(ivec2 at, int width, int height, uint seed_number)",
            "{",
            *ONE_SAMPLE,
            *self.path_start(kernel),
        ]

    def place(self, kernel: Interface) -> tuple[str, str]:
        """Return the texts of a pixel's column and row."""
        return ("at.x", "at.y")


ONE_SAMPLE = (
    "    const int first_row = 0;",
    "    const int samples = 1;",
    "    const uint first_sample = 0u;",
)
"""What is a uniform elsewhere."""

NUMBERS = (("width", 512), ("height", 512), ("seed_number", 0))
"""What a script of Godot sets, with values to start with: the item's size in pixels, a number each frame."""


class _GodotPath(_ShadertoyPath):
    """The same for Godot, which knows no `precise` either and has words of its own for what is shared."""

    target = "godot"
    language = "Godot 4 shading language, one canvas item a feature"
    suffix = ".gdshader"
    first = GodotDenoise.first
    qualifiers = {}
    ends = {PATH: "    return sums_0;\n}"}

    def begin(self, kernel: Interface, parts: Parts) -> str:
        """Return the text of a shader up to its first statement."""
        return "\n".join(
            [
                self.depth(parts),
                parts.top,
                *(f"uniform int {name} = {value};" for name, value in NUMBERS),
                "",
                "vec4 wamnet_trace(ivec2 at, uint seed_value)",
                "{",
                "    vec4 sums_0 = vec4(0.0, 0.0, 0.0, 1.0);",
                *ONE_SAMPLE,
                *self.path_start(kernel),
            ]
        )

    def integer(self, kernel: Interface, name: str) -> str:
        """Return the text of an integer that the kernel is given."""
        return "seed_value" if name == "seed_number" else name


SHADERTOY_END = """\

void mainImage(out vec4 fragColor, in vec2 fragCoord)
{{
    wamnet_trace(ivec2(fragCoord), int(iResolution.x), int(iResolution.y), uint(iFrame));
    vec4 image = vec4(0.0, 0.0, 0.0, 1.0);
    const int sample_count = 1;
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
    const int sample_count = 1;
{statements}
    COLOR = image;
}}
"""
"""The end of a feature's shader."""

STATEMENTS = _GodotPath()
"""The words of an encoding in every host: its statements need no order."""

HOSTS = {"shadertoy": (_ShadertoyPath(), SHADERTOY_END), "godot": (_GodotPath(), GODOT_END)}
"""By target: the dialect of a path, and the text after the path."""


def feature_pass(
    programs: PathPrograms,
    feature: str,
    normalization: Normalization,
    target: str,
    header: Sequence[str],
    whole: bool = False,
) -> str:
    """Return the pass that traces one sample a pixel and writes one encoded feature; `whole`: in integers."""
    dialect, end = HOSTS[target]
    text = emit_path(programs, dialect, layers_of((feature,)), header)
    statements = encode_source((feature,), normalization, STATEMENTS, whole=whole)
    return text + end.format(statements=statements)
