"""What takes part in the benchmark of denoisers: all executors with their schedules, all variants, all peers.

1. A contender is data until it is opened for a model and a size. One that computes the network says which
   program it computes [`Variant`]; its error is against the full network in float64, whatever it leaves out.
   Another denoiser has no error, only a quality.
2. A kernel is named EXECUTOR:SCHEDULE, with :VARIANT where it is not the whole network [`kernel`].
3. Variants run with the schedule that suits the device, or the one that takes its place [`of_machine`]: sines
   and profiles, which need no training [`VARIANTS`], and forms that were trained and are given.
4. Peers come from another distribution, where it is installed [`peers`].
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from fnmatch import fnmatchcase
from functools import partial
from importlib.metadata import entry_points
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...compiler import variants
from ...compiler.artifact import Artifact
from ...compiler.compile import compile_plan
from ...compiler.core import profiles, sine
from ...compiler.core.lower import lower
from ...compiler.plan import Plan, plan_program
from ...compiler.schedules import names
from ...compiler.schedules.common import kernel_gather
from ...compiler.schedules.schedules import PLAIN
from ...compiler.targets import DENOISERS, TARGETS, Language, language_named
from ...compiler.variants import parse, vary
from ...refimpl.errors import ExecutorUnavailable, InputError
from ...refimpl.network.denoise import Model
from ..devices.executor import Executor
from ..devices.kernel import Images
from ..devices.registry import open_executor
from ..run.denoise_on import bound_of
from .rates import Stage, fused, sines_of
from .workload import Given

Array = NDArray[Any]

NO_CACHE = "nothing is kept"
"""What stays on disk of code that a contender compiles, if it compiles any."""

IEEE = "ieee"
"""Profile of kernels, unless a variant has another."""

MACHINE = "machine"
"""Name of the rates of contenders that have none of their own: those of the machine."""


@dataclass(frozen=True, eq=False)
class Variant:
    """A form of the network that trades accuracy for speed: a rank, a profile, a model trained as the form.

    `model` None: the benchmark's own; `steps`: how many steps the model was trained on from that one. `made`:
    the variant that is made of it [compiler/variants.py].
    """

    name: str
    text: str
    rank: int = 0
    profile: str = IEEE
    model: Model | None = None
    steps: int = 0
    made: str = variants.FULL

    def of(self, model: Model) -> Model:
        """Return the network that is run when `model` is the benchmark's."""
        found = self.model or model
        return found if self.made == variants.FULL else vary(parse(self.made), found).model

    def plan(self, model: Model, language: Language | str, schedule: str = PLAIN) -> Plan:
        """Return the plan of the form when `model` is the benchmark's."""
        chosen = language_named(language).under(self.profile)
        return plan_program(lower(self.of(model)), chosen, schedule, self.rank)

    def facts(self, model: Model) -> dict[str, Any]:
        """Return profile, degree of the sine, rank, window, parameters and steps of training."""
        found, degree = self.of(model), None  # the target's own sine
        if profiles.profile_named(self.profile).sine is not None:
            degree = int(self.profile.partition(profiles.DEGREE_WORD)[2] or sine.DEGREE)
        return {
            "profile": self.profile,
            "degree": degree,
            "rank": self.rank or None,
            "window": found.window.size,
            "parameters": parameters_of(found, self.rank),
            "trained_steps": self.steps or None,
        }


def parameters_of(model: Model, rank: int = 0) -> int:
    """Return how many numbers a network has; of a first layer of a rank those of its two factors."""
    weights, biases = model.siren.weights, model.siren.biases
    others = sum(array.size for array in (*weights[1:], *biases))
    rows, columns = weights[0].shape
    size = model.window.size
    return int(others + (rank * (columns // size + size * rows) if rank else rows * columns))


FULL = Variant("full", "the whole network")
"""The network as it is."""


@dataclass(frozen=True)
class Opened:
    """A contender that is ready to be given frames; `run` returns the picture (H, W, 3).

    `display` turns what `run` returns into display-encoded colours, outside of what is timed. `stages` are
    what it does for a pixel [rates.py], `rates` the name of the rates that it has [`MACHINE` or its own].
    `kernel_seconds`: without copies to and from the device. `schedule`: the one that was picked,
    `bound`: what is proven for all images, `certified`: whether the proof is written out.
    """

    run: Callable[[Given], Array]
    device: str
    stages: tuple[Stage, ...] = ()
    source_bytes: int | None = None
    rates: str = MACHINE
    kernel_seconds: Callable[[Given], float] | None = None
    display: Callable[[Array], Array] = np.asarray
    schedule: str = ""
    bound: float | None = None
    certified: bool = False


@dataclass(frozen=True)
class Contender:
    """A way to denoise: its name, what it is in words, and how it is opened for a model and a size (px).

    `variant` is None for another denoiser. `executor` names the kernels' executor, None for peers. `caches`
    says where compiled code stays.
    """

    name: str
    text: str
    open: Callable[[Tools, Model, int], Opened]
    variant: Variant | None = FULL
    executor: str | None = None
    schedule: str = ""
    caches: str = NO_CACHE

    def prepare(self, tools: Tools) -> None:
        """Open what it needs before anything is compiled, or raise ExecutorUnavailable."""
        if self.executor:
            tools.executor(self.executor)


class Tools(ExitStack):
    """Executors that contenders share, each opened once; with the block they are closed."""

    def __init__(self) -> None:
        super().__init__()
        self.executors: dict[str, Executor] = {}

    def executor(self, name: str) -> Executor:
        """Return an open executor, or raise ExecutorUnavailable."""
        if name not in self.executors:
            self.executors[name] = self.enter_context(open_executor(name))
        return self.executors[name]


# ---- the list ----------------------------------------------------------------------------------------------

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

GROUP = "wamnet.peers"
"""Group of entry points, whose values are modules with `contenders`."""

QUICK = ("onnxruntime", "oidn:fast")
"""Peers of a quick run: those that have nothing to compile."""


def kernel(language: Language | str, schedule: str, variant: Variant = FULL) -> Contender:
    """Return the kernel in an executor's language with a schedule: of the whole network, or of a variant."""
    language = language_named(language)
    name, text = f"{language.name}:{schedule}", language.schedules[schedule].idea
    if variant is not FULL:
        name, text = f"{name}:{variant.name}", variant.text
    opens = partial(_opened, language, schedule, variant)
    caches = CACHES.get(language.name, NO_CACHE)
    return Contender(name, text, opens, variant, language.name, schedule, caches=caches)


def _opened(
    language: Language, schedule: str, variant: Variant, tools: Tools, model: Model, size: int
) -> Opened:
    """Compile the kernel and build it."""
    runner = tools.executor(language.name)
    plan = variant.plan(model, language, schedule)
    artifact = compile_plan(plan)
    runner.build(artifact, (size, size))
    alone = getattr(runner, "kernel_seconds", None)
    picked = str(artifact.manifest["schedule"]["name"])
    profile = "" if variant.profile == IEEE else f":{variant.profile}"
    return Opened(
        run=lambda given: runner.run(artifact, _read(artifact, given)),
        device=runner.device,
        stages=fused(artifact, sines_of(plan.analysed)),
        source_bytes=sum(len(each.source.encode()) for each in artifact.kernels),
        rates=f"{language.name}:{picked}{profile}",
        kernel_seconds=alone and (lambda given: alone(artifact, _read(artifact, given))),
        schedule=picked,
        bound=bound_of(artifact),
        certified=artifact.certificate is not None,
    )


def _read(artifact: Artifact, given: Given) -> Images:
    """Return the images that a kernel reads: a form may see fewer features than the network."""
    gather = kernel_gather(artifact.kernels[0].programs)
    images = given.integers if gather.whole else given.images
    return {image.name: images[image.name] for image in gather.images}


def of_machine(
    tools: Tools, size: int, quick: bool = False, forms: Sequence[Variant] = ()
) -> list[Contender]:
    """Return all contenders of a machine; those that cannot run here are in the list and say so later.

    `forms` are trained; they run on OpenCL and OpenGL, as the variants do. `quick`: the kernels with the
    schedules that suit their devices for pictures of this size, the first variant, and `QUICK`.
    """
    found = []
    for name in DENOISERS:
        target = language_named(name)
        try:
            suits = tools.executor(name).schedule_for((size, size))
        except ExecutorUnavailable:
            suits = PLAIN
        schedules = [suits] if quick else list(target.schedules)
        found += [kernel(target, schedule) for schedule in schedules]
        varied = [*(VARIANTS[:1] if quick else VARIANTS), *forms] if name in TARGETS else []
        for form in [*varied, *([] if quick else [INTEGERS])] if name != "numpy" else []:
            found += [kernel(target, each, form) for each in _schedules(target, suits, form)]
    return [*found, *(peer for peer in peers() if not quick or peer.name in QUICK)]


def peers() -> list[Contender]:
    """Return the denoisers of other distributions, where such are installed."""
    return [each for entry in entry_points(group=GROUP) for each in entry.load().contenders]


def _schedules(language: Language, suits: str, form: Variant) -> list[str]:
    """Return the schedules of a variant: the one that suits, and the direct one where that is another.

    A first layer in two passes has the direct one only, integers instead those in bytes where a language has
    such. Spectra name what takes their place in two passes.
    """
    schedule = language.schedules[suits]
    direct = schedule.name if schedule.instead == PLAIN else schedule.instead
    others = [suits] if not form.rank else []
    if form is INTEGERS:
        others = [each for each in language.schedules if names.parse(each)[0] == "dot"]
    return list(dict.fromkeys([*others, direct]))


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
