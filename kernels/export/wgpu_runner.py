"""Exported compute shaders on WebGPU's native implementation: WGSL, and SPIR-V from GLSL and HLSL.

The package `wgpu` brings naga, which reads WGSL and SPIR-V, and drives Vulkan: Mesa's software driver
will do. SPIR-V reaches naga with decorations that it does not know (NoContraction) and says so.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...compiler.artifact import Artifact
from ...compiler.kernel.interface import BLOCK, BOTH, READ, WEIGHTS, WRITE, Interface
from ...refimpl.errors import CompileError, ExecutorUnavailable
from ..devices.kernel import Memory
from . import tools
from .buffer_runner import BufferRunner, Launch

WAY_OUT = "pip install wgpu, and a Vulkan driver: apt-get install mesa-vulkan-drivers"
"""How to get a device."""

UNIFORM_BYTES = 16
"""A uniform buffer's size is a multiple of this."""


def kinds_of(interface: Interface) -> dict[int, str]:
    """Return what WebGPU calls the kinds of a kernel's buffers, by binding."""
    kinds = {READ: "read-only-storage", WRITE: "storage", BOTH: "storage"}
    numbers = interface.numbers()
    found = {numbers[a.name]: "uniform" if a.home == BLOCK else kinds[a.access] for a in interface.arrays}
    return {0: "uniform", **found}


def bound(kernel: Artifact) -> dict[int, str]:
    """Return the kinds of the buffers that are bound: of one of several launches those of its own arrays."""
    kinds = kinds_of(kernel.interface)
    arrays = kernel.manifest.get("schedule", {}).get("arrays")
    if arrays is None:
        return kinds
    numbers = kernel.interface.numbers()
    return {number: kinds[number] for number in (0, *(numbers[name] for name in arrays[0]))}


class WgpuRunner(BufferRunner):
    """A device of WebGPU; `translate` makes of a kernel's source what the device is given."""

    homes = (BLOCK,)

    def __init__(
        self, name: str = "wgsl", translate: Callable[[str], str | bytes] = lambda source: source
    ) -> None:
        super().__init__()
        try:
            import wgpu
        except ImportError:
            raise ExecutorUnavailable(f"wgpu is not installed: {WAY_OUT}") from None
        self._wgpu: Any = wgpu
        # naga tells of every decoration that it leaves out: hundreds in one kernel.
        logging.getLogger("wgpu").setLevel(logging.ERROR)
        try:
            adapter = wgpu.gpu.request_adapter_sync()
            self._device: Any = adapter.request_device_sync()
        except Exception as error:  # noqa: BLE001 (drivers raise what they like)
            raise ExecutorUnavailable(f"wgpu finds no device ({error}): {WAY_OUT}") from None
        self.name = name
        self.device = f"{adapter.info['device']}, {adapter.info['backend_type']}"
        self._translate = translate

    def _build(self, kernel: Artifact, group: tuple[int, int] | None) -> Any:
        code, kinds = self._translate(kernel.source), bound(kernel)
        try:
            module = self._device.create_shader_module(code=code)
            # A layout of its own holds also what a kernel declares and does not read.
            entries = [
                {"binding": place, "visibility": self._wgpu.ShaderStage.COMPUTE, "buffer": {"type": kind}}
                for place, kind in kinds.items()
            ]
            group_layout = self._device.create_bind_group_layout(entries=entries)
            layout = self._device.create_pipeline_layout(bind_group_layouts=[group_layout])
            pipeline = self._device.create_compute_pipeline(
                layout=layout, compute={"module": module, "entry_point": kernel.entry_point}
            )
        except Exception as error:  # noqa: BLE001 (the package has its own kinds)
            raise CompileError(f"{self.device} cannot build the kernel: {error}") from None
        return pipeline, group_layout, set(kinds)

    def _store(self, name: str, array: NDArray[np.float32]) -> Memory:
        kind = self._wgpu.BufferUsage.UNIFORM if name == WEIGHTS else 0
        data = np.ascontiguousarray(array).tobytes()
        usage = kind | self._wgpu.BufferUsage.STORAGE
        return Memory(array.shape, self._device.create_buffer_with_data(data=data, usage=usage))

    def _memory(self, name: str, shape: tuple[int, ...]) -> Memory:
        usage = self._wgpu.BufferUsage.STORAGE | self._wgpu.BufferUsage.COPY_SRC
        return Memory(shape, self._device.create_buffer(size=4 * math.prod(shape), usage=usage))

    def _fetch(self, name: str, memory: Memory) -> NDArray[np.float32]:
        found = np.frombuffer(self._device.queue.read_buffer(memory.held), np.float32)
        return found.reshape(memory.shape).copy()

    def _release(self, memory: Memory) -> None:
        memory.held.destroy()

    def _launch(self, built: Any, launch: Launch) -> None:
        device, (pipeline, layout, numbers) = self._device, built
        sizes = launch.integers.tobytes()
        sizes += bytes(-len(sizes) % UNIFORM_BYTES)
        integers = device.create_buffer_with_data(data=sizes, usage=self._wgpu.BufferUsage.UNIFORM)
        entries = [
            {"binding": number, "resource": {"buffer": buffer, "offset": 0, "size": buffer.size}}
            for number, buffer in {0: integers, **launch.buffers}.items()
            if number in numbers
        ]
        group = device.create_bind_group(layout=layout, entries=entries)
        encoder = device.create_command_encoder()
        compute = encoder.begin_compute_pass()
        compute.set_pipeline(pipeline)
        compute.set_bind_group(0, group)
        compute.dispatch_workgroups(*launch.groups, 1)
        compute.end()
        device.queue.submit([encoder.finish()])


def vulkan_runner(style: str = "") -> WgpuRunner:
    """Return a runner of GLSL for Vulkan by way of SPIR-V, or of its HLSL for a compiler `style`."""

    def translated(source: str) -> bytes:
        return tools.spirv(tools.hlsl(source, style), "hlsl") if style else tools.spirv(source)

    return WgpuRunner("glsl-vulkan", translated)
