"""The dot schedule: tiles of a network of integers whose products are of bytes, four at a time.

1. Inputs and hidden values are bytes n + 128, from 1 to 255; weights are bytes with a sign. Processors
   multiply four such pairs and add them to a sum of 32 bits in one instruction.
2. A row of weights begins its sums at -128 times the sum of its weights: then they are those of n.
3. The tile is that of emit_tiled.py: all pixels' sums of a block of neurons stay in registers while the
   inputs pass by, four bytes a step. A row of taps whose length is not a multiple of four is filled up with
   weights of 0; what is read beyond it does not count.
4. Elementwise operations are those of tiles; their results become bytes before the next layer.

It holds programs in which nothing rounds [proof/whole.py] and whose numbers are of 8 bits. A slot of a matrix
counts four bytes as one number; weights are in the order of emit_tiled.py, with four inputs for each.

For graphics processors, whose instructions multiply bytes that both have a sign, the tile is that of
emit_group.py [`GroupDot`]: a word of it holds four channels of a pixel, counted over all images, and a word
of a hidden layer is a vector of four numbers. Sums begin at 0.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..core import weights
from ..core.ir import Gather, Node, Program
from ..core.weights import Slot
from ..languages.tiled_dialect import TiledDialect
from ..proof import whole
from .emit import kernel_gather
from .emit_group import MOST_CHANNELS, GroupBody, GroupDialect, Grouped
from .emit_tiled import Blocks, Tiled, TiledBody, readers_of_window

FOUR = 4
"""Products of a step."""

MIDDLE = 128
"""What is added to a number to make a byte."""

LARGEST = 127
"""Largest magnitude of a number that is a byte, and of a weight."""

START = "start"
"""How the slots end that hold where sums begin."""


def refused_by_bytes(program: Program) -> str:
    """Return why the numbers and weights of a program are not all integers in [-127, 127], or nothing."""
    try:
        known = whole.known(program)
    except whole.Rounds as reason:
        return f"it is not of integers: {reason}"
    for node in program.nodes:
        if node.op != "affine":
            continue
        read, matrix = known[node.args[0]], program.parameters[str(node["weight"])]
        if node.get("bias") is not None or read.largest > LARGEST:
            return "its numbers take more than 8 bits"
        if np.abs(matrix).max() > LARGEST:
            return "its weights take more than 8 bits"
        # What does not round may be a multiple of a fraction.
        if read.grain < 0 or (matrix != np.floor(matrix)).any():
            return "its numbers or weights are fractions"
    return ""


class DotDialect(TiledDialect):
    """The words of one language for bytes."""

    @abstractmethod
    def bytes(self, name: str, count: str) -> str:
        """Return the declaration of an array of bytes."""

    @abstractmethod
    def byte_row(self, name: str, place: str, written: bool = False) -> str:
        """Return the declaration of a row that begins at a place of an array of bytes."""

    @abstractmethod
    def to_byte(self, value: str) -> str:
        """Return the text of a float as a byte n + 128."""

    @abstractmethod
    def start_sum(self, total: str, offset: int, index: str) -> str:
        """Return the statement that gives a sum vector `index` of the integers from `offset` on."""

    @abstractmethod
    def add_dot(self, total: str, weight: str, place: str) -> str:
        """Return the statement that adds four products a lane: of weights, and of the bytes at a place."""

    @abstractmethod
    def hold_sum(self, name: str, index: str, total: str) -> str:
        """Return the statement that puts a sum into an array of floats, as vector `index`."""


class Dot(Tiled):
    """A tile of `pixels` x `vectors` vectors of `lanes` sums of bytes."""

    order = (
        "matrices block by block of neurons: blocks x fours of inputs x neurons x 4 bytes with a sign; "
        "inputs that are the window go image by image, then row of taps by row, each filled up to fours; "
        f"{START}: where a matrix' sums begin, integers of 32 bits"
    )

    bytewise = True

    def __init__(self, name: str, idea: str, dialect: DotDialect, lanes: int, pixels: int) -> None:
        super().__init__(name, idea, dialect, lanes, pixels, vectors=2)
        self.instead = f"tile{lanes}"

    def refusal(self, program: Program) -> str:
        """Return why this schedule cannot hold the program, or nothing."""
        if reason := refused_by_bytes(program):
            return reason
        names = [node["weight"] for node in program.nodes if node.op == "affine"]
        if len(set(names)) < len(names):
            return "a matrix is applied twice"
        return super().refusal(program)

    def private_bytes(self, program: Program) -> int:
        """Return the bytes of the patches and of the arrays of a work item."""
        gather, body = kernel_gather(program), self._body(program)
        patch = gather.rows * (gather.columns + self.pixels - 1) * gather.channels
        shapes = [program.nodes[index].type.shape for index in body.group_of if body.declares(index)]
        numbers = sum(self.blocks(shape[0]).total * self.lanes * self.pixels for shape in shapes)
        return patch + 5 * numbers

    def rows_of(self, program: Program, name: str) -> list[list[int]]:
        """Return the inputs of a matrix in the runs that are filled up to fours, by their numbers."""
        gather = kernel_gather(program)
        if name not in {str(node["weight"]) for node in readers_of_window(program)}:
            return [list(range(program.parameters[name].shape[1]))]
        starts = np.cumsum([0, *(image.channels for image in gather.images)]).tolist()
        return [
            [
                (dy * gather.columns + dx) * gather.channels + start + c
                for dx in range(gather.columns)
                for c in range(image.channels)
            ]
            for image, start in zip(gather.images, starts, strict=False)
            for dy in range(gather.rows)
        ]

    def layout(self, program: Program) -> Mapping[str, Slot]:
        """Return the slot of each weight, and of where each matrix' sums begin."""
        slots: dict[str, Slot] = {}
        offset = 0
        for name, array in weights.weights(program).items():
            for key, shape in self._shapes(program, name, array.shape).items():
                slots[key] = Slot(key, shape, offset)
                offset += int(np.prod(shape))
        return slots

    def _shapes(self, program: Program, name: str, shape: tuple[int, ...]) -> dict[str, tuple[int, ...]]:
        """Return the shapes of what is stored of a parameter."""
        blocks = self.blocks(shape[0])
        if len(shape) != 2:
            return {name: (blocks.total * self.lanes,)}
        fours = sum(-(-len(run) // FOUR) for run in self.rows_of(program, name))
        return {
            name: (blocks.count, fours, blocks.vectors * self.lanes),
            name + START: (blocks.total * self.lanes,),
        }

    def pack(self, program: Program) -> NDArray[np.float32]:
        """Return the weights (count,) as `layout` places them; bytes and integers are there bit by bit."""
        pieces = []
        for name, array in weights.weights(program).items():
            width = self.blocks(array.shape[0]).total * self.lanes
            filled = np.zeros((width, *array.shape[1:]), np.float32)
            filled[: len(array)] = array
            if array.ndim == 2:
                pieces += self._packed_matrix(program, name, filled)
            else:
                pieces.append(filled)
        return np.concatenate([np.zeros(0, np.float32), *pieces])

    def _packed_matrix(
        self, program: Program, name: str, matrix: NDArray[np.float32]
    ) -> list[NDArray[np.float32]]:
        """Return the bytes of a matrix (neurons, D_in) and where its sums begin, both as floats' bits."""
        found = self.rows_of(program, name)
        runs = [np.pad(matrix[:, run], [(0, 0), (0, -len(run) % FOUR)]) for run in found]
        fours = np.concatenate(runs, axis=1).reshape(len(matrix), -1, FOUR).astype(np.int8)
        blocks = self.blocks(len(matrix))
        ordered = fours.reshape(blocks.count, -1, fours.shape[1], FOUR).transpose(0, 2, 1, 3)
        start = (-MIDDLE * matrix.astype(np.int64).sum(axis=1)).astype("<i4")
        return [np.ascontiguousarray(ordered).ravel().view("<f4"), start.view("<f4")]

    def _body(self, program: Program) -> DotBody:
        """Return the writer of the kernel's statements."""
        return DotBody(program, self.dialect, kernel_gather(program), tile=self)


@dataclass
class DotBody(TiledBody):
    """The statements of a kernel of dots."""

    def __post_init__(self) -> None:
        super().__post_init__()
        assert isinstance(self.dialect, DotDialect), f"{self.dialect.language} has no words for bytes"
        self.dots = self.dialect

    def _prepare(self) -> None:
        """Write the patches; the last step of one may read up to three bytes beyond, which are 0."""
        super()._prepare()
        for image in self.gather.images:
            end = f"patch_{image.name}[{self._patch_size(image.channels)} + i]"
            self._nest([self.words.loop("i", FOUR - 1)], [f"{end} = 0;"])

    def _patch_size(self, channels: int) -> str:
        """Return the bytes of a patch."""
        return f"{self.sides.rows} * PATCH_WIDTH * {channels}"

    def _patch(self, name: str, channels: int) -> str:
        """Return the declaration of an image's patch."""
        return self.dots.bytes(f"patch_{name}", f"{self._patch_size(channels)} + {FOUR - 1}")

    def _patch_row(self, name: str, place: str, written: bool = False) -> str:
        """Return the declaration of a row of a patch."""
        return self.dots.byte_row(name, place, written)

    def _put(self, place: str, value: str) -> list[str]:
        """Return the lines that copy one number of an image."""
        return [f"{place} = {self.dots.to_byte(value)};"]

    def _ready(self, index: int, numbers: int) -> None:
        """Write the bytes of a layer's values."""
        count = f"{self._vectors(numbers)} * LANES"
        self._line(self.dots.bytes(f"bytes{index}", count))
        value = self.dots.to_byte(self.words.at(f"v{index}", "i"))
        self._nest([self.words.loop("i", count)], [f"bytes{index}[i] = {value};"])

    def _start(self, total: str, node: Node, index: str) -> str:
        """Return the statement that starts a sum."""
        return self.dots.start_sum(total, self.slots[f"{node['weight']}{START}"].offset, index)

    def _layer(self, blocks: Blocks, index: int, numbers: int, first: str) -> None:
        """Write the products of a layer's bytes, a pixel's from `first` on."""
        self._dots(blocks, -(-numbers // FOUR), f"bytes{index} + {first}")

    def _hold(self, name: str, index: str, total: str) -> str:
        """Return the statement that puts a sum into an array of floats, as vector `index`."""
        return self.dots.hold_sum(name, index, total)

    def _windowed(self, blocks: Blocks) -> None:
        """Write the sums over the window, row by row of an image's taps."""
        for image in self.gather.images:
            self._open(self.words.loop("dy", self.sides.rows))
            self._line(self._patch_row("row", f"patch_{image.name} + dy * PATCH_WIDTH * {image.channels}"))
            count = -(-self.gather.columns * image.channels // FOUR)
            self._dots(blocks, count, f"row + p * {image.channels}")
            self._close()

    def _dots(self, blocks: Blocks, count: int, place: str) -> None:
        """Write the loop over fours of inputs: each one's weights, times the bytes at each pixel."""
        each, words = range(blocks.vectors), self.dots
        self._open(words.loop("i", count))
        for j in each:
            for line in words.walked(f"w{j}", "w", j):
                self._line(line)
        self._line(words.advance("w", blocks.vectors))
        self._pixels([words.add_dot(f"sum[p][{j}]", f"w{j}", f"{place} + {FOUR} * i") for j in each])
        self._close()


# ---- graphics processors ----------------------------------------------------------------------------------


class GroupDotDialect(GroupDialect):
    """What a language adds for bytes that a group shares; it comes before the language's grouped dialect.

    `by` says what multiplies; `whole_kind` is the type of four integers, `whole_zero` its zeros. Kernels call
    functions that the dialect's text must have: `wamnet_packed` makes four floats the bytes of a word, the
    first one the lowest; `wamnet_dots(sums, weights, word)` adds to each of four sums the products of one
    word of weights with a word; `wamnet_floats` makes sums floats; `wamnet_numbers` reads four words of
    weights as floats.
    """

    by: str
    whole_kind: str
    whole_zero: str

    def four(self, name: str, value: str) -> str:
        """Return the declaration of four integers that may be added to."""
        return f"{self.whole_kind} {name} = {value};"


class GroupDot(Grouped):
    """A tile of words for each group of items, `pixels` of a row for each item."""

    order = (
        "vectors filled up to multiples of 4 with zeros; matrices words x neurons, a word being four inputs "
        "as bytes with a sign, the first one the lowest; of a matrix that reads the window the channels of "
        f"all images make words that are filled up with zeros, at most {MOST_CHANNELS} of them at a time tap "
        "by tap in rows, then word by word"
    )

    bytewise = True

    def refusal(self, program: Program) -> str:
        """Return why this schedule cannot hold the program, or nothing."""
        return refused_by_bytes(program) or super().refusal(program)

    def planes(self, gather: Gather) -> int:
        """Return the most words of a pixel that are in the tile at once."""
        return min(MOST_CHANNELS, -(-gather.channels // FOUR))

    def inputs_of(self, program: Program, name: str) -> NDArray[np.intp]:
        """Return the inputs (words, 4) of a matrix, of which its words have bytes; -1 fills a word up."""
        gather, (_, inputs) = kernel_gather(program), program.parameters[name].shape
        windowed = name in {str(node["weight"]) for node in readers_of_window(program)}
        numbers = np.arange(gather.channels if windowed else inputs)
        words = np.pad(numbers, (0, -len(numbers) % FOUR), constant_values=-1).reshape(-1, FOUR)
        if not windowed:
            return words
        taps = gather.channels * np.arange(gather.rows * gather.columns)[:, None, None]
        chunks = [words[first : first + MOST_CHANNELS] for first in range(0, len(words), MOST_CHANNELS)]
        return np.concatenate([np.where(held < 0, -1, held + taps).reshape(-1, FOUR) for held in chunks])

    def _beyond_tile(self, gather: Gather) -> str:
        """Return nothing: words are of all images, and sums of integers have no order to keep."""
        return ""

    def _rows_at_once(self, program: Program, source: Node) -> int:
        """Return the rows of words in straight code, of a map that reads the window or a layer."""
        if source.op == "input":
            return self.planes(kernel_gather(program))
        return -(-source.type.shape[0] // FOUR)

    def _shape(self, program: Program, name: str, shape: tuple[int, ...]) -> tuple[int, ...]:
        """Return the shape of a stored parameter of a given shape."""
        found = super()._shape(program, name, shape)
        return found if len(shape) != 2 else (1, len(self.inputs_of(program, name)), found[-1])

    def _stored(self, program: Program, name: str, shape: tuple[int, ...]) -> NDArray[np.float32]:
        """Return a parameter in its stored shape; the bytes of a matrix are there bit by bit."""
        matrix = program.parameters[name]
        if matrix.ndim != 2:
            return super()._stored(program, name, shape)
        # The last column, which -1 means, is of zeros.
        filled = np.zeros((shape[-1], matrix.shape[1] + 1), np.int8)
        filled[: len(matrix), :-1] = matrix
        words = filled[:, self.inputs_of(program, name)].transpose(1, 0, 2)
        return np.ascontiguousarray(words).view("<f4").reshape(shape)

    def _body(self, program: Program) -> GroupDotBody:
        """Return the writer of the kernel's statements."""
        return GroupDotBody(program, self.dialect, kernel_gather(program), grouped=self)


def dots(dialect: GroupDotDialect, width: int = 16) -> tuple[GroupDot]:
    """Return the schedule for graphics processors in a language, of groups of `width` x 8 items.

    It has not been measured on one.
    """
    idea = f"group4 with products of bytes, four at a time, of a network of integers: {dialect.by}"
    return (GroupDot("groupdot", idea, dialect, 4, (width, 8), "group4"),)


@dataclass
class GroupDotBody(GroupBody):
    """The statements of a grouped kernel of dots."""

    def __post_init__(self) -> None:
        super().__post_init__()
        assert isinstance(self.words, GroupDotDialect), f"{self.dialect.language} has no words for bytes"
        self.dots = self.words

    def _numbers_at(self, name: str, vector: int) -> str:
        """Return the text of four numbers of a parameter that is a vector."""
        return f"wamnet_numbers({super()._numbers_at(name, vector)})"

    def _affine(self, index: int, node: Node) -> None:
        """Write v = W x for all pixels: sums of integers, which become floats at the end."""
        name, source = str(node["weight"]), node.args[0]
        n_out, n_in = self.program.parameters[name].shape
        self._comment(f"%{index}: affine map {name} from {n_in} to {n_out}")
        sums, first = f"s{index}", self.slots[name].offset // 4
        for p, j in self._places(index):
            self._line(self.dots.four(f"{sums}_{p}_{j}", self.dots.whole_zero))
        if self.program.nodes[source].op == "input":
            self._of_window(index, first)
        else:
            for k in range(-(-n_in // FOUR)):
                values = [f"b{index}_{p}_{k}" for p in range(self.grouped.pixels)]
                for p, value in enumerate(values):
                    parts = [f"{self._at(source, p, k)}.{part}" for part in "xyzw"]
                    self._line(self.dialect.index(value, _packed(parts)))
                self._multiply_by(index, str(first + k * self.vectors(index)), values, sums)
        for p, j in self._places(index):
            self._line(self.words.vector(f"v{index}_{p}_{j}", f"wamnet_floats({sums}_{p}_{j})"))

    def _of_window(self, index: int, first: int) -> None:
        """Write the products of all taps with the weights from vector `first` on."""
        numbers = [self._pixel_at(image, c) for image in self.gather.images for c in range(image.channels)]
        numbers += ["0.0f"] * (-len(numbers) % FOUR)
        words = [_packed(numbers[i : i + FOUR]) for i in range(0, len(numbers), FOUR)]
        for begin in range(0, len(words), MOST_CHANNELS):
            held = words[begin : begin + MOST_CHANNELS]
            self._load(held)
            self._products_of_taps(index, first, len(held))
            first += self.gather.rows * self.gather.columns * len(held) * self.vectors(index)

    def _products_of_taps(self, index: int, first: int, channels: int) -> None:
        """Write the products of the tile's words with the weights from vector `first` on."""
        self._open(self.dialect.loop("dy", self.sides.rows))
        self._row_of_taps(index, first, channels, f"s{index}")
        self._close()

    def _from_tile(self, name: str, value: str) -> str:
        """Return the declaration of what a tile holds at a place."""
        return self.dialect.index(name, value)

    def _multiply_by(self, index: int, first: str, values: Sequence[str], name: str) -> None:
        """Write the additions of a row of words' products with each pixel's word, each read once."""
        for j in range(self.vectors(index)):
            totals = [(f"{name}_{p}_{j}", value) for p, value in enumerate(values)]
            sums = " ".join(f"{total} = wamnet_dots({total}, m, {value});" for total, value in totals)
            self._line(f"{{ {self.dots.four('m', f'w[{first} + {j}]')} {sums} }}")


def _packed(numbers: Sequence[str]) -> str:
    """Return the text of four numbers as the bytes of a word."""
    return f"wamnet_packed({', '.join(numbers)})"
