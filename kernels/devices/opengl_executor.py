"""Kernels as fragment shaders through moderngl: a GPU's driver or Mesa's software renderer, no window needed.

1. Get a context [`CONTEXTS`]: through EGL, or through OSMesa, which renders into main memory [`osmesa.py`].
2. Upload images and weights as float textures; texel row 0 is the frame's top row.
3. Draw one triangle that covers a float colour buffer of the image's size [`CORNERS`], and read it
   back: fragment (x, y) computed the pixel in column x of row y, so rows need no turning.
4. Of two passes the first one draws into as many buffers as its channels fill, which the second one reads
   [`OpenGLExecutor._draw_all`].
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray

from ...compiler.artifact import Artifact
from ...compiler.languages.glsl import ORDER_EXTENSION, WEIGHT_TEXTURE_WIDTH
from ...compiler.scenes.encode_kernel import EncodeArtifact
from ...compiler.scenes.path_kernel import PathArtifact
from ...compiler.schedules.emit import output_channels
from ...compiler.schedules.emit_packed import WEIGHTS_A_TEXEL
from ...compiler.schedules.factor import HORIZONTAL
from ...compiler.schedules.glsl_compute import SHADER_VERSION
from ...refimpl.errors import CompileError, ExecutorUnavailable, InputError
from . import osmesa
from .executor import Executor, Part, keep
from .images import Images, black, gather_of
from .passes import PICTURE, Passes
from .registry import CONTEXT_VARIABLE

CORNERS = """\
void main()
{
    gl_Position = vec4(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0, 0.0, 1.0);
}
"""
"""A vertex shader below its version: a triangle from (-1, -1) to (3, -1) and (-1, 3), which covers the square
of all pixels without a seam."""


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


SOFTWARE = "llvmpipe"
"""What the renderer's name holds if it is Mesa's, on a processor."""

SOFTWARE_SCHEDULE = "inlined"
"""Schedule of a denoiser there: reads of weights are chains of checks and gathers, constants are not."""

GPU_SCHEDULE = "compute4"
"""Schedule of a denoiser on a graphics processor with compute shaders."""

SOFTWARE_PIXELS = 700_000
"""Pixels of the smallest picture for which that is compiled: llvmpipe compiles a weight in 0.63 ms on one
core, and on two cores multiplies by it in 0.96 ns with the plain kernel, in 0.04 ns with the other: 690
thousand pixels pay for the time."""


@dataclass(frozen=True)
class _Built:
    """A kernel on the device, with weights or None, and the sizes of which it has drawn a few pixels.

    A compute shader has no triangle, and the pixels (x, y) of a group's `tile`.
    """

    program: Any
    triangle: Any
    weights: Any
    tile: tuple[int, int] | None = None
    drawn: set[tuple[int, int]] = field(default_factory=set)

    def release(self) -> None:
        """Give it back."""
        for thing in (self.triangle, self.program, self.weights):
            if thing is not None:
                thing.release()


class OpenGLExecutor(Executor):
    """One OpenGL context; another version of the language has another `version`."""

    name = "opengl"
    version = "#version 330 core"

    def __init__(self, context: str | None = None) -> None:
        kind, self._context = _open(context or os.environ.get(CONTEXT_VARIABLE) or "auto")
        # Enter it and leave it: EGL would take it for the current one also after OSMesa has made its own
        # current, and do nothing when it is asked to change.
        with self._context:
            self.device = f"{self._context.info['GL_RENDERER']} through {kind}"
        if SOFTWARE in self.device:
            self.schedule, self.schedule_pixels = SOFTWARE_SCHEDULE, SOFTWARE_PIXELS
            name, least = SOFTWARE_SCHEDULE, SOFTWARE_PIXELS
            self.schedule_reason = f"built-in choice for software, {name} from {least} pixels on"
        elif self._context.version_code >= SHADER_VERSION:
            self.schedule = GPU_SCHEDULE
            self.schedule_reason = "built-in choice for graphics processors, not measured on one"
        else:
            self.schedule_reason = f"built-in choice before OpenGL {SHADER_VERSION / 100:.1f}"
        self.driver = self._context.info["GL_VERSION"]
        self._built: dict[str, _Built] = {}
        self._paths: dict[str, _Built] = {}
        self._encoders: dict[str, _Built] = {}

    def build(self, artifact: Artifact, size: tuple[int, int] = (1, 1)) -> None:
        """Compile the shaders, upload the weights, and draw a few pixels."""
        for kernel in artifact.kernels:
            built = self._built.get(kernel.digest) or self._compile(kernel)
            with self._context:
                for old in keep(self._built, kernel.digest, built):
                    old.release()
        # llvmpipe compiles again for textures whose width or height is, or is not, a power of two.
        small = (3 if size[0] & (size[0] - 1) else 2, 3 if size[1] & (size[1] - 1) else 2)
        built = self._built[artifact.kernels[-1].digest]
        if small not in built.drawn:
            self._run(artifact, black(artifact, small))
            built.drawn.add(small)

    def _compile(self, artifact: Artifact) -> _Built:
        """Compile the shaders and upload the weights."""
        if artifact.manifest["bound"]["output"] and ORDER_EXTENSION not in self._context.extensions:
            raise CompileError(
                f"{self.device} lacks {ORDER_EXTENSION}, whose `precise` the error bound needs: use profile "
                "native, which then promises nothing, or executor opencl or numpy"
            )
        if "group" in artifact.manifest["schedule"]:
            return self._compile_compute(artifact)
        with self._context, ExitStack() as made:
            weights = self._weights(artifact)
            made.callback(weights.release)
            program, triangle = self._program(artifact.source, made)
            made.pop_all()
            return _Built(program, triangle, weights)

    def _compile_compute(self, artifact: Artifact) -> _Built:
        """Compile a compute shader, and put the weights into a storage buffer."""
        schedule = artifact.manifest["schedule"]
        if self._context.version_code < SHADER_VERSION:
            raise CompileError(
                f"{self.device} has OpenGL {self._context.version_code / 100:.1f}: schedule "
                f"{schedule['name']} is a compute shader, which OpenGL "
                f"{SHADER_VERSION / 100:.1f} has; use schedule plain"
            )
        with self._context, ExitStack() as made:
            data = artifact.weights.astype("<f4").tobytes() or bytes(16)
            weights = self._context.buffer(data)
            made.callback(weights.release)
            try:
                program = self._context.compute_shader(artifact.source)
            except moderngl.Error as error:
                raise CompileError(f"{self.device} does not build the kernel: {error}") from None
            made.pop_all()
            width, height = schedule["group"]
            return _Built(program, None, weights, (width * schedule["pixels"], height))

    def _program(self, source: str, made: ExitStack) -> tuple[Any, Any]:
        """Return the shaders and the triangle that they draw; `made` gives them back if something fails."""
        try:
            corners = f"{self.version}\n{CORNERS}"
            program = self._context.program(vertex_shader=corners, fragment_shader=source)
        except moderngl.Error as error:
            raise CompileError(f"{self.device} does not build the kernel: {error}") from None
        made.callback(program.release)
        return program, self._context.vertex_array(program, [])

    def _weights(self, artifact: Artifact) -> Any:
        """Return the weights as a texture of whole rows."""
        texel = artifact.manifest["schedule"].get(WEIGHTS_A_TEXEL, 1)
        rows = max(1, -(-artifact.weights.size // (WEIGHT_TEXTURE_WIDTH * texel)))
        largest = self._context.info["GL_MAX_TEXTURE_SIZE"]
        if rows > largest:
            raise CompileError(
                f"{artifact.weights.size} weights fill {rows} rows of a texture: this OpenGL takes at most "
                f"{largest}; use narrower layers, or executor opencl or numpy"
            )
        padded = np.zeros((rows, WEIGHT_TEXTURE_WIDTH, texel), np.float32)
        padded.reshape(-1)[: artifact.weights.size] = artifact.weights
        return self._texture("weights", padded)

    def _run(self, artifact: Artifact, images: Images) -> NDArray[np.float32]:
        size, textures = next(iter(images.values())).shape[:2], {}
        with self._context, ExitStack() as made:
            for name, image in images.items():
                textures[name] = self._texture(name, image)
                made.callback(textures[name].release)
            drawn = [self._drawn_into(kernel, size, made) for kernel in artifact.kernels]
            self._draw_all(artifact, textures, drawn)
            read = [np.frombuffer(target.read(), np.float32).reshape(*size, 4) for target in drawn[-1][1]]
        return np.concatenate(read, axis=-1)[..., : output_channels(artifact.program)].copy()

    def _drawn_into(self, kernel: Artifact, size: tuple[int, ...], made: ExitStack) -> tuple[Any, list[Any]]:
        """Return the framebuffer and the textures that a kernel draws into."""
        count = -(-output_channels(kernel.program) // 4)
        return self._targets("the pictures", (size[0], size[1]), count, made)

    def _draw_all(
        self, artifact: Artifact, textures: Mapping[str, Any], drawn: Sequence[tuple[Any, list[Any]]]
    ) -> None:
        """Draw an artifact's kernels one after another: images (by name), then what each pass has drawn."""
        for kernel, into in zip(artifact.kernels, drawn, strict=True):
            built = self._built[kernel.digest]
            named = {f"image_{image.name}": textures[image.name] for image in gather_of(kernel).images}
            self._denoise(built, into, named)
            textures = {f"{HORIZONTAL}_{number}": target for number, target in enumerate(into[1])}

    def _denoise(self, built: _Built, drawn: tuple[Any, list[Any]], textures: Mapping[str, Any]) -> None:
        """Run a kernel into the textures of a framebuffer: a compute shader has one."""
        frame, targets = drawn
        if built.tile is None:
            self._draw(built, frame, {"weight_texture": built.weights, **textures})
            return
        self._bind(built, textures, {})
        built.weights.bind_to_storage_buffer(0)
        targets[0].bind_to_image(0, read=False, write=True)
        groups = (-(-n // size) for n, size in zip(targets[0].size, built.tile, strict=True))
        built.program.run(*groups, 1)
        self._context.memory_barrier()

    def _draw(
        self,
        built: _Built,
        frame: Any,
        textures: Mapping[str, Any],
        values: Mapping[str, int] | None = None,
    ) -> None:
        """Draw a built shader into a framebuffer, with textures and numbers under their uniforms' names."""
        self._bind(built, textures, values or {})
        frame.use()
        built.triangle.render(mode=moderngl.TRIANGLES, vertices=3)

    def _bind(self, built: _Built, textures: Mapping[str, Any], values: Mapping[str, int]) -> None:
        """Give a built shader its textures and numbers."""
        units = {name: unit for unit, name in enumerate(textures)}
        for name, texture in textures.items():
            texture.use(units[name])
        for name, value in {**units, **values}.items():
            # A driver removes what the shader does not read, and its name with it.
            if name in built.program:
                built.program[name].value = value

    def forget(self) -> None:
        """Drop the kernels that were built."""
        for kernels in (self._built, self._paths, self._encoders):
            with self._context:
                for built in kernels.values():
                    built.release()
            kernels.clear()

    def build_path(self, kernel: PathArtifact) -> None:
        """Compile the shaders and draw one pixel: drivers finish compiling when they draw."""
        known = self._paths.get(kernel.digest)
        with self._context, ExitStack() as made:
            built = known or _Built(*self._program(kernel.source, made), None)
            made.pop_all()
            for old in keep(self._paths, kernel.digest, built):
                old.release()
        if known is None:
            self._trace(kernel, Part(1, 1, 0, 1, 0, 1, 0))

    def _trace(self, kernel: PathArtifact, part: Part) -> NDArray[np.float32]:
        with self._context, ExitStack() as made:
            frame, targets = self._targets(
                "the sums", (part.rows, part.width), -(-len(kernel.planes) // 4), made
            )
            self._draw(self._paths[kernel.digest], frame, {}, part.integers)
            read = [np.frombuffer(target.read(), np.float32) for target in targets]
        pixels = np.concatenate([buffer.reshape(part.rows, part.width, 4) for buffer in read], axis=-1)
        return np.moveaxis(pixels, -1, 0)[: len(kernel.planes)]

    def _targets(
        self, name: str, size: tuple[int, int], count: int, made: ExitStack
    ) -> tuple[Any, list[Any]]:
        """Return a framebuffer of `size` (height, width) and its RGBA textures, which `made` gives back."""
        self._check_texture(name, size[::-1], 4)
        targets = []
        for _ in range(count):
            targets.append(self._context.texture(size[::-1], 4, dtype="f4"))
            made.callback(targets[-1].release)
            targets[-1].filter = (moderngl.NEAREST, moderngl.NEAREST)
        frame = self._context.framebuffer(targets)
        made.callback(frame.release)
        return frame, targets

    def _passes(self, encode: EncodeArtifact, denoise: Artifact, size: tuple[int, int]) -> Passes:
        return OpenGLPasses(self, encode, denoise, size)

    def _encoder(self, artifact: EncodeArtifact) -> _Built:
        """Return the built encoding shader."""
        with self._context, ExitStack() as made:
            known = self._encoders.get(artifact.digest)
            built = known or _Built(*self._program(artifact.source, made), None)
            made.pop_all()
            for old in keep(self._encoders, artifact.digest, built):
                old.release()
        return built

    def _texture(self, name: str, array: NDArray[np.float32]) -> Any:
        """Return (H, W, C) as a float texture that is read texel by texel."""
        height, width, channels = array.shape
        self._check_texture(repr(name), (width, height), channels)
        texture = self._context.texture((width, height), channels, array.tobytes(), dtype="f4")
        texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
        return texture

    def _check_texture(self, name: str, size: tuple[int, int], channels: int) -> None:
        """Refuse what no texture holds."""
        largest = self._context.info["GL_MAX_TEXTURE_SIZE"]
        if max(size) > largest or channels > 4:
            raise InputError(
                f"texture for {name}",
                f"{size[0]} x {size[1]} with {channels} channels",
                f"this OpenGL takes at most {largest} x {largest} with 4 channels",
                "split the picture, or use another executor",
            )

    def close(self) -> None:
        """Release the context and all that lives in it."""
        self._built.clear()
        self._paths.clear()
        self._encoders.clear()
        self._context.release()


class OpenGLPasses(Passes):
    """Float textures between fragment passes: what one draws into, the next one reads."""

    def __init__(
        self, executor: OpenGLExecutor, encode: EncodeArtifact, denoise: Artifact, size: tuple[int, int]
    ) -> None:
        super().__init__(encode, denoise, size)
        self._executor = executor
        with executor._context, ExitStack() as made:
            self._sums = executor._targets("the pictures", size, -(-len(encode.planes) // 4), made)
            self._encoded = executor._targets("the pictures", size, len(encode.images), made)
            self._drawn = [executor._drawn_into(kernel, size, made) for kernel in denoise.kernels]
            self._made = made.pop_all()
        names = [image.name for image in encode.images]
        self._images = dict(zip((*names, PICTURE), self._encoded[1] + self._drawn[-1][1], strict=True))

    def trace(self, kernel: PathArtifact, part: Part) -> None:
        """Draw the sums."""
        executor = self._executor
        executor.build_path(kernel)
        with executor._context:
            executor._draw(executor._paths[kernel.digest], self._sums[0], {}, part.integers)

    def encode(self, samples: int) -> None:
        """Draw the feature images."""
        executor = self._executor
        built = executor._encoder(self.encoder)
        textures = {f"sums_{number}": texture for number, texture in enumerate(self._sums[1])}
        with executor._context:
            executor._draw(built, self._encoded[0], textures, {"sample_count": samples})

    def denoise(self) -> None:
        """Draw the picture."""
        executor = self._executor
        executor.build(self.denoiser, self.size)
        with executor._context:
            executor._draw_all(self.denoiser, self._images, self._drawn)

    def read(self, name: str) -> NDArray[np.float32]:
        """Copy a texture to the host."""
        with self._executor._context:
            pixels = np.frombuffer(self._images[name].read(), np.float32).reshape(*self.size, 4)
        return pixels[..., : self.channels(name)].copy()

    def finish(self) -> None:
        """Wait for the context."""
        with self._executor._context:
            self._executor._context.finish()

    def close(self) -> None:
        """Release the textures."""
        with self._executor._context:
            self._made.close()


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
