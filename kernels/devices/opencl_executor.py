"""Kernels on OpenCL devices through pyopencl: PoCL on any processor, or a GPU's driver.

The device is the first GPU, else the first device of any kind; `device=` or WAMNET_OPENCL_DEVICE chooses
another by a part of "platform / device". No build option relaxes the arithmetic: the error bound assumes
the standard's.
"""

from __future__ import annotations

import math
import os
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
import pyopencl as cl
from numpy.typing import NDArray

from ...compiler.kernel.interface import BLOCK, DENOISE, RESULT, SCENE_NUMBERS
from ...refimpl.errors import CompileError, ExecutorUnavailable, InputError
from . import pocl_cpu
from .executor import BYTE_SCHEDULE, GPU_SCHEDULE, STACK_BYTES, VECTOR_SCHEDULES, Executor
from .kernel import Images, Memory, Size, in_order, shapes

if TYPE_CHECKING:
    from ...compiler.artifact import Artifact

DEVICE_VARIABLE = "WAMNET_OPENCL_DEVICE"
"""Environment variable that chooses a device where the caller does not."""

LOCAL_SIZE = (16, 4)
"""Work items (x, y) in a group: one size for all images, so that PoCL compiles a kernel once."""

TILE_LOCAL_SIZE = (1, 1)
"""The same for kernels whose items compute several pixels: they are groups by themselves, and need no second
loop around them."""

HAS_BYTES = """\
#if defined(__AVX512VNNI__) && defined(__has_builtin)
#if __has_builtin(__builtin_ia32_vpdpbusd512)
#define FOUND 1
#endif
#endif
#ifndef FOUND
#define FOUND 0
#endif
__kernel void wamnet_has_bytes(__global int *found)
{
    *found = FOUND;
}
"""
"""A kernel that says whether the compiler has VNNI's instruction for products of bytes."""

PATH_LOCAL_SIZE = {1: (8, 8), 2: (1, 1)}
"""Work items (x, y) in a group of a path kernel: one path each, or (2) vectors of paths, which are groups by
themselves and need no second loop around them."""

CPU_LANES = 16
"""Paths in a work item on a CPU: one AVX-512 register, two of AVX2; shorter vectors are slower on both."""

BUILD_OPTIONS = ("-cl-std=CL1.2",)
"""Nothing here may allow what the standard's table of errors does not."""


class OpenCLExecutor(Executor):
    """One OpenCL device with its queue."""

    name = "opencl"
    paints = smooths = True
    homes = (BLOCK,)  # constant memory is a buffer to whoever calls

    def __init__(self, device: str | None = None) -> None:
        super().__init__()
        chosen = _choose(device or os.environ.get(DEVICE_VARIABLE) or "")
        self.device = _describe(chosen)
        _check_arithmetic(chosen)
        self._device, self.largest_bytes = chosen, int(chosen.max_mem_alloc_size)
        # PoCL keeps the records of all devices in one block: only the first one's address is that of a block.
        if chosen.platform.name == pocl_cpu.PLATFORM and chosen == chosen.platform.get_devices()[0]:
            pocl_cpu.name_the_processor(chosen.int_ptr)
        self._context = cl.Context([chosen])
        self._queue = cl.CommandQueue(self._context)
        self._shares = self.trains = bool(chosen.type & cl.device_type.CPU)
        if self._shares:
            self.lanes = CPU_LANES
            lanes = chosen.native_vector_width_float
            suits = VECTOR_SCHEDULES.get(lanes, VECTOR_SCHEDULES[4])
            self._suits(f"processors with {lanes} floats in a register", suits)
        elif chosen.type & cl.device_type.GPU:
            self._suits("graphics processors", GPU_SCHEDULE)
        else:
            self._suits("unknown devices")
        self._kept: Memory | None = None

    @cached_property
    def byte_schedule(self) -> str:  # type: ignore[override]
        """Return the schedule of bytes where the compiler has VNNI's instruction."""
        if self.schedule != VECTOR_SCHEDULES[16]:
            return ""
        answer = np.zeros(1, np.int32)
        held = cl.Buffer(self._context, cl.mem_flags.WRITE_ONLY, answer.nbytes)
        self._compiled(HAS_BYTES).wamnet_has_bytes(self._queue, (1,), None, held)
        cl.enqueue_copy(self._queue, answer, held)
        return BYTE_SCHEDULE if answer[0] else ""

    def _first_run(self, size: Size) -> Size:
        """PoCL compiles when a kernel is first enqueued."""
        return 1, 1

    def _prepare(self, kernel: Artifact) -> tuple[Any, tuple[int, int]]:
        """Return a kernel on the device, and the work items (x, y) in a group."""
        denoises = kernel.role == DENOISE
        local = self._local_size(kernel) if denoises else PATH_LOCAL_SIZE[min(kernel.lanes, 2)]
        return getattr(self._compiled(kernel.source), kernel.entry_point), local

    def _weights(self, kernel: Artifact) -> Memory:
        """Return a copy of the weights; an empty buffer is not a buffer."""
        held = self._copied(kernel.weights if kernel.weights.size else np.zeros(1, np.float32))
        return Memory(kernel.weights.shape, held)

    def _local_size(self, artifact: Artifact) -> tuple[int, int]:
        """Return the size of a group: smaller on a processor for kernels with large arrays."""
        if group := artifact.manifest["schedule"].get("group"):
            self._check_group(artifact.manifest)
            return group[0], group[1]
        items, used = int(self._device.max_work_group_size), int(artifact.manifest["private_bytes"])
        if self._device.type & cl.device_type.CPU:
            self.check_stack(used)
            items = min(items, STACK_BYTES // max(used, 1))
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
                    f"most {most} are available; use schedule plain"
                )

    @contextmanager
    def _session(self, size: Size | None = None) -> Iterator[None]:
        """Say of a picture of `size` that the device does not run it."""
        try:
            yield
        except (cl.Error, MemoryError) as error:
            if size is None:
                raise
            raise InputError(
                f"size of the image on {self.device}",
                f"{size[1]} x {size[0]}",
                f"the device cannot run it: {' '.join(str(error).split())}",
                "split the image, or use executor numpy",
            ) from None

    def _start(
        self, kernel: Artifact, prepared: Any, arrays: Mapping[str, Memory], integers: Mapping[str, int]
    ) -> None:
        taken, (function, local) = kernel.interface, prepared
        picked = kernel.manifest.get("schedule", {"pixels": kernel.lanes})
        items = (
            -(-integers["width"] // picked["pixels"]),
            -(-integers[taken.rows] // picked.get("rows", 1)),
        )
        held = (arrays[array.name].held for array in taken.arrays)
        function(self._queue, _whole(items, local), local, *held, *in_order(taken, integers))

    def sums_shape(self, kernel: Artifact, rows: int, width: int) -> tuple[int, int, int]:
        """Return the shape of whole groups of whole vectors; numbers beyond the part mean nothing."""
        items = (-(-width // kernel.lanes), rows)
        columns, rows = _whole(items, PATH_LOCAL_SIZE[min(kernel.lanes, 2)])
        return len(kernel.planes), rows, columns * kernel.lanes

    def _store(self, name: str, array: NDArray[np.float32]) -> Memory:
        """Return a device buffer with the array's content; on a processor, the array's own memory."""
        # A scene's numbers are the caller's to change while a kernel reads those of the last picture.
        if not self._shares or name == SCENE_NUMBERS:
            return Memory(array.shape, self._copied(array))
        flags = cl.mem_flags.READ_ONLY | cl.mem_flags.USE_HOST_PTR
        return Memory(array.shape, cl.Buffer(self._context, flags, hostbuf=np.ascontiguousarray(array)))

    def _memory(self, name: str, shape: tuple[int, ...]) -> Memory:
        count = 4 * math.prod(shape)
        return Memory(shape, cl.Buffer(self._context, cl.mem_flags.READ_WRITE, count))

    def _result(self, shape: tuple[int, ...]) -> Memory:
        """Return a device buffer; on a processor, the memory of an array, which is what is fetched."""
        if not self._shares:
            return self._memory(RESULT, shape)
        flags = cl.mem_flags.WRITE_ONLY | cl.mem_flags.USE_HOST_PTR
        return Memory(shape, cl.Buffer(self._context, flags, hostbuf=np.empty(shape, np.float32)))

    def _between(self, shape: tuple[int, ...]) -> Memory:
        """Return memory that is kept: the system gives new memory page by page, when it is first written."""
        if self._kept is None or self._kept.shape != shape:
            self._kept = self._memory(RESULT, shape)
        return self._kept

    def _fetch(self, name: str, memory: Memory) -> NDArray[np.float32]:
        array: NDArray[np.float32] | None = memory.held.hostbuf
        if array is None:
            array = np.empty(memory.shape, np.float32)
            cl.enqueue_copy(self._queue, array, memory.held)
            return array
        # Mapping waits for the kernel, and makes the array hold what the buffer does.
        _, done = cl.enqueue_map_buffer(
            self._queue, memory.held, cl.map_flags.READ, 0, array.shape, array.dtype, is_blocking=True
        )
        done.wait()
        return array

    def _fetch_later(self, name: str, memory: Memory) -> Callable[[], NDArray[np.float32]]:
        """Copy behind what was started before, and in front of what will be: the queue keeps its order."""
        array = np.empty(memory.shape, np.float32)
        copied = cl.enqueue_copy(self._queue, array, memory.held, is_blocking=False)
        self._queue.flush()

        def content() -> NDArray[np.float32]:
            copied.wait()
            return array

        return content

    def _finish(self) -> None:
        self._queue.finish()

    def forget(self) -> None:
        """Drop the kernels that were built, and the picture between two passes."""
        super().forget()
        self._kept = None

    def kernel_seconds(self, artifact: Artifact, images: Images) -> float:
        """Return the time of only a built artifact's kernels: images and result stay on the device."""
        size = next(iter(images.values())).shape[:2]
        *first, last = shapes(artifact, (size[0], size[1]))
        result = self._result(last)
        if result.held.hostbuf is not None:
            # Written before the clock starts: the system gives memory when it is first touched.
            result.held.hostbuf.fill(0)
        held = {name: self._store(name, image) for name, image in images.items()}
        written = [*map(self._between, first), result]
        self._queue.finish()
        start = time.perf_counter()
        self._chain(artifact, held, written)
        self._queue.finish()
        return time.perf_counter() - start

    def open_trainer(self, kernel: Artifact, values: NDArray[Any], targets: NDArray[Any]) -> Any:
        """Build the step's kernels, and copy pictures and targets to the device: a processor."""
        if not self.trains:
            raise InputError(
                "device that trains",
                self.device,
                "the training step is scheduled for CPUs: on this device it would take very long",
                f"set {DEVICE_VARIABLE} to a part of a processor's name, such as portable (PoCL)",
            )
        from .opencl_trainer import OpenCLTrainer

        return OpenCLTrainer(self._queue, self._compiled(kernel.source), kernel, values, targets)

    def _compiled(self, source: str) -> Any:
        """Return the built program, or raise with the driver's log."""
        program = cl.Program(self._context, source)
        try:
            # Without pyopencl's own cache: what is reported as compile time is compiling.
            uncached: Any = False
            program.build(options=list(BUILD_OPTIONS), cache_dir=uncached)
        except cl.RuntimeError as error:
            raise CompileError(f"{self.device} cannot build the kernel: {error}") from None
        return program

    def _copied(self, array: NDArray[np.float32]) -> Any:
        """Return a device buffer with a copy of an array, at an address that suits vectors."""
        flags = cl.mem_flags.READ_ONLY | cl.mem_flags.COPY_HOST_PTR
        return cl.Buffer(self._context, flags, hostbuf=array)


def _whole(items: tuple[int, ...], local: tuple[int, ...]) -> tuple[int, ...]:
    """Return the number of work items on each axis, in whole groups; kernels leave out what is beyond."""
    return tuple(-(-n // size) * size for n, size in zip(items, local, strict=True))


def _choose(wanted: str) -> Any:
    """Return the first device whose description holds `wanted`, GPUs first."""
    found: list[Any] = []
    with suppress(cl.Error):
        for platform in cl.get_platforms():
            with suppress(cl.Error):  # a platform that fails has none
                found += platform.get_devices()
    if not found:
        raise ExecutorUnavailable(
            "OpenCL: no platform is installed; pip install 'wamnet[opencl]' installs PoCL on x86-64; other "
            "processors need a system package (Debian: pocl-opencl-icd)"
        )
    found.sort(key=lambda device: not device.type & cl.device_type.GPU)
    matching = [device for device in found if wanted.lower() in _describe(device).lower()]
    if not matching:
        names = "; ".join(map(_describe, found))
        raise ExecutorUnavailable(f"OpenCL: no device matches {wanted!r}; choose a part of one of: {names}")
    return matching[0]


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
