"""The plain schedule: one pixel per work item, loops over taps and neurons; made for reading.

An affine map that reads the window accumulates straight from the images, a partial sum for each row of taps
of an image [core/sums.py]; the window is an array only if something else reads it.

The packed schedule is the same with four weights per read: values are arrays of vectors of four, the weights
a row of neurons for each input, filled up to a multiple of four. The source is short, so that it compiles at
once however many weights there are (spec/webpage.md: in a browser without a graphics processor).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..core import weights
from ..core.ir import Image, Node, Program
from ..core.sums import is_split
from ..kernel import kernel as tree
from ..kernel.interface import PLAIN, RESULT
from ..kernel.kernel import apply, const, load, name, splat
from .common import HEIGHT, X, Y, clamp, constant, loop, output_channels, weight
from .schedules import Schedule, Stored
from .straight import VECTOR, ZERO

J, COUNTER = name("j"), name("i")
"""The loop variables of outputs, and of inputs or copies."""

VALUE = name("value", tree.FLOAT)
"""An input of a map."""

WEIGHTS_A_TEXEL = "weights_a_texel"
"""Key of a manifest's schedule: how many floats a texel of the weight texture has, if not one."""


class Plain(Schedule):
    """One pixel a work item, loops over taps and neurons."""

    name = PLAIN
    idea = "one pixel after another, loops over taps and neurons"

    def built(self) -> tree.Kernel:
        """Return the kernel."""
        constants = self.window()
        return self.assembled([*self.all_groups(), *self.outputs()], constants, weights=self.weights)

    weights, zero = tree.Type(), const(0.0)

    def outputs(self) -> tree.Body:
        """Return the statements that write the output."""
        index, i = self.program.outputs[0][1], COUNTER
        if not self.program.nodes[index].type.shape:
            return self.output_comment(), tree.Store(RESULT, (Y, X, const(0)), self.read(index))
        write = tree.Store(RESULT, (Y, X, i), self.read(index, i))
        return self.output_comment(), loop("i", output_channels(self.program), write)

    def count(self, index: int) -> int:
        """Return the elements of a value's array."""
        return self.program.nodes[index].type.shape[0]

    def component(self, node: Node) -> tree.Expr:
        """Return one component of another group's vector."""
        return self.read(node.args[0], const(int(node["index"])))  # type: ignore[arg-type]

    def elementwise(self, group: tuple[int, ...]) -> list[tree.Statement]:
        """Return the statements of a stack, or of elementwise operations."""
        index, node = group[0], self.program.nodes[group[0]]
        if node.op == "stack":
            return self.stacked(index, node)
        if not node.type.shape:
            return [*self.statements(group, self.read, 1)]
        return self.of_elements(group, self.count(index), lambda k: self.read(k, COUNTER), self.lanes)

    def read(self, index: int, lane: tree.Expr | None = None) -> tree.Expr:
        """Return a value, or one component of it."""
        node = self.program.nodes[index]
        if node.op == "constant":
            return constant(node)
        if node.op == "parameter":
            return weight(self.offset(node["name"]) + lane if lane else self.offset(node["name"]))
        kind = tree.Type(node.type.dtype)
        return load(f"v{index}", lane, kind=kind) if node.type.shape and lane else name(f"t{index}", kind)

    def array(self, index: int) -> tree.Array:
        """Return the declaration of a value's array."""
        kind = self.program.nodes[index].type
        return tree.Array(f"v{index}", tree.Type(kind.dtype), kind.shape)

    def stacked(self, index: int, node: Node) -> list[tree.Statement]:
        """Return the copy of numbers side by side."""
        stores = [
            tree.Store(f"v{index}", (const(i),), self.operand(arg, self.read))
            for i, arg in enumerate(node.args)
        ]
        return [tree.Comment(f"%{index}: {len(node.args)} numbers side by side"), self.array(index), *stores]

    def materialised(self, index: int) -> list[tree.Statement]:
        """Return the copy of the window into an array, if something else than affine maps reads it."""
        if not self.is_array(index):
            return []
        copied = partial(self.each_channel, lambda tap: tree.Store(f"v{index}", (tap,), VALUE))
        copy = self.over_window(copied)
        return [tree.Comment(f"%{index}: the window"), self.array(index), *copy]

    # ---- affine maps -------------------------------------------------------------------------------------

    def affine(self, index: int, node: Node) -> list[tree.Statement]:
        """Return v = W x + b, x being the images around the pixel or an array."""
        v, part, source, bias = f"v{index}", f"part{index}", node.args[0], node.get("bias")
        windowed = self.program.nodes[source].op == "input"
        start = weight(self.offset(bias) // self.lanes + J, self.weights) if bias else self.zero
        sums = replace(self.array(index), kept=windowed)
        filled = self.each(index, tree.Store(v, (J,), start))
        found: list[tree.Statement] = [self.mapped(index, node), sums, filled]
        first = self.offset(node["weight"]) // self.lanes
        if not windowed:
            return [*found, *self.of_layer(index, first, source)]
        if not is_split(self.gather):
            return [*found, *self.over_window(partial(self.channels, index, first, v))]
        zero = self.each(index, tree.Store(part, (J,), self.zero))
        add = self.each(index, tree.Store(v, (J,), load(part, J, kind=self.weights), add=True))
        found.append(tree.Array(part, self.weights, (self.count(index),), kept=True))
        return [*found, *self.over_window(partial(self.channels, index, first, part), zero, add)]

    def each(self, index: int, *body: tree.Statement) -> tree.Statement:
        """Return the loop over the elements of a value's array."""
        return loop("j", self.count(index), *body)

    def products(
        self, index: int, sums: str, first: int, row: tree.Expr, factors: Sequence[tree.Expr]
    ) -> tree.Statement:
        """Return the additions of rows of weights, from one on, times a factor each to all neurons' sums."""
        lines: list[tree.Statement] = []
        for c, factor in enumerate(factors):
            own = weight(first + (row + c) * self.count(index) + J, self.weights)
            product = apply("multiply", own, splat(factor, self.lanes))
            lines.append(tree.Store(sums, (J,), product, add=True))
        return self.each(index, *lines)

    def of_layer(self, index: int, first: int, source: int) -> list[tree.Statement]:
        """Return the products of a layer's values."""
        added = self.products(index, f"v{index}", first, COUNTER, [VALUE])
        return [loop("i", self.count(source), tree.Let("value", self.read(source, COUNTER)), added)]

    def channels(self, index: int, first: int, sums: str, image: Image, at: int) -> list[tree.Statement]:
        """Return the products of a tap's channels of an image."""
        return self.each_channel(lambda row: self.products(index, sums, first, row, [VALUE]), image, at)

    def each_channel(
        self, body: Callable[[tree.Expr], tree.Statement], image: Image, at: int
    ) -> list[tree.Statement]:
        """Return the loop over the channels of a tap; `body` takes the index into the window."""
        c = name("c")
        inner = body(name("tap") + at + c)
        return [loop("c", image.channels, tree.Let("value", self.pixel(image, c)), inner)]

    def over_window(
        self, channels: Callable[[Image, int], list[tree.Statement]], *around: tree.Statement
    ) -> list[tree.Statement]:
        """Return the loops over images, rows of taps and taps; `around` is before and after a row of taps."""
        found: list[tree.Statement] = []
        y, x = Y + name("dy") - self.row, X + name("dx") - self.middle
        tap = (name("dy") * self.columns + name("dx")) * self.gather.channels
        for group in self.gather.groups:
            inner = [line for image, at in group for line in channels(image, at)]
            taps = loop("dx", self.columns, *self.column(y, x), tree.Let("tap", tap), *inner)
            row = tree.Let("row", clamp(y, HEIGHT))
            found.append(loop("dy", self.rows, row, *around[:1], taps, *around[1:]))
        return found


class Packed(Stored, Plain):
    """Loops, and four weights a read: the plain schedule by vectors."""

    name = "packed"
    idea = "four weights a texel, four neurons a `vec4`"
    order = "matrices input-major, each input's neurons filled up with 0 to a multiple of four"
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
        return self.output_comment(), *self.written(Y, X, lambda j: self.read(index, const(j)))

    def count(self, index: int) -> int:
        """Return the vectors of four that hold a value."""
        return -(-self.program.nodes[index].type.shape[0] // 4)

    def of_layer(self, index: int, first: int, source: int) -> list[tree.Statement]:
        """Return the products of a layer's values."""
        whole, rest = divmod(self.program.nodes[source].type.shape[0], 4)
        v, found = f"v{index}", list[tree.Statement]()
        if whole:
            fours = lanes(self.read(source, COUNTER), 4)
            found.append(loop("i", whole, self.products(index, v, first, COUNTER * 4, fours)))
        if rest:
            last = lanes(self.read(source, const(whole)), rest)
            found.append(self.products(index, v, first, const(4 * whole), last))
        return found

    def channels(self, index: int, first: int, sums: str, image: Image, at: int) -> list[tree.Statement]:
        """Return the products of a tap's channels of an image."""
        value = self.pixel(image)
        factors = lanes(name(image.name, value.type), image.channels)
        added = self.products(index, sums, first, name("tap") + at, factors)
        return [tree.Let(image.name, value), added]

    def stored(self, program: Program) -> Mapping[str, NDArray[np.float32]]:
        """Return all weights as they are stored, by name."""
        found = {}
        for key, array in weights.weights(program).items():
            missing = [(0, -len(array) % 4), *[(0, 0)] * (array.ndim - 1)]
            found[key] = np.ascontiguousarray(np.pad(array, missing).T)
        return found

    def details(self, program: Program) -> Mapping[str, Any]:
        """Return the form of the texture."""
        return {WEIGHTS_A_TEXEL: 4}


def lanes(value: tree.Expr, count: int) -> list[tree.Expr]:
    """Return the first components of a vector, or a single value."""
    return [value.lane(c) for c in range(count)] if value.type.lanes > 1 else [value]
