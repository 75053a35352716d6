"""Other places for weights than a target's usual one: a table in the source, or a uniform block.

A home is the dialect of a target that declares its weights elsewhere [`HOMES`; interface.py: TABLE, BLOCK].
Fragment shaders of GLSL have constants as straight code instead [emit_inlined.py]; compute shaders have no
table: Mesa had not compiled one of 770 numbers after a minute, and a buffer is there wherever they are.
"""

from __future__ import annotations

from collections.abc import Mapping

from .c import C
from .cuda import CUDA
from .dialect import Dialect
from .glsl import GLSL
from .glsl_buffers import Compute, Vulkan
from .glsl_es import GLSLES
from .hosts import GodotDenoise
from .interface import BLOCK, DENOISE, TABLE
from .metal import Metal
from .opencl import OpenCL
from .wgsl import WGSL

QUAD = "weights[({index}) / 4][({index}) % 4]"
"""A weight in a block of `vec4`, as std140 wants it."""

PLAIN_INDEX = "weights[{index}]"
"""A weight in a table, or in memory of numbers."""

WHERE = {TABLE: "are in the source", BLOCK: "are a uniform block, or constant memory, of vectors of 4"}
"""What the text for callers says."""

TABLES: tuple[type[Dialect], ...] = (Metal, CUDA, OpenCL, C, GodotDenoise)
"""Targets that can have a table."""

BLOCKS: Mapping[type[Dialect], str] = {
    **dict.fromkeys((GLSL, GLSLES, Vulkan, Compute, WGSL), QUAD),
    **dict.fromkeys((Metal, OpenCL), PLAIN_INDEX),
}
"""Targets that can have a uniform block, or constant memory, and how a weight is read there."""


def _made(base: type[Dialect], home: str, weight: str) -> Dialect:
    """Return the dialect of a target whose weights are elsewhere."""
    said = {DENOISE: f"{base.said[DENOISE]}.\nWeights {WHERE[home]}, whatever stands above"}
    words = {"target": f"{base.target}:{home}", "home": home, "weight": weight, "said": said}
    found: Dialect = type(f"{base.__name__}_{home}", (base,), words)()
    return found


HOMES: Mapping[str, Dialect] = {
    dialect.target: dialect
    for dialect in (
        *(_made(base, TABLE, PLAIN_INDEX) for base in TABLES),
        *(_made(base, BLOCK, weight) for base, weight in BLOCKS.items()),
    )
}
"""All of them, by target and home: `wgsl:uniform`."""
