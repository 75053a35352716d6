"""The packed schedule: four weights per read; values are arrays of vectors of four.

The weights are stored as a row of neurons for each input, filled up to a multiple of four. The source is
short, so that it compiles at once however many weights there are (spec/webpage.md: in a browser without a
graphics processor).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..core import weights
from ..core.ir import Image, Node, Program
from ..core.sums import is_split
from ..kernel import kernel as tree
from ..kernel.kernel import apply, const, load, name, splat
from .common import X, Y, loop, weight
from .plain import Plainly
from .straight import VECTOR, ZERO

WEIGHTS_A_TEXEL = "weights_a_texel"
"""Key of a manifest's schedule: how many floats a texel of the weight texture has, if not one."""

COUNTER, J = name("i"), name("j")


def packed_weights(program: Program) -> Mapping[str, NDArray[np.float32]]:
    """Return all weights as they are stored, by name: inputs x neurons, neurons filled up to fours."""
    found = {}
    for key, array in weights.weights(program).items():
        missing = [(0, -len(array) % 4), *[(0, 0)] * (array.ndim - 1)]
        found[key] = np.ascontiguousarray(np.pad(array, missing).T)
    return found


class Packed(Plainly):
    """Builds the packed kernel: the plain one by vectors."""

    lanes = 4
    weights = VECTOR

    def vectors(self, index: int) -> int:
        """Return the vectors of four that hold a value."""
        return -(-self.program.nodes[index].type.shape[0] // 4)

    def array(self, index: int) -> tree.Array:
        """Return the declaration of a value's array."""
        return tree.Array(f"v{index}", VECTOR, (self.vectors(index),))

    def read(self, index: int, lane: tree.Expr | None = None) -> tree.Expr:
        """Return vector `lane` of a value."""
        node = self.program.nodes[index]
        assert lane is not None
        if node.op == "parameter":
            return weight(self.offset(node["name"]) // 4 + lane, VECTOR)
        return load(f"v{index}", lane, kind=VECTOR)

    def outputs(self) -> tree.Body:
        """Return the statements that write the output."""
        index = self.program.outputs[0][1]
        values = [
            self.read(index, const(i // 4)).lane(i % 4)
            for i in range(self.program.nodes[index].type.shape[0])
        ]
        return tree.Comment(f"output {self.program.outputs[0][0]}"), tree.Write(Y, X, tuple(values))

    def count(self, index: int) -> int:
        """Return the elements of a value's array."""
        return self.vectors(index)

    def affine(self, index: int, node: Node) -> list[tree.Statement]:
        """Return v = W x + b."""
        count, bias, source = self.vectors(index), node.get("bias"), self.program.nodes[node.args[0]]
        v, first = f"v{index}", self.offset(node["weight"]) // 4
        start = weight(self.offset(bias) // 4 + J, VECTOR) if bias else ZERO
        starts = loop("j", count, tree.Store(v, (J,), start))
        sums = replace(self.array(index), kept=source.op == "input")
        found: list[tree.Statement] = [self.mapped(index, node), sums, starts]
        if source.op == "input":
            return [*found, *self.of_window(index, count, first)]
        whole, rest = divmod(source.type.shape[0], 4)
        if whole:
            lines = self.products(
                v, first, COUNTER * 4, load(f"v{node.args[0]}", COUNTER, kind=VECTOR), 4, count
            )
            found.append(loop("i", whole, lines))
        if rest:
            last = load(f"v{node.args[0]}", const(whole), kind=VECTOR)
            found.append(self.products(v, first, const(4 * whole), last, rest, count))
        return found

    def of_window(self, index: int, count: int, first: int) -> list[tree.Statement]:
        """Return the products of all taps: a partial sum for each row of taps of an image."""
        split, v, part = is_split(self.gather), f"v{index}", f"part{index}"
        zero = (loop("j", count, tree.Store(part, (J,), ZERO)),) if split else ()
        add = (loop("j", count, tree.Store(v, (J,), load(part, J, kind=VECTOR), add=True)),) if split else ()
        found: list[tree.Statement] = [tree.Array(part, VECTOR, (count,), kept=True)] if split else []
        tap = (name("dy") * self.columns + name("dx")) * self.gather.channels
        for group in self.gather.groups:
            inner = [
                line
                for image, at in group
                for line in self.channels(image, at, part if split else v, first, count)
            ]
            row = loop("dx", self.columns, *self.tap_column(), tree.Let("tap", tap), *inner)
            found.append(loop("dy", self.rows, self.tap_row(), *zero, row, *add))
        return found

    def channels(self, image: Image, at: int, sums: str, first: int, count: int) -> list[tree.Statement]:
        """Return the products of a tap's channels of an image."""
        value = self.texel(image)
        texel = name(image.name, value.type)
        return [
            tree.Let(image.name, value),
            self.products(sums, first, name("tap") + at, texel, image.channels, count),
        ]

    def products(
        self, sums: str, first: int, row: tree.Expr, value: tree.Expr, inputs: int, count: int
    ) -> tree.Statement:
        """Return the additions of rows of weights times each component of a value."""
        lines: list[tree.Statement] = []
        for c in range(inputs):
            factor = value.lane(c) if value.type.lanes > 1 else value
            product = apply("multiply", weight(first + (row + c) * count + J, VECTOR), splat(factor, 4))
            lines.append(tree.Store(sums, (J,), product, add=True))
        return loop("j", count, *lines)
