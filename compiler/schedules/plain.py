"""The plain schedule: one pixel per work item, loops over taps and neurons; made for reading.

An affine map that reads the window accumulates straight from the images, a partial sum for each row of taps
of an image [core/sums.py]; the window is an array only if something else reads it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

from ..core.ir import Image, Node
from ..core.sums import is_split
from ..kernel import kernel as tree
from ..kernel.kernel import const, load, name
from .common import Nest, X, Y, loop, output, weight

J = name("j")
"""The loop variable of outputs."""


class Plainly(Nest):
    """Builds the plain kernel."""

    def built(self) -> tree.Kernel:
        """Return the kernel."""
        constants = self.window()
        body: list[tree.Statement] = []
        for group in self.groups:
            body += self.of_group(group)
        body += self.outputs()
        return self.kernel(body, constants, weights=self.weights)

    weights, zero = tree.Type(), const(0.0)

    def outputs(self) -> tree.Body:
        """Return the statements that write the output."""
        index = self.program.outputs[0][1]
        shaped = bool(self.program.nodes[index].type.shape)
        return output(self.program, Y, X, lambda i: self.read(index, i) if shaped else self.read(index))

    def count(self, index: int) -> int:
        """Return the elements of a value's array."""
        return self.program.nodes[index].type.shape[0]

    def component(self, node: Node) -> tree.Expr:
        """Return one component of another group's vector."""
        return self.read(node.args[0], const(int(node["index"])))  # type: ignore[arg-type]

    def of_group(self, group: tuple[int, ...]) -> list[tree.Statement]:
        """Return the statements of one group: a window, an affine map, a stack, or elementwise operations."""
        index, node = group[0], self.program.nodes[group[0]]
        if node.op == "input":
            return self.materialised(index) if self.is_array(index) else []
        if node.op == "affine":
            return self.affine(index, node)
        if node.op == "stack":
            return self.stacked(index, node)
        if not node.type.shape:
            return [*self.statements(group, self.read, 1)]
        i, lane = name("i"), lambda k: self.read(k, name("i"))
        kept = [k for k in group if self.is_array(k)]
        lines: list[tree.Statement] = []
        for let, k in zip(self.statements(group, lane, self.lanes), group, strict=True):
            lines += [
                let,
                *([tree.Store(f"v{k}", (i,), name(let.name, let.value.type))] if k in kept else []),
            ]
        return [self.span(group), *map(self.array, kept), loop("i", self.count(index), *lines)]

    def read(self, index: int, lane: tree.Expr | None = None) -> tree.Expr:
        """Return a value, or one component of it."""
        node = self.program.nodes[index]
        if node.op == "constant":
            return self.constant(node)
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
        """Return the copy of the window into an array."""

        def copied(tap: tree.Expr) -> tree.Statement:
            """Return the copy of a value."""
            return tree.Store(f"v{index}", (tap,), name("value", tree.Type()))

        copy = self.over_window(partial(self.each_channel, copied))
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

    def accumulated(self, index: int, first: int, sums: str, row: tree.Expr) -> tree.Statement:
        """Return the loop that adds `value` times one row of weights to all neurons' sums."""
        product = weight(first + row * self.count(index) + J) * name("value", tree.Type())
        return self.each(index, tree.Store(sums, (J,), product, add=True))

    def of_layer(self, index: int, first: int, source: int) -> list[tree.Statement]:
        """Return the products of a layer's values."""
        i = name("i")
        added = self.accumulated(index, first, f"v{index}", i)
        return [loop("i", self.count(source), tree.Let("value", self.read(source, i)), added)]

    def channels(self, index: int, first: int, sums: str, image: Image, at: int) -> list[tree.Statement]:
        """Return the products of a tap's channels of an image."""
        return self.each_channel(partial(self.accumulated, index, first, sums), image, at)

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
        tap = (name("dy") * self.columns + name("dx")) * self.gather.channels
        for group in self.gather.groups:
            inner = [line for image, at in group for line in channels(image, at)]
            row = loop("dx", self.columns, *self.tap_column(), tree.Let("tap", tap), *inner)
            found.append(loop("dy", self.rows, self.tap_row(), *around[:1], row, *around[1:]))
        return found
