"""Straight code: layers as variables of four neurons, every statement written out; no array, so no index.

A compiler keeps all of a layer in registers. Elementwise groups are functions of vectors where a language has
arithmetic on vectors; elsewhere of single values, called for each component.
"""

from __future__ import annotations

from collections.abc import Sequence

from ..core.ir import Node
from ..kernel import kernel as tree
from ..kernel.kernel import apply, call, const, name, splat, stack
from .common import Nest

VECTOR = tree.FLOAT.of(4)
"""Four neurons side by side."""


class Straight(Nest):
    """Builds straight code of one or several pixels."""

    lanes = 4
    pixels = 1

    def vectors(self, index: int) -> int:
        """Return the vectors of four that hold a value."""
        return -(-self.program.nodes[index].type.shape[0] // 4)

    def places(self, index: int) -> list[tuple[int, int]]:
        """Return all (pixel, vector) of a value."""
        return [(p, j) for p in range(self.pixels) for j in range(self.vectors(index))]

    def variable(self, index: int, p: int, j: int) -> str:
        """Return the name of a vector of a value at a pixel."""
        return f"v{index}_{p}_{j}" if self.pixels > 1 or self.pixel_names else f"v{index}_{j}"

    pixel_names = False

    def at(self, index: int, p: int, j: int) -> tree.Expr:
        """Return a vector of a value at a pixel: a variable, or part of a parameter."""
        node = self.program.nodes[index]
        return self.parameter(node, j) if node.op == "parameter" else name(self.variable(index, p, j), VECTOR)

    def parameter(self, node: Node, vector: int) -> tree.Expr:
        """Return four values of a parameter that is a vector."""
        raise NotImplementedError

    def all_groups(self) -> list[tree.Statement]:
        """Return the statements of all layers."""
        found: list[tree.Statement] = []
        for nodes in self.groups:
            node = self.program.nodes[nodes[0]]
            if node.op != "input":
                found += self.affine(nodes[0], node) if node.op == "affine" else self.elementwise(nodes)
        return found

    def affine(self, index: int, node: Node) -> list[tree.Statement]:
        """Return v = W x + b."""
        raise NotImplementedError

    # ---- elementwise groups ------------------------------------------------------------------------------

    def operands(self, group: Sequence[int]) -> list[int]:
        """Return the vectors from outside that a group reads."""
        read = {arg for index in group for arg in self.program.nodes[index].args} - set(group)
        return sorted(index for index in read if self.program.nodes[index].op != "constant")

    def results(self, group: Sequence[int]) -> list[int]:
        """Return the values of a group that others read."""
        return [index for index in group if self.is_array(index)]

    def functions(self) -> list[tree.Function]:
        """Return the functions of elementwise groups."""
        elementwise = [g for g in self.groups if self.program.nodes[g[0]].op not in ("input", "affine")]
        return [
            f for group in elementwise for result in self.results(group) for f in self.function(group, result)
        ]

    def function(self, group: Sequence[int], result: int) -> list[tree.Function]:
        """Return the function that computes one value of a group, and that of its components where needed."""
        kind, taken = VECTOR if self.wide else tree.FLOAT, self.operands(group)
        takes = tuple((f"v{k}", kind) for k in taken)
        lets = self.statements(group, lambda k: name(f"v{k}", kind), kind.lanes)
        own = [let for let in lets if int(let.name[1:]) <= result]
        title = f"elementwise_{result}"
        if self.wide:
            return [tree.Function(title, takes, tuple(own), name(f"t{result}", kind))]
        one = tree.Function(f"{title}_of_one", takes, tuple(own), name(f"t{result}", kind))
        lanes = [[name(f"v{k}", VECTOR).lane(lane) for k in taken] for lane in range(4)]
        whole = stack([call(one.name, given, tree.FLOAT) for given in lanes])
        return [one, tree.Function(title, tuple((n, VECTOR) for n, _ in takes), (), whole)]

    def elementwise(self, group: tuple[int, ...]) -> list[tree.Statement]:
        """Return the calls of a group's functions, one for each pixel and vector."""
        found: list[tree.Statement] = [self.span(group)]
        for result in self.results(group):
            for p, j in self.places(group[0]):
                given = [self.at(k, p, j) for k in self.operands(group)]
                value = call(f"elementwise_{result}", given, VECTOR)
                found.append(tree.Array(self.variable(result, p, j), VECTOR, value=value))
        return found

    # ---- sums --------------------------------------------------------------------------------------------

    def multiplied(
        self, weights: Sequence[tree.Expr], sums: Sequence[Sequence[str]], factors: Sequence[tree.Expr]
    ) -> list[tree.Statement]:
        """Return the additions of a row of weights times each pixel's value, each weight read once.

        `sums`: names, by vector and pixel.
        """
        found: list[tree.Statement] = []
        for weight, names in zip(weights, sums, strict=True):
            m = name("m", weight.type)
            adds = [
                tree.Store(s, (), self.product(m, x, s), add=True)
                for s, x in zip(names, factors, strict=True)
            ]
            found.append(tree.Block((tree.Let("m", weight), *adds)))
        return found

    def product(self, weight: tree.Expr, factor: tree.Expr, total: str) -> tree.Expr:
        """Return what a weight adds to a sum."""
        return apply("multiply", weight, splat(factor, 4))

    def written(self, row: tree.Expr, column: tree.Expr, p: int) -> tree.Statement:
        """Return the statement that writes the output of a pixel."""
        index = self.program.outputs[0][1]
        channels = range(self.program.nodes[index].type.shape[0])
        return tree.Write(row, column, tuple(self.at(index, p, i // 4).lane(i % 4) for i in channels))

    def output_comment(self) -> tree.Comment:
        """Return the comment above the output."""
        return tree.Comment(f"output {self.program.outputs[0][0]}")


def variables(names: Sequence[str], value: tree.Expr, kind: tree.Type = VECTOR) -> list[tree.Array]:
    """Return variables with one first value."""
    return [tree.Array(each, kind, kept=True, value=value, register=True) for each in names]


ZERO = splat(const(0.0), 4)
"""What a sum starts with."""
