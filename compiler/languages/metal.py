"""Metal Shading Language: kernels of one pixel a thread on device buffers, bound as those for Vulkan.

Metal's compiler relaxes arithmetic unless an option forbids it: `MTLCompileOptions.mathMode = .safe`, or
`fastMathEnabled = false` before macOS 15, or `-fno-fast-math` on its command line.
"""

from __future__ import annotations

from collections.abc import Sequence

from ..core.profiles import SineContract
from ..kernel.interface import Interface
from ..kernel.kernel import Kernel
from .cuda import GROUPED
from .dialect import Dialect
from .openings import Buffers

ASSUMES = (
    "the library is compiled with MTLCompileOptions.mathMode = .safe (fastMathEnabled = false before macOS "
    "15, -fno-fast-math offline): the default relaxes arithmetic. Products may be fused with sums. The "
    "device rounds to nearest, which the language leaves open (MSL 8.2)"
)
"""What the source cannot check by itself."""

TOP = """\
#include <metal_stdlib>
using namespace metal;
"""
"""The first lines."""


class Metal(Buffers):
    """The dialect's table; `threads` are the arguments that give a thread its place."""

    target = "metal"
    language = "Metal Shading Language"
    suffix = ".metal"
    native_sine = SineContract("sin() of Metal, 4 ulp in safe mode, less in others", None)
    assumes = ASSUMES
    threads: Sequence[str] = ("uint2 thread_place [[thread_position_in_grid]]",)
    item = ("thread_place.x", "thread_place.y")
    size = "size."
    space = "device "
    reads = "device const {kind} *{name}"
    writes = "device {kind} *{name}"
    block = "constant float *{name}"
    linkage = "static inline "
    mixed_number = "((thread float *){name})[{index}]"
    group = (16, 8)
    grouped = {
        "threads": (
            "uint2 item_place [[thread_position_in_threadgroup]]",
            "uint2 group_place [[threadgroup_position_in_grid]]",
        )
    }
    launches = (
        "Dispatch ceil(width / {columns}) x ceil(height / {rows}) threads, or more, in groups of any size",
        GROUPED,
    )
    shared_array = "threadgroup {kind} {name}[{count}];"
    local_place = ("item_place.x", "item_place.y")
    group_place = ("group_place.x", "group_place.y")
    wait = "threadgroup_barrier(mem_flags::mem_threadgroup);"
    wide = False
    casts = numbered = True
    table = "constant {type} {name}[{count}] = {{{values}}};"
    operations = {**Dialect.operations, "absolute": "fabs({0})"}

    def top(self, kernel: Kernel, top: str) -> list[str]:
        """Return the lines above the function: the structure of the integers is a kernel's own."""
        sizes = [
            "struct Size {",
            *(f"    {self.typed(name)};" for name in kernel.interface.integers),
            "};",
            "",
        ]
        return [TOP, *super().top(kernel, top), *sizes]

    def head(self, kernel: Interface) -> list[str]:
        """Return the lines of the function up to its brace."""
        numbers = kernel.numbers()
        arrays = [
            f"{self.array_argument(each)} [[buffer({numbers[each.name]})]]" for each in kernel.by_number()
        ]
        listed = ["constant Size &size [[buffer(0)]]", *arrays, *self.threads]
        inside = ",\n".join(f"    {each}" for each in listed)
        return [f"kernel void {self.entries[kernel.role]}(", f"{inside})", "{"]
