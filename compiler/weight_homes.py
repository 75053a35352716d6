"""Where weights live besides a target's usual place: a table in the source, or a uniform block.

A home is the dialect of a target with one declaration of its denoiser replaced [`HOMES`].
`inline` is a constant table that loops read, `uniform` a block of `vec4`, or constant memory. Fragment
shaders of GLSL have constants as straight code instead [emit_inlined.py]; compute shaders have no table:
Mesa had not compiled one of 770 numbers after a minute, and a buffer is there wherever they are.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from .c import C
from .cuda import CUDA
from .dialect import Dialect
from .glsl import GLSL
from .glsl_buffers import ComputeDenoise, VulkanDenoise
from .glsl_es import GLSLES
from .hosts import GodotDenoise
from .metal import Metal
from .opencl import OpenCL
from .wgsl import WGSL

INLINE, UNIFORM = "inline", "uniform"
"""Names of homes besides a target's usual one."""

QUAD = "weights[({index}) / 4][({index}) % 4]"
"""A weight in a block of `vec4`, as std140 wants it."""

BLOCK = "layout(std140) uniform Weights {{ vec4 weights[{quads}]; }};"
"""A block of weights in GLSL."""


@dataclass(frozen=True)
class Home:
    """`moves`: pieces of a dialect's `begin` and what takes their place; `weight`: how one is read."""

    dialect: Dialect
    moves: Mapping[str, str]
    weight: str
    table: bool = False

    def made(self, how: str) -> Dialect:
        """Return the dialect."""
        base = type(self.dialect)
        begin = base.begin
        for old, new in self.moves.items():
            assert old in begin, f"{base.target} no longer has {old!r}"
            begin = begin.replace(old, new)
        words: dict[str, object] = {"target": f"{base.target}:{how}", "begin": begin, "weight": self.weight}
        words |= {"weights_table": self.table, "arguments": _arguments(base.arguments, how)}
        found: Dialect = type(f"{base.__name__}_{how}", (base,), words)()
        return found


def _arguments(text: str, how: str) -> str:
    """Return how a kernel is called whose weights are elsewhere."""
    where = {INLINE: "are in the source", UNIFORM: "are a uniform block, or constant memory, of vectors of 4"}
    return f"{text}.\nWeights {where[how]}, whatever stands above"


def _between(text: str, first: str, last: str) -> str:
    """Return the piece of a text from one piece to another."""
    start = text.index(first)
    return text[start : text.index(last, start) + len(last)]


VULKAN_WEIGHTS = "layout(std430, binding = 1) restrict readonly buffer Weights {{ float weights[]; }};\n"
"""The usual declaration in compute shaders."""

WGSL_WEIGHTS = "@group(0) @binding(1) var<storage, read> weights: array<f32>;\n"
"""The same in WGSL."""

FRAGMENT_WEIGHTS = _between(GLSL.begin, "uniform sampler2D weight_texture;", ";") + "\n"
"""The same in fragment shaders."""

FUNCTION = _between(GLSL.begin, "float weights(int index)", "}}\n") + "\n"
"""What reads the texture there."""

C_MOVES = {
    "    const float *restrict weights,\n": "",
    "{entry}({names}, weights, result,": "{entry}({names}, result,",
    "    (void)weights;": "",
}
"""What the header in C loses."""

TABLES = (
    Home(Metal(), {"    device const float *weights [[buffer(1)]],\n": ""}, "weights[{index}]", table=True),
    Home(CUDA(), {"    const float *__restrict__ weights,\n": ""}, "weights[{index}]", table=True),
    Home(OpenCL(), {"    __global const float *restrict weights,\n": ""}, "weights[{index}]", table=True),
    Home(C(), C_MOVES, "weights[{index}]", table=True),
    Home(
        GodotDenoise(),
        {
            "uniform sampler2D weight_texture : filter_nearest, repeat_disable;\n": "",
            _between(GodotDenoise.begin, "float weights(int index)", "}}\n"): "",
        },
        "weights[{index}]",
        table=True,
    ),
)
"""Targets that can have a table."""

BLOCKS = (
    Home(GLSL(), {FRAGMENT_WEIGHTS: BLOCK + "\n", FUNCTION: ""}, QUAD),
    Home(GLSLES(), {FRAGMENT_WEIGHTS: BLOCK + "\n", FUNCTION: ""}, QUAD),
    Home(VulkanDenoise(), {VULKAN_WEIGHTS: BLOCK.replace("(std140)", "(std140, binding = 1)") + "\n"}, QUAD),
    Home(ComputeDenoise(), {VULKAN_WEIGHTS: BLOCK.replace("(std140)", "(std140, binding = 1)") + "\n"}, QUAD),
    Home(
        WGSL(),
        {WGSL_WEIGHTS: "@group(0) @binding(1) var<uniform> weights: array<vec4<f32>, {quads}>;\n"},
        QUAD,
    ),
    Home(
        Metal(),
        {"    device const float *weights [[buffer(1)]],\n": "    constant float *weights [[buffer(1)]],\n"},
        "weights[{index}]",
    ),
    Home(
        OpenCL(),
        {
            "    __global const float *restrict weights,\n": "    __constant float *restrict weights "
            "__attribute__((max_constant_size(16 * {quads}))),\n"
        },
        "weights[{index}]",
    ),
)
"""Targets that can have a uniform block, or constant memory."""

HOMES: Mapping[str, Dialect] = {
    dialect.target: dialect
    for how, homes in ((INLINE, TABLES), (UNIFORM, BLOCKS))
    for dialect in (home.made(how) for home in homes)
}
"""All of them, by target and home: `wgsl:uniform`."""
