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
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..core import weights
from ..core.ir import Node, Program
from ..core.weights import Slot
from ..languages.tiled_dialect import TiledDialect
from ..proof import whole
from .emit import kernel_gather
from .emit_tiled import Blocks, Tiled, TiledBody, readers_of_window

FOUR = 4
"""Products of a step."""

MIDDLE = 128
"""What is added to a number to make a byte."""

LARGEST = 127
"""Largest magnitude of a number that is a byte, and of a weight."""

START = "start"
"""How the slots end that hold where sums begin."""


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
        try:
            known = whole.known(program)
        except whole.Rounds as reason:
            return f"it is not of integers: {reason}"
        for node in program.nodes:
            if node.op != "affine":
                continue
            if node.get("bias") is not None or known[node.args[0]].largest > LARGEST:
                return "its numbers take more than 8 bits"
            if np.abs(program.parameters[str(node["weight"])]).max() > LARGEST:
                return "its weights take more than 8 bits"
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
