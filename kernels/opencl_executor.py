"""Kernels on OpenCL devices through pyopencl: PoCL on any processor, or a GPU's driver.

The device is the first GPU, else the first device of any kind; `device=` or WAMNET_OPENCL_DEVICE chooses
another by a part of "platform / device". No build option relaxes the arithmetic: the error bound assumes
the standard's.
"""

from __future__ import annotations

import os
from typing import Any

import numpy as np
import pyopencl as cl
from numpy.typing import NDArray

from ..compiler.artifact import Artifact
from ..compiler.emit import output_channels
from ..refimpl.errors import CompileError, ExecutorUnavailable
from . import pocl_cpu
from .executor import Executor, Images, black

DEVICE_VARIABLE = "WAMNET_OPENCL_DEVICE"
"""Environment variable that chooses a device where the caller does not."""

LOCAL_SIZE = (16, 4)
"""Work items (x, y) in a group: one size for all images, so that PoCL compiles a kernel once."""

BUILD_OPTIONS = ("-cl-std=CL1.2",)
"""Nothing here may allow what the standard's table of errors does not."""


class OpenCLExecutor(Executor):
    """One OpenCL device with its queue."""

    name = "opencl"

    def __init__(self, device: str | None = None) -> None:
        chosen = _choose(device or os.environ.get(DEVICE_VARIABLE) or "")
        self.device = _describe(chosen)
        if chosen.platform.name == pocl_cpu.PLATFORM:
            pocl_cpu.name_the_processor(chosen.int_ptr)
        self._context = cl.Context([chosen])
        self._queue = cl.CommandQueue(self._context)
        self._built: dict[str, tuple[Any, Any]] = {}

    def build(self, artifact: Artifact, size: tuple[int, int] = (1, 1)) -> None:
        """Compile the source, upload the weights, and run once."""
        if artifact.digest in self._built:
            return
        program = cl.Program(self._context, artifact.source)
        try:
            # Without pyopencl's own cache: what is reported as compile time is compiling.
            uncached: Any = False
            program.build(options=list(BUILD_OPTIONS), cache_dir=uncached)
        except cl.RuntimeError as error:
            raise CompileError(f"{self.device} does not build the kernel: {error}") from None
        # An empty buffer is no buffer.
        weights = artifact.weights if artifact.weights.size else np.zeros(1, np.float32)
        self._built[artifact.digest] = (getattr(program, artifact.entry_point), self._upload(weights))
        self._run(artifact, black(artifact, (1, 1)))

    def _run(self, artifact: Artifact, images: Images) -> NDArray[np.float32]:
        kernel, weights = self._built[artifact.digest]
        height, width = next(iter(images.values())).shape[:2]
        result = np.empty((height, width, output_channels(artifact.program)), np.float32)
        output = cl.Buffer(self._context, cl.mem_flags.WRITE_ONLY, result.nbytes)
        inputs = [self._upload(image) for image in images.values()]
        # Whole groups; the kernel leaves out what lies beyond the image.
        size = tuple(-(-n // local) * local for n, local in zip((width, height), LOCAL_SIZE, strict=True))
        kernel(self._queue, size, LOCAL_SIZE, *inputs, weights, output, np.int32(width), np.int32(height))
        cl.enqueue_copy(self._queue, result, output)
        return result

    def _upload(self, array: NDArray[np.float32]) -> Any:
        """Return a device buffer with the array's content."""
        flags = cl.mem_flags.READ_ONLY | cl.mem_flags.COPY_HOST_PTR
        return cl.Buffer(self._context, flags, hostbuf=np.ascontiguousarray(array))


def _choose(wanted: str) -> Any:
    """Return the first device whose description holds `wanted`, GPUs first."""
    try:
        found = [device for platform in cl.get_platforms() for device in platform.get_devices()]
    except cl.LogicError:
        found = []
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


def _describe(device: Any) -> str:
    """Return "platform version / device"."""
    return f"{device.platform.name.strip()} {device.driver_version.strip()} / {device.name.strip()}"
