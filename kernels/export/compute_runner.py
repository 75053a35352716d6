"""Exported compute shaders, which are kernels on buffers, on OpenGL 4.3."""

from __future__ import annotations

from contextlib import ExitStack
from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray

from ...compiler.languages.interface import BLOCK
from ...compiler.schedules.glsl_compute import SHADER_VERSION
from ...refimpl.errors import CompileError, ExecutorUnavailable
from ..devices.opengl_executor import OpenGLExecutor
from .buffer_runner import BufferRunner, Kernel, Launch


class ComputeRunner(BufferRunner):
    """One OpenGL context."""

    name = "glsl-compute"
    homes = (BLOCK,)

    def __init__(self, context: str | None = None) -> None:
        self._opened = OpenGLExecutor(context)
        self._context = self._opened._context
        self.device = self._opened.device
        if self._context.version_code < SHADER_VERSION:
            raise ExecutorUnavailable(
                f"{self.device} has OpenGL {self._context.version_code / 100:.1f}: compute shaders need "
                f"{SHADER_VERSION / 100:.1f}"
            )

    def _prepare(self, kernel: Kernel, group: tuple[int, int] | None) -> Any:
        with self._context:
            try:
                return self._context.compute_shader(kernel.source)
            except moderngl.Error as error:
                raise CompileError(f"{self.device} does not build the kernel: {error}") from None

    def _launch(self, prepared: Any, launch: Launch) -> list[NDArray[np.float32]]:
        with self._context, ExitStack() as made:
            sizes = np.array([n % 2**32 for n in launch.sizes], np.uint32)
            block = self._context.buffer(np.pad(sizes, (0, -len(sizes) % 4)).tobytes())
            block.bind_to_uniform_block(0)
            made.callback(block.release)
            held = {}
            for place, data in launch.buffers.items():
                held[place] = self._context.buffer(np.ascontiguousarray(data).tobytes())
                made.callback(held[place].release)
                if place in launch.blocks:
                    held[place].bind_to_uniform_block(place)
                else:
                    held[place].bind_to_storage_buffer(place)
            prepared.run(*launch.groups, 1)
            self._context.memory_barrier()
            return [np.frombuffer(held[place].read(), np.float32).copy() for place in launch.back]

    def close(self) -> None:
        """Release the context."""
        self._opened.close()
