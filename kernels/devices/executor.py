"""What every executor is: a device with memory, on which kernels of all roles are built and started.

    run      images -> denoising kernel, or both of its passes -> picture
    call     arrays -> a kernel of any other role -> what it writes
    trace    path kernel -> sums
    passes   paths, encoding and denoiser, without leaving the device [passes.py]
    smooth   layers -> edge-avoiding filter -> image [passes.py]
    follow   first hits, last picture, colour -> history -> this picture

The first three are written once, here; the others are functions of an executor. A device makes a kernel ready
[`Executor._prepare`] and starts it [`_start`]. One with separate memory also makes memory, with a content or
without one [`_store`, `_memory`], copies from it [`_fetch`], and gives it back [`_release`]; others work on
the host's.

`build` is idempotent and does all that can be done before the pixels are known, the driver's own delayed
compilation included: it runs the kernel once on a few pixels. `run` copies the images to the device, runs,
and copies the result back; the times that wamnet reports mean these two [`denoise_on.RunResult`].
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ...compiler.core.ir import Image
from ...compiler.kernel.interface import (
    DENOISE,
    IMAGE,
    LIGHT,
    PLAIN,
    PRIMITIVES,
    READ,
    RESULT,
    SCENE_NUMBERS,
    SUMS,
    WEIGHTS,
)
from ...refimpl.errors import CompileError, InputError
from ..memory import cores
from .kernel import (
    Closing,
    Images,
    Memory,
    Part,
    Size,
    black,
    checked,
    numbers_for,
    plane_integers,
    plane_shape,
    shapes,
    widest,
)

if TYPE_CHECKING:
    from ...compiler.artifact import Artifact
    from ...compiler.targets import Language

KEPT_KERNELS = 64
"""Kernels that an executor keeps built: programs use a few; a process that makes thousands stays small."""

VECTOR_SCHEDULES = {lanes: f"fft:{lanes}" for lanes in (16, 8, 4)}
"""Schedule of a denoiser on a processor, by the floats in its vector registers: each took the least time of
all when PoCL and GCC compiled them for such registers; the tiles of the same vectors take what it refuses."""

GPU_SCHEDULE = "group:2"
"""Schedule of a denoiser on a graphics processor: the fastest of all on an H200."""

STACK_BYTES = 2**20
"""Most bytes of a group's arrays on a processor: half the smallest stack that glibc gives a thread."""

BYTE_SCHEDULE = "dot:16"
"""Schedule of networks of integers on processors with an instruction for products of bytes. Without it loops
and shifts take far longer than tiles of floats."""

INDEX_LIMIT = 2**31
"""Numbers of an image must be fewer where a kernel's indices are `int`."""


@dataclass(frozen=True)
class Built:
    """A kernel that is ready: what the device made of it, its weights there, and the sizes of its runs."""

    prepared: Any
    weights: Memory | None = None
    run_at: set[Size] = field(default_factory=set)


class Executor(Closing, ABC):
    """A device that is open; a context manager that closes it. `name` is its target, `device` a text.

    `profile` is the numerical profile of the kernels that are compiled for it, unless a plan states another.
    `lanes` is the number of paths that its path kernels should follow at once, `schedule` the name of the
    schedule that suits a denoiser on it, for pictures of at least `schedule_pixels`: smaller ones are done
    with the plain kernel before the other is compiled; `schedule_reason` says why.
    `byte_schedule`: that of networks of integers, where the device multiplies bytes. `driver` is the driver's
    version, where `device` does not name it. `trains` says whether it has a compiled trainer. `homes` are the
    homes of weights, apart from the target's usual one, whose kernels it runs
    [compiler/kernel/interface.py]. `paints`: it runs path kernels that write encoded images;
    `smooths`: it filters a frame, and adds a picture to a history, in far less time than the reference.
    `interprets`: it runs programs as they are, without kernels.
    `largest_bytes`: those of an image, where there is a limit.
    """

    name: str
    device: str
    profile: str = "ieee"
    lanes: int = 1
    schedule: str = PLAIN
    schedule_pixels: int = 0
    schedule_reason: str = "the only one"
    byte_schedule: str = ""
    driver: str = ""
    trains: bool = False
    homes: tuple[str, ...] = ()
    paints: bool = False
    smooths: bool = False
    interprets: bool = False
    largest_bytes: int = 0

    def __init__(self) -> None:
        self._built: dict[str, Built] = {}

    @property
    def language(self) -> Language:
        """Return the language of its kernels under its profile, with what there is for it."""
        from ...compiler.targets import language_named

        return language_named(self.name).under(self.profile)

    @property
    def identity(self) -> list[Any]:
        """Return what names the device with its driver, for keys of the cache."""
        return [self.name, self.device, self.driver, cores()]

    # ---- what a device provides --------------------------------------------------------------------------

    @abstractmethod
    def _prepare(self, kernel: Artifact) -> Any:
        """Return a kernel, compiled."""

    def _weights(self, kernel: Artifact) -> Memory:
        """Return a network's weights on the device."""
        return self._store(WEIGHTS, kernel.weights)

    def _discard(self, prepared: Any) -> None:
        """Give a compiled kernel back."""

    def _store(self, name: str, array: NDArray[np.float32]) -> Memory:
        """Return memory with an array's content; `name` is the kernel's name for it."""
        return Memory(array.shape, np.ascontiguousarray(array))

    def _memory(self, name: str, shape: tuple[int, ...]) -> Memory:
        """Return memory that a kernel will write."""
        return Memory(shape, np.empty(shape, np.float32))

    def _result(self, shape: tuple[int, ...]) -> Memory:
        """Return memory for an image that will be fetched once."""
        return self._memory(RESULT, shape)

    def _between(self, shape: tuple[int, ...]) -> Memory:
        """Return memory for what the first pass hands on, perhaps that of the last call."""
        return self._memory(RESULT, shape)

    @abstractmethod
    def _start(
        self, kernel: Artifact, prepared: Any, arrays: Mapping[str, Memory], integers: Mapping[str, int]
    ) -> None:
        """Start a kernel: all arrays by the names of its interface, and at least its integers, by name."""

    def _fetch(self, name: str, memory: Memory) -> NDArray[np.float32]:
        """Wait for what was started, and return the memory's content."""
        held: NDArray[np.float32] = memory.held
        return held.copy()

    def _release(self, memory: Memory) -> None:
        """Give memory back."""

    def _fetch_later(self, name: str, memory: Memory) -> Callable[[], NDArray[np.float32]]:
        """Begin to copy a memory's content, and return what waits for it; the device may work on."""
        content = self._fetch(name, memory)
        return lambda: content

    def _finish(self) -> None:
        """Wait for what was started."""

    @contextmanager
    def _session(self, size: Size | None = None) -> Iterator[None]:
        """Surround all that is done on the device, for a picture of `size` if it is for one; never nested."""
        yield

    def _first_run(self, size: Size) -> Size | None:
        """Return the size of the run with which a driver finishes compiling for pictures of `size`."""
        return None

    def sums_shape(self, kernel: Artifact, rows: int, width: int) -> tuple[int, int, int]:
        """Return (planes, rows, columns) of the sums that a kernel writes: those of a part, or more."""
        return len(kernel.planes), rows, width

    def check_size(self, artifact: Artifact, size: Size) -> None:
        """Refuse images of a size (height, width) beyond `largest_bytes`, or the indices of an `int`."""
        most = widest(artifact)
        count = size[0] * size[1] * most
        if self.largest_bytes and (count >= INDEX_LIMIT or 4 * count > self.largest_bytes):
            raise InputError(
                f"size of the image on {self.device}",
                f"{size[1]} x {size[0]} with {most} channels",
                f"one image must hold fewer than {INDEX_LIMIT} values and at most {self.largest_bytes} bytes",
                "split the image, or use executor numpy",
            )

    def check_stack(self, used: int) -> None:
        """Refuse a kernel whose arrays take so many bytes of a thread's stack."""
        if used > STACK_BYTES:
            raise CompileError(
                f"{self.device}: arrays take {used} bytes per pixel; at most {STACK_BYTES} fit a thread's "
                "stack; use narrower layers, or executor numpy"
            )

    def _suits(self, devices: str, schedule: str = PLAIN) -> None:
        """Choose a schedule for devices like this one."""
        self.schedule, self.schedule_reason = schedule, f"built-in choice for {devices}"

    def open_trainer(self, kernel: Artifact, values: NDArray[Any], targets: NDArray[Any]) -> Any:
        """Return a trainer (opencl_trainer.py) for pictures laid out end to end, or refuse."""
        rule = "has no compiled trainer"
        raise InputError(
            "executor that trains", self.name, rule, "use executor opencl, or refimpl.network.train"
        )

    # ---- what follows from it ----------------------------------------------------------------------------

    def schedule_for(self, size: Size) -> str:
        """Return the name of the schedule that suits one picture of `size` (height, width)."""
        return self.schedule if size[0] * size[1] >= self.schedule_pixels else PLAIN

    def build(self, kernel: Artifact, size: Size = (1, 1)) -> None:
        """Make a kernel, or both of its passes, ready to run on images of `size`; again costs nothing."""
        passes = kernel.kernels
        new = [each.digest for each in passes if each.digest not in self._built]
        try:
            for each in passes:
                self._keep(each)
            small, last = self._first_run(size), self._built[passes[-1].digest]
            if small is not None and small not in last.run_at:
                self._run_once(kernel, small)
                last.run_at.add(small)
        except BaseException:
            # A kernel counts as built after its first run.
            self._drop([self._built.pop(digest) for digest in new if digest in self._built])
            raise

    def _keep(self, kernel: Artifact) -> None:
        """Build a kernel unless it is built, make it the newest, and drop the oldest ones."""
        built = self._built.pop(kernel.digest, None)
        if built is None:
            with self._session(), ExitStack() as made:
                prepared = self._prepare(kernel)
                made.callback(self._discard, prepared)
                built = Built(prepared, self._weights(kernel) if kernel.role == DENOISE else None)
                made.pop_all()
        self._built[kernel.digest] = built
        self._drop([self._built.pop(next(iter(self._built))) for _ in range(len(self._built) - KEPT_KERNELS)])

    def _run_once(self, kernel: Artifact, size: Size) -> None:
        """Run a kernel once on black images, and zeros for all else but the scene."""
        if kernel.role == DENOISE:
            self._run(kernel, black(kernel, size))
            return
        height, width = size
        part = Part(width, height, 0, height, 0, 1, 0).integers
        strides = {**plane_integers(kernel, size), "plane_stride": height * width}
        integers = {**part, **strides, "sample_count": 1, "gap": 1, PRIMITIVES: 1}
        taken = [array for array in kernel.interface.arrays if array.access == READ]
        given = {each.name: np.zeros(plane_shape(each.shape, integers), np.float32) for each in taken}
        self._called(kernel, {**given, **_numbers(kernel, None)}, integers)

    def forget(self) -> None:
        """Drop the kernels that were built: the next build is the driver's."""
        dropped = list(self._built.values())
        self._built.clear()
        self._drop(dropped)

    def _drop(self, dropped: Sequence[Built]) -> None:
        """Give kernels back."""
        if dropped:
            with self._session():
                for built in dropped:
                    self._discard(built.prepared)
                    if built.weights is not None:
                        self._release(built.weights)

    def run(self, artifact: Artifact, inputs: Images) -> NDArray[np.float32]:
        """Return the output (H, W, C) for encoded feature images (H, W, C), float32, by name."""
        images = checked(artifact, inputs)
        self._check_target(artifact)
        height, width = next(iter(images.values())).shape[:2]
        self.check_size(artifact, (height, width))
        self.build(artifact, (height, width))
        return self._run(artifact, images)

    def _run(self, artifact: Artifact, images: Images) -> NDArray[np.float32]:
        """Run a built artifact on checked images."""
        height, width = next(iter(images.values())).shape[:2]
        with self._session((height, width)), ExitStack() as made:
            held = {name: self._stored(name, image, made) for name, image in images.items()}
            *first, last = shapes(artifact, (height, width))
            written = [self._between(shape) for shape in first]
            for memory in written:
                made.callback(self._release, memory)
            written.append(self._result(last))
            made.callback(self._release, written[-1])
            self._chain(artifact, held, written)
            return self._fetch(RESULT, written[-1])

    def _stored(self, name: str, image: NDArray[np.float32], made: ExitStack) -> Memory:
        """Return an image on the device, which `made` gives back."""
        memory = self._store(name, image)
        made.callback(self._release, memory)
        return memory

    def _chain(self, artifact: Artifact, images: Mapping[str, Memory], written: Sequence[Memory]) -> None:
        """Start an artifact's kernels one after another: what one has written is the image of the next."""
        for kernel, result in zip(artifact.kernels, written, strict=True):
            arrays = {f"{IMAGE}{name}": memory for name, memory in images.items()}
            integers = {"width": result.shape[1], "height": result.shape[0]}
            self.start(kernel, {**arrays, RESULT: result}, integers)
            images = {image.name: result for image in artifact.images}

    def start(self, kernel: Artifact, arrays: Mapping[str, Memory], integers: Mapping[str, int]) -> None:
        """Start a built kernel: arrays but its weights by name, and at least its integers."""
        built = self._built[kernel.digest]
        held = {**arrays, WEIGHTS: built.weights} if built.weights is not None else arrays
        self._start(kernel, built.prepared, held, integers)

    def call(self, kernel: Artifact, given: Images, integers: Mapping[str, int]) -> Images:
        """Return all arrays that a kernel writes, of any role but a network's, by the interface's names.

        `given`: those that it reads, and at least its integers.
        """
        self._check_target(kernel)
        self.build(kernel)
        return self._called(kernel, given, integers)

    def _called(self, kernel: Artifact, given: Images, integers: Mapping[str, int]) -> Images:
        """Run a built kernel."""
        rows, width = integers[kernel.interface.rows], integers["width"]
        with self._session((rows, width)), ExitStack() as made:
            arrays = {name: self._stored(name, array, made) for name, array in given.items()}
            # What is written in place of light, or of a history, are planes like these.
            names = {
                array.name: LIGHT if array.planes and array.name == RESULT else array.name
                for array in kernel.interface.written
            }
            for array in kernel.interface.written:
                shape = plane_shape(array.shape, integers)
                shape = self.sums_shape(kernel, rows, width) if array.name == SUMS else shape
                arrays[array.name] = self._made(names[array.name], shape, made)
            self.start(kernel, arrays, integers)
            return {name: self._fetch(known, arrays[name]) for name, known in names.items()}

    def trace(
        self, kernel: Artifact, part: Part, numbers: NDArray[np.float32] | None = None
    ) -> NDArray[np.float32]:
        """Return the sums (planes, rows, width) over the samples of a part of an image.

        `numbers` (n,) are those of the scene that are inputs of the kernel; None: those that it was compiled
        with.
        """
        sums = self.call(kernel, _numbers(kernel, numbers), part.integers)[SUMS]
        return sums[:, : part.rows, : part.width]

    def _made(self, name: str, shape: tuple[int, ...], made: ExitStack) -> Memory:
        """Return memory that a kernel will write, which `made` gives back."""
        memory = self._memory(name, shape)
        made.callback(self._release, memory)
        return memory

    def _images(self, images: Sequence[Image], size: Size, made: ExitStack) -> dict[str, Memory]:
        """Return memory for images by name, which `made` gives back."""
        written = {}
        for image in images:
            written[image.name] = self._made(f"{IMAGE}{image.name}", (*size, image.channels), made)
        return written

    def _turn(self, kernel: Artifact, sums: Memory, written: Mapping[str, Memory], samples: int) -> None:
        """Start a built encoding of sums that may be larger than the images."""
        height, width = next(iter(written.values())).shape[:2]
        _, rows, stride = sums.shape
        arrays = {SUMS: sums, **{f"{IMAGE}{name}": memory for name, memory in written.items()}}
        integers = {"width": width, "height": height, "row_stride": stride, "plane_stride": rows * stride}
        self.start(kernel, arrays, {**integers, "sample_count": samples})

    def _check_target(self, artifact: Artifact) -> None:
        """Refuse a kernel in another language."""
        if artifact.target not in (self.name, *(f"{self.name}:{home}" for home in self.homes)):
            raise InputError(
                f"artifact for executor {self.name!r}: target",
                artifact.target,
                f"must be {self.name}",
                f"compile the program for {self.name}",
            )

    def __enter__(self) -> Any:
        return self


def _numbers(kernel: Artifact, numbers: NDArray[np.float32] | None) -> Images:
    """Return the array of a scene's numbers, where they are inputs."""
    taken = kernel.interface.named(SCENE_NUMBERS)
    return {SCENE_NUMBERS: numbers_for(kernel, numbers)} if taken else {}
