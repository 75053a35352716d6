"""Kernels as fragment shaders through moderngl: a GPU's driver or Mesa's software renderer, no window needed.

1. Get a context [`CONTEXTS`]: through EGL, or through OSMesa, which renders into main memory [`osmesa.py`].
2. Upload images and weights as float textures; texel row 0 is the frame's top row.
3. Draw one triangle that covers a float colour buffer of the image's size [`VERTEX_SHADER`], and read it
   back: fragment (x, y) computed the pixel in column x of row y, so rows need no turning.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray

from ..compiler.artifact import Artifact
from ..compiler.emit import output_channels
from ..compiler.glsl import WEIGHT_TEXTURE_WIDTH
from ..refimpl.errors import CompileError, ExecutorUnavailable, InputError
from . import osmesa
from .executor import Executor, Images, black

CONTEXT_VARIABLE = "WAMNET_OPENGL_CONTEXT"
"""Environment variable that chooses the kind of context where the caller does not."""

VERTEX_SHADER = """\
#version 330 core
void main()
{
    gl_Position = vec4(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0, 0.0, 1.0);
}
"""
"""A triangle from (-1, -1) to (3, -1) and (-1, 3): it covers the square of all pixels, without a seam."""


def _egl() -> Any:
    """Open a context without a display through EGL."""
    options: dict[str, Any] = {"backend": "egl"}
    return moderngl.create_context(require=330, standalone=True, **options)


def _osmesa() -> Any:
    """Open a context in main memory through OSMesa."""
    options: dict[str, Any] = {"context": osmesa.OSMesaContext()}
    return moderngl.create_context(require=330, standalone=True, **options)


CONTEXTS: Mapping[str, Callable[[], Any]] = {"egl": _egl, "osmesa": _osmesa}
"""Kinds of context, in the order in which `auto` tries them."""

HOW_TO_GET = {
    "egl": "install libegl1 and a driver (Mesa's: libgl1-mesa-dri, libegl-mesa0)",
    "osmesa": "install libosmesa6",
}
"""What to do when a kind of context cannot be had, in Debian's words."""


class OpenGLExecutor(Executor):
    """One OpenGL context."""

    name = "opengl"

    def __init__(self, context: str | None = None) -> None:
        kind, self._context = _open(context or os.environ.get(CONTEXT_VARIABLE) or "auto")
        self.device = f"{self._context.info['GL_RENDERER']} through {kind}"
        self._built: dict[str, tuple[Any, Any, Any]] = {}
        self._drawn: set[tuple[str, tuple[int, int]]] = set()

    def build(self, artifact: Artifact, size: tuple[int, int] = (1, 1)) -> None:
        """Compile the shaders, upload the weights, and draw a few pixels."""
        if artifact.digest not in self._built:
            self._compile(artifact)
        # llvmpipe compiles again for textures whose width or height is, or is not, a power of two.
        small = (3 if size[0] & (size[0] - 1) else 2, 3 if size[1] & (size[1] - 1) else 2)
        if (artifact.digest, small) not in self._drawn:
            self._drawn.add((artifact.digest, small))
            self._run(artifact, black(artifact, small))

    def _compile(self, artifact: Artifact) -> None:
        """Compile the shaders and upload the weights."""
        with self._context:
            try:
                program = self._context.program(vertex_shader=VERTEX_SHADER, fragment_shader=artifact.source)
            except moderngl.Error as error:
                raise CompileError(f"{self.device} does not build the kernel: {error}") from None
            triangle = self._context.vertex_array(program, [])
            self._built[artifact.digest] = (program, triangle, self._weights(artifact))

    def _weights(self, artifact: Artifact) -> Any:
        """Return the weights as a texture of whole rows."""
        rows = max(1, -(-artifact.weights.size // WEIGHT_TEXTURE_WIDTH))
        padded = np.zeros((rows, WEIGHT_TEXTURE_WIDTH, 1), np.float32)
        padded.reshape(-1)[: artifact.weights.size] = artifact.weights
        return self._texture("weights", padded)

    def _run(self, artifact: Artifact, images: Images) -> NDArray[np.float32]:
        program, triangle, weights = self._built[artifact.digest]
        height, width = next(iter(images.values())).shape[:2]
        with self._context:
            textures = {f"image_{name}": self._texture(name, image) for name, image in images.items()}
            target = self._context.texture((width, height), 4, dtype="f4")
            frame = self._context.framebuffer([target])
            try:
                for unit, (name, texture) in enumerate({**textures, "weight_texture": weights}.items()):
                    # A driver removes what the shader does not read, and its name with it.
                    if name in program:
                        program[name].value = unit
                    texture.use(unit)
                frame.use()
                triangle.render(mode=moderngl.TRIANGLES, vertices=3)
                pixels = np.frombuffer(target.read(), np.float32).reshape(height, width, 4)
            finally:
                for thing in (frame, target, *textures.values()):
                    thing.release()
        return pixels[..., : output_channels(artifact.program)].copy()

    def _texture(self, name: str, array: NDArray[np.float32]) -> Any:
        """Return (H, W, C) as a float texture that is read texel by texel."""
        height, width, channels = array.shape
        largest = self._context.info["GL_MAX_TEXTURE_SIZE"]
        if max(height, width) > largest or channels > 4:
            raise InputError(
                f"texture for {name!r}",
                f"{width} x {height} with {channels} channels",
                f"this OpenGL takes at most {largest} x {largest} with 4 channels",
                "split the picture, or use another executor",
            )
        texture = self._context.texture((width, height), channels, array.tobytes(), dtype="f4")
        texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
        return texture

    def close(self) -> None:
        """Release the context and all that lives in it."""
        self._built.clear()
        self._drawn.clear()
        self._context.release()


def _open(kind: str) -> tuple[str, Any]:
    """Return the kind of the context and the context, or say why there is none."""
    if kind != "auto" and kind not in CONTEXTS:
        raise InputError(
            "OpenGL context", kind, f"must be auto, {', '.join(CONTEXTS)}", "choose one of these"
        )
    reasons = []
    for name in CONTEXTS if kind == "auto" else (kind,):
        try:
            return name, CONTEXTS[name]()
        except Exception as error:  # noqa: BLE001 (moderngl, ctypes and drivers raise what they like)
            reasons.append(f"{name}: {error}; {HOW_TO_GET[name]}")
    raise ExecutorUnavailable(f"OpenGL 3.3: no context. {' | '.join(reasons)}")
