"""What all schedules share: which program a kernel can hold, groups of nodes, and elementwise statements.

1. Nodes are grouped in their order [`groups_of`]: neighbouring elementwise nodes of one shape share a loop,
   an affine node is a loop nest of its own.
2. A value that another group reads is an array `v<node>`; a value that only its own loop reads is `t<node>`
   [`Nest`]. The numbers are those of the printed program.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any

from ...refimpl.errors import CompileError
from ..core.ir import Gather, Image, Node, Program, users
from ..core.loops import Loop, Part, Walk, loops
from ..core.ops import LOOPS, OPS
from ..core.weights import Slot, tables
from ..kernel import kernel as tree
from ..kernel.interface import IMAGE, RESULT, WEIGHTS, denoiser
from ..kernel.kernel import apply, const, expr, load, name, splat

X, Y, WIDTH, HEIGHT = map(name, ("x", "y", "width", "height"))
"""An item's first pixel, and the size of the images."""

TRIP = "i"
"""Name of the counter of a loop over the rows of tables."""

BRANCH = "node"
"""Name of the number of a tree's node, where a loop walks along one."""


def kernel_gather(program: Program) -> Gather:
    """Return how the window is filled, or refuse a program that no kernel of a denoiser can hold."""
    if program.gather is None or len(program.outputs) != 1:
        raise CompileError(
            f"the program has {len(program.outputs)} outputs and {'a' if program.gather else 'no'} gathered "
            "window: a kernel needs one output and a window; lower a model, or trace with a Gather"
        )
    if any(node.op in LOOPS for node in program.nodes):
        raise CompileError(
            "the program has a loop over the rows of tables, which this skeleton does not support: trace it "
            "without `most_unrolled`"
        )
    return program.gather


def output_channels(program: Program) -> int:
    """Return the number of channels of the only output."""
    shape = program.nodes[program.outputs[0][1]].type.shape
    return shape[0] if shape else 1


def reading_window(program: Program) -> list[int]:
    """Return the indices of the nodes that read the window."""
    inputs = {index for index, node in enumerate(program.nodes) if node.op == "input"}
    return [index for index, node in enumerate(program.nodes) if inputs & set(node.args)]


def readers_of_window(program: Program) -> list[Node]:
    """Return the nodes that read the window."""
    return [program.nodes[index] for index in reading_window(program)]


def groups_of(program: Program) -> list[tuple[int, ...]]:
    """Return groups of node indices in order: nodes that share a loop, or one other node."""
    groups: list[list[int]] = []
    for index, node in enumerate(program.nodes):
        if node.op in ("constant", "parameter"):
            continue
        last = program.nodes[groups[-1][-1]] if groups else node
        if groups and _loops(node) and _loops(last) and node.type.shape == last.type.shape:
            groups[-1].append(index)
        else:
            groups.append([index])
    return [tuple(group) for group in groups]


def _loops(node: Node) -> bool:
    """Return whether the node is one statement, in a loop over components or in straight code."""
    return OPS[node.op].elementwise or node.op in ("component", "take")


def weight(index: tree.Expr | int, kind: tree.Type = tree.FLOAT) -> tree.Expr:
    """Return an element of the weights."""
    return load(WEIGHTS, index, kind=kind)


def loop(counter: str, count: tree.Expr | int, *body: tree.Statement) -> tree.For:
    """Return a loop."""
    return tree.For(counter, expr(count), body)


def constant(node: Node) -> tree.Expr:
    """Return the value of a constant node."""
    value: Any = node["value"]
    return const(float(value) if node.type.dtype == "float32" else value, tree.Type(node.type.dtype))


class _Statements:
    """The statements of a program, one an operation, and the value of each node [`lets`].

    A loop over the rows of tables is a loop on a counter that all lanes share, so that a row is read once.
    """

    def __init__(
        self,
        program: Program,
        known: Mapping[str, tree.Expr],
        lanes: int,
        tables: Mapping[str, str],
        prefix: str,
    ) -> None:
        self.program, self.known, self.lanes, self.tables, self.prefix = program, known, lanes, tables, prefix
        self.values: list[tree.Expr] = []
        self.body: list[tree.Statement] = []
        ends, in_bodies = loops(program)
        for index, node in enumerate(program.nodes):
            if index in ends:
                self.body.append(self._loop(ends[index]))
            self.values.append(self._value(index, node))
            if node.op not in ("input", "constant", "loop") and index not in in_bodies:
                self.body.append(self._statement(index))

    def _value(self, index: int, node: Node) -> tree.Expr:
        """Return a node's value: a constant, or a name."""
        kind = tree.Type(node.type.dtype, self.lanes)
        if node.op == "input":
            key = str(node["name"])
            return self.known.get(key) or name(key, kind)
        if node.op == "constant":
            return splat(constant(node), self.lanes)
        if node.op == "loop":
            return self.values[node.args[int(node["index"])]]  # type: ignore[arg-type]
        return name(f"{self.prefix}{index}", kind)

    def _statement(self, index: int) -> tree.Statement:
        """Return the statement that computes a value."""
        node, own = self.program.nodes[index], self.values[index]
        args = [self.values[arg] for arg in node.args]
        if node.op == "carried":
            return tree.Array(own.value, own.type, kept=True, value=args[0])
        if node.op in ("row", "branch"):
            value = splat(self._entry(node["table"], name(TRIP if node.op == "row" else BRANCH)), self.lanes)
        elif node.op == "take":
            value = self._entry(node["table"], args[0])
        else:
            value = apply(node.op, *args, value=node.get("dtype"))
        return tree.Let(own.value, value, kept=True)

    def _entry(self, table: object, index: tree.Expr) -> tree.Expr:
        """Return the entry of a table."""
        kind = tree.Type(str(self.program.parameters[str(table)].dtype), index.type.lanes)
        return tree.Expr("take", (index,), kind, self.tables[str(table)])

    def _loop(self, found: Loop) -> tree.Statement:
        """Return a loop over the rows of tables."""
        if found.walk is not None:
            return self._walk(found, found.walk)
        return loop(TRIP, found.trips, *self._trip(found, Part(found.body, found.after)))

    def _walk(self, found: Loop, walk: Walk) -> tree.Statement:
        """Return a walk along a tree: a node is entered where any of the lanes enters it."""
        nodes, node = len(self.program.parameters[walk.skip]), name(BRANCH)
        parts = []
        for number, part in enumerate(walk.parts):
            start, end = (self._entry(walk.first, node + (number * (nodes + 1) + more)) for more in (0, 1))
            parts.append(tree.For(TRIP, end, self._trip(found, part), start=start))
        entered = tree.Store(BRANCH, (), node + 1)
        left_out = tree.Store(BRANCH, (), self._entry(walk.skip, node))
        branch = tree.If(tree.any_lane(self.values[walk.enters]), (*parts, entered), (left_out,))
        guard = [self._statement(index) for index in walk.guard]
        visit = loop("visit", nodes, tree.Break(apply("equal", node, nodes)), *guard, branch)
        return tree.Block((tree.Array(BRANCH, node.type, value=const(0)), visit))

    def _trip(self, found: Loop, done: Part) -> tuple[tree.Statement, ...]:
        """Return a trip of a loop: its body, then the assignments of what it carries."""
        changed = {
            self.values[c].value: self.values[n] for c, n in zip(found.carried, done.after, strict=True)
        }
        body = [self._statement(index) for index in done.body]
        return (*body, *assigned(changed, [self.values[c].value for c in found.carried]))


def lets(
    program: Program,
    known: Mapping[str, tree.Expr] | None = None,
    lanes: int = 1,
    prefix: str = "t",
    tables: Mapping[str, str] | None = None,
) -> tuple[list[tree.Statement], dict[str, tree.Expr]]:
    """Return a statement for each operation of a program, and its outputs.

    Inputs are values of their names unless `known` has others; `tables` are the names of tables.
    """
    made = _Statements(program, known or {}, lanes, tables or {}, prefix)
    return made.body, {key: made.values[index] for key, index in program.outputs}


def assigned(
    values: Mapping[str, tree.Expr], variables: Collection[str], masked: Collection[str] = ()
) -> list[tree.Statement]:
    """Return the assignments of values to variables, to those in `masked` where a lane is alive."""
    before: list[tree.Statement] = []
    after: list[tree.Statement] = []
    for variable, value in values.items():
        old, alive = name(variable, value.type), name("alive", tree.BOOL.of(value.type.lanes))
        if value == old:
            continue
        if value.op == "name" and value.value in variables:  # which may be assigned before it is read
            before.append(tree.Let(f"new_{variable}", value, kept=True))
            value = name(f"new_{variable}", value.type)
        if variable == "alive":
            value = alive & value
        elif variable in masked:
            value = apply("select", alive, value, old)
        after.append(tree.Store(variable, (), value))
    return before + after


def fused(lets: Sequence[tree.Let], outputs: Collection[str]) -> list[tree.Let]:
    """Return values without products that only one sum reads, which contains them: compilers fuse those.

    `outputs`: names that others read.
    """
    readers: dict[str, list[str]] = {name: ["output"] for name in outputs}
    for let in lets:
        for part in tree.parts(let.value):
            if part.op == "name":
                readers.setdefault(part.value, []).append(let.value.op)
    read = {let.name for let in lets if readers.get(let.name) in (["add"], ["subtract"])}
    products = {let.name: let.value for let in lets if let.value.op == "multiply" and let.name in read}
    kept = (let for let in lets if let.name not in products)
    return [replace(let, value=tree.substituted(let.value, products)) for let in kept]


Read = Callable[[int], tree.Expr]
"""The expression of a value that another group has computed."""


class Nest:
    """Builds the statements of one program.

    `wide`: the language has elementwise operations on vectors.
    """

    lanes = 1
    wide = True

    def begin(self, program: Program, slots: Mapping[str, Slot]) -> None:
        """Take a program, whose weights are in these slots."""
        self.program, self.slots = program, slots
        self.groups, self.readers = groups_of(program), users(program)
        self.group_of = {index: number for number, group in enumerate(self.groups) for index in group}

    def built(self) -> tree.Kernel:
        """Return the kernel of the program."""
        raise NotImplementedError

    def all_groups(self) -> list[tree.Statement]:
        """Return the statements of all groups of nodes, in order."""
        found: list[tree.Statement] = []
        for group in self.groups:
            index, node = group[0], self.program.nodes[group[0]]
            if node.op == "input":
                found += self.materialised(index)
            else:
                found += self.affine(index, node) if node.op == "affine" else self.elementwise(group)
        return found

    def materialised(self, index: int) -> list[tree.Statement]:
        """Return the copy of the window into an array, if something else than affine maps reads it."""
        return []

    def affine(self, index: int, node: Node) -> list[tree.Statement]:
        """Return v = W x + b, x being the images around the pixels, or a layer."""
        raise NotImplementedError

    def elementwise(self, group: tuple[int, ...]) -> list[tree.Statement]:
        """Return the statements of any other group."""
        raise NotImplementedError

    @cached_property
    def gather(self) -> Gather:
        """Return how the window is filled."""
        return kernel_gather(self.program)

    def window(self) -> list[tree.Constant]:
        """Return the constants of the window."""
        gather, pixel = self.gather, "the tap that lies on the pixel itself"
        names = ("WINDOW_ROWS", "WINDOW_COLUMNS", "CENTRE_ROW", "CENTRE_COLUMN")
        if gather.axes == (0, 1):
            names = ("WINDOW_SIZE", "WINDOW_SIZE", "WINDOW_CENTRE", "WINDOW_CENTRE")
        self.rows, self.columns, self.row, self.middle = map(name, names)
        found = {names[0]: gather.rows, names[1]: gather.columns, names[2]: (gather.rows // 2, pixel)}
        found.setdefault(names[3], gather.columns // 2)
        return named(**found)

    def assembled(
        self, body: Sequence[tree.Statement], constants: Sequence[tree.Constant], **more: object
    ) -> tree.Kernel:
        """Return the kernel of statements; where its weights are is a matter of the language."""
        interface = denoiser(self.gather.images, output_channels(self.program))
        found = tuple(tables(self.program).items())
        return tree.Kernel(interface, tuple(body), tuple(constants), tables=found, **more)  # type: ignore[arg-type]

    # ---- values ------------------------------------------------------------------------------------------

    def is_array(self, index: int) -> bool:
        """Return whether something outside the node's own loop reads this vector component by component."""
        node = self.program.nodes[index]
        readers = [r for r in self.readers[index] if self.group_of[r] != self.group_of[index]]
        if node.op == "input":
            readers = [r for r in readers if self.program.nodes[r].op != "affine"]
        return bool(readers) or any(index == output for _, output in self.program.outputs)

    def statements(self, group: Sequence[int], read: Read, lanes: int) -> list[tree.Let]:
        """Return a statement for each node of an elementwise group; `read`: values of other groups."""
        found: dict[int, tree.Expr] = {}
        lines = []
        for index in group:
            node = self.program.nodes[index]
            value = self._value(node, found, read, lanes if node.type.shape else 1)
            found[index] = name(f"t{index}", value.type)
            lines.append(tree.Let(f"t{index}", value, kept=True))
        return lines

    def array(self, index: int) -> tree.Array:
        """Return the declaration of a value's array."""
        raise NotImplementedError

    def of_elements(
        self, group: Sequence[int], count: tree.Expr | int, read: Read, lanes: int
    ) -> list[tree.Statement]:
        """Return the loop of a group over the elements of its values, and the arrays that keep them."""
        kept = {f"t{k}": f"v{k}" for k in group if self.is_array(k)}
        lines: list[tree.Statement] = []
        for let in self.statements(group, read, lanes):
            lines.append(let)
            if let.name in kept:
                lines.append(tree.Store(kept[let.name], (name("i"),), name(let.name, let.value.type)))
        return [self.span(group), *(self.array(int(t[1:])) for t in kept), loop("i", count, *lines)]

    def _value(self, node: Node, own: Mapping[int, tree.Expr], read: Read, lanes: int) -> tree.Expr:
        """Return what an elementwise node computes."""
        args = [own[a] if a in own else self.operand(a, read) for a in node.args]
        if node.op == "component":
            return self.component(node)
        if node.op == "take":
            return tree.Expr("take", tuple(args), tree.Type(node.type.dtype), node["table"])
        kind = node.get("dtype")
        return apply(node.op, *(splat(a, lanes) for a in args), value=kind)

    def component(self, node: Node) -> tree.Expr:
        """Return one component of another group's vector."""
        raise NotImplementedError

    def operand(self, index: int, read: Read) -> tree.Expr:
        """Return a constant, or what another group has computed."""
        node = self.program.nodes[index]
        return constant(node) if node.op == "constant" else read(index)

    def span(self, group: Sequence[int]) -> tree.Comment:
        """Return the comment above an elementwise group."""
        nodes = f"%{group[0]}" if len(group) == 1 else f"%{group[0]} to %{group[-1]}"
        return tree.Comment(f"{nodes}: elementwise on {self.program.nodes[group[0]].type.shape[0]} numbers")

    def mapped(self, index: int, node: Node) -> tree.Comment:
        """Return the comment above an affine map."""
        n_in = self.program.parameters[str(node["weight"])].shape[1]
        return tree.Comment(f"%{index}: affine map {node['weight']} from {n_in} to {node.type.shape[0]}")

    def offset(self, parameter: object) -> int:
        """Return the place of a parameter's first weight."""
        return self.slots[str(parameter)].offset

    # ---- the window --------------------------------------------------------------------------------------

    def column(self, row: tree.Expr, column: tree.Expr) -> list[tree.Let]:
        """Return the nearest column in the image to a tap's, and whether it is inside where that matters."""
        nearest = [tree.Let("column", clamp(column, WIDTH))]
        if self.gather.window.border == "clamp":
            return nearest
        same, along = apply("equal", name("row"), row), apply("equal", name("column"), column)
        return [*nearest, tree.Let("inside", same & along)]

    def pixel(self, image: Image, channel: tree.Expr | int | None = None) -> tree.Expr:
        """Return a channel, or all of them, at `row` and `column` under the border rule.

        No read leaves the image.
        """
        lanes = image.channels if channel is None else 1
        index = [] if lanes > 1 else [channel or 0]
        value = load(f"{IMAGE}{image.name}", name("row"), name("column"), *index, kind=tree.FLOAT.of(lanes))
        if self.gather.window.border == "clamp":
            return value
        return apply("select", name("inside", tree.BOOL), value, splat(const(0.0), lanes))

    def output_comment(self) -> tree.Comment:
        """Return the comment above the output."""
        return tree.Comment(f"output {self.program.outputs[0][0]}")

    def written(
        self, row: tree.Expr, column: tree.Expr, four: Callable[[int], tree.Expr]
    ) -> list[tree.Statement]:
        """Return the stores of a pixel's channels, of vectors of four."""
        places = ((row, column, const(c)) for c in range(output_channels(self.program)))
        return [tree.Store(RESULT, at, four(c // 4).lane(c % 4)) for c, at in enumerate(places)]


def clamp(value: tree.Expr, count: tree.Expr) -> tree.Expr:
    """Return the nearest index below `count`."""
    return tree.Expr("clamp", (value, const(0), count - 1), tree.INT)


def named(**sizes: Any) -> list[tree.Constant]:
    """Return named integers: values, or (value, comment)."""
    both = {key: size if isinstance(size, tuple) else (size, "") for key, size in sizes.items()}
    return [tree.Constant(key, expr(value), text) for key, (value, text) in both.items()]
