"""Schedules: ways to order the work of one program in a kernel, as data beside the program.

A schedule never changes what is computed, only in which order and from where: sums are reordered and fused,
which the bound of every profile allows (spec/profiles.md, PRO-1), so one bound holds for all schedules of a
target. A target lists its schedules as rungs of a ladder, the plain one first [`compile.TARGETS`]; each rung
adds one idea to the one before. A schedule that cannot hold a program says why, and the plain one takes its
place [`pick`]: it holds every program.

The layout of the weights belongs to the schedule: kernels walk through them in order.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..refimpl.errors import CompileError
from . import ir, weights
from .dialect import Dialect
from .emit import emit, private_bytes
from .ir import Program
from .weights import Slot

PLAIN = "plain"
"""Name of the schedule that every target has: the kernel that is made to be read."""


class Schedule(ABC):
    """One way to order a kernel's work; `idea` is the sentence that sets this rung apart from the last.

    `arguments` says how to call the kernel, `pixels` how many neighbours of a row a work item computes,
    `order` how a matrix lies among the weights; `language` and `suffix` are set where they are its own.
    """

    name: str
    idea: str
    arguments: str
    pixels: int = 1
    language: str = ""
    suffix: str = ""
    order: str = "matrices input-major: D_in x D_out, in C order"

    def refusal(self, program: Program) -> str:
        """Return why this schedule cannot hold the program, or nothing."""
        return ""

    @abstractmethod
    def emit(self, program: Program, header: Sequence[str], bounded: bool) -> str:
        """Return the kernel's source; see emit.py."""

    @abstractmethod
    def private_bytes(self, program: Program) -> int:
        """Return the bytes of the arrays that a work item declares."""

    def details(self, program: Program) -> Mapping[str, Any]:
        """Return what a caller must know besides, for the manifest."""
        return {}

    def layout(self, program: Program) -> Mapping[str, Slot]:
        """Return where each weight lies."""
        return weights.layout(program)

    def pack(self, program: Program) -> NDArray[np.float32]:
        """Return the weights (count,) as `layout` places them."""
        return weights.pack(program)


class Plain(Schedule):
    """One pixel a work item, loops over taps and neurons [emit.py]."""

    name = PLAIN
    idea = "one pixel after another, loops over taps and neurons"

    def __init__(self, dialect: Dialect) -> None:
        self.dialect = dialect
        self.arguments = dialect.arguments

    def emit(self, program: Program, header: Sequence[str], bounded: bool) -> str:
        """Return the kernel's source."""
        return emit(program, self.dialect, header, bounded)

    def private_bytes(self, program: Program) -> int:
        """Return the bytes of a pixel's arrays."""
        return private_bytes(program)


class Printed(Schedule):
    """The program as text, which is all that the interpreter needs."""

    name = PLAIN
    idea = "one operation after another, all pixels at once"
    arguments = "the program's inputs and parameters, by name"

    def emit(self, program: Program, header: Sequence[str], bounded: bool) -> str:
        """Return the text, under the header as comments."""
        return "".join(f"# {line}".rstrip() + "\n" for line in header) + ir.text(program)

    def private_bytes(self, program: Program) -> int:
        """Return what a kernel for one pixel would take."""
        return private_bytes(program)


@dataclass(frozen=True)
class Pick:
    """The schedule of a kernel, and why it is not the one that was asked for, if so."""

    schedule: Schedule
    asked: str
    reason: str = ""
    details: Mapping[str, Any] = field(default_factory=dict)

    def manifest(self) -> Mapping[str, Any]:
        """Return what a manifest says about it."""
        found = {"name": self.schedule.name, "idea": self.schedule.idea, "pixels": self.schedule.pixels}
        found |= self.details
        return {**found, "asked": self.asked, "reason": self.reason} if self.reason else found


def text(picked: Mapping[str, Any]) -> str:
    """Return what a manifest says about its schedule, for a reader."""
    found = f"{picked['name']}: {picked['idea']}"
    return f"{found} (not {picked['asked']}: {picked['reason']})" if "reason" in picked else found


def pick(schedules: Sequence[Schedule], name: str, program: Program) -> Pick:
    """Return the schedule of this name, or the first where that cannot hold the program, with the reason."""
    known = {schedule.name: schedule for schedule in schedules}
    if name not in known:
        raise CompileError(f"schedule {name!r} does not exist for this target; there are: {', '.join(known)}")
    reason = known[name].refusal(program)
    return (
        Pick(schedules[0], name, reason)
        if reason
        else Pick(known[name], name, "", known[name].details(program))
    )
