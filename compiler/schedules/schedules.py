"""Schedules: ways to order the work of one program in a kernel, as data beside the program.

In exact arithmetic a schedule never changes what is computed, only in which order and from where. Most
reorder and fuse sums, which the bound of every profile allows (spec/profiles.md, PRO-1), so that one bound
holds for them; one that computes sums in another way states its own [`Schedule.enclosures`]. A target has
its schedules by name, as rungs of a ladder, the plain one first [targets.py: LANGUAGES]; each rung adds one
idea to one before. A schedule that cannot hold a program says why, and the one that it names instead takes
its place, at last the plain one, which holds every program [`pick`].

The layout of the weights belongs to the schedule: kernels walk through them in order.
"""

from __future__ import annotations

from collections.abc import Mapping
from copy import copy
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ...refimpl.errors import CompileError
from ...refimpl.network import window
from ..core.ir import DTYPES, Gather, Program
from ..core.profiles import SineContract
from ..core.weights import Slot, weights
from ..kernel.interface import PLAIN as PLAIN
from ..kernel.kernel import Kernel
from ..kernel.sizes import integer, item_bytes
from ..languages.dialect import Dialect
from ..languages.renderer import Renderer
from ..proof import bounds
from ..proof.bounds import Enclosure
from .common import Nest, groups_of, kernel_gather, output_channels, readers_of_window
from .names import remedy

if TYPE_CHECKING:
    from ..proof.spectra import Spectra

Images = Mapping[str, NDArray[np.float32]]

LARGEST_PRIVATE = 2**20
"""Most bytes of arrays in a work item: half of the smallest stack that glibc gives a thread, which executors
grant. A quarter kept spectra from layers of 64 neurons, which take a third of the time with them."""

ON_VECTORS = (
    *("add", "subtract", "multiply", "divide", "negative", "absolute", "minimum", "maximum", "floor"),
    *("reciprocal", "sqrt", "sin", "cos", "less", "less_equal", "greater", "greater_equal", "select"),
    *("bitwise_and", "bitwise_xor", "right_shift", "convert"),
)
"""Operations that languages have on vectors."""

ALL = slice(None)
"""All rows of a picture."""


def windows(gather: Gather, images: Images, rows: slice = ALL) -> NDArray[np.float64]:
    """Return the windows (rows, W, n) of given images (H, W, C)."""
    joined = np.concatenate([images[image.name] for image in gather.images], axis=-1, dtype=np.float64)
    first, end, _ = rows.indices(len(joined))
    padded = window.pad(joined, gather.window, gather.axes)[first : end + gather.rows - 1]
    found: NDArray[np.float64] = window.all_windows(padded, gather.window, gather.axes)
    return found


class Schedule(Nest):
    """One way to order a kernel's work; `idea` is the sentence that sets it apart from the one before.

    Its parameters are attributes; a copy of it builds a kernel as data. `instead` names the schedule of
    programs that it refuses; `order` says how a matrix is stored among the weights. `bytewise`: its array of
    weights holds bytes.
    """

    name = ""
    idea = ""
    dialect: Dialect
    instead: str = PLAIN
    bytewise: bool = False
    order: str = "matrices input-major: D_in x D_out, in C order"

    def __init__(self, dialect: Dialect, name: str = "", idea: str = "", **parameters: Any) -> None:
        own = {"dialect": dialect, "name": name or self.name, "idea": idea or self.idea}
        vars(self).update(own | parameters)

    def refusal(self, program: Program) -> str:
        """Return why this schedule cannot hold the program, or nothing."""
        return ""

    def impossible(self, program: Program) -> str:
        """Return why there is no kernel of this program at all, or nothing."""
        return ""

    def kernel(self, program: Program) -> Kernel:
        """Return the kernel of a program; that of the last one is kept, since many ask about it."""
        known = getattr(self, "_built", None)
        if known is None or known[0] is not program or known[1] != vars(self).get("group"):
            known = self._built = (program, vars(self).get("group"), self.build(program))
        return known[2]

    def build(self, program: Program) -> Kernel:
        """Return the kernel of a program."""
        own = copy(self)
        own.wide = self.dialect.wide
        own.begin(program, self.layout(program))
        return own.built()

    def renderer(self, program: Program, bounded: bool) -> Renderer:
        """Return what prints the kernel of a program.

        `bounded`: an error bound is stated, and the language must keep the order of operations.
        """
        if not self.dialect.is_listing:
            _check_channels(program, self.dialect)
        return Renderer(self.dialect, self.kernel(program), bounded, self.pack(program))

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

    def facts(self, program: Program) -> Mapping[str, Any]:
        """Return what a manifest says about it."""
        kernel = self.kernel(program)
        columns, rows = (integer(kernel, each) for each in kernel.step)
        size = {"pixels": columns, **({"rows": rows} if rows > 1 else {})}
        return {"name": self.name, "idea": self.idea, **size, **self.details(program)}

    def stored(self, program: Program) -> Mapping[str, NDArray[np.float32]]:
        """Return all weights as they are stored, by name: input-major, so that loops walk through memory."""
        return {key: array.T for key, array in weights(program).items()}

    def layout(self, program: Program) -> Mapping[str, Slot]:
        """Return the slot of each weight."""
        slots, offset = {}, 0
        for key, array in self.stored(program).items():
            slots[key] = Slot(key, array.shape, offset)
            offset += array.size
        return slots

    def pack(self, program: Program) -> NDArray[np.float32]:
        """Return the weights (count,) as `layout` places them."""
        arrays = (array.ravel() for array in self.stored(program).values())
        return np.concatenate([np.zeros(0, np.float32), *arrays], dtype=np.float32)

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


class Stored(Schedule):
    """A schedule on vectors."""

    def refusal(self, program: Program) -> str:
        """Return why the values of a program cannot all be vectors, or nothing."""
        for index, node in enumerate(program.nodes):
            if node.op in ("constant", "parameter", "input", "affine"):
                continue
            if node.op not in ON_VECTORS:
                return f"%{index} is {node.op}, which has no form on vectors"
            if not node.type.shape:
                return f"%{index} is {node.type}: vectors hold {', '.join(f'{t}[n]' for t in DTYPES)}"
        if reason := _others_between_loops(program):
            return reason
        output = program.nodes[program.outputs[0][1]]
        if (channels := output_channels(program)) > self.dialect.max_output_channels:
            return f"it writes {channels} channels, of at most {self.dialect.max_output_channels}"
        if any(node.op != "affine" for node in readers_of_window(program)):
            return "something besides an affine map reads the window"
        if output.op in ("constant", "parameter", "input"):
            return "the output is not computed"
        return ""

    def beyond_stack(self, program: Program) -> str:
        """Return why an item's memory cannot hold the arrays, or nothing."""
        if (found := self.private_bytes(program)) > LARGEST_PRIVATE:
            return f"its arrays take {found} bytes a work item, of at most {LARGEST_PRIVATE}"
        return ""


def _others_between_loops(program: Program) -> str:
    """Return which value that is not a float another loop would have to read from an array, or nothing."""
    group_of = {index: number for number, group in enumerate(groups_of(program)) for index in group}
    for reader, node in enumerate(program.nodes):
        for index in node.args:
            known = program.nodes[index]
            other = known.op != "constant" and known.type.dtype != "float32"
            if other and group_of.get(index) != group_of[reader]:
                return f"%{index} is {known.type}, which %{reader} in another loop reads"
    return ""


def pick(schedules: Mapping[str, Schedule], name: str, program: Program) -> tuple[Schedule, str]:
    """Return the schedule of this name, or the one in its place that holds the program, with the reason."""
    if name not in schedules:
        raise CompileError(f"schedule {name!r}: unknown to this target ({remedy(name, schedules)})")
    plain, first = next(iter(schedules)), ""
    while name != plain and (reason := schedules[name].refusal(program)):
        first = first or reason
        name = schedules[name].instead
    chosen = schedules[name]
    if name == plain and (reason := chosen.impossible(program)):
        raise CompileError(
            f"no schedule of this target can run the program: {reason}; compile for another target"
        )
    return chosen, first
