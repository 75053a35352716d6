"""What runs kernels here that executors of the registry do not, by compiler target [`RUNNERS`]."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from importlib import import_module

from ..devices.executor import Executor
from ..devices.registry import open_executor
from .targets import TARGETS


def opened(module: str, *name: str) -> Executor:
    """Open an executor of the registry, or a runner of this folder, whose packages are imported only then."""
    if not name:
        return open_executor(module)
    found: Executor = getattr(import_module(f".{module}", __package__), name[0])(*name[1:])
    return found


OWN = ("glsl-es", "glsl-compute", "glsl-vulkan", "wgsl", "metal", "cuda", "godot")
"""Targets whose kernels run as they are."""

RUNNERS: Mapping[str, Callable[[], Executor]] = {
    name: partial(opened, *opens)
    for name, opens in {
        **{name: TARGETS[name].opens for name in OWN},
        "c99": TARGETS["c"].opens,
        "glsl-vulkan/hlsl-fxc": ("wgpu_runner", "hlsl_runner", "fxc"),
        "glsl-vulkan/hlsl-dxc": ("wgpu_runner", "hlsl_runner", "dxc"),
        "wgsl/tint": ("tint_runner", "TintRunner"),
        "wgsl/tint-gles": ("tint_runner", "TintRunner", "opengles"),
    }.items()
}
"""By compiler target, and after a stroke what translates it, or to what; c99 is C, whose name an executor
has. Conformance runs them by name."""
