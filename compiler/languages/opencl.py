"""OpenCL C 1.2: one work item a pixel; images, weights, sums and result are buffers of floats.

Indices into the planes of sums are of `size_t`: they may exceed 2^31. Rows of a launch are the global size,
so that a path kernel is not given their number; an encoding reads planes of any stride.
"""

from __future__ import annotations

from collections.abc import Sequence

from ..core.profiles import OPENCL_SINE
from ..kernel.instructions import BUILTINS, OPENCL_GROUP, OPENCL_ROW, OPENCL_TILE
from ..kernel.interface import ENCODE, INTEGERS, PATH, TRAIN, Array, Interface
from ..kernel.kernel import Kernel
from .c_path import MASKS
from .dialect import Dialect
from .openings import Arguments

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


def any_lane(lanes: int) -> str:
    """Return the function that tells whether any component of a boolean holds: `or` of halves."""
    head = "/* Whether any component is true. The library's any() is a call, which saves all registers. */\n"
    lines, name = [f"{head}int any_lane(int{lanes} mask)\n{{", *[MASKED] * (lanes == 16)], "mask"
    while lanes > 2:
        lanes //= 2
        lines.append(f"    int{lanes} of_{lanes} = {name}.lo | {name}.hi;")
        name = f"of_{lanes}"
    return "\n".join([*lines, f"    return {name}.lo | {name}.hi;", "}"])


class OpenCL(Arguments):
    """The dialect's table; a path kernel has `lanes` paths an item, and `inside` is before what it paints.

    `min` and `max` are single instructions where `fmin` and `fmax`, which must treat NaN, are three. Vectors
    use operators in place of `min`, `max` and `fabs`, with the same values, and clang's builtins for others
    [`vector_operations`]: PoCL's library may be compiled for another processor than the kernel, LLVM then
    inlines none of its functions, and each call saves all vector registers. With the functions the mini cubes
    took twice the time. A boolean in a vector is an integer with all bits set, or none.
    """

    target = "opencl"
    language = "OpenCL C 1.2"
    suffix = ".cl"
    integers = {
        **INTEGERS,
        PATH: tuple(name for name in INTEGERS[PATH] if name != "rows"),
        ENCODE: ("width", "height", "row_stride", "plane_stride", "sample_count"),
    }
    heading = "__kernel void {entry}"
    reads = "__global const {kind} *restrict {name}"
    writes = "__global {kind} *restrict {name}"
    block = "__constant float *restrict {name} __attribute__((max_constant_size(16 * {array.quads})))"
    numbers = "(__global float *)"
    long = "size_t"
    space = "__global "
    vector_kinds = {**Dialect.vector_kinds, "bool": "int{lanes}"}  # truth: all bits set, or none
    mixed = (
        "union {{ {kind} all[{count}]; float number[{count} * {lanes}]; }} {name};",
        "{name}.all[{index}]",
        "{name}.all + {index}",
    )
    mixed_number = "{name}.number[{index}]"
    row_reader = OPENCL_ROW
    lanes = 1
    inside = ""
    paints = True
    item = ("get_global_id(0)", "get_global_id(1)")
    native_sine = OPENCL_SINE
    table = "__constant {type} {name}[{count}] = {{{values}}};"
    operations = {
        **Dialect.operations,
        "absolute": "fabs({0})",
        # pow() computes in double on PoCL, and takes four times as long.
        "power": "exp2({1} * log2({0}))",
        "minimum": "fmin({0}, {1})",
        "maximum": "fmax({0}, {1})",
        **{
            f"{op}imum.{kind}": f"{op}({{0}}, {{1}})" for op in ("min", "max") for kind in ("int32", "uint32")
        },
        "convert": "convert_{type}({0})",
    }

    unroll = "#pragma unroll"
    casts = True
    tiles = (16, 8, 4)
    dot_of_bytes = "{total} = DOT({total}, {weights}, ((const fours *)({place}))->bytes);"
    words = "cl_khr_integer_dot_product where -cl-std=CL3.0 and the device have it, else shifts"
    group = (16, 8)
    launches = (
        "Global size: at least (ceil(width / {columns}), ceil(height / {rows}))",
        "Groups of {group} items; global size: (ceil(width / {columns}), height), in whole groups",
    )
    grouped = {
        "heading": "__kernel __attribute__((reqd_work_group_size(GROUP_WIDTH, GROUP_HEIGHT, 1)))\n"
        "void {entry}"
    }
    shared_array = "__local {kind} {name}[{count}];"
    local_place = ("get_local_id(0)", "get_local_id(1)")
    group_place = ("get_group_id(0)", "get_group_id(1)")
    wait = "barrier(CLK_LOCAL_MEM_FENCE);"
    vector_operations = {
        "absolute": "as_{type}(as_int{lanes}({0}) & 0x7fffffff)",
        "minimum": "{1} < {0} ? {1} : {0}",
        "maximum": "{1} > {0} ? {1} : {0}",
        "floor": "FLOOR({0})",
        "convert": "CONVERT({0}, {type})",
    }

    def vector_of(self, kind: str, values: Sequence[str]) -> str:
        """Return a vector of values, or of one in all lanes."""
        return f"({kind})({', '.join(MASKS.get(value, value) for value in values)})"

    def component(self, lane: int, lanes: int) -> str:
        """Return the name of a component of a vector."""
        return super().component(lane, lanes) if lanes <= 4 else f"s{lane:x}"

    def about(self, array: Array) -> str:
        """Return what an array is that a kernel is given: a path's sums are as large as the grid of items."""
        own = f"global_size(1) rows of global_size(0) * {self.lanes}"
        return super().about(array).replace("rows rows of width", own)

    def top(self, kernel: Kernel, top: str) -> list[str]:
        """Return the lines above the function."""
        named, weights, interface = super().top(kernel, top), kernel.weights, kernel.interface
        if interface.role == PATH:
            painter = [PAINTER.format(lanes=self.lanes)] if interface.images and self.lanes > 1 else []
            return [f"#define LANES {self.lanes}", *named, *painter]
        if weights.lanes == 1:
            return named
        if weights.dtype != "int32" or kernel.group:
            return [BUILTINS, *([OPENCL_GROUP] if weights.dtype == "int32" else []), *named]
        # Which instruction there is depends on LANES.
        return [BUILTINS, *named, OPENCL_TILE.replace("int16", f"int{weights.lanes}")]

    def fitted(self, kernel: Kernel) -> Dialect:
        """Return the dialect for a kernel: 16 lanes have operators in place of functions."""
        found = super().fitted(kernel)
        if kernel.interface.role in (PATH, TRAIN):
            lanes = int(kernel.step[0].value)
            vars(found).update(lanes=lanes, inside="if (left > 0) ")
            found.operations = {**self.operations, "minimum": "min({0}, {1})", "maximum": "max({0}, {1})"}
            numbers, entries = range(lanes), (f"{{table}}[{{0}}.s{lane:x}]" for lane in range(lanes))
            found.vector_operations = {
                **self.vector_operations,
                "any": "any_lane({0})",
                "lanes": f"({{type}})({', '.join(map(str, numbers))})",
                "take": f"({{type}})({', '.join(entries)})",
            }
            found.helpers = {**dict.fromkeys(("floor", "convert"), BUILTINS), "any": any_lane(lanes)}
        return found

    def opening(self, kernel: Interface) -> list[str]:
        """Return the first statements of a path kernel: rows of planes are whole items, which all compute."""
        left = "(int)row + first_row < height ? width - (int)column : 0"
        images = [
            f"    int left = {left}; /* pixels of the row from here on: whole groups are larger */",
            "    size_t place = (size_t)((int)row + first_row) * (size_t)width + column;",
        ]
        return [
            "    size_t column = get_global_id(0) * LANES;",
            "    size_t stride = get_global_size(0) * LANES;",
            "    size_t row = get_global_id(1);",
            "    size_t plane = get_global_size(1) * stride;",
            "    size_t at = row * stride + column;",
            *(images if kernel.images else []),
        ]

    def read(self, array: Array, index: Sequence[str], lanes: int) -> str:
        """Return an element of an array that a kernel is given, or several of a row."""
        if lanes == 1:
            return super().read(array, index, lanes)
        plane, row, column = index
        return f"row_at({array.name} + {plane} * plane + {self.factor(row)} * stride, {column}, width)"

    def written(self, array: Array, index: Sequence[str], value: str, lanes: int) -> str:
        """Return the statement that writes such elements; a path's image ends before a whole group does."""
        place = super().read(array, index, lanes)
        if lanes == 1:
            return f"{self.inside if array.is_image else ''}{place} = {value};"
        place = place.removesuffix("]").replace("[", " + ", 1)
        if array.is_image:
            return f"paint({place}, {array.shape[-1]}, {value}, left);"
        return f"vstore{lanes}({value}, 0, {place});"
