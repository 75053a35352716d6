"""Kernels as fragment shaders through moderngl: a GPU's driver or Mesa's software renderer, no window needed.

1. Get a context [`CONTEXTS`]: through EGL, or through OSMesa, which renders into main memory [`osmesa.py`].
2. Upload images and weights as float textures; texel row 0 is the frame's top row.
3. Draw one triangle that covers a float colour buffer of the image's size [`CORNERS`], and read it
   back: fragment (x, y) computed the pixel in column x of row y, so rows need no turning.
4. What a kernel writes is as many textures as its channels, or planes, fill; the next one reads them.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray

from ...compiler.artifact import Artifact
from ...compiler.kernel.interface import DENOISE, PLANES, READ, SCENE_NUMBERS, WEIGHTS, Interface
from ...compiler.languages.glsl import ORDER_EXTENSION, SHADER_VERSION, WEIGHT_TEXTURE_WIDTH
from ...compiler.schedules.plain import WEIGHTS_A_TEXEL
from ...refimpl.errors import CompileError, ExecutorUnavailable, InputError
from . import llvmpipe, osmesa
from .executor import GPU_SCHEDULE, Executor
from .kernel import Memory, Size, batches
from .registry import CONTEXT_VARIABLE

CORNERS = """\
void main()
{
    gl_Position = vec4(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0, 0.0, 1.0);
}
"""
"""A vertex shader below its version: a triangle from (-1, -1) to (3, -1) and (-1, 3), which covers the square
of all pixels without a seam."""


def _created(**options: Any) -> Any:
    """Return a context of OpenGL 4.3, or 3.3 without compute shaders: some drivers give what is required."""
    try:
        return moderngl.create_context(require=SHADER_VERSION, standalone=True, **options)
    except Exception:  # noqa: BLE001 (moderngl and drivers raise what they like)
        return moderngl.create_context(require=330, standalone=True, **options)


CONTEXTS: Mapping[str, Callable[[], Any]] = {
    "egl": lambda: _created(backend="egl"),
    "osmesa": lambda: _created(context=osmesa.OSMesaContext()),
}
"""Kinds of context, in the order in which `auto` tries them."""

HOW_TO_GET = {
    "egl": "install libegl1 and a driver (Mesa's: libgl1-mesa-dri, libegl-mesa0)",
    "osmesa": "install libosmesa6",
}
"""What to do when a kind of context cannot be had, in Debian's words."""


SOFTWARE_SCHEDULE = "fftpasses:32"
"""Schedule of a denoiser on llvmpipe: a twelfth of the operations, and programs that compile in seconds."""

SOFTWARE_PIXELS = 2**14
"""Pixels of the smallest picture for which that is compiled: llvmpipe takes two seconds, in which the plain
kernel computes some 14,000 pixels of the bundled network."""


@dataclass(frozen=True)
class _Uniforms:
    """Numbers that are uniforms, four to a vector: they reach the device when a kernel is drawn."""

    numbers: NDArray[np.float32]

    @property
    def vectors(self) -> NDArray[np.float32]:
        """Return the numbers (n, 4)."""
        return self.numbers.reshape(-1, 4)

    def release(self) -> None:
        """Do nothing."""


class OpenGLExecutor(Executor):
    """One OpenGL context; another version of the language has another `version`."""

    name = "opengl"
    version = "#version 330 core"
    smooths = True

    def __init__(self, context: str | None = None) -> None:
        super().__init__()
        kind, self._context = _open(context or os.environ.get(CONTEXT_VARIABLE) or "auto")
        self._between_passes: list[Any] = []
        # Enter it and leave it: EGL would take it for the current one also after OSMesa has made its own
        # current, and do nothing when it is asked to change.
        with self._context:
            self.device = f"{self._context.info['GL_RENDERER']} through {kind}"
        computes = self._context.version_code >= SHADER_VERSION
        if llvmpipe.NAME in self.device and computes:
            self.schedule_pixels = SOFTWARE_PIXELS
            devices = f"software, {SOFTWARE_SCHEDULE} from {SOFTWARE_PIXELS} pixels on"
            self._suits(devices, SOFTWARE_SCHEDULE)
        elif computes:
            self._suits("graphics processors", GPU_SCHEDULE)
        else:
            self.schedule_reason = f"built-in choice before OpenGL {SHADER_VERSION / 100:.1f}"
        self.driver = self._context.info["GL_VERSION"]

    @contextmanager
    def _session(self, size: Size | None = None) -> Iterator[None]:
        """Make the context current."""
        with self._context:
            yield

    def _first_run(self, size: Size) -> Size:
        """llvmpipe compiles again for textures whose width or height is, or is not, a power of two."""
        height, width = size
        return 3 if height & (height - 1) else 2, 3 if width & (width - 1) else 2

    def _prepare(self, kernel: Artifact) -> tuple[tuple[Any, ...], Any]:
        """Return the programs, one for each launch, and the triangle of one that draws; others have none."""
        if kernel.role == DENOISE:
            self._check(kernel)
        with ExitStack() as made:
            if _computes(kernel):
                programs, triangle = self._computing(kernel, made), None
            else:
                program, triangle = self._program(kernel.source, made)
                programs = (program,)
            made.pop_all()
            return programs, triangle

    def _check(self, artifact: Artifact) -> None:
        """Refuse a bound that the device cannot keep, and loops that Mesa's renderer ends too early."""
        rounds = any(artifact.manifest["bound"]["output"] or ())
        if rounds and ORDER_EXTENSION not in self._context.extensions:
            raise CompileError(
                f"{self.device} lacks {ORDER_EXTENSION}, which the error bound needs (`precise`): use "
                "profile native, which then has no bound, or executor opencl or numpy"
            )
        count = llvmpipe.iterations(artifact.source) if llvmpipe.NAME in self.device else 0
        if count > llvmpipe.MOST_ITERATIONS:
            raise CompileError(
                f"{self.device}: the kernel's loops take {count} iterations; beyond about "
                f"{llvmpipe.MOST_ITERATIONS} this renderer exits loops early, without an error; "
                "use executor c, opencl or numpy, or a variant with fewer products"
            )

    def _discard(self, prepared: tuple[tuple[Any, ...], Any]) -> None:
        programs, triangle = prepared
        for thing in (triangle, *programs):
            if thing is not None:
                thing.release()

    def _computing(self, kernel: Artifact, made: ExitStack) -> tuple[Any, ...]:
        """Return the compute shader of each launch; `made` gives them back if something fails."""
        if self._context.version_code < SHADER_VERSION:
            raise CompileError(
                f"{self.device} has OpenGL {self._context.version_code / 100:.1f}: schedule "
                f"{kernel.manifest['schedule']['name']} is a compute shader, which needs OpenGL "
                f"{SHADER_VERSION / 100:.1f}; use schedule plain"
            )
        programs = []
        for launch in kernel.launches or (kernel,):
            try:
                programs.append(self._context.compute_shader(launch.source))
            except moderngl.Error as error:
                raise CompileError(f"{self.device} cannot build the kernel: {error}") from None
            made.callback(programs[-1].release)
        return tuple(programs)

    def _program(self, source: str, made: ExitStack) -> tuple[Any, Any]:
        """Return the shaders and the triangle that they draw; `made` gives them back if something fails."""
        try:
            corners = f"{self.version}\n{CORNERS}"
            program = self._context.program(vertex_shader=corners, fragment_shader=source)
        except moderngl.Error as error:
            raise CompileError(f"{self.device} cannot build the kernel: {error}") from None
        made.callback(program.release)
        return program, self._context.vertex_array(program, [])

    def _weights(self, artifact: Artifact) -> Memory:
        """Return the weights as a texture of whole rows, those of compute shaders as a storage buffer."""
        if _computes(artifact):
            data = artifact.weights.astype("<f4").tobytes() or bytes(16)
            return Memory(artifact.weights.shape, [self._context.buffer(data)])
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
        return Memory(padded.shape, [self._texture("weights", padded.shape, padded.tobytes())])

    def _store(self, name: str, array: NDArray[np.float32]) -> Memory:
        """Return an image or a table as a texture, planes as textures of four, numbers as uniforms."""
        if name == SCENE_NUMBERS:
            return Memory(array.shape, [_Uniforms(np.pad(array, (0, -len(array) % 4)))])
        if name not in PLANES:
            image = array if array.ndim == 3 else np.atleast_2d(array)[..., np.newaxis]
            return Memory(array.shape, [self._texture(name, image.shape, image.tobytes())])
        planes = np.pad(array, ((0, -len(array) % 4), (0, 0), (0, 0)))
        fours = [np.moveaxis(planes[first : first + 4], 0, -1) for first in range(0, len(planes), 4)]
        return Memory(array.shape, self._textures(name, array.shape[1:], [four.tobytes() for four in fours]))

    def _memory(self, name: str, shape: tuple[int, ...]) -> Memory:
        """Return textures of four channels, or planes, each."""
        numbers, size = (shape[0], shape[1:]) if name in PLANES else (shape[2], shape[:2])
        return Memory(shape, self._textures(name, size, [None] * -(-numbers // 4)))

    def _textures(self, name: str, size: Sequence[int], contents: Sequence[bytes | None]) -> list[Any]:
        """Return textures of four channels; if one fails the others are given back."""
        with ExitStack() as made:
            textures = []
            for content in contents:
                textures.append(self._texture(name, (*size, 4), content))
                made.callback(textures[-1].release)
            made.pop_all()
        return textures

    def _release(self, memory: Memory) -> None:
        for texture in memory.held:
            texture.release()

    def _fetch(self, name: str, memory: Memory) -> NDArray[np.float32]:
        size = memory.shape[1:] if name in PLANES else memory.shape[:2]
        read = [np.frombuffer(texture.read(), np.float32).reshape(*size, 4) for texture in memory.held]
        pixels = np.concatenate(read, axis=-1)
        if name in PLANES:
            return np.moveaxis(pixels, -1, 0)[: memory.shape[0]]
        return pixels[..., : memory.shape[2]].copy()

    def _finish(self) -> None:
        self._context.finish()

    def _start(
        self, kernel: Artifact, prepared: Any, arrays: Mapping[str, Memory], integers: Mapping[str, int]
    ) -> None:
        programs, triangle = prepared
        targets = [texture for each in kernel.interface.written for texture in arrays[each.name].held]
        textures = self._named(kernel.interface, arrays)
        if triangle is None:
            self._dispatch(kernel, programs, arrays[WEIGHTS].held[0], textures, targets[0])
            return
        if WEIGHTS in arrays:
            textures["weight_texture"] = arrays[WEIGHTS].held[0]
        values = dict(self._values(integers))
        if SCENE_NUMBERS in arrays:
            values[SCENE_NUMBERS] = arrays[SCENE_NUMBERS].held[0].vectors
        self._draw(programs[0], triangle, targets, textures, values)

    def _draw(
        self,
        program: Any,
        triangle: Any,
        targets: Sequence[Any],
        textures: Mapping[str, Any],
        values: Mapping[str, Any],
    ) -> None:
        """Draw into textures, reading others, and numbers, under their uniforms' names."""
        frame = self._context.framebuffer(list(targets))
        try:
            self._bind(program, textures, values)
            frame.use()
            triangle.render(mode=moderngl.TRIANGLES, vertices=3)
        finally:
            frame.release()

    def _named(self, taken: Interface, arrays: Mapping[str, Memory]) -> dict[str, Any]:
        """Return what a kernel reads, by uniforms: images of one memory take its textures in turn."""
        left = {id(memory): list(memory.held) for memory in arrays.values()}
        named: dict[str, Any] = {}
        for array in taken.arrays:
            if array.access != READ or array.name in (WEIGHTS, SCENE_NUMBERS):
                continue
            textures = left[id(arrays[array.name])]
            if array.name in PLANES:
                named |= {f"{array.name}_{number}": texture for number, texture in enumerate(textures)}
            else:
                named[array.name] = textures.pop(0)
        return named

    def _values(self, integers: Mapping[str, int]) -> Mapping[str, Any]:
        """Return a kernel's numbers under its uniforms' names."""
        return integers

    def _dispatch(
        self, kernel: Artifact, programs: Sequence[Any], weights: Any, textures: Mapping[str, Any], into: Any
    ) -> None:
        """Run a compute shader, which writes a texture, or launches for one batch of tiles after another."""
        schedule, (width, height) = kernel.manifest["schedule"], into.size
        weights.bind_to_storage_buffer(0)
        into.bind_to_image(0, read=False, write=True)
        if "launches" not in schedule:
            self._bind(programs[0], textures, {})
            columns, rows = schedule["group"]
            programs[0].run(-(-width // (columns * schedule["pixels"])), -(-height // rows), 1)
            self._context.memory_barrier()
            return
        batch, firsts = batches(schedule, (height, width))
        sizes = [4 * count * batch for count in schedule["memory"].values()]
        if [buffer.size for buffer in self._between_passes] != sizes:
            while self._between_passes:
                self._between_passes.pop().release()
            for size in sizes:
                self._between_passes.append(self._context.buffer(reserve=size))
        for number, buffer in enumerate(self._between_passes, 1):
            buffer.bind_to_storage_buffer(number)
        for first in firsts:
            for program, launch in zip(programs, schedule["launches"], strict=True):
                self._bind(program, textures, {"first_tile": first, "tile_count": batch})
                program.run(batch // (launch["tiles"] * schedule["items"]), launch["lines"], 1)
                self._context.memory_barrier()

    def _bind(self, program: Any, textures: Mapping[str, Any], values: Mapping[str, Any]) -> None:
        """Give a program its textures and numbers."""
        units = {name: unit for unit, name in enumerate(textures)}
        for name, texture in textures.items():
            texture.use(units[name])
        for name, value in {**units, **values}.items():
            # A driver removes what the shader does not read, and its name with it.
            if name in program and isinstance(value, np.ndarray):
                # It may keep only the vectors up to the last one that is read.
                program[name].write(value[: program[name].array_length].tobytes())
            elif name in program:
                program[name].value = value

    def _texture(self, name: str, shape: tuple[int, ...], content: bytes | None) -> Any:
        """Return a float texture (H, W, C) that is read texel by texel; refuse what none holds."""
        (height, width, channels), largest = shape, self._context.info["GL_MAX_TEXTURE_SIZE"]
        if max(height, width) > largest or channels > 4:
            raise InputError(
                f"texture for {name!r}",
                f"{width} x {height} with {channels} channels",
                f"this OpenGL takes at most {largest} x {largest} with 4 channels",
                "split the image, or use another executor",
            )
        texture = self._context.texture((width, height), channels, content, dtype="f4")
        texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
        return texture

    def close(self) -> None:
        """Release the context and all that lives in it."""
        self._built.clear()
        self._context.release()


def _computes(kernel: Artifact) -> bool:
    """Tell whether a kernel is compute shaders; all others draw."""
    return bool({"group", "launches"} & set(kernel.manifest.get("schedule", ())))


def _open(kind: str) -> tuple[str, Any]:
    """Return the kind of the context and the context, or say why there is none."""
    if kind != "auto" and kind not in CONTEXTS:
        raise InputError("OpenGL context", kind, "unknown", f"choose one of auto, {', '.join(CONTEXTS)}")
    reasons = []
    for name in CONTEXTS if kind == "auto" else (kind,):
        try:
            return name, CONTEXTS[name]()
        except Exception as error:  # noqa: BLE001 (moderngl, ctypes and drivers raise what they like)
            reasons.append(f"{name}: {error}; {HOW_TO_GET[name]}")
    raise ExecutorUnavailable(f"OpenGL 3.3: no context. {' | '.join(reasons)}")
