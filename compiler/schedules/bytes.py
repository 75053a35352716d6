"""Schedules of integer networks: products of bytes, four at a time.

1. Inputs and hidden values are bytes, weights are bytes with a sign: one instruction of many processors
   multiplies four pairs and adds the products to a sum of 32 bits (expression `dot4`).
2. On processors [`Bytes`] the tile is that of tile.py. Values are n + 128, from 1 to 255, since the
   instruction takes one factor without a sign; a row of weights begins its sums at -128 times the sum of its
   weights: then they are those of n. A row of taps is filled up to fours with weights of 0.
3. On graphics processors [`GroupBytes`] the tile is that of group.py. Both factors have a sign. A word of the
   tile holds four channels of a pixel, counted over all images; a word of a hidden layer is a vector of four.

They hold programs in which nothing rounds [proof/whole.py] and whose values are of 8 bits. A slot of a matrix
counts four bytes as one number.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..core import weights
from ..core.ir import Image, Node, Program
from ..core.weights import Slot
from ..kernel import kernel as tree
from ..kernel.interface import WEIGHTS
from ..kernel.kernel import apply, const, load, name, splat
from ..proof import whole
from .common import kernel_gather, loop, weight
from .group import MOST_CHANNELS, Group
from .straight import VECTOR
from .tile import (
    COUNTER,
    DY,
    LANES,
    PATCH_WIDTH,
    PIXELS,
    Blocks,
    P,
    Tiled,
    blocks_of,
    matrices,
    readers_of_window,
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


def matrix_twice(program: Program) -> str:
    """Return a refusal where a matrix is applied twice."""
    names = [node["weight"] for node in program.nodes if node.op == "affine"]
    return "a matrix is applied twice" if len(set(names)) < len(names) else ""


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


def bytes_stored(program: Program, lanes: int, vectors: int) -> Mapping[str, NDArray[np.float32]]:
    """Return all weights as they are stored, bit by bit, and where each matrix' sums begin."""
    found: dict[str, NDArray[np.float32]] = {}
    for key, array in weights.weights(program).items():
        blocks = blocks_of(len(array), lanes, vectors)
        filled = np.zeros((blocks.total * lanes, *array.shape[1:]), np.float32)
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


class Bytes(Tiled):
    """Builds the tiled kernel of bytes."""

    def __init__(self, program: Program, slots: Mapping[str, Slot], **parameters: Any) -> None:
        super().__init__(program, slots, **parameters)
        self.sum_type = tree.INT.of(self.lanes)

    def weight_type(self) -> tree.Type:
        """Return the type of an element of the weights."""
        return self.sum_type

    def read(self, index: int) -> tree.Expr:
        """Return element `i` of another group's value; the weights are words, whose bits may be floats."""
        found = super().read(index)
        if found.value != WEIGHTS or not self.wide:
            return found
        return tree.Expr("bits", (weight(found.args[0], self.sum_type),), self.vector)

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
        return weight(self.offset(f"{node['weight']}{START}") // self.lanes + vector, self.sum_type)

    def ended(self, total: tree.Expr) -> tree.Expr:
        """Return a sum as a value of the layer."""
        return apply("convert", total, value="float32")

    def inputs(self, node: Node) -> int:
        """Return the rows of weights of an affine map: fours of inputs."""
        return sum(-(-len(run) // FOUR) for run in runs_of(self.program, str(node["weight"])))

    def layer(self, blocks: Blocks, first: tree.Expr, source: int, numbers: int) -> list[tree.Statement]:
        """Return the bytes of a layer's values, and their products."""
        count, held = PIXELS * self.total(source) * LANES, self.total(source)
        byte = self.copied(load(f"v{source}", COUNTER))
        copy = loop("i", count, tree.Store(f"bytes{source}", (COUNTER,), byte))
        place = P * held * LANES
        return [
            tree.Array(f"bytes{source}", tree.BYTE, (count,)),
            copy,
            self.of_fours(blocks, -(-numbers // FOUR), first, f"bytes{source}", place),
        ]

    def windowed(self, blocks: Blocks, first: tree.Expr) -> list[tree.Statement]:
        """Return the sums over the window, row by row of an image's taps."""
        found: list[tree.Statement] = []
        rows = 0
        for image in self.gather.images:
            count = -(-self.gather.columns * image.channels // FOUR)
            place = (DY * PATCH_WIDTH + P) * image.channels
            at = first + (DY * count + rows) * blocks.vectors
            found.append(
                loop("dy", self.rows, self.of_fours(blocks, count, at, f"patch_{image.name}", place))
            )
            rows += self.gather.rows * count
        return found

    def of_fours(
        self, blocks: Blocks, count: int, first: tree.Expr, array: str, place: tree.Expr
    ) -> tree.Statement:
        """Return the loop over fours of inputs: each one's weights, times the bytes at each pixel."""
        each = range(blocks.vectors)
        row = [tree.Let(f"w{j}", weight(first + COUNTER * blocks.vectors + j, self.sum_type)) for j in each]
        four = load(array, place + FOUR * COUNTER, kind=tree.BYTE.of(FOUR))
        adds = [
            tree.Store("sum", (P, const(j)), dot4(name(f"w{j}", self.sum_type), four), add=True) for j in each
        ]
        return loop("i", count, *row, self.each_pixel(*adds))


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


def words_stored(program: Program) -> Mapping[str, NDArray[np.float32]]:
    """Return all weights as they are stored; the bytes of a matrix are there bit by bit."""
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


def planes_of(program: Program) -> int:
    """Return the most words of a pixel that are in the tile at once."""
    return min(MOST_CHANNELS, -(-kernel_gather(program).channels // FOUR))


def words_at_once(program: Program) -> list[int]:
    """Return the rows of words of each affine map that are in straight code."""
    sources = [program.nodes[node.args[0]] for node in program.nodes if node.op == "affine"]
    return [planes_of(program) if s.op == "input" else -(-s.type.shape[0] // FOUR) for s in sources]


class GroupBytes(Group):
    """Builds the grouped kernel of bytes."""

    element = tree.INT
    weights = tree.INT.of(FOUR)

    def planes(self) -> int:
        """Return the most words of a pixel that are in the tile at once."""
        return planes_of(self.program)

    def parameter(self, node: Node, vector: int) -> tree.Expr:
        """Return four values of a parameter that is a vector."""
        return tree.Expr("bits", (weight(self.offset(node["name"]) // 4 + vector, self.weights),), VECTOR)

    def affine(self, index: int, node: Node) -> list[tree.Statement]:
        """Return v = W x for all pixels: sums of integers, which become floats at the end."""
        source, first = node.args[0], self.offset(node["weight"]) // 4
        zero = splat(const(0), FOUR)
        found: list[tree.Statement] = [self.mapped(index, node)]
        found += [
            tree.Array(f"s{index}_{p}_{j}", self.weights, value=zero, register=True)
            for p, j in self.places(index)
        ]
        if self.program.nodes[source].op == "input":
            found += self.of_window(index, first)
        else:
            for k in range(-(-self.program.nodes[source].type.shape[0] // FOUR)):
                names = [f"b{index}_{p}_{k}" for p in range(self.pixels)]
                for p, each in enumerate(names):
                    found.append(tree.Let(each, packed([self.at(source, p, k).lane(c) for c in range(FOUR)])))
                sums = self.names(f"s{index}", index)
                found += self.multiplied(
                    self.weights_row(index, const(first), k), sums, list(map(name, names))
                )
        for p, j in self.places(index):
            total = apply("convert", name(f"s{index}_{p}_{j}", self.weights), value="float32")
            found.append(tree.Array(self.variable(index, p, j), VECTOR, value=total))
        return found

    def of_window(self, index: int, first: int) -> list[tree.Statement]:
        """Return the products of all taps with the weights from vector `first` on."""
        values = [self.pixel(image, c) for image in self.gather.images for c in range(image.channels)]
        values += [const(0.0)] * (-len(values) % FOUR)
        words = [packed(values[i : i + FOUR]) for i in range(0, len(values), FOUR)]
        found: list[tree.Statement] = []
        for begin in range(0, len(words), MOST_CHANNELS):
            held = words[begin : begin + MOST_CHANNELS]
            found += self.staged(held)
            sums = self.names(f"s{index}", index)
            found.append(loop("dy", self.rows, self.row_of_taps(index, first, len(held), sums)))
            first += self.gather.rows * self.gather.columns * len(held) * self.vectors(index)
        return found

    def product(self, weight: tree.Expr, factor: tree.Expr, total: str) -> tree.Expr:
        """Return what a word of weights adds to a sum."""
        return dot4(weight, factor)


def packed(values: Sequence[tree.Expr]) -> tree.Expr:
    """Return four values as the bytes of a word, the first one the lowest."""
    return tree.Expr("pack4", tuple(values), tree.INT)
