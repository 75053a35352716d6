"""Exported shaders on OpenGL, in the language of their target.

1. Fragment shaders: a driver with ARB_ES3_compatibility, as Mesa's, takes GLSL ES 3.00 with the rules of that
   language [`ESRunner`].
2. Compute shaders, which are kernels on buffers, on OpenGL 4.3 [`ComputeRunner`].

3. Shaders of Shadertoy and Godot: the words of their hosts are declared around them [`ShadertoyRunner`].
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray

from ...compiler.artifact import Artifact
from ...compiler.kernel.interface import BLOCK, TABLE, Interface
from ...compiler.languages.glsl import SHADER_VERSION
from ...compiler.languages.glsl_es import VERSION
from ...refimpl.errors import CompileError, ExecutorUnavailable
from ..devices.kernel import Memory, Size
from ..devices.opengl_executor import OpenGLExecutor
from . import tools
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


# ---- hosts ------------------------------------------------------------------------------------------------


GODOT_WORDS = re.compile(
    r"^(?:shader_type|render_mode)\b.*;\n|(?<=^uniform )(\w+ \w+) (?:: .*|= \d+);$", re.M
)
"""What no other language has: the kind of a shader, and what follows the names of uniforms."""


class ShadertoyRunner(ESRunner):
    """Tabs of Shadertoy."""

    name = "shadertoy"

    def _wrapped(self, source: str) -> str:
        """Return a kernel as a shader of its own: what its host declares before it, and what calls it."""
        return tools.shim(f"{self.name}.frag").replace("@kernel@", source)

    def _program(self, source: str, made: ExitStack) -> tuple[Any, Any]:
        return super()._program(self._wrapped(source), made)

    def _values(self, integers: Mapping[str, int]) -> Mapping[str, Any]:
        """Return the host's numbers for a picture."""
        return {"iResolution": (float(integers["width"]), float(integers["height"]), 1.0)}

    def _named(self, taken: Interface, arrays: Mapping[str, Memory]) -> dict[str, Any]:
        """Return the textures under the host's names."""
        return {f"iChannel{i}": texture for i, texture in enumerate(super()._named(taken, arrays).values())}

    def _fetch(self, name: str, memory: Memory) -> NDArray[np.float32]:
        """Return what was drawn with the picture's top row first: Shadertoy shows row 0 at the bottom."""
        return super()._fetch(name, memory)[::-1].copy()

    def draw(self, source: str, size: tuple[int, int], values: dict[str, Any]) -> NDArray[np.float32]:
        """Return what a pass without images writes (H, W, 4), texel row 0 first, with numbers by name."""
        numbers = {**self._values({"width": size[1], "height": size[0]}), **values}
        with self._session(size), ExitStack() as made:
            program, triangle = self._program(source, made)
            made.callback(triangle.release)
            written = self._memory("what the pass draws", (*size, 4))
            made.callback(self._release, written)
            self._draw(program, triangle, written.held, {}, numbers)
            return super()._fetch("what the pass draws", written)


class GodotRunner(ShadertoyRunner):
    """Shaders of Godot's canvas items."""

    name = "godot"
    homes = (TABLE,)

    def _wrapped(self, source: str) -> str:
        # What is left of a match is a uniform's type and name.
        return super()._wrapped(GODOT_WORDS.sub(lambda match: f"{match[1]};" if match[1] else "", source))

    def _values(self, integers: Mapping[str, int]) -> Mapping[str, Any]:
        return {"wamnet_size": (float(integers["width"]), float(integers["height"]))}

    def _named(self, taken: Interface, arrays: Mapping[str, Memory]) -> dict[str, Any]:
        return ESRunner._named(self, taken, arrays)

    def _fetch(self, name: str, memory: Memory) -> NDArray[np.float32]:
        return ESRunner._fetch(self, name, memory)
