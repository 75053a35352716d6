"""The tiled schedule: a work item computes a row of pixels, and keeps their sums in vector registers.

1. The images around the pixels are copied to a patch of the work item's own; the border rule is applied
   there, and the loops that follow know no border [`TiledBody._prepare`].
2. The numbers of a layer stand side by side in vectors of `lanes`, the last one filled up with neurons whose
   weights are 0: nothing reads them.
3. An affine map works on blocks of `vectors` vectors: all pixels' sums of a block are in registers while the
   inputs pass by, each weight is loaded once for all pixels, each input is one number for all lanes. With
   14 pixels and 2 vectors there are 28 independent sums for 3 loads a step and input: arithmetic units, not
   loads, set the pace (the register tile of K. Goto and R. van de Geijn, Anatomy of High-Performance Matrix
   Multiplication, 2008, section 4).
4. Weights lie in the order in which the loops need them [`Tiled.layout`].
5. Elementwise operations run on vectors, one after another; layers meet in arrays of the work item's own.

What the schedule does not hold, it names [`Tiled.refusal`].
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ..core import weights
from ..core.ir import Gather, Node, Program
from ..core.ops import OPS
from ..core.sums import is_split
from ..core.weights import Slot
from ..languages.dialect import Dialect
from ..languages.tiled_dialect import TiledDialect
from .emit import Body, emit, kernel_gather, output_channels, schedule
from .schedules import Schedule

LARGEST_PRIVATE = 2**20
"""Most bytes of arrays in a work item: half of the smallest stack that glibc gives a thread, which executors
grant. A quarter kept spectra from layers of 64 neurons, which take a third of the time with them."""


@dataclass(frozen=True)
class Blocks:
    """How n numbers fill vectors: `count` blocks of `vectors` vectors."""

    vectors: int
    count: int

    @property
    def total(self) -> int:
        """Return the number of vectors."""
        return self.vectors * self.count


def refused_by_vectors(program: Program, dialect: Dialect) -> str:
    """Return why the values of a program cannot all be vectors of this dialect, or nothing."""
    for index, node in enumerate(program.nodes):
        if node.op in ("constant", "parameter", "input", "affine"):
            continue
        if not OPS[node.op].elementwise or node.op not in dialect.operations:
            return f"%{index} is {node.op}, which has no form on vectors"
        if node.type.dtype not in dialect.types or not node.type.shape:
            return f"%{index} is {node.type}: vectors hold {', '.join(f'{t}[n]' for t in dialect.types)}"
    if reason := _others_between_loops(program):
        return reason
    output = program.nodes[program.outputs[0][1]]
    if (channels := output_channels(program)) > dialect.max_output_channels:
        return f"it writes {channels} channels, of at most {dialect.max_output_channels}"
    if any(node.op != "affine" for node in readers_of_window(program)):
        return "something besides an affine map reads the window"
    if output.op in ("constant", "parameter", "input"):
        return "the output is not computed"
    return ""


def _others_between_loops(program: Program) -> str:
    """Return which value that is not a float another loop would have to read from an array, or nothing."""
    group_of = {index: number for number, group in enumerate(schedule(program)) for index in group}
    for reader, node in enumerate(program.nodes):
        for index in node.args:
            known = program.nodes[index]
            if (
                known.op != "constant"
                and known.type.dtype != "float32"
                and group_of.get(index) != group_of[reader]
            ):
                return f"%{index} is {known.type}, which %{reader} in another loop reads"
    return ""


class Tiled(Schedule):
    """A tile of `pixels` x `vectors` vectors of `lanes` numbers."""

    order = (
        "vectors filled up with zeros; matrices block by block of neurons: blocks x D_in x neurons; the rows "
        "of one that reads the window go image by image, then tap by tap in rows, then channel by channel"
    )

    def __init__(self, name: str, idea: str, dialect: Dialect, lanes: int, pixels: int, vectors: int) -> None:
        self.name, self.idea, self.dialect = name, idea, dialect
        self.lanes, self.pixels, self.vectors = lanes, pixels, vectors
        self.arguments = dialect.arguments

    def called(self) -> Mapping[str, str]:
        """Return the numbers that the text about its arguments has."""
        return {"pixels": str(self.pixels), "bytes": str(4 * self.lanes)}

    def blocks(self, numbers: int) -> Blocks:
        """Return how so many numbers fill vectors."""
        count = -(-numbers // self.lanes)
        vectors = min(self.vectors, count)
        return Blocks(vectors, -(-count // vectors))

    def refusal(self, program: Program) -> str:
        """Return why this schedule cannot hold the program, or nothing."""
        if reason := refused_by_vectors(program, self.dialect):
            return reason
        if reason := self._shared_matrix(program):
            return reason
        if (found := self.private_bytes(program)) > LARGEST_PRIVATE:
            return f"its arrays take {found} bytes a work item, of at most {LARGEST_PRIVATE}"
        return ""

    def _shared_matrix(self, program: Program) -> str:
        """Return a refusal where one matrix is needed in two orders."""
        used = readers_of_window(program)
        if _matrices(used) & _matrices(node for node in program.nodes if node not in used):
            return "a matrix is applied to the window and to a layer, which need it in two orders"
        return ""

    def emit(self, program: Program, header: Sequence[str], bounded: bool) -> str:
        """Return the kernel's source."""
        return emit(program, self.dialect, header, bounded, self._body(program))

    def private_bytes(self, program: Program) -> int:
        """Return the bytes of the patches and of the arrays of a work item."""
        gather, body = kernel_gather(program), self._body(program)
        patch = gather.rows * (gather.columns + self.pixels - 1) * gather.channels
        shapes = [program.nodes[index].type.shape for index in body.group_of if body.declares(index)]
        numbers = sum(self.blocks(shape[0]).total * self.lanes * self.pixels for shape in shapes)
        return 4 * (patch + numbers)

    def layout(self, program: Program) -> Mapping[str, Slot]:
        """Return the slot of each weight."""
        slots: dict[str, Slot] = {}
        offset = 0
        for name, array in weights.weights(program).items():
            shape = self._shape(program, name, array.shape)
            slots[name] = Slot(name, shape, offset)
            offset += int(np.prod(shape))
        return slots

    def pack(self, program: Program) -> NDArray[np.float32]:
        """Return the weights (count,) as `layout` places them."""
        slots = self.layout(program).items()
        pieces = [self._stored(program, name, slot.shape).ravel() for name, slot in slots]
        return np.concatenate([np.zeros(0, np.float32), *pieces])

    def _shape(self, program: Program, name: str, shape: tuple[int, ...]) -> tuple[int, ...]:
        """Return the shape of a stored parameter of a given shape."""
        blocks = self.blocks(shape[0])
        if len(shape) == 2:
            return (blocks.count, shape[1], blocks.vectors * self.lanes)
        return (blocks.total * self.lanes,)

    def _stored(self, program: Program, name: str, shape: tuple[int, ...]) -> NDArray[np.float32]:
        """Return a parameter in its stored shape."""
        rows = np.atleast_2d(program.parameters[name].T)  # (D_in, D_out), or (1, D_out)
        if name in _matrices(readers_of_window(program)):
            rows = rows[self._window_rows(kernel_gather(program))]
        blocks = self.blocks(rows.shape[1])
        filled = np.zeros((len(rows), blocks.total * self.lanes), np.float32)
        filled[:, : rows.shape[1]] = rows
        by_block = filled.reshape(len(rows), blocks.count, -1).transpose(1, 0, 2)
        return by_block.reshape(shape)

    def _window_rows(self, gather: Gather) -> NDArray[np.intp]:
        """Return the window's indices (n_inputs,): image by image, in each tap by tap, channel by channel."""
        return np.asarray(gather.by_image, np.intp)

    def _body(self, program: Program) -> Body:
        """Return the writer of the kernel's statements."""
        return TiledBody(program, self.dialect, kernel_gather(program), tile=self)


def readers_of_window(program: Program) -> list[Node]:
    """Return the nodes that read the window."""
    inputs = {index for index, node in enumerate(program.nodes) if node.op == "input"}
    return [node for node in program.nodes if inputs & set(node.args)]


def _matrices(nodes: Iterable[Node]) -> set[str]:
    """Return the names of the matrices that affine maps among these nodes apply."""
    return {str(node["weight"]) for node in nodes if node.op == "affine"}


@dataclass
class TiledBody(Body):
    """The statements of a tiled kernel."""

    tile: Tiled = field(kw_only=True)

    def __post_init__(self) -> None:
        super().__post_init__()
        assert isinstance(self.dialect, TiledDialect), f"{self.dialect.language} has no words for tiles"
        self.words = self.dialect
        self.slots = self.tile.layout(self.program)

    def defines(self) -> list[str]:
        """Return the sizes of the tile and of the patch."""
        tile, define = self.tile, self.words.define
        values = {
            "PIXELS": (tile.pixels, "neighbours in a row that a work item computes"),
            "LANES": (tile.lanes, "numbers in a vector"),
            "PATCH_WIDTH": (f"({self.sides.columns} + PIXELS - 1)", "columns that all windows touch"),
        }
        sizes = [f"{define.format(name=name, value=n)} /* {what} */" for name, (n, what) in values.items()]
        return [*self.words.contraction, *self.integers(), *sizes]

    def _prepare(self) -> None:
        """Write the copies of the images around the pixels, under the border rule."""
        self._comment("the images around the pixels: what lies beyond the border is filled in here")
        names, words = self.sides, self.words
        for image in self.gather.images:
            self._line(self._patch(image.name, image.channels))
        self._line(words.index("left", f"x - {names.column}"))
        self._line(words.index("top", f"y - {names.row}"))
        columns = "left >= 0 && left + PATCH_WIDTH <= width"
        self._line(words.flag("within", f"{columns} && top >= 0 && top + {names.rows} <= height"))
        self._open(words.loop("dy", names.rows))
        self._line(words.index("row", f"{words.clamp}(top + dy, 0, height - 1)"))
        for image in self.gather.images:
            self._copy(image.name, image.channels)
        self._close()

    def _copy(self, name: str, channels: int) -> None:
        """Write the copy of a row of the patch: at once inside the image, else pixel by pixel."""
        words = self.words
        pixel = words.pixel.format(image=name, channels=channels)
        self._line(self._patch_row(f"to_{name}", f"patch_{name} + dy * PATCH_WIDTH * {channels}", True))
        self._open(words.when("within"))
        source = f"image_{name}[(row * width + left) * {channels} + i]"
        self._nest([words.loop("i", f"PATCH_WIDTH * {channels}")], self._put(f"to_{name}[i]", source))
        self._close()
        self._open(words.otherwise())
        self._open(words.loop("dx", "PATCH_WIDTH"))
        self._line(words.index("column", f"{words.clamp}(left + dx, 0, width - 1)"))
        if self.gather.window.border == "zero":
            self._line(words.flag("inside", self._inside()))
        put = self._put(f"to_{name}[dx * {channels} + c]", self._bordered(pixel))
        self._nest([words.loop("c", channels)], put)
        self._close()
        self._close()

    def _patch(self, name: str, channels: int) -> str:
        """Return the declaration of an image's patch."""
        return self.words.singles(f"patch_{name}", f"{self.sides.rows} * PATCH_WIDTH * {channels}")

    def _patch_row(self, name: str, place: str, written: bool = False) -> str:
        """Return the declaration of a row of a patch."""
        return self.words.row(name, place, written)

    def _put(self, place: str, value: str) -> list[str]:
        """Return the lines that copy one number of an image."""
        return [f"{place} = {value};"]

    def _affine(self, index: int, node: Node) -> None:
        """Write v = W x + b for all pixels, block by block."""
        numbers, source, words = node.type.shape[0], self.program.nodes[node.args[0]], self.words
        blocks, weight = self.tile.blocks(numbers), self.slots[str(node["weight"])]
        n_in, several = source.type.shape[0], blocks.count > 1
        self._declare(index, f"%{index}: affine map {node['weight']} from {n_in} to {numbers}")
        if source.op != "input":
            self._ready(node.args[0], n_in)
        self._open(words.loop("block", blocks.count) if several else "{")
        each = range(blocks.vectors)
        first = f"block * {weight.shape[1] * blocks.vectors}" if several else ""
        self._line(words.walk("w", weight.offset, first))
        self._line(words.sums("sum", blocks.vectors))
        at = f"block * {blocks.vectors} + " if several else ""
        self._pixels([self._start(f"sum[p][{j}]", node, f"{at}{j}") for j in each])
        if source.op == "input":
            self._windowed(blocks)
        else:
            held = self.tile.blocks(n_in).total
            self._layer(blocks, node.args[0], n_in, f"p * {held} * LANES")
        places = [f"p * {blocks.total} + {at}{j}" for j in each]
        self._pixels([self._hold(f"v{index}", places[j], f"sum[p][{j}]") for j in each])
        self._close()

    def _ready(self, index: int, numbers: int) -> None:
        """Write what a layer's values need before another reads them: nothing."""

    def _layer(self, blocks: Blocks, index: int, numbers: int, first: str) -> None:
        """Write the products of a layer's values, a pixel's from `first` on."""
        self._multiply(blocks, str(numbers), self.words.at(f"v{index}", f"{first} + i"))

    def _hold(self, name: str, index: str, total: str) -> str:
        """Return the statement that puts a sum into an array, as vector `index`."""
        return self.words.hold(name, index, total)

    def _start(self, total: str, node: Node, index: str) -> str:
        """Return the statement that starts a sum."""
        bias = node.get("bias")
        if not bias:
            return self.words.set_zero(total)
        return self.words.set_weights(total, self.slots[str(bias)].offset, index)

    def _windowed(self, blocks: Blocks) -> None:
        """Write the sums over the window: a partial sum for each image and row, which stays in registers."""
        each, split, words = range(blocks.vectors), is_split(self.gather), self.words
        for image in self.gather.images:
            self._open(words.loop("dy", self.sides.rows))
            self._line(self._patch_row("row", f"patch_{image.name} + dy * PATCH_WIDTH * {image.channels}"))
            if split:
                self._line(words.sums("part", blocks.vectors))
                self._pixels([words.set_zero(f"part[p][{j}]") for j in each])
            inputs = f"{self.sides.columns} * {image.channels}"
            self._multiply(blocks, inputs, f"row[p * {image.channels} + i]", "part" if split else "sum")
            if split:
                self._pixels([words.add(f"sum[p][{j}]", f"part[p][{j}]") for j in each])
            self._close()

    def _multiply(self, blocks: Blocks, inputs: str, value: str, sums: str = "sum") -> None:
        """Write the loop over inputs: each one's row of a block of weights, times its value at each pixel."""
        each, words = range(blocks.vectors), self.words
        self._open(words.loop("i", inputs))
        for j in each:
            for line in words.walked(f"w{j}", "w", j):
                self._line(line)
        self._line(words.advance("w", blocks.vectors))
        products = [words.add_product(f"{sums}[p][{j}]", f"w{j}", "value") for j in each]
        self._pixels([words.single("value", value), *products])
        self._close()

    def _pixels(self, lines: list[str]) -> None:
        """Write a loop over pixels that keeps each pixel's sums in registers of their own."""
        if self.words.unroll:
            self._line(self.words.unroll)
        self._nest([self.words.loop("p", "PIXELS")], lines)

    def _outputs(self) -> None:
        """Write the only output of each pixel that lies in the image."""
        name, index = self.program.outputs[0]
        channels, words = self.program.nodes[index].type.shape[0], self.words
        held = self.tile.blocks(channels).total
        self._comment(f"output {name}")
        value = words.at(f"v{index}", f"p * {held} * LANES + i")
        line = words.store.format(channels=channels, i="i", value=value)
        loops = [words.loop_while("p", "PIXELS", "x + p < width"), words.loop("i", channels)]
        self._nest(loops, [line])

    def _fuses(self, index: int) -> bool:
        """Return whether this is a product that one sum reads: compilers fuse what one expression holds."""
        if self.program.nodes[index].op != "multiply" or len(self.readers[index]) != 1:
            return False
        (reader,) = self.readers[index]
        inside = self.group_of.get(reader) == self.group_of[index] and not self._is_array(index)
        return inside and self.program.nodes[reader].op in ("add", "subtract")

    # ---- values ------------------------------------------------------------------------------------------

    def _read(self, index: int, lane: str, group: int | None = None) -> str:
        """Return the text of element `lane` of a value, read inside `group`."""
        node = self.program.nodes[index]
        if node.op == "parameter":
            vectors = self.tile.blocks(node.type.shape[0]).total
            return self.words.parameter(self.slots[str(node["name"])].offset, lane, vectors)
        return super()._read(index, lane, group)

    def _element(self, index: int, lane: str) -> str:
        """Return the text of an element of the array of a value."""
        return self.words.element(f"v{index}", lane)

    def _vectors(self, numbers: int) -> str:
        """Return the text of the number of vectors of all pixels."""
        return f"PIXELS * {self.tile.blocks(numbers).total}"

    def _count(self, numbers: int) -> str:
        """Return the text of the number of elements of all pixels."""
        return self.words.elements(self._vectors(numbers))

    def _declaration(self, index: int) -> str:
        """Return the declaration of the array of a value."""
        return self.words.held(f"v{index}", self._vectors(self.program.nodes[index].type.shape[0]))
