"""Kernels on OpenCL devices through pyopencl: PoCL on any processor, or a GPU's driver.

The device is the first GPU, else the first device of any kind; `device=` or WAMNET_OPENCL_DEVICE chooses
another by a part of "platform / device". No build option relaxes the arithmetic: the error bound assumes
the standard's.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from typing import Any

import numpy as np
import pyopencl as cl
from numpy.typing import NDArray

from ...compiler.artifact import Artifact
from ...compiler.languages.interface import BLOCK, Interface
from ...compiler.scenes.encode_kernel import EncodeArtifact
from ...compiler.scenes.path_kernel import PathArtifact
from ...compiler.schedules.emit import output_channels
from ...compiler.training.step_kernel import StepKernel
from ...refimpl.errors import CompileError, ExecutorUnavailable, InputError
from . import pocl_cpu
from .executor import INDEX_LIMIT, Executor, Part, in_order, keep
from .images import Images, black, images_of
from .opencl_trainer import OpenCLTrainer
from .passes import PICTURE, Passes

DEVICE_VARIABLE = "WAMNET_OPENCL_DEVICE"
"""Environment variable that chooses a device where the caller does not."""

LOCAL_SIZE = (16, 4)
"""Work items (x, y) in a group: one size for all images, so that PoCL compiles a kernel once."""

TILE_LOCAL_SIZE = (1, 1)
"""The same for kernels whose items compute several pixels: they are groups by themselves, and need no second
loop around them."""

CPU_SCHEDULES = {16: "fft32", 8: "tile8"}
"""Schedule of a denoiser by the floats in a vector register of a processor; others have registers of 4. What
the first one refuses, `tile16` takes."""

GPU_SCHEDULE = "group4"
"""Schedule of a denoiser on a graphics processor."""

STACK_BYTES = 2**20
"""Most bytes of a group's arrays on a processor: half the smallest stack that glibc gives a thread."""

PATH_LOCAL_SIZE = {1: (8, 8), 2: (1, 1)}
"""Work items (x, y) in a group of a path kernel: one path each, or (2) vectors of paths, which are groups by
themselves and need no second loop around them."""

CPU_LANES = 16
"""Paths in a work item on a CPU: one AVX-512 register, two of AVX2; shorter vectors are slower on both."""

BUILD_OPTIONS = ("-cl-std=CL1.2",)
"""Nothing here may allow what the standard's table of errors does not."""


@dataclass(frozen=True)
class _Built:
    """A kernel on the device, what it takes, its weights, work items (x, y) in a group, an item's pixels."""

    kernel: Any
    interface: Interface
    weights: Any
    local: tuple[int, int]
    extent: tuple[int, int]


class OpenCLExecutor(Executor):
    """One OpenCL device with its queue."""

    name = "opencl"
    homes = (BLOCK,)  # constant memory is a buffer to whoever calls

    def __init__(self, device: str | None = None) -> None:
        chosen = _choose(device or os.environ.get(DEVICE_VARIABLE) or "")
        self.device = _describe(chosen)
        _check_arithmetic(chosen)
        self._device = chosen
        # PoCL keeps the records of all devices in one block: only the first one's address is that of a block.
        if chosen.platform.name == pocl_cpu.PLATFORM and chosen == chosen.platform.get_devices()[0]:
            pocl_cpu.name_the_processor(chosen.int_ptr)
        self._context = cl.Context([chosen])
        self._queue = cl.CommandQueue(self._context)
        self._built: dict[str, _Built] = {}
        self._paths: dict[str, Any] = {}
        self._shares = False
        if chosen.type & cl.device_type.CPU:
            self._shares = True
            self.lanes = CPU_LANES
            self.trains = True
            lanes = chosen.native_vector_width_float
            self.schedule = CPU_SCHEDULES.get(lanes, "tile4")
            self.schedule_reason = f"built-in choice for processors with {lanes} floats in a register"
        elif chosen.type & cl.device_type.GPU:
            self.schedule = GPU_SCHEDULE
            self.schedule_reason = "built-in choice for graphics processors, not measured on one"
        else:
            self.schedule_reason = "built-in choice for unknown devices"
        self._encoders: dict[str, Any] = {}
        self._kept: Any = None

    def build(self, artifact: Artifact, size: tuple[int, int] = (1, 1)) -> None:
        """Compile the sources, upload the weights, and run once."""
        new = [kernel.digest for kernel in artifact.kernels if kernel.digest not in self._built]
        for kernel in artifact.kernels:
            self._build(kernel)
        if not new:
            return
        try:
            # PoCL compiles when a kernel is first enqueued.
            self._launch(artifact, black(artifact, (1, 1)))
        except BaseException:
            for digest in new:
                self._built.pop(digest, None)
            raise

    def _build(self, artifact: Artifact) -> None:
        """Compile one kernel and upload its weights; again costs nothing."""
        if artifact.digest in self._built:
            keep(self._built, artifact.digest, self._built[artifact.digest])
            return
        local_size = self._local_size(artifact)
        program = self._compiled(artifact.source)
        # An empty buffer is not a buffer.
        weights = artifact.weights if artifact.weights.size else np.zeros(1, np.float32)
        kernel, schedule = getattr(program, artifact.entry_point), artifact.manifest["schedule"]
        extent = (schedule["pixels"], schedule.get("rows", 1))
        built = _Built(kernel, artifact.interface, self._copied(weights), local_size, extent)
        keep(self._built, artifact.digest, built)

    def check_size(self, artifact: Artifact, size: tuple[int, int]) -> None:
        """Refuse images that do not fit one buffer of the device, or whose indices `int` does not hold."""
        height, width = size
        written = [output_channels(kernel.program) for kernel in artifact.kernels]
        most = max(*written, *(i.channels for i in images_of(artifact)))
        count, largest = height * width * most, self._device.max_mem_alloc_size
        if count >= INDEX_LIMIT or 4 * count > largest:
            raise InputError(
                f"size of the picture on {self.device}",
                f"{width} x {height} with {most} channels",
                f"one image must hold fewer than {INDEX_LIMIT} numbers and at most {largest} bytes",
                "split the picture, or use executor numpy",
            )

    def _local_size(self, artifact: Artifact) -> tuple[int, int]:
        """Return the size of a group: smaller on a processor for kernels with large arrays."""
        if group := artifact.manifest["schedule"].get("group"):
            self._check_group(artifact.manifest)
            return group[0], group[1]
        items, used = int(self._device.max_work_group_size), int(artifact.manifest["private_bytes"])
        if self._device.type & cl.device_type.CPU:
            items = min(items, STACK_BYTES // max(used, 1))
        if not items:
            width = max(node.type.shape[0] for node in artifact.program.nodes if node.type.shape)
            raise CompileError(
                f"{self.device}: the kernel's arrays take {used} bytes a pixel (the longest vector has "
                f"{width} numbers): at most {STACK_BYTES} fit a processor's stack; use narrower layers, or a "
                "GPU, or executor numpy"
            )
        wanted = LOCAL_SIZE if artifact.manifest["schedule"]["pixels"] == 1 else TILE_LOCAL_SIZE
        x = min(wanted[0], items)
        return x, min(wanted[1], items // x)

    def _check_group(self, manifest: Mapping[str, Any]) -> None:
        """Refuse a kernel whose groups the device does not hold."""
        schedule, device = manifest["schedule"], self._device
        items = schedule["group"][0] * schedule["group"][1]
        shared, private = schedule["shared_bytes"], items * manifest["private_bytes"]
        least = {
            "items": (items, int(device.max_work_group_size)),
            "bytes that they share": (shared, int(device.local_mem_size)),
        }
        if device.type & cl.device_type.CPU:
            least["bytes of variables, on a processor's stack"] = (private, STACK_BYTES)
        for what, (wanted, most) in least.items():
            if wanted > most:
                raise CompileError(
                    f"{self.device}: schedule {schedule['name']} needs groups of {wanted} {what}, and at "
                    f"most {most} are to be had; use schedule plain"
                )

    def _run(self, artifact: Artifact, images: Images) -> NDArray[np.float32]:
        with self._told(next(iter(images.values())).shape[:2]):
            return self._launch(artifact, images)

    @contextmanager
    def _told(self, size: tuple[int, ...]) -> Iterator[None]:
        """Say of a picture of `size` (height, width) that the device does not run it."""
        try:
            yield
        except (cl.Error, MemoryError) as error:
            raise InputError(
                f"size of the picture on {self.device}",
                f"{size[1]} x {size[0]}",
                f"the device does not run it ({' '.join(str(error).split())})",
                "split the picture, or use executor numpy",
            ) from None

    def _launch(self, artifact: Artifact, images: Images) -> NDArray[np.float32]:
        """Copy the images, run the built kernels, and copy the result back."""
        height, width = next(iter(images.values())).shape[:2]
        result = np.empty((height, width, output_channels(artifact.program)), np.float32)
        output = self._result(result)
        inputs = [self._upload(image) for image in images.values()]
        self._start(artifact, inputs, output, (height, width))
        if self._shares:
            # Mapping waits for the kernel, and makes the array hold what the buffer does.
            _, done = cl.enqueue_map_buffer(
                self._queue, output, cl.map_flags.READ, 0, result.shape, result.dtype, is_blocking=True
            )
            done.wait()
        else:
            cl.enqueue_copy(self._queue, result, output)
        return result

    def _start(self, artifact: Artifact, inputs: Sequence[Any], output: Any, size: tuple[int, int]) -> None:
        """Start the built kernels of an artifact one after another; what they hand on stays on the device."""
        *first, last = artifact.kernels
        for kernel in first:
            between = self._between(4 * size[0] * size[1] * output_channels(kernel.program))
            self._enqueue(self._built[kernel.digest], inputs, between, size)
            inputs = [between]
        self._enqueue(self._built[last.digest], inputs, output, size)

    def _between(self, count: int) -> Any:
        """Return a buffer of so many bytes for an image between two passes; the last one is kept."""
        if self._kept is None or self._kept.size != count:
            self._kept = cl.Buffer(self._context, cl.mem_flags.READ_WRITE, count)
        return self._kept

    def _enqueue(
        self,
        built: _Built,
        inputs: Sequence[Any],
        output: Any,
        size: tuple[int, int],
    ) -> None:
        """Start a built kernel on images of `size` (height, width) that are on the device."""
        columns, rows = built.extent
        items = (-(-size[1] // columns), -(-size[0] // rows))
        numbers = in_order(built.interface, {"width": size[1], "height": size[0]})
        places = _whole(items, built.local)
        built.kernel(self._queue, places, built.local, *inputs, built.weights, output, *numbers)

    def forget(self) -> None:
        """Drop the kernels that were built, and the picture between two passes."""
        for built in (self._built, self._paths, self._encoders):
            built.clear()
        self._kept = None

    def kernel_seconds(
        self, artifact: Artifact, images: Images, clock: Callable[[], float] = time.perf_counter
    ) -> float:
        """Return the time of only a built artifact's kernels: images and result stay on the device."""
        height, width = next(iter(images.values())).shape[:2]
        # Memory that is written before the clock starts: the system gives it when it is first touched.
        result = np.full((height, width, output_channels(artifact.program)), 0, np.float32)
        inputs, output = [self._upload(image) for image in images.values()], self._result(result)
        self._queue.finish()
        start = clock()
        self._start(artifact, inputs, output, (height, width))
        self._queue.finish()
        return clock() - start

    def build_path(self, kernel: PathArtifact) -> None:
        """Compile the source, and follow one path: PoCL compiles when a kernel is first enqueued."""
        known = self._paths.get(kernel.digest)
        function = known or getattr(self._compiled(kernel.source), kernel.entry_point)
        keep(self._paths, kernel.digest, function)
        if known is None:
            self._trace(kernel, Part(1, 1, 0, 1, 0, 1, 0))

    def _trace(self, kernel: PathArtifact, part: Part) -> NDArray[np.float32]:
        sums = np.empty(sums_shape(kernel, part), np.float32)
        output = cl.Buffer(self._context, cl.mem_flags.WRITE_ONLY, sums.nbytes)
        self._follow(kernel, part, output)
        cl.enqueue_copy(self._queue, sums, output)
        return sums[:, : part.rows, : part.width]

    def _follow(self, kernel: PathArtifact, part: Part, output: Any) -> None:
        """Start a built path kernel, whose sums go to a buffer of [`sums_shape`]."""
        _, rows, stride = sums_shape(kernel, part)
        numbers = in_order(kernel.interface, part.integers)
        local, columns = PATH_LOCAL_SIZE[min(kernel.lanes, 2)], stride // kernel.lanes
        self._paths[kernel.digest](self._queue, (columns, rows), local, output, *numbers)

    def _passes(self, encode: EncodeArtifact, denoise: Artifact, size: tuple[int, int]) -> Passes:
        return OpenCLPasses(self, encode, denoise, size)

    def _encoder(self, artifact: EncodeArtifact) -> Any:
        """Return the built encoding kernel."""
        known = self._encoders.get(artifact.digest)
        function = known or getattr(self._compiled(artifact.source), artifact.entry_point)
        keep(self._encoders, artifact.digest, function)
        return function

    def open_trainer(self, kernel: StepKernel, values: NDArray[Any], targets: NDArray[Any]) -> Any:
        """Build the step's kernels, and copy pictures and targets to the device: a processor."""
        if not self.trains:
            raise InputError(
                "device that trains",
                self.device,
                "the step is scheduled for processors: here it would take very long",
                f"set {DEVICE_VARIABLE} to a part of a processor's name, such as portable (PoCL)",
            )
        return OpenCLTrainer(self._queue, self._compiled(kernel.source), kernel, values, targets)

    def _compiled(self, source: str) -> Any:
        """Return the built program, or raise with the driver's log."""
        program = cl.Program(self._context, source)
        try:
            # Without pyopencl's own cache: what is reported as compile time is compiling.
            uncached: Any = False
            program.build(options=list(BUILD_OPTIONS), cache_dir=uncached)
        except cl.RuntimeError as error:
            raise CompileError(f"{self.device} does not build the kernel: {error}") from None
        return program

    def _upload(self, array: NDArray[np.float32]) -> Any:
        """Return a device buffer with the array's content; on a processor, the array's own memory."""
        if not self._shares:
            return self._copied(array)
        flags = cl.mem_flags.READ_ONLY | cl.mem_flags.USE_HOST_PTR
        return cl.Buffer(self._context, flags, hostbuf=np.ascontiguousarray(array))

    def _copied(self, array: NDArray[np.float32]) -> Any:
        """Return a device buffer with a copy of an array, at an address that suits vectors."""
        flags = cl.mem_flags.READ_ONLY | cl.mem_flags.COPY_HOST_PTR
        return cl.Buffer(self._context, flags, hostbuf=array)

    def _result(self, array: NDArray[np.float32]) -> Any:
        """Return a device buffer for an array of results; on a processor, the array's own memory."""
        if self._shares:
            flags = cl.mem_flags.WRITE_ONLY | cl.mem_flags.USE_HOST_PTR
            return cl.Buffer(self._context, flags, hostbuf=array)
        return cl.Buffer(self._context, cl.mem_flags.WRITE_ONLY, array.nbytes)


class OpenCLPasses(Passes):
    """Buffers between kernels of one queue, which runs them in order."""

    def __init__(
        self, executor: OpenCLExecutor, encode: EncodeArtifact, denoise: Artifact, size: tuple[int, int]
    ) -> None:
        super().__init__(encode, denoise, size)
        self._executor, self._shape = executor, (0, 0, 0)
        self._sums: Any = None
        names = [image.name for image in encode.images]
        with executor._told(size):
            self._images = {name: self._buffer(self.channels(name)) for name in (*names, PICTURE)}

    def _buffer(self, channels: int) -> Any:
        """Return a buffer for an image of the picture's size."""
        height, width = self.size
        flags = cl.mem_flags.READ_WRITE
        return cl.Buffer(self._executor._context, flags, 4 * height * width * channels)

    def trace(self, kernel: PathArtifact, part: Part) -> None:
        """Start the path kernel; the sums' buffer is kept while kernels need one of its shape."""
        executor, shape = self._executor, sums_shape(kernel, part)
        executor.build_path(kernel)
        with executor._told(self.size):
            if shape != self._shape:
                count = 4 * shape[0] * shape[1] * shape[2]
                self._sums = cl.Buffer(executor._context, cl.mem_flags.READ_WRITE, count)
                self._shape = shape
            executor._follow(kernel, part, self._sums)

    def encode(self, samples: int) -> None:
        """Start the encoding kernel."""
        executor, (height, width) = self._executor, self.size
        _, rows, stride = self._shape
        images = [self._images[image.name] for image in self.encoder.images]
        given = {"width": width, "height": height, "row_stride": stride, "plane_stride": rows * stride}
        numbers = in_order(self.encoder.interface, {**given, "sample_count": samples})
        kernel, places = executor._encoder(self.encoder), _whole((width, height), LOCAL_SIZE)
        with executor._told(self.size):
            kernel(executor._queue, places, LOCAL_SIZE, self._sums, *images, *numbers)

    def denoise(self) -> None:
        """Start the denoising kernel."""
        executor = self._executor
        executor.build(self.denoiser, self.size)
        images = [self._images[image.name] for image in images_of(self.denoiser)]
        with executor._told(self.size):
            executor._start(self.denoiser, images, self._images[PICTURE], self.size)

    def read(self, name: str) -> NDArray[np.float32]:
        """Copy a buffer to the host."""
        result = np.empty((*self.size, self.channels(name)), np.float32)
        with self._executor._told(self.size):
            cl.enqueue_copy(self._executor._queue, result, self._images[name])
        return result

    def finish(self) -> None:
        """Wait for the queue."""
        with self._executor._told(self.size):
            self._executor._queue.finish()

    def close(self) -> None:
        """Release the buffers."""
        for buffer in (self._sums, *self._images.values()):
            if buffer is not None:
                buffer.release()
        self._sums, self._shape, self._images = None, (0, 0, 0), {}


def sums_shape(kernel: PathArtifact, part: Part) -> tuple[int, int, int]:
    """Return (planes, rows, numbers in a row) of the sums that a kernel writes for a part of an image.

    They are whole groups of whole vectors; what is beyond the part is computed too, and means nothing.
    """
    items = (-(-part.width // kernel.lanes), part.rows)
    columns, rows = _whole(items, PATH_LOCAL_SIZE[min(kernel.lanes, 2)])
    return len(kernel.planes), rows, columns * kernel.lanes


def _whole(items: tuple[int, ...], local: tuple[int, ...]) -> tuple[int, ...]:
    """Return the number of work items on each axis, in whole groups; kernels leave out what is beyond."""
    return tuple(-(-n // size) * size for n, size in zip(items, local, strict=True))


def _choose(wanted: str) -> Any:
    """Return the first device whose description holds `wanted`, GPUs first."""
    found = _devices()
    if not found:
        raise ExecutorUnavailable(
            "OpenCL: no platform is installed; pip install 'wamnet[opencl]' brings PoCL, for any processor"
        )
    found.sort(key=lambda device: not device.type & cl.device_type.GPU)
    matching = [device for device in found if wanted.lower() in _describe(device).lower()]
    if not matching:
        names = "; ".join(map(_describe, found))
        raise ExecutorUnavailable(f"OpenCL: no device matches {wanted!r}; choose a part of one of: {names}")
    return matching[0]


def _devices() -> list[Any]:
    """Return the devices of all platforms; a platform that fails has none."""
    found: list[Any] = []
    with suppress(cl.Error):
        for platform in cl.get_platforms():
            with suppress(cl.Error):
                found += platform.get_devices()
    return found


def _check_arithmetic(device: Any) -> None:
    """Refuse a device whose arithmetic is not that of the error bound (full profile, round to nearest)."""
    nearest = bool(device.single_fp_config & cl.device_fp_config.ROUND_TO_NEAREST)
    if device.profile != "FULL_PROFILE" or not nearest:
        lacking = "" if nearest else ", not rounding to nearest"
        raise ExecutorUnavailable(
            f"OpenCL: {_describe(device)} has {device.profile}{lacking}: "
            "error bounds need FULL_PROFILE and rounding to nearest; choose another device"
        )


def _describe(device: Any) -> str:
    """Return "platform version / device"."""
    return f"{device.platform.name.strip()} {device.driver_version.strip()} / {device.name.strip()}"
