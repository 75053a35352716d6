"""The plain schedule: one pixel per work item, loops over taps and neurons; made for reading.

An affine map that reads the window accumulates straight from the images, a partial sum for each row of taps
of an image [core/sums.py]; the window is an array only if something else reads it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from ..core.ir import Node
from ..core.sums import is_split
from ..kernel import kernel as tree
from ..kernel.kernel import const, load, name
from .common import Nest, X, Y, loop, output, weight


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

    weights = tree.Type()

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
        copy = self.over_window(lambda tap: [tree.Store(f"v{index}", (tap,), name("value", tree.Type()))])
        return [tree.Comment(f"%{index}: the window"), self.array(index), *copy]

    def affine(self, index: int, node: Node) -> list[tree.Statement]:
        """Return v = W x + b, x being the images around the pixel or an array."""
        n_out, j, v = node.type.shape[0], name("j"), f"v{index}"
        first, bias, source = self.offset(node["weight"]), node.get("bias"), self.program.nodes[node.args[0]]
        start = weight(self.offset(bias) + j) if bias else const(0.0)
        starts = loop("j", n_out, tree.Store(v, (j,), start))
        sums = replace(self.array(index), kept=source.op == "input")
        found: list[tree.Statement] = [self.mapped(index, node), sums, starts]

        def accumulated(sums: str, row: tree.Expr) -> tree.Statement:
            """Return the loop that adds `value` times one row of weights to all neurons' sums."""
            product = weight(first + row * n_out + j) * name("value", tree.Type())
            return loop("j", n_out, tree.Store(sums, (j,), product, add=True))

        if source.op != "input":
            i = name("i")
            value = tree.Let("value", self.read(node.args[0], i))
            return [*found, loop("i", source.type.shape[0], value, accumulated(v, i))]
        if not is_split(self.gather):
            return [*found, *self.over_window(lambda tap: [accumulated(v, tap)])]
        part = f"part{index}"
        zero = loop("j", n_out, tree.Store(part, (j,), const(0.0)))
        add = loop("j", n_out, tree.Store(v, (j,), load(part, j), add=True))
        found.append(tree.Array(part, tree.Type(), (n_out,), kept=True))
        return [*found, *self.over_window(lambda tap: [accumulated(part, tap)], (zero,), (add,))]

    def over_window(
        self, body: Callable[[tree.Expr], list[tree.Statement]], before: tree.Body = (), after: tree.Body = ()
    ) -> list[tree.Statement]:
        """Return the loops over images, rows of taps, taps and channels that set `value`.

        `body` takes the index into the window; `before` and `after` surround an image's row of taps.
        """
        found: list[tree.Statement] = []
        tap = (name("dy") * self.columns + name("dx")) * self.gather.channels
        for group in self.gather.groups:
            channels = []
            for image, first in group:
                c = name("c")
                inner = body(name("tap") + first + c)
                channels.append(loop("c", image.channels, tree.Let("value", self.pixel(image, c)), *inner))
            row = loop("dx", self.columns, *self.tap_column(), tree.Let("tap", tap), *channels)
            found.append(loop("dy", self.rows, self.tap_row(), *before, row, *after))
        return found
