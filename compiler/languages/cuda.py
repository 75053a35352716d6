"""CUDA C: kernels of one pixel a thread on buffers of floats, as those for OpenCL; `extern "C"` names.

The compiler may fuse a product with a sum, which profile `ieee` allows. Division and square root are rounded
as IEEE 754 says unless an option relaxes them: do not pass -use_fast_math, -ftz=true or -prec-div=false.
"""

from __future__ import annotations

from ..core.profiles import CUDA_SINE
from .c import C
from .dialect import Dialect, Parts
from .interface import DENOISE, ENCODE, PATH, Interface
from .openings import IMAGES, NUMBERS, WEIGHTS_RESULT, Arguments

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

ASSUMES = (
    "the compiler is not told to relax arithmetic: no -use_fast_math, no -ftz=true, no -prec-div=false, no "
    "-prec-sqrt=false; it may fuse products with sums, which the bound allows"
)
"""What the source cannot check by itself."""

LAUNCH = "Launch blocks of any size that together cover (width, {rows}) threads"
"""How all these kernels are called."""


class CUDA(Arguments):
    """The dialect's table."""

    target = "cuda"
    language = "CUDA C"
    suffix = ".cu"
    native_sine = CUDA_SINE
    assumes = ASSUMES
    heading = 'extern "C" __global__ void {entry}'
    reads = "const float *__restrict__ {name}"
    writes = "float *__restrict__ {name}"
    item = ("blockIdx.x * blockDim.x + threadIdx.x", "blockIdx.y * blockDim.y + threadIdx.y")
    types = scalars = {**Dialect.types, "uint32": "unsigned int"}
    clamp = "wamnet_clamp"
    max_output_channels = 2**16
    table = "static __device__ const {type} {name}[{count}] = {{{values}}};"
    operations = {
        **C.operations,
        "minimum": "fminf({0}, {1})",
        "maximum": "fmaxf({0}, {1})",
        **{
            f"{op}imum.{kind}": f"{op}({{0}}, {{1}})" for op in ("min", "max") for kind in ("int32", "uint32")
        },
    }
    pixel, weight, store = C.pixel, C.weight, C.store
    said = {
        DENOISE: f"{IMAGES};\n{WEIGHTS_RESULT};\nwidth; height.\n{LAUNCH.format(rows='height')}",
        PATH: (
            "sums: float, one plane of rows * width numbers for each of:\n"
            f"{{planes}};\n{NUMBERS}; seed.\n"
            f"{LAUNCH.format(rows='rows')}; thread (x, y) follows pixel x of row first_row + y"
        ),
        ENCODE: (
            "sums: float, one plane of width * height numbers for each of:\n"
            f"{{planes}};\n{IMAGES};\nwidth; height; sample_count.\n{LAUNCH.format(rows='height')}"
        ),
    }

    def top(self, kernel: Interface, parts: Parts) -> list[str]:
        """Return the lines above the function."""
        return [*super().top(kernel, parts), *([CLAMP] if kernel.role == DENOISE else [])]

    def offset(self, name: str, value: str) -> str:
        """Return the declaration of a place in memory."""
        return f"size_t {name} = {value};"

    def factor(self, text: str) -> str:
        """Return a number as a factor of a place in memory."""
        return f"(size_t){text}"
