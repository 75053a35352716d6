"""All targets: what runs kernels, how its source is made, and which schedules it has.

Targets that an executor of the registry runs are in [`DENOISERS`]; the demo and the benchmark of all targets
take those in [`TARGETS`]. Targets whose kernels other programs run are in [`EXPORTED`].
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from ..refimpl.errors import CompileError, choice
from .core.loops import USUAL, Forms
from .core.profiles import SineContract
from .languages import opencl_path, planes
from .languages.c import C
from .languages.cuda import CUDA
from .languages.dialect import Dialect
from .languages.glsl import GLSL
from .languages.glsl_buffers import Compute, Vulkan
from .languages.glsl_es import GLSLES, GLSLESInlined, GLSLESPacked
from .languages.glsl_inlined import GLSLInlined
from .languages.hosts import GodotDenoise, ShadertoyDenoise
from .languages.interface import DENOISE, ENCODE, PATH
from .languages.metal import Metal
from .languages.opencl import OpenCL
from .languages.weight_homes import HOMES
from .languages.wgsl import WGSL
from .schedules.buffers_group import (
    ComputeGroup,
    CUDADot,
    CUDAGroup,
    MetalGroup,
    VulkanDot,
    VulkanGroup,
    WGSLDot,
    WGSLGroup,
    groups,
)
from .schedules.c_dot import C_DOT
from .schedules.c_fourier import C_FOURIER
from .schedules.c_tiled import C_LADDER
from .schedules.emit_dot import dots
from .schedules.emit_inlined import Inlined
from .schedules.emit_packed import Packed
from .schedules.glsl_compute import GLSL_COMPUTE
from .schedules.opencl_dot import OPENCL_DOT
from .schedules.opencl_fourier import OPENCL_FOURIER
from .schedules.opencl_group import OPENCL_GROUP_DOT, OPENCL_GROUPS
from .schedules.opencl_tiled import OPENCL_LADDER
from .schedules.schedules import Plain, Printed, Schedule


@dataclass(frozen=True)
class Target:
    """Something that runs kernels: how its source is made, and what its own sine promises.

    `dialect` is the language's, which the interpreter lacks; `paths` are the dialects of path kernels by the
    number of paths that they follow at once, none where there are no path kernels, and `forms` says what
    becomes of a scene's primitives. `planes` are the dialects of kernels on planes, the edge-avoiding
    filter and the history, by the number of pixels in a work item. `widest`: most channels of an image that a
    kernel reads, `most` of all that it writes; None: any number. `assumes`: what a bound rests on that the
    language does not promise.
    """

    name: str
    language: str
    suffix: str
    entry: str
    native_sine: SineContract
    schedules: tuple[Schedule, ...]
    dialect: Dialect | None = None
    paths: Mapping[int, Dialect | None] = field(default_factory=dict)
    planes: Mapping[int, Dialect | None] = field(default_factory=dict)
    forms: Forms = USUAL
    widest: int | None = None
    most: int | None = None
    assumes: str = ""

    @property
    def encodes(self) -> bool:
        """Return whether there are kernels that encode features."""
        return self.dialect is None or ENCODE in self.dialect.said

    def __reduce__(self) -> tuple[Any, ...]:
        """Travel to other processes by name: schedules hold functions."""
        return target_named, (self.name,)


def _dialect_target(dialect: Dialect, *ladder: Schedule) -> Target:
    """Return the target whose source a dialect makes; `ladder` are its schedules after the plain one."""
    return Target(
        dialect.target,
        dialect.language,
        dialect.suffix,
        dialect.entries[DENOISE],
        dialect.native_sine,
        (Plain(dialect), *ladder),
        dialect,
        {1: dialect} if PATH in dialect.said else {},
        widest=dialect.channels_per_result,
        most=dialect.max_output_channels,
        assumes=dialect.assumes,
    )


MESA = Forms(few=10000.0)
"""Most operations of primitives that become statements in fragment shaders. llvmpipe reads a table at a
loop's counter lane by lane, so a loop that Mesa does not unroll itself (it does up to some 30 trips) is two
to four times slower than statements; but it compiles the statements of 100 primitives of all kinds, which
take 8,000 operations, in 1 to 5 s, those of 300 in 9 to 60 s. A walk is slower still than a loop
(`wamnet bench primitives --executors opengl`)."""

TARGETS: Mapping[str, Target] = {
    target.name: target
    for target in (
        Target(
            "numpy",
            "wamnet IR",
            ".ir.txt",
            "program",
            SineContract("np.sin, whose documentation promises nothing", None),
            (Printed(),),
            paths={1: None},
            planes={1: None},
        ),
        replace(
            _dialect_target(
                OpenCL(), *OPENCL_LADDER, *OPENCL_FOURIER, *OPENCL_DOT, *OPENCL_GROUPS, *OPENCL_GROUP_DOT
            ),
            paths={lanes: opencl_path.of_lanes(lanes) for lanes in opencl_path.LANES},
            planes={lanes: planes.of_lanes(lanes) for lanes in opencl_path.LANES},
            forms=Forms(trees=True),
        ),
        replace(
            _dialect_target(GLSL(), Inlined(GLSLInlined()), *GLSL_COMPUTE),
            planes={1: planes.GLSLPlanes()},
            forms=MESA,
        ),
    )
}
"""The targets that the demo and the benchmark show, by the name of the executor that runs them."""

DENOISERS: Mapping[str, Target] = {
    **TARGETS,
    "c": replace(
        _dialect_target(C(), *C_LADDER, *C_FOURIER, *C_DOT),
        planes={1: planes.CPlanes()},
        forms=Forms(trees=True),
    ),
}
"""All targets that an executor of the registry runs."""

EXPORTED: Mapping[str, Target] = {
    target.name: target
    for target in (
        replace(
            _dialect_target(GLSLES(), Inlined(GLSLESInlined()), Packed(GLSLESPacked())),
            forms=MESA,
        ),
        _dialect_target(Compute(), *groups(ComputeGroup(), 8)),
        _dialect_target(Vulkan(), *groups(VulkanGroup(), 8), *dots(VulkanDot(), 8)),
        _dialect_target(WGSL(), *groups(WGSLGroup(), 8), *dots(WGSLDot(), 8)),
        _dialect_target(CUDA(), *groups(CUDAGroup()), *dots(CUDADot())),
        _dialect_target(Metal(), *groups(MetalGroup())),
        replace(_dialect_target(ShadertoyDenoise()), schedules=(Inlined(ShadertoyDenoise()),)),
        _dialect_target(GodotDenoise()),
    )
} | {name: _dialect_target(dialect) for name, dialect in HOMES.items()}
"""Targets that are written for other programs to run: kernels/export has what runs them in tests."""


def target_named(name: str) -> Target:
    """Return the target, or say which ones there are."""
    known = {**DENOISERS, **EXPORTED}
    if name not in known:
        raise CompileError(f"target {name!r}: unknown ({choice(name, known)})")
    return known[name]


def schedule_named(target: str, name: str) -> Schedule:
    """Return the schedule of this name of a target."""
    return {schedule.name: schedule for schedule in target_named(target).schedules}[name]


def integers_of(target: str, role: str) -> tuple[str, ...]:
    """Return the integers that a target's kernels of a role are given."""
    dialect = target_named(target).dialect
    return dialect.integers[role] if dialect else ()
