"""OpenCL C 1.2 for path kernels: several paths in a work item on CPUs, in vectors; one on GPUs.

`min` and `max` are single instructions where `fmin` and `fmax`, which must treat NaN, are three. A boolean
in a vector is an integer with all bits set, or none.

Vectors use operators in place of `min`, `max`, `fabs` and `floor`, with the same values
[`VECTOR_OPERATIONS`]: PoCL's library may be compiled for another processor than the kernel, LLVM then inlines
none of its functions, and each call saves all vector registers. With the functions the mini cubes took twice
the time.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from numpy.typing import NDArray

from ..kernel.interface import Interface
from .opencl import OpenCL

LANES = (1, 4, 8, 16)
"""Numbers of paths that a work item follows at once."""

VECTOR_OPERATIONS = {
    "absolute": "as_{{type}}(as_int{lanes}({{0}}) & 0x7fffffff)",
    **{
        f"{op}imum{kind}": f"{{{{{a}}}}} < {{{{{b}}}}} ? {{{{1}}}} : {{{{0}}}}"
        for op, a, b in (("min", 1, 0), ("max", 0, 1))
        for kind in ("", ".int32", ".uint32")
    },
    "floor": "floor_{{type}}({{0}})",
}
"""Operations on vectors as the standard defines `min`, `max` and `fabs`, for a number of `lanes`."""

FLOOR = """\
/* The largest integer up to x: one of 2^23 or more is an integer itself. */
float{lanes} floor_float{lanes}(float{lanes} x)
{{
    float{lanes} near = convert_float{lanes}(convert_int{lanes}(x));
    float{lanes} below = near > x ? near - 1.0f : near;
    return (as_int{lanes}(x) & 0x7fffffff) < 0x4b000000 ? below : x;
}}
"""
"""Floor of vectors: cut off towards zero, and one less where that is above; the bits 0x4b000000 are 2^23."""


MASKED = """\
#if defined(__AVX512DQ__) && defined(__has_builtin)
#if __has_builtin(__builtin_ia32_cvtd2mask512)
    return (ushort)__builtin_ia32_cvtd2mask512(mask);
#endif
#endif"""
"""Whether any of 16 lanes holds, by one instruction of AVX-512: the `or` of halves takes four steps, each of
which waits for the one before."""


def any_enters(lanes: int) -> str:
    """Return the function of a walk that tells whether any component of a boolean holds: `or` of halves."""
    head, lines, name = f"int any_enters(int{lanes} mask)", [MASKED] if lanes == 16 else [], "mask"
    while lanes > 2:
        lanes //= 2
        lines.append(f"    int{lanes} of_{lanes} = {name}.lo | {name}.hi;")
        name = f"of_{lanes}"
    return "\n".join(
        [
            "/* Whether any path enters a node. The library's any() is a call, which saves all registers. */",
            head,
            "{",
            *lines,
            f"    return {name}.lo | {name}.hi;",
            "}",
            "",
        ]
    )


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

    def __init__(self, lanes: int) -> None:
        kinds = {"float32": "float", "int32": "int", "uint32": "uint", "bool": "int"}
        self.lanes = lanes
        self.elements = kinds
        self.types = {kind: f"{name}{lanes}" for kind, name in kinds.items()}
        self.lane_numbers = f"({self.types['uint32']})({', '.join(map(str, range(lanes)))})"
        self.sum_store = f"vstore{lanes}({{value}}, 0, sums + {{plane}} * plane + at);"
        entries = ", ".join(f"({{table}})[({{0}}).s{lane:x}]" for lane in range(lanes))
        self.operations = {
            **OpenCLPath.operations,
            **{name: template.format(lanes=lanes) for name, template in VECTOR_OPERATIONS.items()},
            "take": f"({{type}})({entries})",
            "row": "({type})({table}[{0}])",
        }
        self.helpers = {"floor": FLOOR.format(lanes=lanes), "walk": any_enters(lanes)}

    def splat(self, value: str, dtype: str) -> str:
        """Return the text of a number that is the same in all lanes."""
        return f"({self.types[dtype]})({value})"

    def number(self, value: Any, dtype: str) -> str:
        """Return the text of a number in all lanes."""
        return self.splat(self._element(value, dtype).removeprefix("(").removesuffix(")"), dtype)

    def table_declaration(self, name: str, array: NDArray[Any]) -> str:
        """Return the declaration of a constant table of single numbers."""
        dtype = str(array.dtype)
        values = ", ".join(self._element(value, dtype) for value in array)
        return self.table.format(type=self.elements[dtype], name=name, count=len(array), values=values)

    def image_helpers(self, kernel: Interface) -> list[str]:
        """Return a function for each number of channels: pixels of a row, channels interleaved."""
        return [self._painter(channels) for channels in sorted({int(i.shape[2]) for i in kernel.images})]

    def _painter(self, channels: int) -> str:
        """Return the function that writes the pixels of one image, or those that are left of its row."""
        lanes, vector = self.lanes, self.types["float32"]
        numbers = [f"c{n % channels}.s{n // channels:x}" for n in range(lanes * channels)]
        parts = [", ".join(numbers[lanes * k : lanes * (k + 1)]) for k in range(channels)]
        taken = ", ".join(f"{vector} c{channel}" for channel in range(channels))
        return "\n".join(
            [
                f"void paint_{channels}(__global float *restrict to, {taken}, int left)",
                "{",
                *(f"    {vector} part_{k} = ({vector})({part});" for k, part in enumerate(parts)),
                "    if (left >= LANES) {",
                *(f"        vstore{lanes}(part_{k}, {k}, to);" for k in range(channels)),
                "        return;",
                "    }",
                f"    float all[{lanes * channels}];",
                *(f"    vstore{lanes}(part_{k}, {k}, all);" for k in range(channels)),
                f"    for (int i = 0; i < {channels} * left; ++i) {{",
                "        to[i] = all[i];",
                "    }",
                "}",
            ]
        )

    def painting(self, kernel: Interface, values: Mapping[str, Sequence[str]]) -> list[str]:
        """Return the statements that write the pixels of an item inside the picture."""
        return [
            f"    paint_{len(texts)}(image_{name} + place * {len(texts)}, {', '.join(texts)}, left);"
            for name, texts in values.items()
        ]

    def _element(self, value: Any, dtype: str) -> str:
        """Return the text of a number in one lane."""
        return ("-1" if value else "0") if dtype == "bool" else super().number(value, dtype)


def of_lanes(lanes: int) -> OpenCLPath:
    """Return the dialect for a number of paths in a work item."""
    return OpenCLPath() if lanes == 1 else OpenCLVectorPath(lanes)
