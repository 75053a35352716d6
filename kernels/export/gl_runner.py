"""Exported shaders on OpenGL, in the language of their target.

1. Fragment shaders: a driver with ARB_ES3_compatibility, as Mesa's, takes GLSL ES 3.00 with the rules of that
   language [`ESRunner`].
2. Compute shaders, which are kernels on buffers, on OpenGL 4.3 [`ComputeRunner`].
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray

from ...compiler.artifact import Artifact
from ...compiler.kernel.interface import BLOCK
from ...compiler.languages.glsl import SHADER_VERSION
from ...compiler.languages.glsl_es import VERSION
from ...refimpl.errors import CompileError, ExecutorUnavailable
from ..devices.kernel import Memory, Size
from ..devices.opengl_executor import OpenGLExecutor
from .buffer_runner import BufferRunner, Launch


class ESRunner(OpenGLExecutor):
    """GLSL ES 3.00."""

    name = "glsl-es"
    version = VERSION


class ComputeRunner(BufferRunner):
    """One OpenGL context."""

    name = "glsl-compute"
    homes = (BLOCK,)

    def __init__(self, context: str | None = None) -> None:
        super().__init__()
        self._opened = OpenGLExecutor(context)
        self._context = self._opened._context
        self.device = self._opened.device
        if self._context.version_code < SHADER_VERSION:
            raise ExecutorUnavailable(
                f"{self.device} has OpenGL {self._context.version_code / 100:.1f}: compute shaders need "
                f"{SHADER_VERSION / 100:.1f}"
            )

    @contextmanager
    def _session(self, size: Size | None = None) -> Iterator[None]:
        with self._context:
            yield

    def _build(self, kernel: Artifact, group: tuple[int, int] | None) -> Any:
        try:
            return self._context.compute_shader(kernel.source)
        except moderngl.Error as error:
            raise CompileError(f"{self.device} cannot build the kernel: {error}") from None

    def _discard(self, prepared: tuple[Any, ...]) -> None:
        for built in prepared:
            built.release()

    def _store(self, name: str, array: NDArray[np.float32]) -> Memory:
        return Memory(array.shape, self._context.buffer(np.ascontiguousarray(array).tobytes()))

    def _memory(self, name: str, shape: tuple[int, ...]) -> Memory:
        return Memory(shape, self._context.buffer(reserve=4 * math.prod(shape)))

    def _release(self, memory: Memory) -> None:
        memory.held.release()

    def _fetch(self, name: str, memory: Memory) -> NDArray[np.float32]:
        return np.frombuffer(memory.held.read(), np.float32).reshape(memory.shape).copy()

    def _launch(self, built: Any, launch: Launch) -> None:
        whole = np.pad(launch.integers, (0, -len(launch.integers) % 4))
        block = self._context.buffer(whole.tobytes())
        block.bind_to_uniform_block(0)
        for number, buffer in launch.buffers.items():
            if number in launch.blocks:
                buffer.bind_to_uniform_block(number)
            else:
                buffer.bind_to_storage_buffer(number)
        built.run(*launch.groups, 1)
        self._context.memory_barrier()
        block.release()

    def close(self) -> None:
        """Release the context."""
        self._opened.close()
