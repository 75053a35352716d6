"""Compute shaders whose images, weights, sums and results are storage buffers: GLSL 4.50 for Vulkan, 4.30.

One invocation computes one pixel, in straight copies of the kernels for OpenCL: rows from the top, channels
interleaved. Sizes are in a uniform block. Translators make SPIR-V, HLSL and Metal from the first one
(kernels/export/tools.py), so its text uses only numbers and arrays.
"""

from __future__ import annotations

from collections.abc import Sequence

from ..core.profiles import SineContract
from ..kernel.instructions import PORTABLE, VULKAN_EXTENSION, VULKAN_GROUP
from ..kernel.interface import (
    BLOCK,
    DENOISE,
    ENCODE,
    ITEMS,
    PATH,
    READ,
    WEIGHTS,
    Array,
    Interface,
)
from ..kernel.kernel import Kernel
from .cuda import GROUPED
from .glsl import Groups
from .openings import Buffers

LEAST_SHARED = 2**14
"""Bytes that a group may share on every device: WebGPU's maxComputeWorkgroupStorageSize, and Vulkan's
maxComputeSharedMemorySize."""

GROUP = (8, 8)
"""Invocations (x, y) in a work group: 64, which every implementation of Vulkan and of OpenGL 4.3 takes."""

GROUPS = (
    f"Groups of {GROUP[0]} x {GROUP[1]}: "
    f"ceil(width / ({{columns}} * {GROUP[0]})) x ceil(height / ({{rows}} * {GROUP[1]}))"
)
"""What is dispatched."""


class Declared(Buffers):
    """Languages whose buffers are declared with numbers, above a function without arguments.

    `integers_block`: the lines before, of and after the integers; `uniform`, `storage`: an array of weights
    in a uniform block and any other; `accesses`: the words of one that is read, and of one that is written.
    """

    numbered = declares_above = one_type = True
    wide = False
    group_size: Sequence[int | str] = GROUP
    integers_block: tuple[str, str, str]
    uniform: str
    storage: str
    accesses: tuple[str, str]
    group = (8, 8)
    largest_shared = LEAST_SHARED
    launches = (GROUPS, GROUPED)

    entries = dict.fromkeys((DENOISE, PATH, ENCODE), "main")

    def declared(self, kernel: Interface) -> list[str]:
        """Return the declarations of the integers and of all arrays; naga knows none that is only written."""
        numbers, (opened, field, closed) = kernel.numbers(), self.integers_block
        fields = [field.format(self.typed(name)) for name in kernel.integers]
        lines = [opened.format(*self.group_size), *fields, closed]
        for array in kernel.by_number():
            name, kind = self.element(array)
            block = f"{array.name[0].upper()}{array.name[1:]}"
            shown = {"number": numbers[array.name], "block": block, "name": name, "kind": kind}
            form = self.uniform if array.home == BLOCK else self.storage
            lines.append(form.format(access=self.accesses[array.access != READ], array=array, **shown))
        return lines

    def element(self, array: Array) -> tuple[str, str]:
        """Return an array's name in the kernel, and the type of its elements."""
        if array.lanes > 1:
            return array.name, self.vector_kind(array.dtype, array.lanes)
        if array.name == WEIGHTS and self.vectors and self.vectors.lanes > 1:
            return "w", self.vector_kind(self.vectors.dtype, self.vectors.lanes)
        return array.name, self.scalars["float32"]

    def top(self, kernel: Kernel, top: str) -> list[str]:
        """Return the lines above the function."""
        above = [] if kernel.interface.role == ENCODE else [top]
        words = [self.instructions] if kernel.weights.dtype == "int32" else []
        return [*above, *self.declared(kernel.interface), *self.group_memory(kernel), "", *words]


class Vulkan(Groups, Declared):
    """The dialect's table for Vulkan."""

    target = "glsl-vulkan"
    language = "GLSL 4.50 for Vulkan, compute shader"
    suffix = ".comp"
    first: tuple[str, ...] = ("#version 450", "#define PRECISE precise")
    native_sine = SineContract(
        "sin() of Vulkan, which promises 2^-11 on [-pi, pi] alone, and that absolutely", None
    )
    integers_block = (
        "layout(local_size_x = {0}, local_size_y = {1}) in;\nlayout(std140, binding = 0) uniform Size {{",
        "    {0};",
        "};",
    )
    uniform = "layout(std140, binding = {number}) uniform {block} {{ vec4 {name}[{array.quads}]; }};"
    storage = "layout(std430, binding = {number}) restrict {access}buffer {block} {{ {kind} {name}[]; }};"
    accesses = ("readonly ", "")
    grouped = {"group_size": ("GROUP_WIDTH", "GROUP_HEIGHT")}
    launching = {"group_size": (ITEMS, 1)}
    words = (
        f"GL_EXT_integer_dot_product where the compiler knows it and {PORTABLE} is not defined, else shifts"
    )
    extensions = VULKAN_EXTENSION
    instructions = VULKAN_GROUP
    item = ("gl_GlobalInvocationID.x", "gl_GlobalInvocationID.y")

    def head(self, kernel: Interface) -> list[str]:
        """Return the lines of the function up to its brace."""
        return ["void main()", "{"]


class Compute(Vulkan):
    """The same for OpenGL 4.3."""

    words = ""

    target = "glsl-compute"
    language = "GLSL 4.30, compute shader"
    first: tuple[str, ...] = ("#version 430 core", "#define PRECISE precise")
    native_sine = SineContract("sin() of GLSL 4.30, which promises nothing", None)
