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
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...refimpl.errors import CompileError
from ...refimpl.network import dataset
from ..core import weights
from ..core.ir import Gather, Program
from ..core.profiles import SineContract
from ..core.weights import Slot
from ..kernel.interface import PLAIN as PLAIN
from ..kernel.kernel import Kernel
from ..kernel.sizes import integer, item_bytes, shared_bytes
from ..languages.dialect import Dialect
from ..languages.listing import Listing
from ..languages.renderer import Renderer
from ..proof import bounds
from ..proof.bounds import Enclosure
from ..proof.spectra import Spectra
from . import fourier, packed
from .bytes import (
    START,
    Bytes,
    GroupBytes,
    bytes_stored,
    matrix_twice,
    refused_by_bytes,
    words_at_once,
    words_stored,
)
from .common import Nest, kernel_gather, output_channels
from .fft import Sizes, Spectral, sizes_of, spectra_stored
from .group import (
    LARGEST_NUMBERS,
    MOST_CHANNELS,
    Group,
    beyond_tile,
    refused_by_group,
    refused_by_statements,
    rows_at_once,
)
from .inlined import LARGEST_WEIGHTS, Inlined
from .names import remedy
from .plain import Plainly
from .tile import (
    LARGEST_PRIVATE,
    Tiled,
    all_stored,
    placed,
    readers_of_window,
    refused_by_vectors,
    shared_matrix,
)

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
    weights. `bytewise`: its array of weights holds bytes. Its `builder` makes kernels as data, and takes the
    schedule's parameters that `takes` names.
    """

    name = ""
    idea = ""
    dialect: Dialect
    builder: type[Nest]
    takes: tuple[str, ...] = ()
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
        parameters = {key: getattr(self, key) for key in self.takes}
        return self.builder(program, self.layout(program), wide=self.dialect.wide, **parameters).built()

    def renderer(self, program: Program, bounded: bool) -> Renderer:
        """Return what prints the kernel of a program.

        `bounded`: an error bound is stated, and the language must keep the order of operations.
        """
        if not isinstance(self.dialect, Listing):
            _check_channels(program, self.dialect)
        return Renderer(self.dialect, self.kernel(program), bounded, self.pack(program))

    def extent(self, program: Program) -> tuple[int, int]:
        """Return the columns and rows of pixels that a work item computes."""
        kernel = self.kernel(program)
        across, down = (integer(kernel, each) for each in kernel.step)
        return across, down

    def arguments(self, program: Program) -> str:
        """Return how the kernel is called."""
        renderer = self.renderer(program, False)
        return renderer.dialect.arguments(renderer.kernel)

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
    builder = Plainly


class Stored(Schedule):
    """A schedule whose weights are stored in an order of its own: arrays one after another."""

    def stored(self, program: Program) -> Mapping[str, NDArray[np.float32]]:
        """Return all weights as they are stored, by name."""
        raise NotImplementedError

    def layout(self, program: Program) -> Mapping[str, Slot]:
        """Return the slot of each weight."""
        return placed(self.stored(program))

    def pack(self, program: Program) -> NDArray[np.float32]:
        """Return the weights (count,) as `layout` places them."""
        return np.concatenate([np.zeros(0, np.float32), *(a.ravel() for a in self.stored(program).values())])

    def beyond_stack(self, program: Program) -> str:
        """Return why an item's memory cannot hold the arrays, or nothing."""
        if (found := self.private_bytes(program)) > LARGEST_PRIVATE:
            return f"its arrays take {found} bytes a work item, of at most {LARGEST_PRIVATE}"
        return ""


class Tile(Stored):
    """A tile of `pixels` x `vectors` vectors of `lanes` neurons [tile.py]."""

    order = (
        "vectors filled up with zeros; matrices block by block of neurons: blocks x D_in x neurons; the rows "
        "of one that reads the window go image by image, then tap by tap in rows, then channel by channel"
    )

    builder: type[Nest] = Tiled
    takes = ("lanes", "pixels", "vectors")
    lanes: int
    vectors = 2

    def refusal(self, program: Program) -> str:
        """Return why this schedule cannot hold the program, or nothing."""
        reason = refused_by_vectors(program, self.dialect.max_output_channels) or shared_matrix(program)
        return reason or self.beyond_stack(program)

    def stored(self, program: Program) -> Mapping[str, NDArray[np.float32]]:
        """Return all weights as they are stored, by name."""
        return all_stored(program, self.lanes, self.vectors)


class Grouped(Stored):
    """A tile of the image for each group of items, `pixels` of a row for each item [group.py]."""

    order = (
        "vectors filled up to multiples of 4 with zeros; matrices D_in x neurons; the rows of one that reads "
        f"the window go image by image, at most {MOST_CHANNELS} channels at a time, then tap by tap in rows, "
        "then channel by channel"
    )

    builder: type[Nest] = Group
    takes = ("pixels", "group")
    pixels: int
    group: tuple[int, int]
    rows_at_once = staticmethod(rows_at_once)

    def refusal(self, program: Program) -> str:
        """Return why this schedule cannot hold the program, or nothing."""
        return (
            refused_by_vectors(program, self.dialect.max_output_channels)
            or shared_matrix(program)
            or ("" if self.bytewise else beyond_tile(kernel_gather(program)))
            or refused_by_group(program, self.pixels)
            or refused_by_statements(program, self.pixels, self.rows_at_once(program))
            or self.beyond_memory(program)
        )

    def beyond_memory(self, program: Program) -> str:
        """Return why a group's memory cannot hold the tile, or nothing."""
        if (shared := shared_bytes(self.kernel(program))) > (most := self.dialect.largest_shared):
            return f"its tile takes {shared} bytes that a group shares, of at most {most}"
        return ""

    def stored(self, program: Program) -> Mapping[str, NDArray[np.float32]]:
        """Return all weights as they are stored, by name."""
        return all_stored(program, 4, LARGEST_NUMBERS)

    def details(self, program: Program) -> Mapping[str, Any]:
        """Return the size of a group and what it shares."""
        return {"group": list(self.group), "shared_bytes": shared_bytes(self.kernel(program))}


class Inline(Schedule):
    """Everything unrolled, weights in the source [inlined.py]."""

    name = "inlined"
    idea = "all loops unrolled, every weight a constant of the source"
    order = "every weight is a constant of the source"
    builder = Inlined

    def refusal(self, program: Program) -> str:
        """Return why this schedule cannot hold the program, or nothing."""
        count = sum(array.size for array in weights.weights(program).values())
        if count > LARGEST_WEIGHTS:
            return (
                f"it has {count} weights, of at most {LARGEST_WEIGHTS}: more take a driver minutes to compile"
            )
        return self.impossible(program)

    def impossible(self, program: Program) -> str:
        """Return why there is no kernel of this program at all, or nothing."""
        return refused_by_vectors(program, self.dialect.max_output_channels)

    def layout(self, program: Program) -> Mapping[str, Slot]:
        """Return nothing: no weight lies outside the source."""
        return {}

    def pack(self, program: Program) -> NDArray[np.float32]:
        """Return no weights."""
        return np.zeros(0, np.float32)


class Packed(Stored):
    """Loops, and four weights a read [packed.py]."""

    name = "packed"
    idea = "four weights a texel, four neurons a `vec4`"
    order = "matrices input-major, each input's neurons filled up with 0 to a multiple of four"
    builder = packed.Packed

    def refusal(self, program: Program) -> str:
        """Return why this schedule cannot hold the program, or nothing."""
        return refused_by_vectors(program, self.dialect.max_output_channels)

    def stored(self, program: Program) -> Mapping[str, NDArray[np.float32]]:
        """Return all weights as they are stored, by name."""
        return packed.packed_weights(program)

    def details(self, program: Program) -> Mapping[str, Any]:
        """Return the form of the texture."""
        return {packed.WEIGHTS_A_TEXEL: 4}


class Dot(Tile):
    """A tile whose products are of bytes [bytes.py]."""

    order = (
        "matrices block by block of neurons: blocks x fours of inputs x neurons x 4 bytes with a sign; "
        "inputs that are the window go image by image, then row of taps by row, each filled up to fours; "
        f"{START}: where a matrix' sums begin, integers of 32 bits"
    )
    bytewise = True
    instead = "tile:16"
    builder = Bytes

    def refusal(self, program: Program) -> str:
        """Return why this schedule cannot hold the program, or nothing."""
        return refused_by_bytes(program) or matrix_twice(program) or super().refusal(program)

    def stored(self, program: Program) -> Mapping[str, NDArray[np.float32]]:
        """Return all weights as they are stored, by name."""
        return bytes_stored(program, self.lanes, self.vectors)


class GroupDot(Grouped):
    """A tile of words for each group of items [bytes.py]."""

    order = (
        "vectors filled up to multiples of 4 with zeros; matrices words x neurons, a word being four inputs "
        "as bytes with a sign, the first one the lowest; of a matrix that reads the window the channels of "
        f"all images make words that are filled up with zeros, at most {MOST_CHANNELS} of them at a time tap "
        "by tap in rows, then word by word"
    )
    bytewise = True
    builder = GroupBytes
    rows_at_once = staticmethod(words_at_once)

    def refusal(self, program: Program) -> str:
        """Return why this schedule cannot hold the program, or nothing."""
        return refused_by_bytes(program) or super().refusal(program)

    def stored(self, program: Program) -> Mapping[str, NDArray[np.float32]]:
        """Return all weights as they are stored, by name."""
        return words_stored(program)


COST = 3.0
"""Times that an operation of a transform takes of one of the direct sum: 2.6, as measured on an AMD EPYC with
tiles of 32; most of its operands are loaded and stored."""


class Fourier(Stored):
    """Tiles of `points` x `points` pixels, `tiles` side by side [fft.py]."""

    order = (
        "vectors filled up with zeros; the spectrum of the matrix that reads the window: columns of "
        "frequencies 0 to points / 2, pairs of vectors of neurons, rows of frequencies, pairs of channels, "
        "(real, imaginary) of the first and of the second channel, two vectors of neurons; other "
        "matrices block by block of neurons: blocks x D_in x neurons"
    )

    builder: type[Nest] = Spectral
    takes: tuple[str, ...] = ("lanes", "pixels", "points", "tiles")
    lanes: int
    points: int
    tiles: int

    def stored(self, program: Program) -> Mapping[str, NDArray[np.float32]]:
        """Return all weights as they are stored, by name."""
        return spectra_stored(program, self.lanes, self.points, self.tiles)

    def held(self, program: Program) -> Program:
        """Return the program whose parameters are what the kernel holds, before transforms."""
        found = fourier.arrangement(program, self.lanes)
        return found.centred(found.moved(program))

    def pack(self, program: Program) -> NDArray[np.float32]:
        """Return the weights (count,) as `layout` places them, the neurons of the first layer in order."""
        return super().pack(self.held(program))

    def coded(self, program: Program, parameters: Mapping[str, NDArray[np.float32]]) -> NDArray[np.float32]:
        """Return other numbers in the places of the weights; 0 for those that the kernel does not hold."""
        found = fourier.arrangement(program, self.lanes)
        own = [found.weight, *([found.bias] if found.bias and any(found.centres) else [])]
        lost = {name: np.zeros_like(parameters[name]) for name in own}
        return super().pack(found.moved(replace(program, parameters={**parameters, **lost})))

    def spectra(self, program: Program) -> Spectra:
        """Return how the sums over the window are computed, for their bound."""
        (layer,), found = readers_of_window(program), fourier.arrangement(program, self.lanes)
        gather, count = kernel_gather(program), layer.type.shape[0]
        held = found.centred(found.moved(program))
        # Columns, groups, rows, pairs, halves, parts and places of neurons.
        stored = self.stored(held)[found.weight].astype(np.float64)
        placed = stored[..., 0, :] + 1j * stored[..., 1, :]
        placed = placed.transpose(1, 5, 2, 0, 4, 3).reshape(
            -1, self.points, self.points // 2 + 1, *placed.shape[3:5]
        )
        placed = placed.reshape(*placed.shape[:3], -1)[:count, ..., : gather.channels]
        table, bias = np.empty_like(placed), np.zeros(count)
        table[found.order] = 2 * self.points * placed
        if found.bias is not None:
            bias[found.order] = held.parameters[found.bias]
        block, centres = self.sizes(program).block, np.array(found.centres)
        return Spectra(self.points, gather.rows, found.order, self.lanes, block, centres, table, bias)

    def sizes(self, program: Program) -> Sizes:
        """Return the sizes of a program's kernel."""
        return sizes_of(program, self.lanes, self.points, self.tiles)

    def enclosures(
        self, program: Program, sine: SineContract, images: Images | None = None, rows: slice = ALL
    ) -> list[Enclosure]:
        """Return the enclosure of every node: the sums over the window are those of spectra."""
        gather, of = kernel_gather(program), self.spectra(program)
        if images is None:
            norm = np.array(self.points * np.linalg.norm(fourier.radius(gather, of.centres)))
            return fourier.enclose(program, sine, bounds.window_box(gather), norm, of)
        found = windows(gather, images, rows)
        joined = np.concatenate([images[image.name] for image in gather.images], axis=-1, dtype=np.float64)
        norms = fourier.tile_norms(joined, gather.window, self.points, of.centres)[rows]
        return fourier.enclose(program, sine, (found, found), norms, of)

    def refusal(self, program: Program) -> str:
        """Return why this schedule cannot hold the program, or nothing."""
        gather, readers = kernel_gather(program), readers_of_window(program)
        if gather.whole:
            return "sums from spectra are rounded, those of integers are not"
        if reason := refused_by_vectors(program, self.dialect.max_output_channels):
            return reason
        if len(readers) != 1:
            return f"{len(readers)} affine maps read the window, not one"
        if gather.axes != (0, 1) or gather.rows >= self.points:
            return f"a window of {gather.rows} x {gather.columns} pixels in a tile of {self.points}"
        names = [node["weight"] for node in program.nodes if node.op == "affine"]
        if names.count(readers[0]["weight"]) != 1:
            return "a matrix is applied to the window and to a layer"
        if reason := self.beyond_stack(program):
            return reason
        direct, spectra = self.operations(program)
        if COST * spectra > direct:
            return f"the direct sum takes {direct:.0f} operations on vectors a pixel, spectra {spectra:.0f}"
        return ""

    def operations(self, program: Program) -> tuple[float, float]:
        """Return the operations on vectors, per pixel, of the direct sum over the window and of this one."""
        (layer,), s, n = readers_of_window(program), self.sizes(program), self.points
        direct = kernel_gather(program).n_inputs * -(-layer.type.shape[0] // self.lanes)
        products = (n // 2 + 1) * n * s.pairs * 16 * self.tiles * s.neurons
        # The split-radix algorithm takes 4 n log2(n) - 6 n + 8 operations.
        one = 4 * n * (n.bit_length() - 1) - 6 * n + 8
        transforms = s.inputs * (2 * n + 2) + self.tiles * s.neurons * (n + s.out)
        return direct, (products + one * transforms) / (self.tiles * s.out**2)


class Printed(Plain):
    """The program as text, which is all that the interpreter needs."""

    idea = "one operation after another, all pixels at once"


@dataclass(frozen=True)
class Pick:
    """The schedule of a kernel, and the reason if it is not the requested one."""

    schedule: Schedule
    asked: str
    program: Program
    reason: str = ""

    def manifest(self) -> Mapping[str, Any]:
        """Return what a manifest says about it."""
        columns, rows = self.schedule.extent(self.program)
        found = {"name": self.schedule.name, "idea": self.schedule.idea, "pixels": columns}
        found = {**found, "rows": rows} if rows > 1 else found
        found |= self.schedule.details(self.program)
        return {**found, "asked": self.asked, "reason": self.reason} if self.reason else found


def pick(schedules: Sequence[Schedule], name: str, program: Program) -> Pick:
    """Return the schedule of this name, or the one in its place that holds the program, with the reason."""
    known = {schedule.name: schedule for schedule in schedules}
    if name not in known:
        raise CompileError(f"schedule {name!r}: unknown to this target ({remedy(name, known)})")
    chosen, first = known[name], ""
    while chosen is not schedules[0] and (reason := chosen.refusal(program)):
        first = first or reason
        chosen = known[chosen.instead]
    if chosen is schedules[0] and (reason := chosen.impossible(program)):
        raise CompileError(
            f"no schedule of this target can run the program: {reason}; compile for another target"
        )
    return Pick(chosen, name, program, first)
