"""Shaders of Shadertoy and Godot on OpenGL: the words of their hosts are declared around them."""

from __future__ import annotations

import re
from contextlib import ExitStack
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...compiler.artifact import Artifact
from ...compiler.languages.glsl_es import VERSION
from ...compiler.languages.hosts import CHANNELS
from ...compiler.languages.interface import TABLE
from ..devices.images import Images
from .gl_runner import ESRunner

TOP = f"""\
{VERSION}
precision highp float;
precision highp int;
precision highp sampler2D;
out vec4 wamnet_written;
"""
"""The first lines of both."""

SHADERTOY = f"""\
{TOP}uniform vec3 iResolution;
uniform float iTime;
uniform int iFrame;
{"".join(f"uniform sampler2D iChannel{i};{chr(10)}" for i in range(CHANNELS))}{{source}}
void main()
{{{{
    mainImage(wamnet_written, gl_FragCoord.xy);
}}}}
"""
"""What Shadertoy declares before a tab, and what calls it."""

GODOT = f"""\
{TOP}uniform vec2 wamnet_size;
vec2 UV;
vec4 COLOR;
{{source}}
void main()
{{{{
    UV = gl_FragCoord.xy / wamnet_size;
    fragment();
    wamnet_written = COLOR;
}}}}
"""
"""What Godot gives a canvas item, and what calls it; its row 0 is the top, as the pictures' here."""

GODOT_WORDS = re.compile(
    r"^(?:shader_type|render_mode)\b.*;\n|(?<=^uniform )(\w+ \w+) (?:: .*|= \d+);$", re.M
)
"""What no other language has: the kind of a shader, and what follows the names of uniforms."""


def _plain(match: re.Match[str]) -> str:
    """Return what is left of a match: a uniform's type and name."""
    return f"{match[1]};" if match[1] else ""


class ShadertoyRunner(ESRunner):
    """Tabs of Shadertoy."""

    name = "shadertoy"

    def _wrapped(self, source: str) -> str:
        """Return a tab as a shader of its own."""
        return SHADERTOY.format(source=source)

    def _program(self, source: str, made: ExitStack) -> tuple[Any, Any]:
        return super()._program(self._wrapped(source), made)

    def _values(self, size: tuple[int, int]) -> dict[str, Any]:
        """Return the host's numbers for a picture of a size (height, width)."""
        return {"iResolution": (float(size[1]), float(size[0]), 1.0)}

    def _named(self, textures: dict[str, Any]) -> dict[str, Any]:
        """Return the textures under the host's names."""
        return {f"iChannel{i}": texture for i, texture in enumerate(textures.values())}

    def _shown(self, picture: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return what is read back with the picture's top row first: Shadertoy shows row 0 at the bottom."""
        return picture[::-1].copy()

    def _run(self, artifact: Artifact, images: Images) -> NDArray[np.float32]:
        height, width = next(iter(images.values())).shape[:2]
        built = self._built[artifact.digest]
        with self._context, ExitStack() as made:
            textures = {}
            for name, image in images.items():
                textures[name] = self._texture(name, image)
                made.callback(textures[name].release)
            frame, (target,) = self._targets("the picture", (height, width), 1, made)
            named: dict[str, Any] = self._named(textures)
            if built.weights is not None:
                named["weight_texture"] = built.weights
            self._draw(built, frame, named, self._values((height, width)))
            found = np.frombuffer(target.read(), np.float32).reshape(height, width, 4)
        channels = artifact.manifest["output"]["channels"]
        return self._shown(found)[..., :channels].copy()

    def draw(self, source: str, size: tuple[int, int], values: dict[str, Any]) -> NDArray[np.float32]:
        """Return what a pass without images writes (H, W, 4), texel row 0 first, with numbers by name."""
        with self._context, ExitStack() as made:
            program, triangle = self._program(source, made)
            frame, (target,) = self._targets("the pass", size, 1, made)
            for name, value in {**self._values(size), **values}.items():
                if name in program:
                    program[name].value = value
            frame.use()
            triangle.render(vertices=3)
            found = np.frombuffer(target.read(), np.float32).reshape(*size, 4).copy()
            triangle.release()
        return found


class GodotRunner(ShadertoyRunner):
    """Shaders of Godot's canvas items."""

    name = "godot"
    homes = (TABLE,)

    def _wrapped(self, source: str) -> str:
        return GODOT.format(source=GODOT_WORDS.sub(_plain, source))

    def _values(self, size: tuple[int, int]) -> dict[str, Any]:
        return {"wamnet_size": (float(size[1]), float(size[0]))}

    def _named(self, textures: dict[str, Any]) -> dict[str, Any]:
        return {f"image_{name}": texture for name, texture in textures.items()}

    def _shown(self, picture: NDArray[np.float32]) -> NDArray[np.float32]:
        return picture
