"""Straight code: layers as variables of four neurons, every statement written out; no array, so no index.

A compiler keeps all of a layer in registers. Elementwise groups are functions of vectors where a language has
arithmetic on vectors; elsewhere of single values, called for each component. Parameters are read from memory,
or are constants of the source where they have no slot there.

The inlined schedule has all weights as constants. For a renderer on a processor (Mesa's llvmpipe) a constant
is an operand, while every other read of a weight is a chain of checks and gathers: measured, a weight in a
texture costs 23 times as much, one in a uniform block 5 times. The price is paid once, when the driver
compiles, in proportion to the number of weights.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from ..core import weights
from ..core.ir import Image, Node, Program
from ..core.sums import is_split
from ..kernel import kernel as tree
from ..kernel.kernel import apply, call, const, name, splat, stack
from .common import HEIGHT, X, Y, clamp, weight
from .schedules import Stored

VECTOR = tree.FLOAT.of(4)
"""Four neurons side by side."""

ZERO = splat(const(0.0), 4)
"""What a sum starts with."""

LARGEST_WEIGHTS = 2**16
"""Most weights that are constants of a kernel: llvmpipe compiles some two thousand a second."""


def numbers(array: NDArray[np.float32], vector: int) -> tree.Expr:
    """Return four values of a vector (n,) from 4 * vector on, 0 behind the end, as a constant."""
    held = array[4 * vector : 4 * vector + 4].tolist()
    return stack([const(float(value)) for value in held + [0.0] * (4 - len(held))])


def variables(names: Sequence[str], value: tree.Expr) -> list[tree.Array]:
    """Return variables with one first value."""
    return [tree.Array(each, VECTOR, kept=True, value=value, register=True) for each in names]


class Straight(Stored):
    """Builds straight code of one or several pixels; with several, names of variables say which."""

    lanes = 4
    pixels = 0
    weights = VECTOR

    def vectors(self, index: int) -> int:
        """Return the vectors of four that hold a value."""
        return -(-self.program.nodes[index].type.shape[0] // 4)

    def places(self, index: int) -> list[tuple[int, int]]:
        """Return all (pixel, vector) of a value."""
        return [(p, j) for p in range(self.pixels or 1) for j in range(self.vectors(index))]

    def variable(self, value: str, p: int, j: int) -> str:
        """Return the name of a vector of a value at a pixel."""
        return f"{value}_{p}_{j}" if self.pixels else f"{value}_{j}"

    def names(self, value: str, index: int) -> list[list[str]]:
        """Return the names of sums, by vector and pixel."""
        pixels = range(self.pixels or 1)
        return [[self.variable(value, p, j) for p in pixels] for j in range(self.vectors(index))]

    def at(self, index: int, p: int, j: int) -> tree.Expr:
        """Return a vector of a value at a pixel: a variable, or part of a parameter."""
        node = self.program.nodes[index]
        return (
            self.four(node["name"], j)
            if node.op == "parameter"
            else name(self.variable(f"v{index}", p, j), VECTOR)
        )

    def four(self, parameter: object, vector: int) -> tree.Expr:
        """Return four values of a parameter that is a vector."""
        if str(parameter) not in self.slots:
            return numbers(self.program.parameters[str(parameter)], vector)
        found = weight(self.offset(parameter) // 4 + vector, self.weights)
        return found if self.weights == VECTOR else tree.Expr("bits", (found,), VECTOR)

    # ---- affine maps -------------------------------------------------------------------------------------

    def affine(self, index: int, node: Node) -> list[tree.Statement]:
        """Return v = W x + b for all pixels."""
        bias, windowed = node.get("bias"), self.program.nodes[node.args[0]].op == "input"
        starts = [(p, j, self.four(bias, j) if bias else ZERO) for p, j in self.places(index)]
        sums = [
            tree.Array(self.variable(f"v{index}", p, j), VECTOR, kept=windowed, value=start)
            for p, j, start in starts
        ]
        return [self.mapped(index, node), *sums, *self.additions(index, node)]

    def additions(self, index: int, node: Node) -> list[tree.Statement]:
        """Return the additions of all products to the sums."""
        source = node.args[0]
        if self.program.nodes[source].op == "input":
            return self.of_window(index, node)
        found: list[tree.Statement] = []
        for i, (lets, factors) in enumerate(self.inputs(index, source)):
            sums = self.names(self.total(index), index)
            found += [*lets, *self.multiplied(self.row_of(index, node, i), sums, factors)]
        return found

    def total(self, index: int) -> str:
        """Return what the sums of a layer are called."""
        return f"v{index}"

    def inputs(self, index: int, source: int) -> Iterator[tuple[list[tree.Let], list[tree.Expr]]]:
        """Yield the values of a layer one by one, at each pixel, and what makes them."""
        for i in range(self.program.nodes[source].type.shape[0]):
            yield [], [self.at(source, p, i // 4).lane(i % 4) for p in range(self.pixels or 1)]

    def of_window(self, index: int, node: Node) -> list[tree.Statement]:
        """Return the additions of the products of all taps."""
        raise NotImplementedError

    def row_of(self, index: int, node: Node, row: int) -> list[tree.Expr]:
        """Return the weights of one input of a layer."""
        if (key := str(node["weight"])) in self.slots:
            return self.weights_row(index, const(self.offset(key) // 4), row)
        return fours(self.program.parameters[key][:, row])

    def weights_row(self, index: int, first: tree.Expr, row: int) -> list[tree.Expr]:
        """Return a row of weights in memory."""
        count = self.vectors(index)
        return [weight(first + (row * count + j), self.weights) for j in range(count)]

    def multiplied(
        self, weights: Sequence[tree.Expr], sums: Sequence[Sequence[str]], factors: Sequence[tree.Expr]
    ) -> list[tree.Statement]:
        """Return the additions of a row of weights times each pixel's value, each weight read once.

        `sums`: names, by vector and pixel.
        """
        found: list[tree.Statement] = []
        for own, names in zip(weights, sums, strict=True):
            m = name("m", own.type) if own.op == "load" else own
            adds = [
                tree.Store(s, (), self.product(m, x), add=True) for s, x in zip(names, factors, strict=True)
            ]
            found += [tree.Block((tree.Let("m", own), *adds))] if own.op == "load" else adds
        return found

    def product(self, weight: tree.Expr, factor: tree.Expr) -> tree.Expr:
        """Return what a weight adds to a sum."""
        return apply("multiply", weight, splat(factor, 4))

    def summed(self, index: int, part: str, body: Sequence[tree.Statement]) -> list[tree.Statement]:
        """Return additions to partial sums, which start with 0 and are added to the sums."""
        places = self.places(index)
        total, names = ([self.variable(n, p, j) for p, j in places] for n in (f"v{index}", part))
        adds = [tree.Store(t, (), name(n, VECTOR), add=True) for t, n in zip(total, names, strict=True)]
        return [*variables(names, ZERO), *body, *adds]

    # ---- elementwise groups ------------------------------------------------------------------------------

    def operands(self, group: Sequence[int]) -> list[int]:
        """Return the vectors from outside that a group reads."""
        read = {arg for index in group for arg in self.program.nodes[index].args} - set(group)
        return sorted(index for index in read if self.program.nodes[index].op != "constant")

    def results(self, group: Sequence[int]) -> list[int]:
        """Return the values of a group that others read."""
        return [index for index in group if self.is_array(index)]

    def functions(self) -> tuple[tree.Function, ...]:
        """Return the functions of elementwise groups."""
        elementwise = [g for g in self.groups if self.program.nodes[g[0]].op not in ("input", "affine")]
        return tuple(
            f for group in elementwise for result in self.results(group) for f in self.function(group, result)
        )

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
                found.append(tree.Array(self.variable(f"v{result}", p, j), VECTOR, value=value))
        return found

    def output(self, row: tree.Expr, column: tree.Expr, p: int = 0) -> list[tree.Statement]:
        """Return the statements that write the output of a pixel."""
        return self.written(row, column, lambda j: self.at(self.program.outputs[0][1], p, j))


def fours(column: NDArray[np.float32]) -> list[tree.Expr]:
    """Return the weights (D_out,) of one input as constants."""
    return [numbers(column, j) for j in range(-(-len(column) // 4))]


class Inline(Straight):
    """Everything unrolled, weights in the source."""

    name = "inlined"
    idea = "all loops unrolled, every weight a constant of the source"
    order = "every weight is a constant of the source"

    def built(self) -> tree.Kernel:
        """Return the kernel."""
        constants = self.window()
        body = [*self.all_groups(), self.output_comment(), *self.output(Y, X)]
        return self.assembled(body, constants, functions=self.functions())

    def of_window(self, index: int, node: Node) -> list[tree.Statement]:
        """Return the products of all taps: a partial sum for each row of taps of an image."""
        gather, split, matrix = (
            self.gather,
            is_split(self.gather),
            self.program.parameters[str(node["weight"])],
        )
        part = f"part{index}" if split else f"v{index}"
        found: list[tree.Statement] = []
        for group in gather.groups:
            for row in range(gather.rows):
                lines = []
                for column in range(gather.columns):
                    tap = (row * gather.columns + column) * gather.channels
                    images = [(image, matrix[:, tap + first :]) for image, first in group]
                    lines.append(self.tap(row, column, images, self.names(part, index)))
                found.append(tree.Block(tuple(self.summed(index, part, lines) if split else lines)))
        return found

    def tap(
        self,
        row: int,
        column: int,
        images: list[tuple[Image, NDArray[np.float32]]],
        sums: Sequence[Sequence[str]],
    ) -> tree.Statement:
        """Return the products of a tap's channels with their columns of weights."""
        at = Y + row - self.gather.rows // 2, X + column - self.gather.columns // 2
        lines: list[tree.Statement] = [
            tree.Let("row", clamp(at[0], HEIGHT)),
            *self.column(*at),
        ]
        for image, columns in images:
            value = self.pixel(image)
            texel = name(image.name, value.type)
            lines.append(tree.Let(image.name, value))
            for c in range(image.channels):
                factor = texel.lane(c) if image.channels > 1 else texel
                lines += self.multiplied(fours(columns[:, c]), sums, [factor])
        return tree.Block(tuple(lines))

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
        return super().refusal(program)

    def stored(self, program: Program) -> Mapping[str, NDArray[np.float32]]:
        """Return nothing: no weight lies outside the source."""
        return {}
