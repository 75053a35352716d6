"""The inlined schedule: straight code of one pixel, weights are constants of the source.

For a renderer on a processor (Mesa's llvmpipe) a constant is an operand, while every other read of a weight
is a chain of checks and gathers: measured, a weight in a texture costs 23 times as much, one in a uniform
block 5 times. The price is paid once, when the driver compiles, in proportion to the number of weights.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..core.ir import Image, Node
from ..core.sums import is_split
from ..kernel import kernel as tree
from ..kernel.kernel import apply, const, name, splat, stack
from .common import HEIGHT, WIDTH, X, Y, clamp
from .straight import VECTOR, ZERO, Straight, variables

LARGEST_WEIGHTS = 2**16
"""Most weights of a kernel: llvmpipe compiles some two thousand a second."""


def numbers(array: NDArray[np.float32], vector: int) -> tree.Expr:
    """Return four values of a vector (n,) from 4 * vector on, 0 behind the end, as a constant."""
    held = array[4 * vector : 4 * vector + 4].tolist()
    return stack([const(float(value)) for value in held + [0.0] * (4 - len(held))])


class Inlined(Straight):
    """Builds the inlined kernel."""

    def built(self) -> tree.Kernel:
        """Return the kernel."""
        constants = self.window()
        body = [*self.all_groups(), self.output_comment(), self.written(Y, X, 0)]
        return self.kernel(body, constants, functions=tuple(self.functions()))

    def parameter(self, node: Node, vector: int) -> tree.Expr:
        """Return four values of a parameter that is a vector."""
        return numbers(self.program.parameters[str(node["name"])], vector)

    # ---- affine maps -------------------------------------------------------------------------------------

    def affine(self, index: int, node: Node) -> list[tree.Statement]:
        """Return v = W x + b, one constant column of weights times one input after another."""
        matrix, bias = self.program.parameters[str(node["weight"])], node.get("bias")
        found: list[tree.Statement] = [self.mapped(index, node)]
        for j in range(self.vectors(index)):
            start = self.start(str(bias), j) if bias else ZERO
            kept = self.program.nodes[node.args[0]].op == "input"
            found.append(tree.Array(self.variable(index, 0, j), VECTOR, kept=kept, value=start))
        if self.program.nodes[node.args[0]].op == "input":
            return [*found, *self.of_window(index, matrix)]
        for i, column in enumerate(matrix.T):
            found += self.added(f"v{index}", column, self.at(node.args[0], 0, i // 4).lane(i % 4))
        return found

    def start(self, bias: str, vector: int) -> tree.Expr:
        """Return four values of a bias, with which sums start."""
        return numbers(self.program.parameters[bias], vector)

    def added(self, sums: str, column: NDArray[np.float32], value: tree.Expr) -> list[tree.Statement]:
        """Return the additions of a column of weights (D_out,) times a value to all vectors."""
        products = [
            apply("multiply", numbers(column, j), splat(value, 4)) for j in range(-(-len(column) // 4))
        ]
        return [tree.Store(f"{sums}_{j}", (), product, add=True) for j, product in enumerate(products)]

    def of_window(self, index: int, matrix: NDArray[np.float32]) -> list[tree.Statement]:
        """Return the products of all taps: a partial sum for each row of taps of an image."""
        gather, split = self.gather, is_split(self.gather)
        part = f"part{index}"
        found: list[tree.Statement] = []
        for group in gather.groups:
            for row in range(gather.rows):
                lines: list[tree.Statement] = []
                if split:
                    lines += variables([f"{part}_{j}" for j in range(self.vectors(index))], ZERO)
                for column in range(gather.columns):
                    tap = (row * gather.columns + column) * gather.channels
                    lines.append(
                        self.tap(
                            row,
                            column,
                            [(image, matrix[:, tap + first :]) for image, first in group],
                            part if split else f"v{index}",
                        )
                    )
                if split:
                    names = [
                        (self.variable(index, 0, j), name(f"{part}_{j}", VECTOR))
                        for j in range(self.vectors(index))
                    ]
                    lines += [tree.Store(total, (), value, add=True) for total, value in names]
                found.append(tree.Block(tuple(lines)))
        return found

    def tap(
        self, row: int, column: int, images: list[tuple[Image, NDArray[np.float32]]], sums: str
    ) -> tree.Statement:
        """Return the products of a tap's channels with their columns of weights."""
        at = Y + row - self.gather.rows // 2, X + column - self.gather.columns // 2
        lines: list[tree.Statement] = [
            tree.Let("row", clamp(at[0], HEIGHT)),
            tree.Let("column", clamp(at[1], WIDTH)),
        ]
        lines += self.inside(*at)
        for image, columns in images:
            value = self.texel(image)
            texel = name(image.name, value.type)
            lines.append(tree.Let(image.name, value))
            for c in range(image.channels):
                lines += self.added(sums, columns[:, c], texel.lane(c) if image.channels > 1 else texel)
        return tree.Block(tuple(lines))
