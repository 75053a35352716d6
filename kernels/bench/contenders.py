"""The list of contenders: all executors with all their schedules, all variants of the network, all peers.

1. A kernel is named EXECUTOR:SCHEDULE, with :VARIANT where it is not the whole network [`kernel`].
2. Variants run with the schedule that suits the device [`Executor.schedule`] [`of_machine`].
3. Peers stand in files of their own, `peer_*.py`; a new one is a file and a line in `PEERS`.
"""

from __future__ import annotations

from collections.abc import Sequence
from fnmatch import fnmatchcase
from functools import partial

from ...compiler.compile import TARGETS, analysed, compile_program
from ...refimpl.denoise import Model
from ...refimpl.errors import ExecutorUnavailable, InputError
from . import peer_oidn, peer_onnxruntime, peer_tinygrad, peer_torch
from .contender import FULL, NO_CACHE, Contender, Opened, Tools, Variant
from .cost import fused, sines_of

VARIANTS: tuple[Variant, ...] = (
    Variant("rank16", "first layer of rank 16, in two passes", rank=16),
    Variant("rank12", "first layer of rank 12, in two passes", rank=12),
    Variant("rank8", "first layer of rank 8, in two passes", rank=8),
)
"""Forms of the network besides the whole one."""

CACHES = {
    "numpy": NO_CACHE,
    "opencl": "PoCL keeps kernels on disk, ~/.cache/pocl",
    "opengl": "Mesa keeps shaders on disk, ~/.cache/mesa_shader_cache",
}
"""What the drivers of an executor keep of what they have compiled."""

PEERS: tuple[Contender, ...] = (
    *peer_torch.CONTENDERS,
    *peer_onnxruntime.CONTENDERS,
    *peer_tinygrad.CONTENDERS,
    *peer_oidn.CONTENDERS,
)
"""What others make."""

QUICK = ("onnxruntime", "oidn:fast")
"""Peers of a quick run: those that have nothing to compile."""


def kernel(executor: str, schedule: str, variant: Variant = FULL) -> Contender:
    """Return the contender that is a kernel of this schedule."""
    name = f"{executor}:{schedule}" + ("" if variant is FULL else f":{variant.name}")
    ideas = {each.name: each.idea for each in TARGETS[executor].schedules}
    text = ideas[schedule] if variant is FULL else variant.text
    open_it = partial(_open_kernel, executor, schedule, variant)
    return Contender(name, text, open_it, variant, executor, schedule, caches=CACHES.get(executor, NO_CACHE))


def _open_kernel(
    executor: str, schedule: str, variant: Variant, tools: Tools, model: Model, size: int
) -> Opened:
    """Compile the kernel and build it."""
    runner, program = tools.executor(executor), variant.program(model)
    artifact = compile_program(program, executor, "ieee", schedule, variant.rank)
    runner.build(artifact, (size, size))
    alone = getattr(runner, "kernel_seconds", None)
    picked = str(artifact.manifest["schedule"]["name"])
    return Opened(
        run=lambda given: runner.run(artifact, given.images),
        device=runner.device,
        stages=fused(artifact, sines_of(analysed(program))),
        source_bytes=sum(len(each.source.encode()) for each in artifact.kernels),
        rates=f"{executor}:{picked}",
        kernel_seconds=alone and (lambda given: alone(artifact, given.images)),
    )


def of_machine(tools: Tools, size: int, quick: bool = False) -> list[Contender]:
    """Return all contenders of a machine; those that cannot run here are in the list and say so later.

    `quick`: the kernels with the schedules that suit their devices for pictures of this size, the first
    variant, and `QUICK`.
    """
    found = []
    for name, target in TARGETS.items():
        try:
            suits = tools.executor(name).schedule_for((size, size))
        except ExecutorUnavailable:
            suits = target.schedules[0].name
        chosen = [suits] if quick else [schedule.name for schedule in target.schedules]
        found += [kernel(name, schedule) for schedule in chosen]
        if name != "numpy":
            found += [kernel(name, suits, variant) for variant in (VARIANTS[:1] if quick else VARIANTS)]
    return [*found, *(peer for peer in PEERS if not quick or peer.name in QUICK)]


def chosen(contenders: Sequence[Contender], only: Sequence[str], executors: Sequence[str]) -> list[Contender]:
    """Return the contenders whose names match one of the patterns, and the kernels of some executors.

    Without patterns all; without `executors` the kernels of all of them.
    """
    for pattern in only:
        if not any(fnmatchcase(each.name, pattern) for each in contenders):
            names = ", ".join(each.name for each in contenders)
            raise InputError(
                "name of a contender", pattern, f"it matches none of {names}", "use one of these"
            )
    named = [each for each in contenders if not only or any(fnmatchcase(each.name, p) for p in only)]
    return [each for each in named if not executors or each.executor in (None, *executors)]
