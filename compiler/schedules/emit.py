"""From a program to the text of a kernel, for any dialect, with the plain schedule.

1. Nodes are grouped in their order [`schedule`]: neighbouring elementwise nodes of one shape share a loop, an
   affine node is a loop nest of its own.
2. An affine node that reads the window accumulates straight from the images, a partial sum for each row of
   taps of an image [sums.py]; the window vector exists only if something else reads it [`_over_window`].
3. A value that another group reads is an array `v<number>`; a number, or a value that only its own loop
   reads, is a variable `t<number>`; numbers are those of the printed program.

The language's own words come from the dialect's templates; nothing here asks which language it is.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from ...refimpl.errors import CompileError
from ..core.ir import Gather, Image, Node, Program, users
from ..core.lines import Lines
from ..core.ops import LOOPS, OPS
from ..core.sums import is_split
from ..core.weights import layout, pack, tables
from ..languages import interface
from ..languages.dialect import Dialect, Parts
from ..languages.interface import Interface


@dataclass(frozen=True)
class Sides:
    """What a kernel calls the rows and columns of its window, and the place of the pixel itself in it."""

    rows: str
    columns: str
    row: str
    column: str


SQUARE = Sides("WINDOW_SIZE", "WINDOW_SIZE", "WINDOW_CENTRE", "WINDOW_CENTRE")
"""The names in a kernel whose window is as high as wide."""

OBLONG = Sides("WINDOW_ROWS", "WINDOW_COLUMNS", "CENTRE_ROW", "CENTRE_COLUMN")
"""The names in a kernel whose window reaches along one axis."""


def sides(gather: Gather) -> Sides:
    """Return the names of a kernel's window."""
    return SQUARE if gather.axes == (0, 1) else OBLONG


def _window_defines(gather: Gather, dialect: Dialect) -> list[str]:
    """Return the lines that give the window's names their values."""
    names, pixel = sides(gather), "/* the tap that lies on the pixel itself */"
    # The rows and columns of a square window share their names.
    values = {names.rows: gather.rows, names.columns: gather.columns}
    values |= {names.row: gather.rows // 2, names.column: gather.columns // 2}
    lines = {name: dialect.define.format(name=name, value=value) for name, value in values.items()}
    lines[names.row] += f" {pixel}"
    return list(lines.values())


def emit(
    program: Program, dialect: Dialect, header: Sequence[str], bounded: bool, body: Body | None = None
) -> str:
    """Return the kernel's source; `header` are the lines of the comment at its top.

    `bounded`: an error bound is stated, and the language must keep the order of operations that it rests on.
    `body`: another schedule's.
    """
    gather = kernel_gather(program)
    _check_channels(program, dialect)
    body = body or Body(program, dialect, gather)
    defines = [*_window_defines(gather, dialect), *body.defines()]
    declared = [dialect.table_declaration(name, array) for name, array in tables(program).items()]
    packed = pack(program)
    if dialect.home == interface.TABLE:
        declared.append(dialect.table_declaration(interface.WEIGHTS, packed))
    kernel = interface.denoiser(
        gather.images,
        packed.size,
        output_channels(program),
        dialect.home,
        dialect.integers[interface.DENOISE],
    )
    parts = Parts(top="\n".join([*defines, *declared]), bounded=bounded)
    return framed(dialect, kernel, parts, header, body.text())


def framed(
    dialect: Dialect, kernel: Interface, parts: Parts, header: Sequence[str], lines: Sequence[str]
) -> str:
    """Return a kernel's source: a comment, what the kernel is bound to, its statements, its end."""
    comment = ["/*", *(f" * {line}".rstrip() for line in header), " */"]
    begin, end = dialect.begin(kernel, parts), dialect.ends[kernel.role]
    return dialect.finished("\n".join([*dialect.first, *comment, begin, *lines, end])) + "\n"


def private_bytes(program: Program) -> int:
    """Return the bytes of the arrays that a kernel declares for each pixel."""
    body = Body(program, Dialect(), kernel_gather(program))
    parts = [index for index in _split(program) if index in body.group_of]
    arrays = [*filter(body.declares, body.group_of), *parts]
    return sum(4 * program.nodes[index].type.shape[0] for index in arrays)


def _split(program: Program) -> list[int]:
    """Return the indices of the affine maps that add up partial sums over the window [sums.py]."""
    nodes = program.nodes
    found = [i for i, node in enumerate(nodes) if node.op == "affine" and nodes[node.args[0]].op == "input"]
    return found if is_split(kernel_gather(program)) else []


def kernel_gather(program: Program) -> Gather:
    """Return how the window is filled, or refuse a program that this skeleton cannot hold."""
    if program.gather is None or len(program.outputs) != 1:
        raise CompileError(
            f"the program has {len(program.outputs)} outputs and {'a' if program.gather else 'no'} gathered "
            "window: a kernel needs one output and a window; lower a model, or trace with a Gather"
        )
    if any(node.op in LOOPS for node in program.nodes):
        raise CompileError(
            "the program has a loop over the rows of tables, which this skeleton does not hold: trace it "
            "without `most_unrolled`"
        )
    return program.gather


def _check_channels(program: Program, dialect: Dialect) -> None:
    """Refuse an output that the language cannot write at once."""
    kind = program.nodes[program.outputs[0][1]].type
    if kind.dtype != "float32":
        raise CompileError(f"the output has type {kind}: a kernel writes float32; convert it with astype")
    channels = output_channels(program)
    if channels > dialect.max_output_channels:
        raise CompileError(
            f"the output has {channels} channels: {dialect.language} writes at most "
            f"{dialect.max_output_channels}; compile for another target"
        )


def output_channels(program: Program) -> int:
    """Return the number of channels of the only output."""
    shape = program.nodes[program.outputs[0][1]].type.shape
    return shape[0] if shape else 1


def schedule(program: Program) -> list[tuple[int, ...]]:
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


def _plus(*terms: str | int) -> str:
    """Return the text of a sum, without terms that are 0."""
    return " + ".join(str(term) for term in terms if term != 0)


@dataclass
class Body(Lines):
    """The statements of one kernel; other schedules override how values are kept and affine maps computed."""

    program: Program
    dialect: Dialect
    gather: Gather
    lines: list[str] = field(default_factory=list)
    depth: int = 1

    def __post_init__(self) -> None:
        self.groups = schedule(self.program)
        self.slots = layout(self.program)
        self.readers = users(self.program)
        self.sides = sides(self.gather)
        self.group_of = {index: number for number, group in enumerate(self.groups) for index in group}

    def defines(self) -> list[str]:
        """Return the lines below the window's."""
        return []

    def integers(self) -> tuple[str, ...]:
        """Return the lines that integers in vectors need, if there are any."""
        kinds = {node.type.dtype for node in self.program.nodes if node.type.shape}
        return self.dialect.integers_top if kinds & {"int32", "uint32"} else ()

    def text(self) -> list[str]:
        """Return the lines between the kernel's braces."""
        self._prepare()
        for group in self.groups:
            self._group(group)
        self._outputs()
        return self.lines

    def _prepare(self) -> None:
        """Write the lines before the first value."""

    # ---- groups ------------------------------------------------------------------------------------------

    def _group(self, group: tuple[int, ...]) -> None:
        """Write one group: a window, an affine map, a stack, or elementwise operations."""
        node = self.program.nodes[group[0]]
        if node.op == "input":
            if self._is_array(group[0]):
                self._materialised(group[0])
        elif node.op == "affine":
            self._affine(group[0], node)
        elif node.op == "stack":
            self._declare(group[0], f"%{group[0]}: {len(node.args)} numbers side by side")
            for i, arg in enumerate(node.args):
                self._line(f"v{group[0]}[{i}] = {self._read(arg, '')};")
        else:
            self._elementwise(group)

    def _materialised(self, index: int) -> None:
        """Write the window into an array."""
        self._declare(index, f"%{index}: the window")
        self._over_window(lambda tap: [f"v{index}[{tap}] = value;"])

    def _affine(self, index: int, node: Node) -> None:
        """Write v = W x + b, x being the images around the pixel or an array."""
        weight, n_out = self.slots[str(node["weight"])], node.type.shape[0]
        n_in, source = weight.shape[0], self.program.nodes[node.args[0]]
        self._declare(index, f"%{index}: affine map {node['weight']} from {n_in} to {n_out}")
        bias = node.get("bias")
        start = self._weight(_plus(self.slots[str(bias)].offset, "j")) if bias else "0.0f"
        neurons = self.dialect.loop("j", n_out)
        self._nest([neurons], [f"v{index}[j] = {start};"])
        if source.op == "input":
            sums, zero, add = f"v{index}", [], []
            if is_split(self.gather):
                sums = f"part{index}"
                zero, add = [f"{sums}[j] = 0.0f;"], [f"v{index}[j] += {sums}[j];"]
                self._line(self.dialect.array("float32", sums, n_out, kept=True))
            self._over_window(
                lambda tap: self._accumulate(sums, neurons, _plus(weight.offset, f"({tap}) * {n_out}", "j")),
                lambda: self._nest([neurons] if zero else [], zero),
                lambda: self._nest([neurons] if add else [], add),
            )
        else:
            inner = self._accumulate(f"v{index}", neurons, _plus(weight.offset, f"i * {n_out}", "j"))
            value = self.dialect.let("float32", "value", self._read(node.args[0], "i"))
            self._nest([self.dialect.loop("i", n_in)], [value, *inner])

    def _accumulate(self, sums: str, neurons: str, weight: str) -> list[str]:
        """Return the loop that adds `value` times one row of weights to all neurons' sums."""
        return [neurons, f"    {sums}[j] += {self._weight(weight)} * value;", "}"]

    def _elementwise(self, group: tuple[int, ...]) -> None:
        """Write the operations of a group, in a loop when they work on vectors."""
        shape = self.program.nodes[group[0]].type.shape
        lane = "i" if shape else ""
        span = f"%{group[0]}" if len(group) == 1 else f"%{group[0]} to %{group[-1]}"
        if shape:
            self._comment(f"{span}: elementwise on {shape[0]} numbers")
            for index in filter(self._is_array, group):
                self._line(self._declaration(index))
        statements = []
        for index in group:
            if self._fuses(index):
                continue
            kind, text = self.program.nodes[index].type.dtype, self._expression(index, lane)
            statements.append(self.dialect.let(kind, f"t{index}", text, kept=True))
            if shape and self._is_array(index):
                statements.append(f"{self._element(index, 'i')} = t{index};")
        self._nest([self.dialect.loop("i", self._count(shape[0]))] if shape else [], statements)

    def _expression(self, index: int, lane: str) -> str:
        """Return the right side of an elementwise node or a component."""
        node = self.program.nodes[index]
        if node.op == "component":
            return self._read(node.args[0], str(node["index"]))
        operands = [self._read(arg, lane, self.group_of[index]) for arg in node.args]
        return self.dialect.expression(node, self.program.nodes[node.args[-1]].type.dtype, operands)

    def _fuses(self, index: int) -> bool:
        """Return whether a value has no name: its text is part of the only expression that reads it."""
        return False

    def _outputs(self) -> None:
        """Write the only output to the result."""
        index = self.program.outputs[0][1]
        channels = output_channels(self.program)
        self._comment(f"output {self.program.outputs[0][0]}")
        store, results = self.dialect.store, self.dialect.results(channels)
        if not self.program.nodes[index].type.shape:
            value = self._read(index, "")
            self._line(store.format(result=results[0], channels=1, i="0", value=value))
            return
        each = self.dialect.channels_per_result or channels
        for first, result in zip(range(0, channels, each), results, strict=True):
            count = min(each, channels - first)
            if self.dialect.indexes_results:
                value = self._read(index, _plus(first, "i"))
                line = store.format(result=result, channels=channels, i="i", value=value)
                self._nest([self.dialect.loop("i", count)], [line])
                continue
            for i in range(count):
                value = self._read(index, str(first + i))
                self._line(store.format(result=result, channels=channels, i=i, value=value))

    # ---- the window --------------------------------------------------------------------------------------

    def _over_window(
        self,
        body: Callable[[str], list[str]],
        before: Callable[[], None] = lambda: None,
        after: Callable[[], None] = lambda: None,
    ) -> None:
        """Write the loops over images, rows of taps, taps and channels that set `value`.

        `body` takes the index into the window; `before` and `after` write the lines around an image's row.
        """
        dialect, names = self.dialect, self.sides
        row = f"{dialect.clamp}(y + dy - {names.row}, 0, height - 1)"
        column = f"{dialect.clamp}(x + dx - {names.column}, 0, width - 1)"
        for group in self.gather.groups:
            self._open(dialect.loop("dy", names.rows))
            self._line(dialect.index("row", row))
            before()
            self._open(dialect.loop("dx", names.columns))
            self._line(dialect.index("column", column))
            if self.gather.window.border == "zero":
                self._line(dialect.let("bool", "inside", self._inside()))
            tap = f"(dy * {names.columns} + dx) * {self.gather.channels}"
            self._line(dialect.index("tap", tap))
            for image, first in group:
                self._channels(image, body(_plus("tap", first, "c")))
            self._close()
            after()
            self._close()

    def _inside(self) -> str:
        """Return the text of whether a tap lies in the image; `row` and `column` are clamped."""
        names = self.sides
        return f"row == y + dy - {names.row} && column == x + dx - {names.column}"

    def _bordered(self, pixel: str) -> str:
        """Return the text of a tap's number under the border rule; no read leaves the image."""
        zero = self.gather.window.border == "zero"
        return self.dialect.select("inside", pixel, "0.0f") if zero else pixel

    def _channels(self, image: Image, lines: list[str]) -> None:
        """Write the loop over an image's channels at a tap."""
        dialect = self.dialect
        pixel = dialect.pixel.format(image=image.name, channels=image.channels)
        value = self._bordered(pixel)
        declared = dialect.let("float32", "value", value)
        self._nest([dialect.loop("c", image.channels)], [declared, *lines])

    # ---- values ------------------------------------------------------------------------------------------

    def _read(self, index: int, lane: str, group: int | None = None) -> str:
        """Return the text of component `lane` of a value ('' for a number), read inside `group`."""
        node = self.program.nodes[index]
        if node.op == "constant":
            return self.dialect.constant(node)
        if node.op == "parameter":
            return self._weight(_plus(self.slots[str(node["name"])].offset, lane))
        if not node.type.shape or self.group_of[index] == group:
            return self._expression(index, lane) if self._fuses(index) else f"t{index}"
        return self._element(index, lane)

    def _element(self, index: int, lane: str) -> str:
        """Return the text of an element of the array of a value."""
        return f"v{index}[{lane}]"

    def _count(self, numbers: int) -> str:
        """Return the text of the number of elements in the array of a vector of `numbers`."""
        return str(numbers)

    def _declaration(self, index: int) -> str:
        """Return the declaration of the array of a value."""
        node = self.program.nodes[index]
        return self.dialect.array(node.type.dtype, f"v{index}", node.type.shape[0])

    def declares(self, index: int) -> bool:
        """Return whether the kernel has an array for this value."""
        node = self.program.nodes[index]
        return bool(node.type.shape) and (node.op in ("affine", "stack") or self._is_array(index))

    def _is_array(self, index: int) -> bool:
        """Return whether something outside the node's own loop reads this vector component by component."""
        node = self.program.nodes[index]
        readers = [r for r in self.readers[index] if self.group_of[r] != self.group_of[index]]
        if node.op == "input":
            readers = [r for r in readers if self.program.nodes[r].op != "affine"]
        return bool(readers) or any(index == output for _, output in self.program.outputs)

    def _weight(self, index: str) -> str:
        """Return the text of one weight."""
        return self.dialect.weight.format(index=index)

    # ---- lines -------------------------------------------------------------------------------------------

    def _declare(self, index: int, comment: str) -> None:
        """Write a comment and the declaration of an array."""
        self._comment(comment)
        self._line(self._declaration(index))

    def _nest(self, loops: Sequence[str], body: Sequence[str]) -> None:
        """Write loops around a body whose lines carry their own further indentation."""
        for loop in loops:
            self._open(loop)
        for line in body:
            self._line(line)
        for _ in loops:
            self._close()
