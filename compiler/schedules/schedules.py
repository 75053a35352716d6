"""Schedules: ways to order the work of one program in a kernel, as data beside the program.

In exact arithmetic a schedule never changes what is computed, only in which order and from where. Most
reorder and fuse sums, which the bound of every profile allows (spec/profiles.md, PRO-1), so that one bound
holds for them; one that computes sums in another way states its own [`Schedule.enclosures`]. A target lists
its schedules as rungs of a ladder, the plain one first [`compile.TARGETS`]; each rung adds one idea to one
before. A schedule that cannot hold a program says why, and the one that it names instead takes its place, at
last the plain one, which holds every program [`pick`].

The layout of the weights belongs to the schedule: kernels walk through them in order.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...refimpl.errors import CompileError, choice
from ...refimpl.network import dataset
from ..core import ir, weights
from ..core.ir import Gather, Program
from ..core.profiles import SineContract
from ..core.weights import Slot
from ..languages.dialect import Dialect
from ..languages.interface import PLAIN as PLAIN
from ..proof import bounds
from ..proof.bounds import Enclosure
from ..proof.spectra import Spectra
from .emit import emit, kernel_gather, private_bytes

Images = Mapping[str, NDArray[np.float32]]

ALL = slice(None)
"""All rows of a picture."""


def windows(gather: Gather, images: Images, rows: slice = ALL) -> NDArray[np.float64]:
    """Return the windows (rows, W, n) of given images (H, W, C)."""
    joined = np.concatenate([images[image.name] for image in gather.images], axis=-1, dtype=np.float64)
    first, end, _ = rows.indices(len(joined))
    padded = dataset.pad(joined, gather.window, gather.axes)[first : end + gather.rows - 1]
    found: NDArray[np.float64] = dataset.all_windows(padded, gather.window, gather.axes)
    return found


class Schedule(ABC):
    """One way to order a kernel's work; `idea` is the sentence that sets this rung apart from the last.

    `arguments` says how to call the kernel, `pixels` how many neighbours of a row a work item computes,
    `order` how a matrix is stored among the weights; `language` and `suffix` are set where they are its own;
    `instead` names the schedule of programs that it refuses. `bytewise`: its array of weights holds bytes.
    """

    name: str
    idea: str
    arguments: str
    pixels: int = 1
    language: str = ""
    suffix: str = ""
    instead: str = PLAIN
    bytewise: bool = False
    order: str = "matrices input-major: D_in x D_out, in C order"

    def refusal(self, program: Program) -> str:
        """Return why this schedule cannot hold the program, or nothing."""
        return ""

    def extent(self, program: Program) -> tuple[int, int]:
        """Return the columns and rows of pixels that a work item computes."""
        return self.pixels, 1

    def enclosures(
        self, program: Program, sine: SineContract, images: Images | None = None, rows: slice = ALL
    ) -> list[Enclosure]:
        """Return the enclosure of every node of an analysed program in this schedule's arithmetic.

        For all images in their ranges, or for given ones (H, W, C), then for each pixel of some `rows`.
        """
        gather = kernel_gather(program)
        box = bounds.window_box(gather) if images is None else (windows(gather, images, rows),) * 2
        return bounds.enclose(program, {"window": box}, sine)

    @abstractmethod
    def emit(self, program: Program, header: Sequence[str], bounded: bool) -> str:
        """Return the kernel's source; see emit.py."""

    @abstractmethod
    def private_bytes(self, program: Program) -> int:
        """Return the bytes of the arrays that a work item declares."""

    def called(self) -> Mapping[str, str]:
        """Return the further numbers of the text about its arguments, by name."""
        return {}

    def details(self, program: Program) -> Mapping[str, Any]:
        """Return what else a caller must know, for the manifest."""
        return {}

    def layout(self, program: Program) -> Mapping[str, Slot]:
        """Return the slot of each weight."""
        return weights.layout(program)

    def pack(self, program: Program) -> NDArray[np.float32]:
        """Return the weights (count,) as `layout` places them."""
        return weights.pack(program)

    def coded(self, program: Program, parameters: Mapping[str, NDArray[np.float32]]) -> NDArray[np.float32]:
        """Return other numbers (count,) in the places of the weights: to find where each one is."""
        return self.pack(replace(program, parameters=parameters))

    def spectra(self, program: Program) -> Spectra | None:
        """Return how the sums over the window are computed from spectra, or None where they are not."""
        return None


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
    """The schedule of a kernel, and the reason if it is not the requested one."""

    schedule: Schedule
    asked: str
    extent: tuple[int, int]
    reason: str = ""
    details: Mapping[str, Any] = field(default_factory=dict)

    def manifest(self) -> Mapping[str, Any]:
        """Return what a manifest says about it."""
        columns, rows = self.extent
        found = {"name": self.schedule.name, "idea": self.schedule.idea, "pixels": columns}
        found = {**found, "rows": rows} if rows > 1 else found
        found |= self.details
        return {**found, "asked": self.asked, "reason": self.reason} if self.reason else found


def pick(schedules: Sequence[Schedule], name: str, program: Program) -> Pick:
    """Return the schedule of this name, or the one in its place that holds the program, with the reason."""
    known = {schedule.name: schedule for schedule in schedules}
    if name not in known:
        raise CompileError(f"schedule {name!r}: unknown to this target ({choice(name, known)})")
    chosen, first = known[name], ""
    while chosen is not schedules[0] and (reason := chosen.refusal(program)):
        first = first or reason
        chosen = known[chosen.instead]
    return Pick(chosen, name, chosen.extent(program), first, chosen.details(program))
