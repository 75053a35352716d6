"""What runs exported kernels here, by target: the target's own compiler and device, or the nearest to it.

A way [`WAYS`] opens an executor, whose packages are imported only then, and says how a kernel reaches it.
Conformance runs those in [`RUNNERS`] by name.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module

from ..devices.executor import Executor
from ..devices.registry import open_executor

Opener = Callable[[], Executor]


@dataclass(frozen=True)
class Way:
    """How a target's kernels are run; `route`: what they are translated to before, if they are.

    `stands_in`: what runs them computes the same, but is nothing that the target's users have. `timed`: where
    options of a compiler decide, those that are timed: the advised ones, and those of a plain build.
    """

    open: Opener
    route: str = ""
    stands_in: bool = False
    timed: tuple[Sequence[str], ...] = ()


def _opener(module: str, name: str, *arguments: str) -> Opener:
    """Return what opens a runner of this folder, by its module and name."""

    def opened() -> Executor:
        found: Executor = getattr(import_module(f".{module}", __package__), name)(*arguments)
        return found

    return opened


WAYS: Mapping[str, Way] = {
    "opencl": Way(lambda: open_executor("opencl")),
    "glsl": Way(lambda: open_executor("opengl")),
    "glsl-es": Way(_opener("gl_runner", "ESRunner")),
    "glsl-compute": Way(_opener("gl_runner", "ComputeRunner")),
    "glsl-vulkan": Way(_opener("wgpu_runner", "vulkan_runner"), "SPIR-V, wgpu, "),
    "spirv": Way(_opener("wgpu_runner", "vulkan_runner"), "wgpu, "),
    "hlsl": Way(_opener("wgpu_runner", "hlsl_runner"), "back to SPIR-V, wgpu, "),
    "wgsl": Way(_opener("wgpu_runner", "WgpuRunner"), "wgpu, "),
    "metal": Way(_opener("host_runner", "MetalRunner"), "as C++ with a shim, ", stands_in=True),
    "c": Way(_opener("host_runner", "CRunner"), timed=(("-O3", "-march=native"), ("-O2",))),
    "cuda": Way(_opener("host_runner", "CUDARunner"), "as C++ with a shim, ", stands_in=True),
    "shadertoy": Way(_opener("host_pass_runner", "ShadertoyRunner"), "its uniforms declared, "),
    "godot": Way(_opener("host_pass_runner", "GodotRunner"), "its words declared, "),
}
"""By target of exports."""

RUNNERS: Mapping[str, Opener] = {
    **{
        name: WAYS[name].open
        for name in ("glsl-es", "glsl-compute", "glsl-vulkan", "wgsl", "metal", "cuda", "godot")
    },
    "c99": WAYS["c"].open,
    "glsl-vulkan/hlsl-fxc": _opener("wgpu_runner", "hlsl_runner", "fxc"),
    "glsl-vulkan/hlsl-dxc": _opener("wgpu_runner", "hlsl_runner", "dxc"),
    "wgsl/tint": _opener("tint_runner", "TintRunner"),
    "wgsl/tint-gles": _opener("tint_runner", "TintRunner", "opengles"),
}
"""By compiler target, and after a stroke what translates it, or to what; c99 is C, whose name an executor
has."""
