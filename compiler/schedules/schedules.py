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

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...refimpl.errors import CompileError
from ...refimpl.network import dataset
from ..core import ir, weights
from ..core.ir import Gather, Program
from ..core.profiles import SineContract
from ..core.weights import Slot
from ..kernel.kernel import Kernel
from ..kernel.sizes import integer, item_bytes
from ..languages.c import stack_bytes
from ..languages.dialect import Dialect
from ..languages.interface import PLAIN as PLAIN
from ..languages.renderer import Renderer
from ..proof import bounds
from ..proof.bounds import Enclosure
from ..proof.spectra import Spectra
from .common import kernel_gather, output_channels
from .plain import plain

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


class Schedule:
    """One way to order a kernel's work; `idea` is the sentence that sets it apart from the one before.

    `instead` names the schedule of programs that it refuses; `order` says how a matrix is stored among the
    weights. `bytewise`: its array of weights holds bytes. A schedule of kernels builds them as data, and prints
    them in its language [`kernel`].
    """

    name: str
    idea: str
    dialect: Dialect
    instead: str = PLAIN
    bytewise: bool = False
    order: str = "matrices input-major: D_in x D_out, in C order"

    def refusal(self, program: Program) -> str:
        """Return why this schedule cannot hold the program, or nothing."""
        return ""

    def kernel(self, program: Program) -> Kernel:
        """Return the kernel of a program."""
        raise NotImplementedError

    def emit(self, program: Program, header: Sequence[str], bounded: bool) -> str:
        """Return the kernel's source; `header` are the lines of the comment at its top.

        `bounded`: an error bound is stated, and the language must keep the order of operations.
        """
        _check_channels(program, self.dialect)
        return Renderer(self.dialect, self.kernel(program), bounded, self.pack(program)).source(header)

    def extent(self, program: Program) -> tuple[int, int]:
        """Return the columns and rows of pixels that a work item computes."""
        kernel = self.kernel(program)
        across, down = (integer(kernel, each) for each in kernel.step)
        return across, down

    def arguments(self, program: Program) -> str:
        """Return how the kernel is called."""
        kernel, channels = self.kernel(program), output_channels(program)
        columns, rows = self.extent(program)
        stack = stack_bytes(item_bytes(kernel))
        return self.dialect.called(kernel).format(columns=columns, rows=rows, channels=channels, stack=stack)

    def enclosures(
        self, program: Program, sine: SineContract, images: Images | None = None, rows: slice = ALL
    ) -> list[Enclosure]:
        """Return the enclosure of every node of an analysed program in this schedule's arithmetic.

        For all images in their ranges, or for given ones (H, W, C), then for each pixel of some `rows`.
        """
        gather = kernel_gather(program)
        box = bounds.window_box(gather) if images is None else (windows(gather, images, rows),) * 2
        return bounds.enclose(program, {"window": box}, sine)

    def private_bytes(self, program: Program) -> int:
        """Return the bytes of the arrays that a work item declares."""
        return item_bytes(self.kernel(program))

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


def _check_channels(program: Program, dialect: Dialect) -> None:
    """Refuse an output that the language cannot write at once."""
    kind = program.nodes[program.outputs[0][1]].type
    if kind.dtype != "float32":
        raise CompileError(f"the output has type {kind}: a kernel writes float32; convert it with astype")
    channels = output_channels(program)
    if channels > dialect.max_output_channels:
        raise CompileError(
            f"the output has {channels} channels: {dialect.language} writes at most "
            f"{dialect.max_output_channels}; compile for another target"
        )


class Plain(Schedule):
    """One pixel a work item, loops over taps and neurons [plain.py]."""

    name = PLAIN
    idea = "one pixel after another, loops over taps and neurons"

    def __init__(self, dialect: Dialect) -> None:
        self.dialect = dialect

    def kernel(self, program: Program) -> Kernel:
        """Return the kernel of a program."""
        return plain(program)


class Printed(Schedule):
    """The program as text, which is all that the interpreter needs."""

    name = PLAIN
    idea = "one operation after another, all pixels at once"

    def arguments(self, program: Program) -> str:
        """Return how it is called."""
        return "the program's inputs and parameters, by name"

    def emit(self, program: Program, header: Sequence[str], bounded: bool) -> str:
        """Return the text, under the header as comments."""
        return "".join(f"# {line}".rstrip() + "\n" for line in header) + ir.text(program)

    def kernel(self, program: Program) -> Kernel:
        """Return the kernel that a language would have."""
        return plain(program)


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
        raise CompileError(f"schedule {name!r} does not exist for this target; there are: {', '.join(known)}")
    chosen, first = known[name], ""
    while chosen is not schedules[0] and (reason := chosen.refusal(program)):
        first = first or reason
        chosen = known[chosen.instead]
    return Pick(chosen, name, chosen.extent(program), first, chosen.details(program))
