"""CUDA C on NVIDIA's devices: a kernel is compiled by nvcc with a function that launches it, and loaded.

One library more has what the runtime does with memory. Libraries of one process share the device's context.
"""

import ctypes
import math
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wamnet.compiler.artifact import Artifact
from wamnet.compiler.kernel.interface import UNSIGNED
from wamnet.kernels.devices.kernel import Memory
from wamnet.kernels.export import tools
from wamnet.kernels.export.buffer_runner import BufferRunner, Launch
from wamnet.refimpl.errors import CompileError, ExecutorUnavailable

OPTIONS = ("-O3", "-arch=native", "-shared", "-Xcompiler", "-fPIC")
"""Nothing here relaxes arithmetic; products and sums are fused by default, which profile ieee allows."""

BLOCK = (32, 4)
"""Threads (x, y) of a block of kernels that do not wait for each other."""

RUNTIME = """\
#include <cuda_runtime.h>
extern "C" {
int wamnet_name(char *name, int size)
{
    cudaDeviceProp found;
    int version = 0, error = cudaGetDeviceProperties(&found, 0);
    for (int i = 0; i < size; ++i) {
        name[i] = i + 1 < size && !error ? found.name[i] : 0;
    }
    cudaDriverGetVersion(&version);
    return error ? -error : version;
}
int wamnet_memory(void **memory, size_t bytes) { return cudaMalloc(memory, bytes); }
int wamnet_free(void *memory) { return cudaFree(memory); }
int wamnet_store(void *to, const void *from, size_t bytes)
{
    return cudaMemcpy(to, from, bytes, cudaMemcpyHostToDevice);
}
int wamnet_fetch(void *to, const void *from, size_t bytes)
{
    return cudaMemcpy(to, from, bytes, cudaMemcpyDeviceToHost);
}
int wamnet_finish() { return cudaDeviceSynchronize(); }
}
"""
"""What the runtime does with memory."""

GLUE = """\
#include "kernel.txt"
extern "C" int wamnet_launch(
    const int *sizes, float *const *buffers, unsigned columns, unsigned rows, unsigned width, unsigned height)
{{
    {entry}<<<dim3(columns, rows), dim3(width, height)>>>({arguments});
    return cudaGetLastError();
}}
"""
"""The function that launches a kernel: numbers of blocks, then a block's threads."""


class NvccRunner(BufferRunner):
    """The first device of NVIDIA's runtime, and nvcc."""

    name = "cuda"

    def __init__(self) -> None:
        super().__init__()
        self._folder = tempfile.TemporaryDirectory(prefix="wamnet-nvcc-")
        try:
            self._runtime = self._library(RUNTIME)
            name = ctypes.create_string_buffer(256)
            version = self._runtime.wamnet_name(name, len(name))
            if version < 0:
                raise ExecutorUnavailable(f"no device (error {-version}): a driver of NVIDIA is needed")
        except (CompileError, ExecutorUnavailable) as error:
            self.close()
            # -arch=native is refused where there is no device.
            raise ExecutorUnavailable(f"CUDA: {error}") from None
        self.device = f"{name.value.decode()}, CUDA {version // 1000}.{version % 1000 // 10}"

    def _library(self, source: str, kernel: str = "") -> Any:
        """Return a library made of a source."""
        folder = Path(tempfile.mkdtemp(dir=self._folder.name))
        (folder / "kernel.txt").write_text(kernel, encoding="utf-8")
        (folder / "glue.cu").write_text(source, encoding="utf-8")
        tools.run("nvcc", *OPTIONS, "-I.", "-o", "made.so", "glue.cu", folder=folder)
        return ctypes.CDLL(str(folder / "made.so"))

    def _done(self, error: int) -> None:
        """Refuse what the runtime refuses."""
        if error:
            raise CompileError(f"{self.device}: CUDA error {error}")

    def _build(self, kernel: Artifact, group: tuple[int, int] | None) -> Any:
        taken = kernel.interface
        numbers = taken.numbers()
        arguments = [f"buffers[{numbers[array.name]}]" for array in taken.arrays]
        arguments += [f"{'(unsigned)' * (n in UNSIGNED)}sizes[{i}]" for i, n in enumerate(taken.integers)]
        glue = GLUE.format(entry=kernel.entry_point, arguments=", ".join(arguments))
        return self._library(glue, kernel.source), group or BLOCK

    def _memory(self, name: str, shape: tuple[int, ...]) -> Memory:
        held = ctypes.c_void_p()
        self._done(self._runtime.wamnet_memory(ctypes.byref(held), ctypes.c_size_t(4 * math.prod(shape))))
        return Memory(shape, held)

    def _store(self, name: str, array: NDArray[np.float32]) -> Memory:
        made, data = self._memory(name, array.shape), np.ascontiguousarray(array)
        pointer = ctypes.c_void_p(data.ctypes.data)
        self._done(self._runtime.wamnet_store(made.held, pointer, ctypes.c_size_t(data.nbytes)))
        return made

    def _fetch(self, name: str, memory: Memory) -> NDArray[np.float32]:
        found = np.empty(memory.shape, np.float32)
        pointer = ctypes.c_void_p(found.ctypes.data)
        self._done(self._runtime.wamnet_fetch(pointer, memory.held, ctypes.c_size_t(found.nbytes)))
        return found

    def _release(self, memory: Memory) -> None:
        self._runtime.wamnet_free(memory.held)

    def _finish(self) -> None:
        self._done(self._runtime.wamnet_finish())

    def _launch(self, built: Any, launch: Launch) -> None:
        library, block = built
        count = max(launch.buffers) + 1
        pointers = (ctypes.c_void_p * count)(*(launch.buffers.get(n) for n in range(count)))
        integers = (ctypes.c_uint32 * len(launch.integers))(*launch.integers.tolist())
        blocks = [-(-threads // size) for threads, size in zip(launch.threads, block, strict=True)]
        self._done(library.wamnet_launch(integers, pointers, *blocks, *block))

    def close(self) -> None:
        """Remove the folder."""
        self._folder.cleanup()
