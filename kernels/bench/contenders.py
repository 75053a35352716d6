"""The list of contenders: all executors with all their schedules, all variants of the network, all peers.

1. A kernel is named EXECUTOR:SCHEDULE, with :VARIANT where it is not the whole network [`kernel`].
2. Variants run with the schedule that suits the device, or the one that takes its place [`of_machine`]: sines
   and profiles, which need no training [`VARIANTS`], and forms that were trained and are given.
3. Peers come from another distribution, where it is installed [`peers.py`].
"""

from __future__ import annotations

from collections.abc import Sequence
from fnmatch import fnmatchcase
from functools import partial

from ...compiler.artifact import Artifact
from ...compiler.compile import compile_program
from ...compiler.plan import analysed
from ...compiler.schedules.common import kernel_gather
from ...compiler.schedules.schedules import PLAIN, Dot
from ...compiler.targets import DENOISERS, TARGETS, schedule_named
from ...refimpl.errors import ExecutorUnavailable, InputError
from ...refimpl.network.denoise import Model
from ..devices.images import Images
from . import peers
from .contender import FULL, IEEE, NO_CACHE, Contender, Opened, Tools, Variant
from .cost import fused, sines_of
from .workload import Given

VARIANTS: tuple[Variant, ...] = (
    Variant("sine7", "sines of degree 7", profile="ieee-sine7"),
    Variant("sine9", "sines of degree 9", profile="ieee-sine9"),
    Variant("sine5", "sines of degree 5", profile="ieee-sine5"),
    Variant("native", "the target's own sine", profile="native"),
)
"""Forms of the network that need no training; what is cut away is trained first [`of_machine`]."""

INTEGERS = Variant("whole8", "integers: the same bits on every device", made="whole8")
"""The network in integers."""

CACHES = {
    "numpy": NO_CACHE,
    "opencl": "PoCL keeps kernels on disk, ~/.cache/pocl",
    "opengl": "Mesa keeps shaders on disk, ~/.cache/mesa_shader_cache",
}
"""What the drivers of an executor keep of what they have compiled."""

QUICK = ("onnxruntime", "oidn:fast")
"""Peers of a quick run: those that have nothing to compile."""


def kernel(executor: str, schedule: str, variant: Variant = FULL) -> Contender:
    """Return the contender that is a kernel of this schedule."""
    name = f"{executor}:{schedule}" + ("" if variant is FULL else f":{variant.name}")
    text = schedule_named(executor, schedule).idea if variant is FULL else variant.text
    open_it = partial(_open_kernel, executor, schedule, variant)
    return Contender(name, text, open_it, variant, executor, schedule, caches=CACHES.get(executor, NO_CACHE))


def _open_kernel(
    executor: str, schedule: str, variant: Variant, tools: Tools, model: Model, size: int
) -> Opened:
    """Compile the kernel and build it."""
    runner, program = tools.executor(executor), variant.program(model)
    artifact = compile_program(program, executor, variant.profile, schedule, variant.rank)
    runner.build(artifact, (size, size))
    alone = getattr(runner, "kernel_seconds", None)
    picked = str(artifact.manifest["schedule"]["name"])
    profile = "" if variant.profile == IEEE else f":{variant.profile}"
    return Opened(
        run=lambda given: runner.run(artifact, _read(artifact, given)),
        device=runner.device,
        stages=fused(artifact, sines_of(analysed(program))),
        source_bytes=sum(len(each.source.encode()) for each in artifact.kernels),
        rates=f"{executor}:{picked}{profile}",
        kernel_seconds=alone and (lambda given: alone(artifact, _read(artifact, given))),
        schedule=picked,
        bound=_bound_of(artifact),
        certified=artifact.certificate is not None,
    )


def _read(artifact: Artifact, given: Given) -> Images:
    """Return the images that a kernel reads: a form may see fewer features than the network."""
    gather = kernel_gather(artifact.kernels[0].program)
    images = given.integers if gather.whole else given.images
    return {image.name: images[image.name] for image in gather.images}


def _bound_of(artifact: Artifact) -> float | None:
    """Return the bound of rounding for all images; of a rank against the product of its factors."""
    factored = artifact.manifest.get("factored")
    output = (factored["rounding"] if factored else artifact.manifest["bound"])["output"]
    return max(output) if output else None


def of_machine(
    tools: Tools, size: int, quick: bool = False, forms: Sequence[Variant] = ()
) -> list[Contender]:
    """Return all contenders of a machine; those that cannot run here are in the list and say so later.

    `forms` are trained; they run on OpenCL and OpenGL, as the variants do. `quick`: the kernels with the
    schedules that suit their devices for pictures of this size, the first variant, and `QUICK`.
    """
    found = []
    for name, target in DENOISERS.items():
        try:
            suits = tools.executor(name).schedule_for((size, size))
        except ExecutorUnavailable:
            suits = target.schedules[0].name
        schedules = [suits] if quick else [schedule.name for schedule in target.schedules]
        found += [kernel(name, schedule) for schedule in schedules]
        if name in TARGETS and name != "numpy":
            found += _varied(name, suits, [*(VARIANTS[:1] if quick else VARIANTS), *forms])
        if name != "numpy" and not quick:
            found += _of_integers(name, suits)
    return [*found, *(peer for peer in peers.contenders() if not quick or peer.name in QUICK)]


def _of_integers(executor: str, suits: str) -> list[Contender]:
    """Return the kernels of a network of integers: in bytes where a language has such, and in floats."""
    direct = _of_two_passes(executor, suits)
    bytewise = [s.name for s in DENOISERS[executor].schedules if isinstance(s, Dot)]
    return [kernel(executor, each, INTEGERS) for each in dict.fromkeys([*bytewise, direct])]


def _varied(executor: str, suits: str, variants: Sequence[Variant]) -> list[Contender]:
    """Return the kernels of variants: with the schedule that suits, and the direct one where that is another.

    A first layer in two passes has the direct one only.
    """
    direct, found = _of_two_passes(executor, suits), []
    for variant in variants:
        both = [] if variant.rank else [suits]
        found += [kernel(executor, each, variant) for each in dict.fromkeys([*both, direct])]
    return found


def _of_two_passes(target: str, suits: str) -> str:
    """Return the schedule of a first layer in two passes: spectra name what takes their place."""
    schedule = schedule_named(target, suits)
    return schedule.name if schedule.instead == PLAIN else schedule.instead


def chosen(contenders: Sequence[Contender], only: Sequence[str], executors: Sequence[str]) -> list[Contender]:
    """Return the contenders whose names match one of the patterns, and the kernels of some executors.

    Without patterns all; without `executors` the kernels of all of them.
    """
    for pattern in only:
        if not any(fnmatchcase(each.name, pattern) for each in contenders):
            names = ", ".join(each.name for each in contenders)
            raise InputError("name of a program", pattern, "matches none", f"choose one of {names}")
    named = [each for each in contenders if not only or any(fnmatchcase(each.name, p) for p in only)]
    return [each for each in named if not executors or each.executor in (None, *executors)]
