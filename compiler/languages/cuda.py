"""CUDA C: kernels of one pixel a thread on buffers of floats, as those for OpenCL; `extern "C"` names.

The compiler may fuse a product with a sum, which profile `ieee` allows. Division and square root are rounded
as IEEE 754 says unless an option relaxes them: do not pass -use_fast_math, -ftz=true or -prec-div=false.
"""

from __future__ import annotations

from collections.abc import Sequence

from ..core.profiles import CUDA_SINE
from ..kernel.instructions import CUDA_GROUP, CUDA_VECTOR
from ..kernel.interface import DENOISE
from ..kernel.kernel import Kernel
from .c import C
from .dialect import Dialect
from .openings import Arguments

CLAMP = """\
#ifndef WAMNET_CLAMP
#define WAMNET_CLAMP
static __device__ inline int wamnet_clamp(int value, int low, int high)
{
    return value < low ? low : value > high ? high : value;
}
#endif
"""
"""Limits an index; the language has no such function."""

GROUPED = (
    "Start ceil(width / ({columns} * GROUP_WIDTH)) x ceil(height / GROUP_HEIGHT) groups of {group} items;\n"
    "those beyond the picture write nothing"
)
"""How all kernels with groups are started."""

ASSUMES = (
    "the compiler is not told to relax arithmetic: no -use_fast_math, no -ftz=true, no -prec-div=false, no "
    "-prec-sqrt=false; it may fuse products with sums, which the bound allows"
)
"""What the source cannot check by itself."""


class CUDA(Arguments):
    """The dialect's table."""

    target = "cuda"
    language = "CUDA C"
    suffix = ".cu"
    native_sine = CUDA_SINE
    assumes = ASSUMES
    heading = 'extern "C" __global__ void {entry}'
    reads = "const {kind} *__restrict__ {name}"
    writes = "{kind} *__restrict__ {name}"
    long = "size_t"
    space = ""
    linkage = "static __device__ inline "
    mixed_number = "((float *){name})[{index}]"
    item = ("blockIdx.x * blockDim.x + threadIdx.x", "blockIdx.y * blockDim.y + threadIdx.y")
    scalars = {**Dialect.scalars, "uint32": "unsigned int"}
    clamp = "wamnet_clamp"
    group = (16, 8)
    grouped = {"heading": 'extern "C" __global__ void __launch_bounds__(GROUP_WIDTH * GROUP_HEIGHT) {entry}'}
    launches = (
        "Launch blocks of any size that together cover (ceil(width / {columns}), ceil(height / {rows})) "
        "threads",
        GROUPED,
    )
    shared_array = "__shared__ {kind} {name}[{count}];"
    local_place = ("threadIdx.x", "threadIdx.y")
    group_place = ("blockIdx.x", "blockIdx.y")
    wait = "__syncthreads();"
    wide = False
    casts = True
    words = "__dp4a, which needs -arch=sm_61 or later"
    table = "static __device__ const {type} {name}[{count}] = {{{values}}};"
    operations = {
        **C.operations,
        "minimum": "fminf({0}, {1})",
        "maximum": "fmaxf({0}, {1})",
        **{
            f"{op}imum.{kind}": f"{op}({{0}}, {{1}})" for op in ("min", "max") for kind in ("int32", "uint32")
        },
    }

    def top(self, kernel: Kernel, top: str) -> list[str]:
        """Return the lines above the function."""
        weights = kernel.weights
        if kernel.interface.role == DENOISE:
            vectors = (
                CUDA_VECTOR if weights.lanes > 1 else "",
                CUDA_GROUP if weights.dtype == "int32" else "",
            )
            top = "".join((CLAMP, *vectors, top))
        return super().top(kernel, top)

    def vector_kind(self, dtype: str, lanes: int) -> str:
        """Return the name of a vector type, which has the operators that sums need: CUDA's own have none."""
        return "wamnet_vector" if dtype == "float32" and lanes > 2 else f"{self.scalars[dtype]}{lanes}"

    def vector_of(self, kind: str, values: Sequence[str]) -> str:
        """Return a vector of values, or of one in all lanes."""
        made = "wamnet_made" if kind == "wamnet_vector" else f"make_{kind}"
        return f"{made}({', '.join(values if len(values) > 1 else [*values] * 4)})"
