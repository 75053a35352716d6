"""OpenCL C 1.2: one work item a pixel; images, weights, sums and result are buffers of floats.

Indices into the planes of sums are of `size_t`: they may exceed 2^31. Rows of a launch are the global size,
so that a path kernel is not given their number; an encoding reads planes of any stride.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from ..core.profiles import OPENCL_SINE
from ..kernel.instructions import BUILTINS, OPENCL_GROUP, OPENCL_ROW, OPENCL_TILE
from ..kernel.interface import BLOCK, DENOISE, ENCODE, INTEGERS, PATH, Array, Interface
from ..kernel.kernel import Type
from .dialect import Dialect, Parts
from .openings import IMAGES, WEIGHTS_RESULT, Arguments


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
    long = "size_t"
    row_reader = OPENCL_ROW
    item = ("get_global_id(0)", "get_global_id(1)")
    pixel = "image_{image}[({row} * width + {column}) * {channels} + {c}]"
    weight = "weights[{index}]"
    store = "result[({row} * width + {column}) * {channels} + {i}] = {value};"
    painted = "image_{image}[place * {channels} + {channel}] = {value}"
    said = {
        DENOISE: f"{IMAGES};\n{WEIGHTS_RESULT};\nwidth; height.\nGlobal size: at least (width, height)",
        PATH: (
            "sums: float, one plane of global_size(1) rows of global_size(0) * {lanes} numbers for each of:\n"
            "{planes};\n"
            "width, height of the image; first_row; first_sample; samples to add up; seed.\n"
            "Work item (i, j) follows the pixels from {lanes} * i of row first_row + j on"
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
        return f"({kind})({', '.join(values)})"

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
        lanes = [f"#define LANES {self.lanes}"] if kernel.role == PATH else []
        return [*lanes, *super().top(kernel, parts)]

    def guard(self, kernel: Interface) -> list[str]:
        """Return the item's place; items of a path kernel beyond the picture compute on."""
        if kernel.role != PATH:
            return super().guard(kernel)
        return [
            "    size_t column = get_global_id(0) * LANES;",
            "    size_t stride = get_global_size(0) * LANES;",
            "    size_t row = get_global_id(1);",
            "    size_t plane = get_global_size(1) * stride;",
            "    size_t at = row * stride + column;",
        ]

    def path_start(self, kernel: Interface) -> list[str]:
        """Return the first statements of a path kernel: pixel and seed."""
        return Dialect.path_start(self, kernel)

    def read(self, array: Array, index: Sequence[str], lanes: int) -> str:
        """Return an element of an array that a kernel is given, or several of a row."""
        if lanes == 1:
            return super().read(array, index, lanes)
        plane, row, column = index
        return f"row_at({array.name} + {plane} * plane + {self.factor(row)} * stride, {column}, width)"

    def written(self, array: Array, index: Sequence[str], value: str, lanes: int) -> str:
        """Return the statement that writes such elements."""
        if lanes == 1:
            return super().written(array, index, value, lanes)
        place = super().read(array, index, lanes).removesuffix("]").replace("[", " + ", 1)
        return f"vstore{lanes}({value}, 0, {place});"

    def images_end(self, kernel: Interface, values: Mapping[str, Sequence[str]]) -> list[str]:
        """Return the last statements of a path kernel: whole groups are larger than the picture."""
        return [
            "    int left = width - (int)column; /* pixels of the row from here on */",
            "    if ((int)row + first_row < height && left > 0) {",
            "        size_t place = (size_t)((int)row + first_row) * (size_t)width + column;",
            *(f"    {line}" for line in super().images_end(kernel, values)),
            "    }",
        ]

    def place(self, kernel: Interface) -> tuple[str, str]:
        """Return the texts of an item's column and row."""
        return ("column", "(int)row")
