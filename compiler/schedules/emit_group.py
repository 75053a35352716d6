"""The grouped schedule, for graphics processors: a work group shares a tile of the image, an item its pixels.

1. The image is cut into tiles: a group of `width` x `height` items computes as many pixels, times `pixels`
   along the row. Item and pixel p are `p * width` columns apart, so that neighbours in a group read and write
   neighbours in memory at every step.
2. All that the group's windows touch, at most [`MOST_CHANNELS`] channels of one image at a time, is loaded
   once into memory that the group shares, channel by channel, under the border rule [`GroupBody._load`]; the
   loops over taps know no border.
3. The numbers of a layer are variables of four, one set a pixel: the emitter writes every statement out, no
   array is indexed by a variable, so that a compiler can keep all of them in registers
   [`LARGEST_NUMBERS`, `LARGEST_STATEMENTS`]. Only the loop over taps is a loop.
4. A weight is read once by an item for all its pixels, four neurons at a time, and all items of a group read
   the same one at the same moment: it is broadcast.
5. Elementwise operations are functions on four numbers.

No item ends before the others: those beyond the image's edge load, wait, compute, and store nothing.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..core.ir import Gather, Image, Node, Program
from ..languages.dialect import Dialect
from ..languages.interface import Interface
from ..languages.openings import Buffers
from .emit import kernel_gather
from .emit_inlined import InlinedBody
from .emit_tiled import Tiled, refused_by_vectors
from .schedules import PLAIN

MOST_CHANNELS = 4
"""Most channels of a tile: one of 64 x 8 pixels for windows of 12 x 12 then takes 23 KB, of the 32 KB that
OpenCL 1.2 (CL_DEVICE_LOCAL_MEM_SIZE) and OpenGL 4.3 (MAX_COMPUTE_SHARED_MEMORY_SIZE) promise."""

LARGEST_SHARED = 2**15
"""Most bytes of a tile where a dialect does not say less: what both standards promise."""

LARGEST_NUMBERS = 1024
"""Most numbers of a layer and the one before it, over an item's pixels: four times the registers that an item
has on graphics processors; beyond, a compiler spills more than it keeps."""

LARGEST_STATEMENTS = 2**15
"""Most products of four in straight code: more take drivers minutes to compile."""

ORDER = (
    "vectors filled up to multiples of 4 with zeros; matrices D_in x neurons; the rows of one that reads the "
    f"window go image by image, at most {MOST_CHANNELS} channels at a time, then tap by tap in rows, then "
    "channel by channel"
)
"""The order of the weights, in words."""


class GroupDialect(Dialect):
    """What a language adds: its vectors of four, how to `wait` for the group, how a pixel is read.

    `stored`: statements before and after those that store a pixel's numbers. `strided` opens a loop over a
    group's share of the tile, `largest_shared` is what a group may share, `first_weight` the name of the
    place of a tap's first weight; `local` and `group` are the texts of an item's place in its group, and of
    its group's. A language whose functions work on numbers only has its functions of vectors made of those
    [`Lifted`].
    """

    kind: str
    wait: str
    literal_zero: str
    pixel_at: str
    stored: tuple[tuple[str, ...], tuple[str, ...]] = ((), ())
    strided: str = "for (int {i} = {first}; {i} < {end}; {i} += {step}) {{"
    largest_shared: int = LARGEST_SHARED
    first_weight: str = "from"
    local: tuple[str, str]
    group: tuple[str, str]

    def item_place(self) -> list[str]:
        """Return the statements that declare where an item is in its group, and its first pixel."""
        inside = [self.cast("int32", text) for text in self.local]
        column, row = (self.cast("int32", text) for text in self.group)
        places = {
            "local_x": inside[0],
            "local_y": inside[1],
            "item": "local_y * GROUP_WIDTH + local_x",
            "x": f"{column} * (GROUP_WIDTH * PIXELS) + local_x",
            "y": f"{row} * GROUP_HEIGHT + local_y",
        }
        return [f"    {self.index(name, text)}" for name, text in places.items()]

    def vector(self, name: str, value: str) -> str:
        """Return the declaration of four numbers that may be added to."""
        return f"{self.kind} {name} = {value};"

    def truth(self, name: str, value: str) -> str:
        """Return the declaration of a boolean."""
        return f"bool {name} = {value};"

    def function(self, name: str, read: Sequence[str], body: Sequence[str], result: str) -> list[str]:
        """Return a function on vectors: `read` are the names of its operands, `result` that of its value."""
        operands = ", ".join(f"{self.kind} {each}" for each in read)
        return [f"{self.kind} {name}({operands})", "{", *_indented(body), f"    return {result};", "}"]


class BufferGroup(GroupDialect, Buffers):
    """A language whose arrays are buffers; it comes before the language's plain dialect.

    `shared_tile`, `weights_as_vectors`: declarations at the top of the function, where they are there.
    """

    shared_tile: str = ""
    weights_as_vectors: str = ""

    def opening(self, kernel: Interface) -> list[str]:
        """Return the first statements: what the group shares, and the item's place."""
        shared = [f"    {line}" for line in (self.shared_tile, self.weights_as_vectors) if line]
        variables = [*self.variables(kernel, self.early), *self.variables(kernel, self.late)]
        return [*shared, *variables, *self.item_place()]


class Lifted(GroupDialect):
    """A language whose functions work on numbers: one of vectors calls that of numbers for each component.

    `function_head`: a function's name and operands, `operand` each of these, `made` a vector of four numbers.
    """

    function_head: str
    operand: str
    made: str

    def function(self, name: str, read: Sequence[str], body: Sequence[str], result: str) -> list[str]:
        """Return the function of numbers, and that of vectors."""
        one, number = f"{name}_of_one", self.types["float32"]
        calls = [f"{one}({', '.join(f'{each}.{part}' for each in read)})" for part in "xyzw"]
        vector = self.made.format(values=", ".join(calls))
        return [
            self._head(one, read, number),
            "{",
            *_indented(body),
            f"    return {result};",
            "}",
            self._head(name, read, self.kind),
            "{",
            f"    return {vector};",
            "}",
        ]

    def _head(self, name: str, read: Sequence[str], kind: str) -> str:
        """Return the first line of a function."""
        operands = ", ".join(self.operand.format(kind=kind, name=each) for each in read)
        return self.function_head.format(kind=kind, name=name, operands=operands)


def _indented(lines: Sequence[str]) -> list[str]:
    """Return lines of a function's body."""
    return [f"    {line}" for line in lines]


class Grouped(Tiled):
    """A tile for each group of items `group` (x, y), `pixels` of a row for each item."""

    order = ORDER

    def __init__(
        self,
        name: str,
        idea: str,
        dialect: GroupDialect,
        pixels: int,
        group: tuple[int, int] = (16, 8),
        instead: str = PLAIN,
    ) -> None:
        super().__init__(name, idea, dialect, lanes=4, pixels=pixels, vectors=LARGEST_NUMBERS)
        self.words, self.group, self.instead = dialect, group, instead

    def called(self) -> Mapping[str, str]:
        """Return the numbers that the text about its arguments has."""
        return {**super().called(), "group": f"{self.group[0]} x {self.group[1]}"}

    def refusal(self, program: Program) -> str:
        """Return why this schedule cannot hold the program, or nothing."""
        if reason := refused_by_vectors(program, self.dialect) or self._shared_matrix(program):
            return reason
        if reason := self._beyond_tile(kernel_gather(program)):
            return reason
        if (numbers := self._numbers(program)) > LARGEST_NUMBERS:
            return (
                f"two layers of {self.pixels} pixels are {numbers} numbers, of at most {LARGEST_NUMBERS}: "
                "no registers hold them"
            )
        if (count := self._statements(program)) > LARGEST_STATEMENTS:
            return f"it unrolls to {count} products, of at most {LARGEST_STATEMENTS}: drivers take minutes"
        if (shared := self.shared_bytes(program)) > (most := self.words.largest_shared):
            return f"its tile takes {shared} bytes that a group shares, of at most {most}"
        return ""

    def _beyond_tile(self, gather: Gather) -> str:
        """Return why a tile cannot hold the images, or nothing."""
        if gather.joined or any(image.channels > MOST_CHANNELS for image in gather.images):
            return f"a tile holds {MOST_CHANNELS} channels at once, and one row of taps is one partial sum"
        return ""

    def planes(self, gather: Gather) -> int:
        """Return the most numbers of a pixel that are in the tile at once."""
        return max(last - first for _, first, last in chunks(gather))

    def shared_bytes(self, program: Program) -> int:
        """Return the bytes of the tile."""
        gather = kernel_gather(program)
        width = self.group[0] * self.pixels + gather.columns - 1
        return 4 * width * (self.group[1] + gather.rows - 1) * self.planes(gather)

    def private_bytes(self, program: Program) -> int:
        """Return the bytes of an item's variables that live from one statement to another."""
        body = self._body(program)
        return sum(16 * self.pixels * body.vectors(i) for i in body.group_of if body.declares(i))

    def details(self, program: Program) -> Mapping[str, Any]:
        """Return the size of a group and what it shares."""
        return {"group": list(self.group), "shared_bytes": self.shared_bytes(program)}

    def _numbers(self, program: Program) -> int:
        """Return the numbers of the widest two layers that meet in an affine map, over all pixels."""
        pairs = [(node, program.nodes[node.args[0]]) for node in program.nodes if node.op == "affine"]
        sizes = [n.type.shape[0] + (0 if s.op == "input" else s.type.shape[0]) for n, s in pairs]
        return self.pixels * max(sizes, default=0)

    def _statements(self, program: Program) -> int:
        """Return the number of products of four in straight code, over all pixels."""
        affine = [node for node in program.nodes if node.op == "affine"]
        rows = [self._rows_at_once(program, program.nodes[node.args[0]]) for node in affine]
        return sum(self.pixels * n * -(-a.type.shape[0] // 4) for a, n in zip(affine, rows, strict=True))

    def _rows_at_once(self, program: Program, source: Node) -> int:
        """Return the rows of weights in straight code, of a map that reads the window or a layer."""
        if source.op == "input":
            return max(image.channels for image in kernel_gather(program).images)
        return source.type.shape[0]

    def _window_rows(self, gather: Gather) -> NDArray[np.intp]:
        """Return the window's indices (n_inputs,) in the order of the loops."""
        starts = dict(zip((i.name for i in gather.images), _starts(gather), strict=True))
        taps = np.arange(gather.rows * gather.columns)[:, None] * gather.channels
        pieces = [
            (taps + starts[image.name] + np.arange(first, last)).ravel()
            for image, first, last in chunks(gather)
        ]
        return np.concatenate(pieces)

    def _body(self, program: Program) -> GroupBody:
        """Return the writer of the kernel's statements."""
        return GroupBody(program, self.dialect, kernel_gather(program), grouped=self)


def chunks(gather: Gather) -> Iterator[tuple[Image, int, int]]:
    """Yield each image with the first channel, and the one after the last, of what a tile holds of it."""
    for image in gather.images:
        for first in range(0, image.channels, MOST_CHANNELS):
            yield image, first, min(first + MOST_CHANNELS, image.channels)


def _starts(gather: Gather) -> list[int]:
    """Return the place of each image's first channel in a tap."""
    return [0, *np.cumsum([image.channels for image in gather.images])[:-1].tolist()]


@dataclass
class GroupBody(InlinedBody):
    """The statements of a grouped kernel; functions of elementwise groups come before it."""

    grouped: Grouped = field(kw_only=True)

    def __post_init__(self) -> None:
        super().__post_init__()
        self.words = self.grouped.words
        self.slots = self.grouped.layout(self.program)

    def defines(self) -> list[str]:
        """Return the sizes of group and tile, and the functions of elementwise groups."""
        grouped, names = self.grouped, self.sides
        self.functions = [
            line
            for group in self.groups
            if self.program.nodes[group[0]].op not in ("input", "affine")
            for result in self._results(group)
            for line in self._function_of(group, result)
        ]
        columns = f"(GROUP_WIDTH * PIXELS + {names.columns} - 1)"
        return [
            *self.integers(),
            self._define("GROUP_WIDTH", grouped.group[0], "items of a group along a row"),
            self._define("GROUP_HEIGHT", grouped.group[1]),
            self._define("PIXELS", grouped.pixels, "pixels of an item, GROUP_WIDTH columns apart"),
            self._define("TILE_WIDTH", columns, "all that windows touch"),
            self._define("TILE_HEIGHT", f"(GROUP_HEIGHT + {names.rows} - 1)"),
            self._define("PLANE", "(TILE_WIDTH * TILE_HEIGHT)", "numbers of a channel"),
            self._define("TILE_NUMBERS", f"(PLANE * {grouped.planes(self.gather)})"),
            *self.functions,
        ]

    def _define(self, name: str, value: object, text: str = "") -> str:
        """Return the line that names a number."""
        return self.dialect.define.format(name=name, value=value) + (f" /* {text} */" if text else "")

    def _function_of(self, group: tuple[int, ...], result: int) -> list[str]:
        """Return the function that computes one value of a group from other groups' vectors."""
        read = [self._element(index, "") for index in self._operands(group)]
        body = [
            self.dialect.let(
                self.program.nodes[index].type.dtype, f"t{index}", self._expression(index, ""), kept=True
            )
            for index in group
            if index <= result
        ]
        return self.words.function(f"elementwise_{result}", read, body, f"t{result}")

    def _elementwise(self, group: tuple[int, ...]) -> None:
        """Write the calls of a group's functions, one for each pixel and vector."""
        span = f"%{group[0]}" if len(group) == 1 else f"%{group[0]} to %{group[-1]}"
        self._comment(f"{span}: elementwise on {self.program.nodes[group[0]].type.shape[0]} numbers")
        for result in self._results(group):
            for p, vector in self._places(group[0]):
                operands = [self._at(index, p, vector) for index in self._operands(group)]
                name = f"v{result}_{p}_{vector}"
                self._line(self.words.vector(name, f"elementwise_{result}({', '.join(operands)})"))

    def _places(self, index: int) -> list[tuple[int, int]]:
        """Return all (pixel, vector) of a value."""
        return [(p, j) for p in range(self.grouped.pixels) for j in range(self.vectors(index))]

    def _at(self, index: int, p: int, vector: int) -> str:
        """Return the text of four numbers of a value at a pixel."""
        node = self.program.nodes[index]
        if node.op == "parameter":
            return self._numbers_at(str(node["name"]), vector)
        return f"v{index}_{p}_{vector}"

    def _numbers_at(self, name: str, vector: int) -> str:
        """Return the text of four numbers of a parameter that is a vector."""
        return f"w[{self.slots[name].offset // 4 + vector}]"

    def _affine(self, index: int, node: Node) -> None:
        """Write v = W x + b for all pixels."""
        weight, source = self.slots[str(node["weight"])], self.program.nodes[node.args[0]]
        n_in, bias = weight.shape[1], node.get("bias")
        self._comment(f"%{index}: affine map {node['weight']} from {n_in} to {node.type.shape[0]}")
        for p, j in self._places(index):
            start = self._numbers_at(str(bias), j) if bias else self.words.literal_zero
            self._line(self.words.vector(f"v{index}_{p}_{j}", start))
        first = weight.offset // 4
        if source.op == "input":
            for image, begin, end in chunks(self.gather):
                self._load([self._pixel_at(image, c) for c in range(begin, end)])
                self._products_of_taps(index, first, end - begin)
                first += self.gather.rows * self.gather.columns * (end - begin) * self.vectors(index)
            return
        for i in range(n_in):
            values = [f"v{node.args[0]}_{p}_{i // 4}.{'xyzw'[i % 4]}" for p in range(self.grouped.pixels)]
            self._multiply_by(index, str(first + i * self.vectors(index)), values, f"v{index}")

    def _prepare(self) -> None:
        """Write where the tile begins."""
        self._line(self.dialect.index("left", f"x - local_x - {self.sides.column}"))
        self._line(self.dialect.index("top", f"y - local_y - {self.sides.row}"))

    def _pixel_at(self, image: Image, channel: int) -> str:
        """Return the text of a channel under the border rule."""
        pixel = self.words.pixel_at.format(image=image.name, channels=image.channels, c=channel)
        inside = self.gather.window.border == "clamp"
        return pixel if inside else self.dialect.select("inside", pixel, "0.0f")

    def _load(self, numbers: Sequence[str]) -> None:
        """Write the copy of a pixel's numbers for all that the group's windows touch, by all its items."""
        border, index, clamp = self.gather.window.border, self.dialect.index, self.dialect.clamp
        self._line(self.words.wait)
        step = "GROUP_WIDTH * GROUP_HEIGHT"
        self._open(self.words.strided.format(i="i", first="item", end="PLANE", step=step))
        self._line(index("tile_row", "top + i / TILE_WIDTH"))
        self._line(index("tile_column", "left + i % TILE_WIDTH"))
        self._line(index("row", f"{clamp}(tile_row, 0, height - 1)"))
        self._line(index("column", f"{clamp}(tile_column, 0, width - 1)"))
        if border == "zero":
            self._line(self.words.truth("inside", "row == tile_row && column == tile_column"))
        for plane, value in enumerate(numbers):
            self._line(f"tile[{plane} * PLANE + i] = {value};")
        self._close()
        self._line(self.words.wait)

    def _products_of_taps(self, index: int, first: int, channels: int) -> None:
        """Write the products of the tile's taps with the weights from vector `first` on."""
        places = self._places(index)
        self._open(self.dialect.loop("dy", self.sides.rows))
        # A partial sum for each row of taps [sums.py].
        for p, j in places:
            self._line(self.words.vector(f"part_{p}_{j}", self.words.literal_zero))
        self._row_of_taps(index, first, channels, "part")
        for p, j in places:
            self._line(f"v{index}_{p}_{j} += part_{p}_{j};")
        self._close()

    def _row_of_taps(self, index: int, first: int, planes: int, sums: str) -> None:
        """Write the products of a row of taps, which are added to sums of this name."""
        step = planes * self.vectors(index)
        self._open(self.dialect.loop("dx", self.sides.columns))
        self._line(self.dialect.index("at", "(local_y + dy) * TILE_WIDTH + local_x + dx"))
        start = f"{first} + (dy * {self.sides.columns} + dx) * {step}"
        self._line(self.dialect.index(self.words.first_weight, start))
        for c in range(planes):
            names = [f"x{c}_{p}" for p in range(self.grouped.pixels)]
            for p, name in enumerate(names):
                self._line(self._from_tile(name, f"tile[{c} * PLANE + at + {p} * GROUP_WIDTH]"))
            first_of = f"{self.words.first_weight} + {c * self.vectors(index)}"
            self._multiply_by(index, first_of, names, sums)
        self._close()

    def _from_tile(self, name: str, value: str) -> str:
        """Return the declaration of what a tile holds at a place."""
        return self.dialect.single(name, value)

    def _multiply_by(self, index: int, first: str, values: Sequence[str], name: str) -> None:
        """Write the additions of a row of weights times each pixel's value, each weight read once."""
        for j in range(self.vectors(index)):
            sums = " ".join(f"{name}_{p}_{j} += m * {value};" for p, value in enumerate(values))
            self._line(f"{{ {self.words.vector('m', f'w[{first} + {j}]')} {sums} }}")

    def _outputs(self) -> None:
        """Write the only output of each pixel that lies in the image."""
        name, index = self.program.outputs[0]
        channels = self.program.nodes[index].type.shape[0]
        self._comment(f"output {name}")
        for p in range(self.grouped.pixels):
            self._open(f"if (x + {p} * GROUP_WIDTH < width && y < height) {{")
            for line in self._stores(index, p, channels):
                self._line(line)
            self._close()

    def _stores(self, index: int, p: int, channels: int) -> list[str]:
        """Return the statements that write one pixel: its numbers one by one."""
        store, (before, after) = self.dialect.store, self.words.stored
        values = [f"v{index}_{p}_{i // 4}.{'xyzw'[i % 4]}" for i in range(channels)]
        lines = [store.format(p=p, channels=channels, i=i, value=value) for i, value in enumerate(values)]
        return [*before, *lines, *(line.format(p=p) for line in after)]
