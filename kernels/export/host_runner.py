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

from ...compiler.interface import FIRST_IMAGE, READ_NUMBER, TABLE, WRITTEN_NUMBER
from ...refimpl.errors import ExecutorUnavailable
from . import tools
from .buffer_runner import BufferRunner, Launch

OPTIONS = ("-O1", "-ffp-contract=off", "-fPIC", "-shared")
"""Nothing here may allow what the standards do not."""

CUDA_SHIM = """\
#include <math.h>
#include <stddef.h>
#define __global__
#define __device__
#define __shared__ static
#define __align__(bytes) alignas(bytes)
#define __launch_bounds__(threads)
#define __syncthreads() wamnet_wait()
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
#define threadgroup static
typedef unsigned int uint;
struct uint2 { uint x, y; };
namespace metal {
struct alignas(16) float4 {
    float x, y, z, w;
    explicit float4(float all) : x(all), y(all), z(all), w(all) {}
    float4(float a, float b, float c, float d) : x(a), y(b), z(c), w(d) {}
};
static inline float4 operator*(float4 a, float b) { return float4(a.x * b, a.y * b, a.z * b, a.w * b); }
static inline void operator+=(float4 &a, float4 b)
{
    a = float4(a.x + b.x, a.y + b.y, a.z + b.z, a.w + b.w);
}
enum class mem_flags { mem_threadgroup };
static inline void threadgroup_barrier(mem_flags) { wamnet_wait(); }
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

ALONE = "static inline void wamnet_wait() {}\n"
"""Nobody waits."""

TOGETHER = """\
#include <barrier>
#include <thread>
#include <vector>
static std::barrier<> *wamnet_barrier;
static inline void wamnet_wait() { wamnet_barrier->arrive_and_wait(); }
"""
"""Threads wait for all others of their group."""

GROUPS = """\
extern "C" void wamnet_call(const int *sizes, float *const *buffers, int columns, int rows)
{{
    for (int group = 0; group < columns * rows; ++group) {{
        int group_column = group % columns, group_row = group / columns;
        std::barrier<> barrier({width} * {height});
        wamnet_barrier = &barrier;
        std::vector<std::thread> items;
        for (int item = 0; item < {width} * {height}; ++item) {{
            items.emplace_back([&barrier, item, group_column, group_row, sizes, buffers] {{
                int column = item % {width}, row = item / {width};
                {call}
                barrier.arrive_and_drop();
            }});
        }}
        for (std::thread &each : items) {{
            each.join();
        }}
    }}
}}
"""
"""The same for kernels whose threads wait: those of a group at once, one group after another."""


class HostRunner(BufferRunner):
    """A compiler and the glue of one language; what it has built stays loaded as long as the process."""

    program = "c++"
    suffix = ".cpp"
    options: tuple[str, ...] = ("-std=c++20", "-pthread")

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

    def _glue(self, source: str, entry: str, count: int, group: tuple[int, int] | None, folder: Path) -> str:
        """Return the text that is compiled, with a function `wamnet_call`."""
        raise NotImplementedError

    def _weights(self, buffer: str) -> list[str]:
        """Return the argument that holds weights, if they are one."""
        return [] if self.name.endswith(TABLE) else [buffer]

    def _prepare(self, source: str, entry: str, count: int, group: tuple[int, int] | None) -> Any:
        self._count += 1
        folder = Path(self._folder.name) / str(self._count)
        folder.mkdir()
        (folder / "kernel.txt").write_text(source, encoding="utf-8")
        glue = self._glue(source, entry, count, group, folder)
        (folder / f"glue{self.suffix}").write_text(glue, encoding="utf-8")
        tools.run(
            self.program,
            *(*self.options, *OPTIONS, "-I.", "-o", "kernel.so", f"glue{self.suffix}", "-lm"),
            folder=folder,
        )
        function = ctypes.CDLL(str(folder / "kernel.so")).wamnet_call
        function.restype = None
        return function, group is not None

    def _launch(self, prepared: Any, launch: Launch) -> list[NDArray[np.float32]]:
        held = {place: np.array(data, np.float32, order="C") for place, data in launch.buffers.items()}
        empty = np.zeros(4, np.float32)
        pointers = (ctypes.c_void_p * (max(held) + 1))(
            *(held.get(place, empty).ctypes.data for place in range(max(held) + 1))
        )
        sizes = (ctypes.c_uint32 * len(launch.sizes))(*(n % 2**32 for n in launch.sizes))
        function, grouped = prepared
        function(sizes, pointers, *(launch.groups if grouped else launch.threads))
        return [held[place].reshape(-1) for place in launch.back]

    def close(self) -> None:
        """Remove the folder."""
        self._folder.cleanup()


def _images(count: int) -> list[str]:
    """Return the texts of so many image buffers."""
    return [f"buffers[{FIRST_IMAGE + i}]" for i in range(count)]


class CRunner(HostRunner):
    """C99, as a C compiler takes it; check.py compiles exports with warnings as errors."""

    name = "c"
    program = "cc"
    suffix = ".c"
    options = ("-std=c99",)

    def _glue(self, source: str, entry: str, count: int, group: tuple[int, int] | None, folder: Path) -> str:
        images, reads, writes = _images(count), f"buffers[{READ_NUMBER}]", f"buffers[{WRITTEN_NUMBER}]"
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

    def _glue(self, source: str, entry: str, count: int, group: tuple[int, int] | None, folder: Path) -> str:
        images = _images(count)
        reads, writes = f"buffers[{READ_NUMBER}]", f"buffers[{WRITTEN_NUMBER}]"
        arguments = {
            "wamnet_denoise": [*images, *self._weights(reads), writes, *_sizes(2)],
            "wamnet_trace": [writes, *_sizes(7)],
            "wamnet_encode": [reads, *images, *_sizes(3)],
        }
        call = f"{entry}({', '.join(arguments[entry])});"
        if group is None:
            place = "blockIdx = {(unsigned)column, (unsigned)row, 0}; blockDim = {1, 1, 1};"
            place += " threadIdx = {0, 0, 0};"
        else:
            place = "blockIdx = {(unsigned)group_column, (unsigned)group_row, 0};"
            place += " threadIdx = {(unsigned)column, (unsigned)row, 0};"
        return _waiting(group) + CUDA_SHIM + _started(f"{place} {call}", group)


class MetalRunner(HostRunner):
    """Metal as C++."""

    name = "metal"
    options = ("-std=c++20", "-pthread", "-Wno-attributes")

    def _glue(self, source: str, entry: str, count: int, group: tuple[int, int] | None, folder: Path) -> str:
        (folder / "metal_stdlib").write_text(METAL_SHIM, encoding="utf-8")
        arguments = ["*(const Size *)sizes", *(f"buffers[{place}]" for place in _bindings(source) if place)]
        places = ["{(uint)column, (uint)row}"]
        if group is not None:
            places.append("{(uint)group_column, (uint)group_row}")
        call = f"{entry}({', '.join([*arguments, *places])});"
        return f'{_waiting(group)}#include "kernel.txt"\n{_started(call, group)}'


def _waiting(group: tuple[int, int] | None) -> str:
    """Return what lets threads wait for those of their group, if there is one."""
    return ALONE if group is None else TOGETHER


def _started(call: str, group: tuple[int, int] | None) -> str:
    """Return the function that runs all threads."""
    if group is None:
        return THREADS.format(call=call)
    return GROUPS.format(call=call, width=group[0], height=group[1])


def _bindings(source: str) -> Sequence[int]:
    """Return the numbers of the buffers that a kernel of Metal takes, in its order."""
    return [int(number) for number in re.findall(r"\[\[buffer\((\d+)\)\]\]", source)]


def _sizes(count: int) -> list[str]:
    """Return the texts of so many sizes."""
    return [f"sizes[{i}]" for i in range(count)]
