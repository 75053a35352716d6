"""What runs exported kernels here, by target: the target's own compiler and device, or the nearest to it."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from ..executor import Executor
from . import host_runner, wgpu_runner


def _es() -> Executor:
    """Open OpenGL for GLSL ES."""
    from .gl_runner import ESRunner

    return ESRunner()


def _godot() -> Executor:
    """Open OpenGL for shaders of Godot."""
    from .host_pass_runner import GodotRunner

    return GodotRunner()


def _compute() -> Executor:
    """Open OpenGL for compute shaders."""
    from .compute_runner import ComputeRunner

    return ComputeRunner()


RUNNERS: Mapping[str, Callable[[], Executor]] = {
    "glsl-es": _es,
    "glsl-compute": _compute,
    "glsl-vulkan": wgpu_runner.vulkan_runner,
    "glsl-vulkan/hlsl-fxc": lambda: wgpu_runner.hlsl_runner("fxc"),
    "glsl-vulkan/hlsl-dxc": lambda: wgpu_runner.hlsl_runner("dxc"),
    "wgsl": wgpu_runner.WgpuRunner,
    "metal": host_runner.MetalRunner,
    "c99": host_runner.CRunner,
    "cuda": host_runner.CUDARunner,
    "godot": _godot,
}
"""By compiler target, and after a stroke what it is translated to; c99 is C, whose name an executor has."""
