"""When executors disagree: which one is off, where, since which stage, and on how small a picture.

1. Compile the network for each executor and schedule [`kernels_of`], run each kernel, and hold each number
   against the float64 reference and the bound of its schedule at this frame [`judged`], [compiler/plan.py].
   What is not a finite number deviates.
2. Name the odd ones out: those that deviate while others are within their bounds. If all deviate, it is the
   program or the bound that is suspect [`conclusion`].
3. Cut the picture down to one that still shows it [reduce.py: `shrink`], and run the network's first stages
   without the rest until one deviates [reduce.py: `first_stage`].

Executors run in processes of their own [`Apart`]: one that crashes, or never answers, has deviated; the next
run starts another process. One that refuses a kernel in its own words has not: it has written nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from operator import attrgetter, methodcaller
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...compiler.artifact import Artifact
from ...compiler.compile import compile_plan
from ...compiler.core import ir
from ...compiler.core.ir import Program
from ...compiler.plan import Expected, Plan, plan_program
from ...compiler.targets import language_named
from ...refimpl.errors import CompileError, ExecutorUnavailable, WamnetError
from ..devices.executor import Executor
from ..devices.kernel import Closing, Images
from ..devices.registry import WAYS, open_executor
from ..orphans import Worker, WorkerEnded

LIMIT_S = 300.0
"""Seconds after which a kernel, its compilation included, counts as one that never ends."""


@dataclass(frozen=True)
class Outcome:
    """A picture (H, W, C), or why the executor refuses the kernel, or how it failed."""

    image: NDArray[np.float32] | None = None
    refusal: str = ""
    failure: str = ""


def attempt(device: Executor, artifact: Artifact, images: Images) -> Outcome:
    """Run a kernel; an error in the house's words is a refusal, any other a failure."""
    try:
        return Outcome(device.run(artifact, images))
    except WamnetError as error:
        return Outcome(refusal=_line(str(error)))
    except Exception as error:  # noqa: BLE001 - whatever it is, it is the result
        return Outcome(failure=_line(f"{type(error).__name__}: {error}"))


class Apart(Closing):
    """An executor in a process of its own, which tells failures in place of raising them.

    `way` is its name in registry.WAYS; raises ExecutorUnavailable where it is missing. `language` is that of
    its kernels.
    """

    def __init__(self, way: str) -> None:
        self.way, self.limit_s = way, LIMIT_S
        self.language = language_named(WAYS[way][0])
        self._worker: Worker | None = None
        opened = self._asked(attrgetter("device"))
        if isinstance(opened, Outcome):
            self.close()
            raise ExecutorUnavailable(f"{way}: {opened.failure}")
        self.device = str(opened)

    def picked(self, size: tuple[int, int]) -> str:
        """Return the name of the schedule that the executor picks for a size (height, width)."""
        found = self._asked(methodcaller("schedule_for", size))
        return found if isinstance(found, str) else "plain"

    def run(self, artifact: Artifact, images: Images) -> Outcome:
        """Run a kernel on images (H, W, C)."""
        found = self._asked(attempt, artifact, dict(images))
        assert isinstance(found, Outcome)
        return found

    def _asked(self, function: Callable[..., Any], *arguments: object) -> Any:
        """Return a function of the executor, in a process that starts if the last one has ended."""
        if self._worker is None:
            self._worker = Worker()
        try:
            return self._worker.call(self.limit_s, _of_executor, self.way, function, *arguments)
        except WorkerEnded as error:
            self._worker = None
            return Outcome(failure=str(error))

    def close(self) -> None:
        """End the process."""
        if self._worker is not None:
            self._worker.close()
            self._worker = None


@lru_cache(1)
def _opened(way: str) -> Executor:
    """Return the executor of a process."""
    name, options = WAYS[way]
    return open_executor(name, **options)


def _of_executor(way: str, function: Callable[..., Any], *arguments: object) -> Any:
    """Return what a function returns of a process's executor, or why that is missing."""
    try:
        executor = _opened(way)
    except Exception as error:  # noqa: BLE001 - whatever it is, the executor is missing
        return Outcome(failure=_line(str(error)))
    return function(executor, *arguments)


def _line(text: str) -> str:
    """Return a text on one line."""
    return " ".join(text.split())


Compile = Callable[[Plan], Artifact]
"""What makes a plan's kernel."""

NONE: Mapping[str, str] = {}
"""No schedule but the picked one."""

PICKED, EVERY = "picked", "all"
"""Which schedules are run: the one that the executor picks, or all that its target has."""


@dataclass(frozen=True)
class Kernel:
    """A kernel and what runs it; without an `artifact`, the `reason` why the compiler refuses it."""

    runner: Apart
    schedule: str
    artifact: Artifact | None
    reason: str = ""

    @property
    def name(self) -> str:
        """Return executor and schedule."""
        return f"{self.runner.way} {self.schedule}"


@dataclass(frozen=True)
class Verdict:
    """What a kernel wrote: its worst number, (row, column, channel), and how far that one may be off.

    `ratio`: the largest error / bound; `refusal`, `failure`: why there is no picture.
    """

    kernel: Kernel
    error: float = 0.0
    ratio: float = 0.0
    pixel: tuple[int, int, int] | None = None
    found: float = 0.0
    expected: float = 0.0
    bound: float = 0.0
    refusal: str = ""
    failure: str = ""

    @property
    def ran(self) -> bool:
        """Tell whether there is something to judge."""
        return not self.refusal

    @property
    def within(self) -> bool:
        """Tell whether the picture is as promised; NaN is not."""
        return self.ran and not self.failure and self.ratio <= 1.0

    @property
    def deviates(self) -> bool:
        """Tell whether the executor did not keep the promise."""
        return self.ran and not self.within

    @property
    def promised(self) -> bool:
        """Tell whether there is a bound to be within."""
        return bool(np.isfinite(self.bound))

    @property
    def state(self) -> str:
        """Return the verdict in a few words."""
        if self.refusal:
            return f"refused: {self.refusal}"
        if self.failure:
            return f"FAILED: {self.failure}"
        if not self.within:
            return "DEVIATES"
        return "within" if self.promised else "no bound"


def kernels_of(
    runners: Sequence[Apart],
    program: Program,
    size: tuple[int, int],
    which: str = PICKED,
    compiled: Compile = compile_plan,
    instead: Mapping[str, str] = NONE,
) -> list[Kernel]:
    """Return the kernels of a program for each runner, in the picked schedule or in `all` that hold it.

    `instead`: schedules by language, instead of the picked ones.
    """
    known: dict[tuple[str, str], Artifact | str] = {}
    kernels = []
    for runner in runners:
        language = runner.language
        every = list(language.schedules)
        named = which if which != PICKED else instead.get(language.name) or runner.picked(size)
        for schedule in every if which == EVERY else [named]:
            key = (language.name, schedule)
            if key not in known:
                try:
                    known[key] = compiled(plan_program(program, language, schedule))
                except CompileError as error:
                    known[key] = str(error)
            found = known[key]
            if isinstance(found, str):
                kernels.append(Kernel(runner, schedule, None, found))
                continue
            actual = str(found.manifest["schedule"]["name"])
            # One that is replaced by another is that other one, which has its turn.
            if actual == schedule or which != EVERY:
                kernels.append(Kernel(runner, actual, found))
    return kernels


class Judge:
    """What kernels may write for images (H, W, C) by their plans: computed once where it is the same."""

    def __init__(self, images: Images) -> None:
        self.images = images
        self._known: dict[Any, Expected] = {}

    def verdict(self, kernel: Kernel) -> Verdict:
        """Run a kernel, and judge what it writes."""
        if kernel.artifact is None:
            return Verdict(kernel, refusal=kernel.reason)
        outcome = kernel.runner.run(kernel.artifact, self.images)
        if outcome.image is None:
            return Verdict(kernel, refusal=outcome.refusal, failure=outcome.failure)
        plan = kernel.artifact.plan
        # Most schedules share one bound.
        key = (ir.digest(plan.analysed), plan.sine, None if plan.shares_bound else plan.schedule.name)
        if key not in self._known:
            self._known[key] = plan.expected(self.images)
        return _judged(kernel, outcome, self._known[key])


def judged(kernels: Sequence[Kernel], images: Images) -> list[Verdict]:
    """Run kernels on images (H, W, C), and return the verdicts in their order."""
    judge = Judge(images)
    return [judge.verdict(kernel) for kernel in kernels]


def _judged(kernel: Kernel, outcome: Outcome, held: Expected) -> Verdict:
    """Return the verdict about a picture (H, W, C)."""
    assert outcome.image is not None
    found = outcome.image.astype(np.float64)
    with np.errstate(invalid="ignore", divide="ignore"):
        error = np.abs(found - held.value)
        # A bound of 0 is kept by no error only.
        ratio = np.where(error == 0.0, 0.0, np.where(np.isfinite(found), error / held.bound, np.inf))
    at = tuple(int(i) for i in np.unravel_index(int(np.argmax(ratio)), found.shape))
    return Verdict(
        kernel,
        error=float(np.nanmax(error)) if np.isfinite(found).all() else float("inf"),
        ratio=float(ratio.max()),
        pixel=(at[0], at[1], at[2]),
        found=float(found[at]),
        expected=float(held.value[at]),
        bound=float(held.bound[at]),
    )


def odd_ones(verdicts: Sequence[Verdict]) -> list[Verdict]:
    """Return the kernels that deviate."""
    return [verdict for verdict in verdicts if verdict.deviates]


def conclusion(verdicts: Sequence[Verdict]) -> str:
    """Return in one sentence who is the odd one out."""
    ran, odd = [v for v in verdicts if v.ran], odd_ones(verdicts)
    if not ran:
        return "nothing ran: every kernel was refused"
    if not odd:
        return _within(ran, "kernel")
    names = " and ".join(_names(odd, ran))
    if len(odd) < len(ran):
        many = len(_names(odd, ran)) > 1
        ones = "are the odd ones out" if many else "is the odd one out"
        return f"{names} {ones}: {_within([v for v in ran if v.within], 'other')}"
    if len(ran) == 1:
        return f"{names} deviates, and nothing else ran: run other executors beside it"
    return "all deviate: the program or the bound is suspect, not an executor"


def _names(odd: Sequence[Verdict], ran: Sequence[Verdict]) -> list[str]:
    """Return the names of the odd ones: an executor's, if all its schedules deviate, or a kernel's."""
    names: dict[str, None] = {}
    for verdict in odd:
        way = verdict.kernel.runner.way
        whole = all(v.deviates for v in ran if v.kernel.runner.way == way)
        several = sum(v.kernel.runner.way == way for v in ran) > 1
        names[f"{way} (all schedules)" if whole and several else verdict.kernel.name] = None
    return list(names)


def _within(verdicts: Sequence[Verdict], what: str) -> str:
    """Return how many of these are within their bounds, and how many have none."""
    with_bound = sum(verdict.promised for verdict in verdicts)
    without = len(verdicts) - with_bound
    texts = []
    if with_bound:
        whose = "its bound" if with_bound == 1 else "their bounds"
        texts.append(f"{_count(with_bound, what)} within {whose}")
    if without:
        texts.append(f"{_count(without, what)} without a bound that wrote finite numbers")
    return ", ".join(texts)


def _count(number: int, what: str) -> str:
    """Return a number of things."""
    return f"{number} {what}{'' if number == 1 else 's'}"
