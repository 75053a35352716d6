"""OpenCL C 1.2 for path kernels: several paths in a work item on CPUs, in vectors; one on GPUs.

`min` and `max` are single instructions where `fmin` and `fmax`, which must treat NaN, are three. A truth
value in a vector is an integer with all bits set, or none.

Vectors use operators in place of `min`, `max`, `fabs` and `floor`, with the same values
[`VECTOR_OPERATIONS`]: PoCL's library may be compiled for another processor than the kernel, LLVM then inlines
none of its functions, and each call saves all vector registers. With the functions the mini cubes took twice
the time.
"""

from __future__ import annotations

from typing import Any

from numpy.typing import NDArray

from .opencl import OpenCL
from .path_dialect import PathDialect

VECTORS = (4, 8, 16)
"""Lengths of vectors for which there is a schedule, besides 1."""

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


class OpenCLPath(OpenCL, PathDialect):
    """The dialect's table for one path in a work item."""

    entry = PathDialect.entry
    lanes = 1
    lane_numbers = "0u"
    path_begin = """\
#define LANES {lanes}
#define MAX_DEPTH {max_depth}u /* scatterings of a path */
{tables}
__kernel void {entry}(
    __global float *restrict sums,
    int width,
    int height,
    int first_row,
    uint first_sample,
    int samples,
    uint seed_number)
{{
    size_t column = get_global_id(0) * LANES;
    size_t stride = get_global_size(0) * LANES;
    size_t row = get_global_id(1);
    size_t plane = get_global_size(1) * stride;
    size_t at = row * stride + column;
    {counter} x = {column} + {lane_numbers};
    {counter} y = {row};
    {counter} seed = {seed};"""
    path_end = "}}"
    scalar_float = "(float){0}"
    output_declaration = ""
    uniforms = {
        "column": "(uint)column",
        "row": "(uint)((int)row + first_row)",
        "seed": "seed_number",
        "width": "(float)width",
        "height": "(float)height",
        "sample": "first_sample + (uint)n",
    }
    path_arguments = (
        "sums: float, one plane of global_size(1) rows of global_size(0) * {lanes} numbers for each of:\n"
        "{planes};\n"
        "width, height of the image; first_row; first_sample; samples to add up; seed.\n"
        "Work item (i, j) follows the pixels from {lanes} * i of row first_row + j on"
    )
    sum_store = "sums[{plane} * plane + at] = {value};"
    max_planes = 2**16
    operations = {
        **OpenCL.operations,
        "minimum": "min({0}, {1})",
        "maximum": "max({0}, {1})",
    }


class OpenCLVectorPath(OpenCLPath):
    """The dialect's table for 4, 8 or 16 paths in a work item."""

    splat = "({type})({value})"
    any_lane = "any({mask})"

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
        self.helpers = {"floor": FLOOR.format(lanes=lanes)}

    def number(self, value: Any, dtype: str) -> str:
        """Return the text of a number in all lanes."""
        element = self._element(value, dtype).removeprefix("(").removesuffix(")")
        return self.splat.format(type=self.types[dtype], value=element)

    def table_declaration(self, name: str, array: NDArray[Any]) -> str:
        """Return the declaration of a constant table of single numbers."""
        dtype = str(array.dtype)
        values = ", ".join(self._element(value, dtype) for value in array)
        return self.table.format(type=self.elements[dtype], name=name, count=len(array), values=values)

    def _element(self, value: Any, dtype: str) -> str:
        """Return the text of a number in one lane."""
        return ("-1" if value else "0") if dtype == "bool" else super().number(value, dtype)


def schedule(lanes: int) -> OpenCLPath:
    """Return the dialect for a number of paths in a work item."""
    return OpenCLPath() if lanes == 1 else OpenCLVectorPath(lanes)
