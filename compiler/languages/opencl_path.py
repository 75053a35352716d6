"""OpenCL C 1.2 for path kernels: several paths in a work item on CPUs, in vectors; one on GPUs.

`min` and `max` are single instructions where `fmin` and `fmax`, which must treat NaN, are three. A boolean
in a vector is an integer with all bits set, or none.

Vectors use operators in place of `min`, `max` and `fabs`, with the same values, and clang's builtins for
others [`OpenCL.vector_operations`]: PoCL's library may be compiled for another processor than the kernel,
LLVM then inlines none of its functions, and each call saves all vector registers. With the functions the
mini cubes took twice the time.
"""

from __future__ import annotations

from ..kernel.instructions import BUILTINS
from .opencl import OpenCL

LANES = (1, 4, 8, 16)
"""Numbers of paths that a work item follows at once."""

MASKED = """\
#if defined(__AVX512DQ__) && defined(__has_builtin)
#if __has_builtin(__builtin_ia32_cvtd2mask512)
    return (ushort)__builtin_ia32_cvtd2mask512(mask);
#endif
#endif"""
"""Whether any of 16 lanes holds, by one instruction of AVX-512: the `or` of halves takes four steps, each of
which waits for the one before."""

PAINTER = """\
void paint(__global float *restrict to, int step, float{lanes} values, int left)
{{
    float all[LANES];
    vstore{lanes}(values, 0, all);
    for (int i = 0; i < LANES && i < left; ++i) {{
        to[i * step] = all[i];
    }}
}}"""
"""The function that writes a channel of the pixels of an item, or of those that are left of its row."""


def any_enters(lanes: int) -> str:
    """Return the function of a walk that tells whether any component of a boolean holds: `or` of halves."""
    head = "/* Whether any path enters a node. The library's any() is a call, which saves all registers. */\n"
    lines, name = [f"{head}int any_enters(int{lanes} mask)\n{{", *[MASKED] * (lanes == 16)], "mask"
    while lanes > 2:
        lanes //= 2
        lines.append(f"    int{lanes} of_{lanes} = {name}.lo | {name}.hi;")
        name = f"of_{lanes}"
    return "\n".join([*lines, f"    return {name}.lo | {name}.hi;", "}", ""])


class OpenCLPath(OpenCL):
    """The dialect's table for one path in a work item."""

    operations = {
        **OpenCL.operations,
        "minimum": "min({0}, {1})",
        "maximum": "max({0}, {1})",
    }


class OpenCLVectorPath(OpenCLPath):
    """The dialect's table for 4, 8 or 16 paths in a work item."""

    any_lane = "any({mask})"
    any_enters = "any_enters({mask})"
    splatted = "({type})({value})"
    painted = "paint(image_{image} + place * {channels} + {channel}, {channels}, {value}, left)"

    def __init__(self, lanes: int) -> None:
        kinds = {"float32": "float", "int32": "int", "uint32": "uint", "bool": "int"}
        self.lanes = lanes
        self.types = {kind: f"{name}{lanes}" for kind, name in kinds.items()}
        self.lane_numbers = f"({self.types['uint32']})({', '.join(map(str, range(lanes)))})"
        self.sum_store = f"vstore{lanes}({{value}}, 0, sums + {{plane}} * plane + at);"
        entries = ", ".join(f"({{table}})[({{0}}).s{lane:x}]" for lane in range(lanes))
        self.operations = {
            **{name: text for name, text in OpenCL.operations.items() if "." not in name},
            **OpenCL.vector_operations,
            "take": f"({{type}})({entries})",
            "row": "({type})({table}[{0}])",
        }
        self.painter = PAINTER.format(lanes=lanes)
        self.helpers = {**dict.fromkeys(("floor", "convert"), BUILTINS), "walk": any_enters(lanes)}


def of_lanes(lanes: int) -> OpenCLPath:
    """Return the dialect for a number of paths in a work item."""
    return OpenCLPath() if lanes == 1 else OpenCLVectorPath(lanes)
