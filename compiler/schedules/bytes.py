"""Schedules of integer networks: products of bytes, four at a time.

1. Inputs and hidden values are bytes, weights are bytes with a sign: one instruction of many processors
   multiplies four pairs and adds the products to a sum of 32 bits (expression `dot4`).
2. On processors [`Dot`] the tile is that of tile.py. Values are n + 128, from 1 to 255, since the
   instruction takes one factor without a sign; a row of weights begins its sums at -128 times the sum of its
   weights: then they are those of n. A row of taps is filled up to fours with weights of 0.
3. On graphics processors [`GroupDot`] the tile is that of group.py. Both factors have a sign. A word of the
   tile holds four channels of a pixel, counted over all images; a word of a hidden layer is a vector of four.

They hold programs in which nothing rounds [proof/whole.py] and whose values are of 8 bits. A slot of a matrix
counts four bytes as one number.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from ..core import weights
from ..core.ir import Image, Node, Program
from ..core.weights import Slot
from ..kernel import kernel as tree
from ..kernel.interface import WEIGHTS
from ..kernel.kernel import apply, const, load, name, splat
from ..proof import whole
from .common import kernel_gather, loop, readers_of_window, weight
from .group import MOST_CHANNELS, Grouped
from .straight import VECTOR
from .tile import (
    COUNTER,
    LANES,
    PATCH_WIDTH,
    PIXELS,
    Blocks,
    P,
    Tile,
    blocks_of,
    matrices,
    stored,
)

FOUR = 4
"""Products of a step."""

MIDDLE = 128
"""What is added to a value to make a byte without a sign."""

LARGEST = 127
"""Largest magnitude of a value that is a byte, and of a weight."""

START = "start"
"""How the slots end that hold where sums begin."""


def refused_by_bytes(program: Program) -> str:
    """Return why the values and weights of a program are not all integers in [-127, 127], or nothing."""
    try:
        known = whole.known(program)
    except whole.Rounds as reason:
        return f"it is not of integers: {reason}"
    for node in program.nodes:
        if node.op != "affine":
            continue
        low, high, grain = known[node.args[0]]
        matrix = program.parameters[str(node["weight"])]
        if node.get("bias") is not None or max(-low.min(), high.max()) > LARGEST:
            return "its numbers take more than 8 bits"
        if np.abs(matrix).max() > LARGEST:
            return "its weights take more than 8 bits"
        # What does not round may be a multiple of a fraction.
        if grain < 0 or (matrix != np.floor(matrix)).any():
            return "its numbers or weights are fractions"
    return ""


def dot4(weights: tree.Expr, four: tree.Expr) -> tree.Expr:
    """Return the four products of bytes in each lane of words of weights, added up."""
    return tree.Expr("dot4", (weights, four), weights.type)


# ---- processors ------------------------------------------------------------------------------------------


def runs_of(program: Program, parameter: str) -> list[list[int]]:
    """Return the inputs of a matrix in the runs that are filled up to fours, by their numbers."""
    gather = kernel_gather(program)
    if parameter not in matrices(readers_of_window(program)):
        return [list(range(program.parameters[parameter].shape[1]))]
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


class Dot(Tile):
    """A tile whose products are of bytes."""

    order = (
        "matrices block by block of neurons: blocks x fours of inputs x neurons x 4 bytes with a sign; "
        "inputs that are the window go image by image, then row of taps by row, each filled up to fours; "
        f"{START}: where a matrix' sums begin, integers of 32 bits"
    )
    bytewise = True
    instead = "tile:16"

    def begin(self, program: Program, slots: Mapping[str, Slot]) -> None:
        """Take a program, whose weights are in these slots."""
        super().begin(program, slots)
        self.weights, self.part = tree.INT.of(self.lanes), ""

    def read(self, index: int) -> tree.Expr:
        """Return element `i` of another group's value; the weights are words, whose bits may be floats."""
        found = super().read(index)
        if found.value != WEIGHTS or not self.wide:
            return found
        return tree.Expr("bits", (weight(found.args[0], self.weights),), self.vector)

    def patch(self, image: Image, size: tree.Expr) -> tree.Array:
        """Return the declaration of an image's patch; a last step may read three bytes beyond."""
        return tree.Array(f"patch_{image.name}", tree.BYTE, (size + (FOUR - 1),))

    def patches(self) -> list[tree.Statement]:
        """Return the copies of the images; what may be read beyond them is 0."""
        found = super().patches()
        for image in self.gather.images:
            end = self.rows * PATCH_WIDTH * image.channels
            found.append(
                loop("i", FOUR - 1, tree.Store(f"patch_{image.name}", (end + COUNTER,), const(0, tree.BYTE)))
            )
        return found

    def copied(self, value: tree.Expr) -> tree.Expr:
        """Return a value of an image as a byte n + 128."""
        return apply("convert", apply("convert", value, value="int32") + MIDDLE, value="uint8")

    def start(self, node: Node, vector: tree.Expr) -> tree.Expr:
        """Return what a sum starts with."""
        return weight(self.offset(f"{node['weight']}{START}") // self.lanes + vector, self.weights)

    def ended(self, total: tree.Expr) -> tree.Expr:
        """Return a sum as a value of the layer."""
        return apply("convert", total, value="float32")

    def inputs(self, node: Node) -> int:
        """Return the rows of weights of an affine map: fours of inputs."""
        return sum(-(-len(run) // FOUR) for run in runs_of(self.program, str(node["weight"])))

    def layer(self, blocks: Blocks, first: tree.Expr, source: int, count: int) -> list[tree.Statement]:
        """Return the bytes of a layer's values, and their products."""
        size, array = PIXELS * self.total(source) * LANES, f"bytes{source}"
        byte = self.copied(load(f"v{source}", COUNTER))
        place = P * self.total(source) * LANES
        return [
            tree.Array(array, tree.BYTE, (size,)),
            loop("i", size, tree.Store(array, (COUNTER,), byte)),
            self.multiplied(blocks, const(-(-count // FOUR)), first, "sum", array, place),
        ]

    def steps(self, channels: int) -> tuple[int, tree.Expr]:
        """Return the fours of a row of an image's taps."""
        count = -(-self.gather.columns * channels // FOUR)
        return count, const(count)

    def factor(self, array: str, place: tree.Expr) -> tuple[list[tree.Let], tree.Expr]:
        """Return the four bytes of step `i` at a pixel."""
        return [], load(array, place + FOUR * COUNTER, kind=tree.BYTE.of(FOUR))

    def product(self, weights: tree.Expr, factor: tree.Expr) -> tree.Expr:
        """Return what words of weights add to a sum."""
        return dot4(weights, factor)

    def refusal(self, program: Program) -> str:
        """Return why this schedule cannot hold the program, or nothing."""
        names = [node["weight"] for node in program.nodes if node.op == "affine"]
        twice = "a matrix is applied twice" if len(set(names)) < len(names) else ""
        return refused_by_bytes(program) or twice or super().refusal(program)

    def stored(self, program: Program) -> Mapping[str, NDArray[np.float32]]:
        """Return all weights as they are stored, by name."""
        found: dict[str, NDArray[np.float32]] = {}
        for key, array in weights.weights(program).items():
            blocks = blocks_of(len(array), self.lanes, self.vectors)
            filled = np.zeros((blocks.total * self.lanes, *array.shape[1:]), np.float32)
            filled[: len(array)] = array
            if array.ndim != 2:
                found[key] = filled
                continue
            runs = [np.pad(filled[:, run], [(0, 0), (0, -len(run) % FOUR)]) for run in runs_of(program, key)]
            fours = np.concatenate(runs, axis=1).reshape(len(filled), -1, FOUR).astype(np.int8)
            ordered = fours.reshape(blocks.count, -1, fours.shape[1], FOUR).transpose(0, 2, 1, 3)
            found[key] = np.ascontiguousarray(ordered).view("<f4")[..., 0]
            found[key + START] = (-MIDDLE * filled.astype(np.int64).sum(axis=1)).astype("<i4").view("<f4")
        return found


# ---- graphics processors ---------------------------------------------------------------------------------


def words_of(program: Program, parameter: str) -> NDArray[np.intp]:
    """Return the inputs (words, 4) of a matrix, of which its words have bytes; -1 fills a word up."""
    gather, (_, inputs) = kernel_gather(program), program.parameters[parameter].shape
    windowed = parameter in matrices(readers_of_window(program))
    count = np.arange(gather.channels if windowed else inputs)
    words = np.pad(count, (0, -len(count) % FOUR), constant_values=-1).reshape(-1, FOUR)
    if not windowed:
        return words
    taps = gather.channels * np.arange(gather.rows * gather.columns)[:, None, None]
    chunks = [words[first : first + MOST_CHANNELS] for first in range(0, len(words), MOST_CHANNELS)]
    return np.concatenate([np.where(held < 0, -1, held + taps).reshape(-1, FOUR) for held in chunks])


class GroupDot(Grouped):
    """A tile of words for each group of items."""

    order = (
        "vectors filled up to multiples of 4 with zeros; matrices words x neurons, a word being four inputs "
        "as bytes with a sign, the first one the lowest; of a matrix that reads the window the channels of "
        f"all images make words that are filled up with zeros, at most {MOST_CHANNELS} of them at a time tap "
        "by tap in rows, then word by word"
    )
    bytewise = True
    instead = "group:4"
    element = tree.INT
    weights = tree.INT.of(FOUR)
    part = ""

    def tiles(self) -> list[list[tree.Expr]]:
        """Return the words of a pixel that are in the tile at once, one tile after another."""
        values = [value for tile in super().tiles() for value in tile]
        values += [const(0.0)] * (-len(values) % FOUR)
        words = [packed(values[i : i + FOUR]) for i in range(0, len(values), FOUR)]
        return [words[begin : begin + MOST_CHANNELS] for begin in range(0, len(words), MOST_CHANNELS)]

    def affine(self, index: int, node: Node) -> list[tree.Statement]:
        """Return v = W x for all pixels: sums of integers, which become floats at the end."""
        found: list[tree.Statement] = [self.mapped(index, node)]
        names = [(self.variable(self.total(index), p, j), p, j) for p, j in self.places(index)]
        zero = splat(const(0), FOUR)
        found += [tree.Array(each, self.weights, value=zero, register=True) for each, _, _ in names]
        found += self.additions(index, node)
        for each, p, j in names:
            value = apply("convert", name(each, self.weights), value="float32")
            found.append(tree.Array(self.variable(f"v{index}", p, j), VECTOR, value=value))
        return found

    def total(self, index: int) -> str:
        """Return what the sums of a layer are called."""
        return f"s{index}"

    def inputs(self, index: int, source: int) -> Iterator[tuple[list[tree.Let], list[tree.Expr]]]:
        """Yield the words of a layer's values, at each pixel, and what makes them."""
        for k in range(self.vectors(source)):
            names = [f"b{index}_{p}_{k}" for p in range(self.pixels)]
            fours = [packed([self.at(source, p, k).lane(c) for c in range(FOUR)]) for p in range(self.pixels)]
            yield list(map(tree.Let, names, fours)), list(map(name, names))

    def product(self, weight: tree.Expr, factor: tree.Expr) -> tree.Expr:
        """Return what a word of weights adds to a sum."""
        return dot4(weight, factor)

    def refusal(self, program: Program) -> str:
        """Return why this schedule cannot hold the program, or nothing."""
        return refused_by_bytes(program) or super().refusal(program)

    def beyond_tile(self, program: Program) -> str:
        """Return nothing: the words of all channels are in tiles, some after others."""
        return ""

    def at_once(self, program: Program, inputs: int | None) -> int:
        """Return the rows of words that are in straight code: for so many inputs, or of a tap."""
        if inputs is None:
            return min(MOST_CHANNELS, -(-kernel_gather(program).channels // FOUR))
        return -(-inputs // FOUR)

    def stored(self, program: Program) -> Mapping[str, NDArray[np.float32]]:
        """Return all weights as they are stored, by name."""
        found: dict[str, NDArray[np.float32]] = {}
        for key, array in weights.weights(program).items():
            if array.ndim != 2:
                found[key] = stored(program, key, FOUR, len(array))
                continue
            filled = np.zeros((-(-len(array) // FOUR) * FOUR, array.shape[1] + 1), np.int8)
            filled[: len(array), :-1] = array  # the last column, which -1 means, is of zeros
            words = filled[:, words_of(program, key)].transpose(1, 0, 2)
            found[key] = np.ascontiguousarray(words).view("<f4")[None, ..., 0]
        return found


def packed(values: Sequence[tree.Expr]) -> tree.Expr:
    """Return four values as the bytes of a word, the first one the lowest."""
    return tree.Expr("pack4", tuple(values), tree.INT)
