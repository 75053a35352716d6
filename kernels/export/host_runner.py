"""Exported C, and CUDA C and Metal with a few of their words in C++, built by the system's compiler.

CUDA's and Metal's kernels use so little of their languages that a shim of macros and functions makes them
C++: what is run is the exported text, thread by thread. It says nothing about their compilers' arithmetic.
"""

from __future__ import annotations

import ctypes
import re
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...compiler.weight_homes import INLINE
from ...refimpl.errors import ExecutorUnavailable
from . import tools
from .buffer_runner import READ, WRITTEN, BufferRunner, Launch

OPTIONS = ("-O1", "-ffp-contract=off", "-fPIC", "-shared")
"""Nothing here may allow what the standards do not."""

CUDA_SHIM = """\
#include <math.h>
#include <stddef.h>
#define __global__
#define __device__
struct wamnet_place { unsigned int x, y, z; };
static thread_local wamnet_place blockIdx, blockDim, threadIdx;
template <class T> static inline T min(T a, T b) { return b < a ? b : a; }
template <class T> static inline T max(T a, T b) { return a < b ? b : a; }
#include "kernel.txt"
"""
"""The words of CUDA that kernels use."""

METAL_SHIM = """\
#define kernel
#define device
#define constant const
typedef unsigned int uint;
struct uint2 { uint x, y; };
namespace metal {
static inline float fabs(float x) { return __builtin_fabsf(x); }
static inline float floor(float x) { return __builtin_floorf(x); }
static inline float sqrt(float x) { return __builtin_sqrtf(x); }
static inline float sin(float x) { return __builtin_sinf(x); }
static inline float cos(float x) { return __builtin_cosf(x); }
static inline float pow(float x, float y) { return __builtin_powf(x, y); }
template <class T> static inline T min(T a, T b) { return b < a ? b : a; }
template <class T> static inline T max(T a, T b) { return a < b ? b : a; }
static inline int clamp(int x, int low, int high) { return min(max(x, low), high); }
}
"""
"""The words of Metal that kernels use: the file that they include."""

THREADS = """\
extern "C" void wamnet_call(const int *sizes, float *const *buffers, int columns, int rows)
{{
    for (int row = 0; row < rows; ++row) {{
        for (int column = 0; column < columns; ++column) {{
            {call}
        }}
    }}
}}
"""
"""The function that is called: all threads, one after another."""


class HostRunner(BufferRunner):
    """A compiler and the glue of one language; what it has built stays loaded as long as the process."""

    program = "c++"
    suffix = ".cpp"
    options: tuple[str, ...] = ("-std=c++17",)

    def __init__(self, name: str = "") -> None:
        self.name = name or self.name
        self._folder = tempfile.TemporaryDirectory(prefix="wamnet-host-")
        self._count = 0
        try:
            told = tools.run(self.program, "--version", folder=Path(self._folder.name))
        except ExecutorUnavailable:
            self._folder.cleanup()
            raise
        self.device = " ".join(told.split()[:4])

    def _glue(self, source: str, entry: str, count: int, folder: Path) -> str:
        """Return the text that is compiled, with a function `wamnet_call`."""
        raise NotImplementedError

    def _weights(self, buffer: str) -> list[str]:
        """Return the argument that holds weights, if they are one."""
        return [] if self.name.endswith(INLINE) else [buffer]

    def _prepare(self, source: str, entry: str, count: int) -> Any:
        self._count += 1
        folder = Path(self._folder.name) / str(self._count)
        folder.mkdir()
        (folder / "kernel.txt").write_text(source, encoding="utf-8")
        (folder / f"glue{self.suffix}").write_text(self._glue(source, entry, count, folder), encoding="utf-8")
        tools.run(
            self.program,
            *(*self.options, *OPTIONS, "-I.", "-o", "kernel.so", f"glue{self.suffix}", "-lm"),
            folder=folder,
        )
        function = ctypes.CDLL(str(folder / "kernel.so")).wamnet_call
        function.restype = None
        return function

    def _launch(self, prepared: Any, launch: Launch) -> list[NDArray[np.float32]]:
        held = {place: np.array(data, np.float32, order="C") for place, data in launch.buffers.items()}
        empty = np.zeros(4, np.float32)
        pointers = (ctypes.c_void_p * (max(held) + 1))(
            *(held.get(place, empty).ctypes.data for place in range(max(held) + 1))
        )
        sizes = (ctypes.c_uint32 * len(launch.sizes))(*(n % 2**32 for n in launch.sizes))
        prepared(sizes, pointers, *launch.threads)
        return [held[place].reshape(-1) for place in launch.back]

    def close(self) -> None:
        """Remove the folder."""
        self._folder.cleanup()


def _images(count: int) -> list[str]:
    """Return the texts of so many image buffers."""
    return [f"buffers[{WRITTEN + 1 + i}]" for i in range(count)]


class CRunner(HostRunner):
    """C99, as a C compiler takes it; check.py compiles exports with warnings as errors."""

    name = "c"
    program = "cc"
    suffix = ".c"
    options = ("-std=c99",)

    def _glue(self, source: str, entry: str, count: int, folder: Path) -> str:
        images, reads, writes = _images(count), f"buffers[{READ}]", f"buffers[{WRITTEN}]"
        part = ", ".join(["(uint32_t)sizes[4]" if i == 4 else f"sizes[{i}]" for i in range(6)])
        arguments = {
            "wamnet_pixel": [*images, *self._weights(reads), writes, *_sizes(2)],
            "wamnet_trace_pixel": ["&part", writes],
            "wamnet_encode": [reads, *images, *_sizes(3)],
        }
        functions = {"wamnet_pixel": "wamnet_image", "wamnet_trace_pixel": "wamnet_trace"}
        before = {
            "wamnet_trace_pixel": f"const wamnet_part part = {{{part}, (uint32_t)sizes[6]}};\n    "
        }.get(entry, "")
        call = f"{before}{functions.get(entry, entry)}({', '.join(arguments[entry])});"
        head = "void wamnet_call(const int *sizes, float *const *buffers, int columns, int rows)"
        return (
            f'#include "kernel.txt"\n{head};\n{head}\n{{\n    (void)columns;\n    (void)rows;\n'
            f"    {call}\n}}\n"
        )


class CUDARunner(HostRunner):
    """CUDA C as C++."""

    name = "cuda"

    def _glue(self, source: str, entry: str, count: int, folder: Path) -> str:
        images = _images(count)
        reads, writes = f"buffers[{READ}]", f"buffers[{WRITTEN}]"
        arguments = {
            "wamnet_denoise": [*images, *self._weights(reads), writes, *_sizes(2)],
            "wamnet_trace": [writes, *_sizes(7)],
            "wamnet_encode": [reads, *images, *_sizes(3)],
        }
        place = (
            "blockIdx = {(unsigned)column, (unsigned)row, 0}; blockDim = {1, 1, 1}; threadIdx = {0, 0, 0};"
        )
        return CUDA_SHIM + THREADS.format(call=f"{place} {entry}({', '.join(arguments[entry])});")


class MetalRunner(HostRunner):
    """Metal as C++."""

    name = "metal"
    options = ("-std=c++17", "-Wno-attributes")

    def _glue(self, source: str, entry: str, count: int, folder: Path) -> str:
        (folder / "metal_stdlib").write_text(METAL_SHIM, encoding="utf-8")
        places = _bindings(source)
        arguments = [f"buffers[{place}]" for place in places if place]
        call = f"{entry}({', '.join(['*(const Size *)sizes', *arguments])}, {{(uint)column, (uint)row}});"
        return f'#include "kernel.txt"\n{THREADS.format(call=call)}'


def _bindings(source: str) -> Sequence[int]:
    """Return the numbers of the buffers that a kernel of Metal takes, in its order."""
    return [int(number) for number in re.findall(r"\[\[buffer\((\d+)\)\]\]", source)]


def _sizes(count: int) -> list[str]:
    """Return the texts of so many sizes."""
    return [f"sizes[{i}]" for i in range(count)]
