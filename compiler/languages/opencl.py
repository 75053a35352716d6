"""OpenCL C 1.2: one work item a pixel; images, weights, sums and result are buffers of floats.

Indices into the planes of sums are of `size_t`: they may exceed 2^31. Rows of a launch are the global size,
so that a path kernel is not given their number; an encoding reads planes of any stride.
"""

from __future__ import annotations

from collections.abc import Sequence

from ..core.profiles import OPENCL_SINE
from ..kernel.instructions import BUILTINS, OPENCL_GROUP, OPENCL_TILE
from ..kernel.interface import BLOCK, DENOISE, ENCODE, INTEGERS, PATH, Array, Interface
from ..kernel.kernel import Kernel, Type
from .c_path import MASKS
from .dialect import Dialect, Parts
from .openings import IMAGES, WEIGHTS_RESULT, Arguments

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

ONE_PATH = {"painted": "if (left > 0) image_{image}[place * {channels} + {channel}] = {value};"}
"""How an item of one path writes."""

LANES_OF_PATHS = {
    "painted": "paint(image_{image} + place * {channels} + {channel}, {channels}, {value}, left);",
    "sum_store": "vstore{lanes}({value}, 0, sums + {plane} * plane + at);",
}
"""How an item of several paths writes."""


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
    """The dialect's table."""

    target = "opencl"
    language = "OpenCL C 1.2"
    suffix = ".cl"
    integers = {
        **INTEGERS,
        PATH: tuple(name for name in INTEGERS[PATH] if name != "rows"),
        ENCODE: ("width", "height", "row_stride", "plane_stride", "sample_count"),
    }
    heading = "__kernel void {entry}"
    reads = "__global const float *restrict {name}"
    writes = "__global float *restrict {name}"
    item = ("get_global_id(0)", "get_global_id(1)")
    pixel = "image_{image}[({row} * width + {column}) * {channels} + {c}]"
    weight = "weights[{index}]"
    store = "result[({row} * width + {column}) * {channels} + {i}] = {value};"
    image_store = "image_{image}[pixel * {channels} + {channel}] = {value};"
    said = {
        DENOISE: f"{IMAGES};\n{WEIGHTS_RESULT};\nwidth; height.\nGlobal size: at least (width, height)",
        PATH: (
            "sums: float, one plane of global_size(1) rows of global_size(0) * {lanes} numbers for each of:\n"
            "{planes};\n"
            "width, height of the image; first_row; first_sample; samples to add up; seed.\n"
            "Work item (i, j) follows the pixels from {lanes} * i of row first_row + j on"
        ),
        ENCODE: (
            "sums: float, one plane of plane_stride numbers for each of:\n"
            "{planes};\n"
            f"{IMAGES};\n"
            "width; height; row_stride: numbers from row to row of a plane; plane_stride; sample_count.\n"
            "Global size: at least (width, height)"
        ),
    }
    max_output_channels = 2**16
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
    transforms = True
    tiles = (16, 8, 4)
    dot_of_bytes = "{total} = DOT({total}, {weights}, ((const fours *)({place}))->bytes);"
    words = "cl_khr_integer_dot_product where -cl-std=CL3.0 and the device have it, else shifts"
    group = (16, 8)
    launches = (
        "Global size: at least (width, height)",
        "Global size: at least (ceil(width / {columns}), ceil(height / {rows}))",
        "Groups of {group} items; global size: (ceil(width / {columns}), height), in whole groups",
    )
    aligned = ("weights;", "weights, at an address that is a multiple of {bytes};")
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

    def vector_kind(self, dtype: str, lanes: int) -> str:
        """Return the name of a vector type; truth is an integer with all bits set."""
        return f"{'int' if dtype == 'bool' else self.scalars[dtype]}{lanes}"

    def vector_of(self, kind: str, values: Sequence[str]) -> str:
        """Return a vector of values, or of one in all lanes."""
        return f"({kind})({', '.join(MASKS.get(value, value) for value in values)})"

    def weights_as_vectors(self, kind: Type) -> list[str]:
        """Return the declaration of the weights as vectors."""
        vector = f"{self.scalars[kind.dtype]}{kind.lanes}"
        line = f"    __global const {vector} *w = (__global const {vector} *)weights;"
        return [line] if kind.lanes > 1 else []

    def mixed_address(self, name: str, index: str, kind: str) -> str:
        """Return the address of a vector of an array whose components are read by their own index."""
        return f"{name}.all + {index}"

    def mixed_array(self, kind: str, name: str, count: str, lanes: int) -> str:
        """Return the declaration of an array of vectors whose components are read by their own index."""
        return f"union {{ {kind} all[{count}]; float number[{count} * {lanes}]; }} {name};"

    def mixed_element(self, name: str, index: str, kind: str, number: bool) -> str:
        """Return a component of such an array, or a vector."""
        return f"{name}.{'number' if number else 'all'}[{index}]"

    def array_argument(self, array: Array) -> str:
        """Return an argument that is an array."""
        if array.home == BLOCK:
            size = f"__attribute__((max_constant_size(16 * {array.quads})))"
            return f"__constant float *restrict {array.name} {size}"
        return super().array_argument(array)

    def top(self, kernel: Interface, parts: Parts) -> list[str]:
        """Return the lines above the function."""
        if parts.kernel is not None and parts.kernel.weights.lanes > 1:
            named = super().top(kernel, parts)
            if parts.kernel.weights.dtype != "int32":
                return [BUILTINS, *named]
            if parts.kernel.group:
                return [BUILTINS, OPENCL_GROUP, *named]
            # Which instruction there is depends on LANES.
            return [BUILTINS, *named, OPENCL_TILE.replace("int16", f"int{parts.kernel.weights.lanes}")]
        if kernel.role != PATH:
            return super().top(kernel, parts)
        painter = [PAINTER.format(lanes=self.lanes)] if kernel.images and self.lanes > 1 else []
        return [f"#define LANES {self.lanes}", *super().top(kernel, parts), *painter]

    def fitted(self, kernel: Kernel) -> Dialect:
        """Return the dialect for a kernel: a path kernel has operators in place of functions."""
        found = super().fitted(kernel)
        if kernel.interface.role == PATH:
            lanes = int(kernel.step[0].value)
            vars(found).update(LANES_OF_PATHS if lanes > 1 else ONE_PATH, lanes=lanes)
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

    def guard(self, kernel: Interface) -> list[str]:
        """Return the item's place; items of a path kernel beyond the picture compute on."""
        if kernel.role != PATH:
            return super().guard(kernel)
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

    def places_of_planes(self, kernel: Interface) -> list[str]:
        """Return nothing: rows of planes are whole items."""
        return []

    def encode_start(self, kernel: Interface) -> list[str]:
        """Return the first statements of an encoding: its places in planes and images, and the samples."""
        return [
            "    size_t at = (size_t)y * (size_t)row_stride + (size_t)x;",
            "    size_t plane = (size_t)plane_stride;",
            "    size_t pixel = (size_t)y * (size_t)width + (size_t)x;",
            f"    {self.samples(kernel)}",
        ]
