"""The packed schedule: four weights per read; values are arrays of vectors of four.

The weights are stored as a row of neurons for each input, filled up to a multiple of four. The source is
short, so that it compiles at once however many weights there are (spec/webpage.md: in a browser without a
graphics processor).
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from ..core import weights
from ..core.ir import Image, Program
from ..kernel import kernel as tree
from ..kernel.kernel import apply, const, load, name, splat
from .common import X, Y, loop, weight
from .plain import J, Plainly
from .straight import VECTOR, ZERO

WEIGHTS_A_TEXEL = "weights_a_texel"
"""Key of a manifest's schedule: how many floats a texel of the weight texture has, if not one."""

COUNTER = name("i")
"""The loop variable of copies."""


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
    weights, zero = VECTOR, ZERO

    def array(self, index: int) -> tree.Array:
        """Return the declaration of a value's array."""
        return tree.Array(f"v{index}", VECTOR, (self.count(index),))

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
        """Return the vectors of four that hold a value."""
        return -(-self.program.nodes[index].type.shape[0] // 4)

    def of_layer(self, index: int, first: int, source: int) -> list[tree.Statement]:
        """Return the products of a layer's values."""
        whole, rest = divmod(self.program.nodes[source].type.shape[0], 4)
        v, found = f"v{index}", list[tree.Statement]()
        if whole:
            lines = self.products(index, v, first, COUNTER * 4, self.read(source, COUNTER), 4)
            found.append(loop("i", whole, lines))
        if rest:
            last = self.read(source, const(whole))
            found.append(self.products(index, v, first, const(4 * whole), last, rest))
        return found

    def channels(self, index: int, first: int, sums: str, image: Image, at: int) -> list[tree.Statement]:
        """Return the products of a tap's channels of an image."""
        value = self.texel(image)
        texel = name(image.name, value.type)
        added = self.products(index, sums, first, name("tap") + at, texel, image.channels)
        return [tree.Let(image.name, value), added]

    def products(
        self, index: int, sums: str, first: int, row: tree.Expr, value: tree.Expr, inputs: int
    ) -> tree.Statement:
        """Return the additions of rows of weights times each component of a value."""
        lines: list[tree.Statement] = []
        for c in range(inputs):
            factor = value.lane(c) if value.type.lanes > 1 else value
            own = weight(first + (row + c) * self.count(index) + J, VECTOR)
            lines.append(tree.Store(sums, (J,), apply("multiply", own, splat(factor, 4)), add=True))
        return self.each(index, *lines)
