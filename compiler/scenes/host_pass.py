"""A feature of a noisy picture in one pass of a host: a path kernel that encodes what it adds up.

It adds up the planes of the feature's layer, one sample per pixel, and returns channels [`HOSTS`].
"""

from __future__ import annotations

from collections.abc import Sequence

from ...refimpl.network.dataset import Normalization
from ..kernel.interface import PATH, Array, Interface
from ..languages.dialect import Parts
from ..languages.glsl_es import GLSLES
from ..languages.hosts import NO_PRECISE, GodotDenoise
from .encode_kernel import encoding_of
from .lower_encode import layers_of
from .lower_scene import PathPrograms
from .path_kernel import renderer_of


class _ShadertoyPath(GLSLES):
    """The words of a path, and of the encoding at its end, whose channels are those of a variable."""

    target = "shadertoy"
    language = "Shadertoy (GLSL ES 3.00), one buffer a feature"
    suffix = ".glsl"
    first: tuple[str, ...] = ()
    preamble = NO_PRECISE
    most_numbers = 0
    said = {PATH: ""}
    paints = True
    fragment = ("at.x", "at.y")
    ends = {
        PATH: """\
    return image;
}

void mainImage(out vec4 fragColor, in vec2 fragCoord)
{
    fragColor = wamnet_trace(ivec2(fragCoord), int(iResolution.x), int(iResolution.y), uint(iFrame));
}"""
    }
    takes = "ivec2 at, int width, int height, uint seed_number"
    uniforms_of_host: tuple[str, ...] = ()

    def path_begin(self, kernel: Interface, parts: Parts) -> list[str]:
        """Return what follows the first lines of a path kernel."""
        return [
            parts.top,
            *self.uniforms_of_host,
            "",
            f"vec4 wamnet_trace({self.takes})",
            "{",
            "    vec4 image = vec4(0.0, 0.0, 0.0, 1.0);",
            *ONE_SAMPLE,
            *self.places(kernel),
        ]

    def read(self, array: Array, index: Sequence[str], lanes: int) -> str:
        """Return a channel of the image."""
        return f"image[{index[-1]}]"


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
    ends = {
        PATH: """\
    return image;
}

void fragment()
{
    ivec2 at = ivec2(UV * vec2(float(width), float(height)));
    COLOR = wamnet_trace(at, uint(seed_number));
}"""
    }
    takes = "ivec2 at, uint seed_value"
    uniforms_of_host = tuple(f"uniform int {name} = {value};" for name, value in NUMBERS)

    def begin(self, kernel: Interface, parts: Parts) -> str:
        """Return the text of a shader up to its first statement."""
        return "\n".join(self.path_begin(kernel, parts))

    def integer(self, kernel: Interface, name: str) -> str:
        """Return the text of an integer that the kernel is given."""
        return "seed_value" if name == "seed_number" else name


HOSTS = {"shadertoy": _ShadertoyPath(), "godot": _GodotPath()}
"""The dialect of a pass, by target; every frame of a host has random numbers of its own."""


def feature_pass(
    programs: PathPrograms,
    feature: str,
    normalization: Normalization,
    language: str,
    header: Sequence[str],
    whole: bool = False,
) -> str:
    """Return the pass that traces one sample a pixel and writes one encoded feature; `whole`: in integers."""
    encoding = encoding_of((feature,), normalization, whole=whole)
    return renderer_of(programs, HOSTS[language], layers_of((feature,)), encoding=encoding).source(header)
