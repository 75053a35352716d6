"""Shaders of Shadertoy and Godot on OpenGL: the words of their hosts are declared around them."""

from __future__ import annotations

import re
from collections.abc import Mapping
from contextlib import ExitStack
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...compiler.kernel.interface import TABLE, Interface
from ...compiler.languages.glsl_es import VERSION
from ...compiler.languages.hosts import CHANNELS
from ..devices.kernel import Memory
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

    def _values(self, integers: Mapping[str, int]) -> Mapping[str, Any]:
        """Return the host's numbers for a picture."""
        return {"iResolution": (float(integers["width"]), float(integers["height"]), 1.0)}

    def _named(self, taken: Interface, arrays: Mapping[str, Memory]) -> dict[str, Any]:
        """Return the textures under the host's names."""
        return {f"iChannel{i}": texture for i, texture in enumerate(super()._named(taken, arrays).values())}

    def _fetch(self, name: str, memory: Memory) -> NDArray[np.float32]:
        """Return what was drawn with the picture's top row first: Shadertoy shows row 0 at the bottom."""
        return super()._fetch(name, memory)[::-1].copy()

    def draw(self, source: str, size: tuple[int, int], values: dict[str, Any]) -> NDArray[np.float32]:
        """Return what a pass without images writes (H, W, 4), texel row 0 first, with numbers by name."""
        numbers = {**self._values({"width": size[1], "height": size[0]}), **values}
        with self._session(size), ExitStack() as made:
            program, triangle = self._program(source, made)
            made.callback(triangle.release)
            written = self._memory("what the pass draws", (*size, 4))
            made.callback(self._release, written)
            self._draw(program, triangle, written.held, {}, numbers)
            return super()._fetch("what the pass draws", written)


class GodotRunner(ShadertoyRunner):
    """Shaders of Godot's canvas items."""

    name = "godot"
    homes = (TABLE,)

    def _wrapped(self, source: str) -> str:
        return GODOT.format(source=GODOT_WORDS.sub(_plain, source))

    def _values(self, integers: Mapping[str, int]) -> Mapping[str, Any]:
        return {"wamnet_size": (float(integers["width"]), float(integers["height"]))}

    def _named(self, taken: Interface, arrays: Mapping[str, Memory]) -> dict[str, Any]:
        return ESRunner._named(self, taken, arrays)

    def _fetch(self, name: str, memory: Memory) -> NDArray[np.float32]:
        return ESRunner._fetch(self, name, memory)
