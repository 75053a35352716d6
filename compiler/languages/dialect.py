"""What a target's language looks like: words, and a table of operations; no decisions.

A dialect is all that the emitters know of a language, for every role of a kernel:

1. Statements are made by methods [`Dialect.memory`, `Dialect.for_loop`, ...] and by templates of one line.
   Names in braces: `image` and `channels` of a feature image, `index` into the weights, `i` and `value` of an
   output channel and `result` its array, `0`, `1`, `2` the operands of an operation, `type` the type of its
   result, `table` the name of its table, `name`, `count` and `values` of a table's declaration. An
   operation's template may differ for a kind of operand: `minimum.int32`. The text between is the language's
   own, its braces doubled. Arrays of other kernels than denoisers are accessed by a pair of methods
   [`Dialect.read`, `Dialect.written`].
2. A kernel opens with what it is bound to [`Dialect.begin`]: each binding style declares an interface
   [interface.py] in its own way [openings.py for buffers, glsl.py for textures], and ends with [`ends`].
"""

from __future__ import annotations

import re
import textwrap
from collections.abc import Mapping, Sequence
from copy import copy
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..core.profiles import SineContract
from ..kernel.interface import (
    BOTH,
    BUFFER,
    DENOISE,
    ENCODE,
    FOLLOW,
    GUIDE,
    INTEGERS,
    PATH,
    SMOOTH,
    TRAIN,
    Array,
    Interface,
)
from ..kernel.kernel import Kernel, Launch, Type
from ..kernel.sizes import integer

BATCHES = (
    "The last arrays are the manifest's `memory`: so many numbers of a tile each. Tiles of {columns} x\n"
    "{rows} pixels lie in rows from the top; a batch is tile_count of them from first_tile on, a multiple\n"
    "of `items` times the most `tiles` of an item. For each batch start tile_count / tiles x lines items\n"
    "of each of the `launches`, in groups of `items` x 1, in order and with barriers between"
)
"""How several launches are started."""

STAGED = f"Compile the text once for each launch, STAGE defined as its number.\n{BATCHES}"
"""The same where each of them is a program by itself."""

LAUNCHED = f"Each launch is an entry point whose name ends with its number.\n{BATCHES}"
"""The same where they are functions."""

NOTHING: Mapping[str, str] = {}
"""No text for any name."""

LONG_TABLE, TABLE_ROW = 200, 8
"""Length above which a constant table is written in rows, and the numbers of a row."""


class Dialect:
    """One language; a subclass sets every attribute that has no value here.

    `unordered`: lines for a compiler that may reorder operations, without a bound and with one.
    `assumes`: what a bound rests on that the language does not promise.
    `first`: lines before any comment. `home`: where weights are [interface.py]. More channels than
    `channels_per_result` go into several results; `indexes_results`: a variable may choose a result's
    channel. A path kernel has `path_lanes` paths at once where the target's compiler chooses their number,
    which `at_once` describes; it takes `most_numbers` of a scene. `paints`:
    it may write encoded images in place of sums. `helpers`: functions that operations on vectors call.
    `scalars`: the types of single numbers. `one_type`: what is read as vectors is not read as numbers.
    `staged`: a launch is a program, which is compiled if STAGE is its number; `declares_memory`: what
    launches of a denoiser hand on are arrays like others. `is_listing`: programs
    are printed, not kernels. `numbers` makes the address of a vector that of its first number. `mixed`: of an
    array of vectors whose components are read by their own index too the declaration, an element, and an
    element's address, and `mixed_number` such a component; `linkage` is before the type of a function,
    `place_type` that of places.
    """

    target: str
    language: str
    suffix: str
    entries: Mapping[str, str] = {
        **{role: f"wamnet_{role}" for role in (DENOISE, ENCODE, GUIDE, SMOOTH, FOLLOW, TRAIN)},
        PATH: "wamnet_trace",
    }
    integers: Mapping[str, tuple[str, ...]] = INTEGERS
    ends: Mapping[str, str] = dict.fromkeys(INTEGERS, "}")
    home: str = BUFFER
    pixel: str
    weight: str
    store: str
    max_output_channels: int
    channels_per_result: int | None = None
    indexes_results: bool = True
    native_sine: SineContract
    unordered: tuple[str, str] = ("", "")
    assumes: str = ""
    first: tuple[str, ...] = ()
    define: str = "#define {name} {value}"
    clamp: str = "clamp"
    scalars: Mapping[str, str] = {"float32": "float", "int32": "int", "uint32": "uint", "bool": "bool"}
    byte: str = "uchar"
    place_type: str = "int"
    vector_kinds: Mapping[str, str] = {
        "float32": "float{lanes}", "int32": "int{lanes}", "uint32": "uint{lanes}", "bool": "bool{lanes}",
    }  # fmt: skip
    let: str = "{kind} {name} = {value};"
    loop: str = "for (int {name} = {start}; {name} < {end}; {turn}) {{"
    turn: str = "++{name}"
    linkage: str = ""
    mixed: tuple[str, str, str] = ("{kind} {name}[{count}];", "{name}[{index}]", "{name} + {index}")
    mixed_number: str = "{name}[({index}) / 4][({index}) % 4]"
    qualifiers: Mapping[str, str] = {}
    table: str
    at_once: str = ""
    path_lanes: int = 0
    helpers: Mapping[str, str] = {}
    most_numbers: int = 2**16
    max_planes: int = 2**16
    max_images: int = 2**16
    paints: bool = False
    unroll: str = ""
    casts: bool = False
    numbered: bool = False
    dot_of_bytes: str = ""
    instructions: str = ""
    own: str = ""
    tiles: tuple[int, ...] = (4,)
    words: str = ""
    wide: bool = True
    one_type: bool = False
    calls_vectors: bool = False
    vector_operations: Mapping[str, str] = {}
    weight_vector: str = "w[{index}]"
    wait: str = ""
    texel: str = ""
    row_reader: str = ""
    pixel_begin: tuple[str, ...] = ()
    pixel_end: tuple[str, ...] = ()
    shared_array: str = ""
    group: tuple[int, int] | None = None
    largest_shared: int = 2**15
    grouped: Mapping[str, Any] = {}
    staged: bool = False
    numbers: str = ""
    launching: Mapping[str, Any] = {}
    vectors: Type | None = None
    launches: tuple[str, str] = ("", "")
    declares_memory: bool = False
    is_listing: bool = False
    local_place: tuple[str, str] = ("", "")
    group_place: tuple[str, str] = ("", "")
    operations: Mapping[str, str] = {
        "add": "{0} + {1}",
        "subtract": "{0} - {1}",
        "multiply": "{0} * {1}",
        "divide": "{0} / {1}",
        "negative": "-{0}",
        "absolute": "abs({0})",
        "minimum": "min({0}, {1})",
        "maximum": "max({0}, {1})",
        "floor": "floor({0})",
        "sqrt": "sqrt({0})",
        "power": "pow({0}, {1})",
        "exp": "exp({0})",
        "sin": "sin({0})",
        "cos": "cos({0})",
        "reciprocal": "1.0f / {0}",
        "less": "{0} < {1}",
        "less_equal": "{0} <= {1}",
        "greater": "{0} > {1}",
        "greater_equal": "{0} >= {1}",
        "equal": "{0} == {1}",
        "not_equal": "{0} != {1}",
        "logical_and": "{0} && {1}",
        "logical_or": "{0} || {1}",
        "logical_not": "!{0}",
        "bitwise_and": "{0} & {1}",
        "bitwise_xor": "{0} ^ {1}",
        "right_shift": "{0} >> {1}",
        "remainder": "{0} % {1}",
        "take": "{table}[{0}]",
        "select": "{0} ? {1} : {2}",
        "convert": "{type}({0})",
        "any": "{0}",
    }

    def begin(self, kernel: Kernel, top: str, bounded: bool) -> str:
        """Return the text of a kernel up to its first statement.

        `top`: definitions and constant tables; `bounded`: an error bound is stated, and the language must
        keep the order of operations.
        """
        raise NotImplementedError

    def placed(self, home: str, weight: str) -> Dialect:
        """Return the dialect of a target whose weights are elsewhere."""
        found = copy(self)
        vars(found).update(target=f"{self.target}:{home}", home=home, weight=weight)
        return found

    def cast(self, dtype: str, text: str) -> str:
        """Return the text of a number converted to another kind."""
        return f"{self.scalars[dtype]}({text})"

    def finished(self, text: str) -> str:
        """Return the whole text of a kernel, without what may not be left behind."""
        return text

    def apart(self, source: str, part: str) -> str:
        """Return a kernel whose names are those of no other part of its denoiser, if a host joins them."""
        return source

    def integer(self, kernel: Interface, name: str) -> str:
        """Return the text of an integer that the kernel is given."""
        return name

    # ---- words of kernels as data [renderer.py] ------------------------------------------------------------

    def arguments(
        self, kernel: Kernel, lists: Mapping[str, Sequence[str]] = NOTHING, notes: Mapping[str, str] = NOTHING
    ) -> str:
        """Return how a kernel is called: what its arguments are, and how many items are started.

        `lists`: what the planes or columns of arrays are; `notes`: what else callers must know of arguments.
        """
        interface = kernel.interface
        numbers = interface.numbers() if self.numbered else {}
        said = [f"0 32-bit integers: {', '.join(interface.integers)}"] if self.numbered else []
        for array in interface.by_number() if self.numbered else interface.arrays:
            if array.shape == (0,) or (interface.role == DENOISE and array.access == BOTH):
                continue
            number = f"{numbers[array.name]} " if self.numbered else ""
            note = f", {notes[array.name]}" if array.name in notes else ""
            listed = "\n".join(textwrap.wrap(", ".join(lists.get(array.name, ())), 98))
            about = textwrap.fill(f"{number}{self.about(array)}{note}", 98)
            said.append(f"{about}:\n{listed}" if listed else about)
        names = [name for name in interface.integers if name in notes or not self.numbered]
        said.append("; ".join(f"{n}: {notes[n]}" if n in notes else n for n in names))
        return ";\n".join(filter(None, said)) + f".\n{self.launch(kernel)}"

    def about(self, array: Array) -> str:
        """Return what an array is that a kernel is given, by its name."""
        raise NotImplementedError

    def launch(self, kernel: Kernel) -> str:
        """Return how many items of such a kernel are started."""
        columns, rows = (integer(kernel, each) for each in kernel.step)
        said, grouped = self.launches
        if kernel.launches:
            said = STAGED if self.staged else LAUNCHED
        elif kernel.group:
            said = grouped.replace("{group}", " x ".join(map(str, kernel.group)))
        said = re.sub(r"\(1 \* (\w+)\)", r"\1", said.format(columns=columns, rows=rows))
        said = re.sub(r"ceil\((width|height) / 1\)", r"\1", said)
        if kernel.interface.role != PATH:
            return said
        followed = f"item (i, j) follows the pixels from {columns} * i on of row first_row + j"
        return f"{said.replace('height', 'rows')}; {followed}"

    def read(self, array: Array, index: Sequence[str], lanes: int) -> str:
        """Return an element of an array that a kernel is given, or several of a row [`row_reader`]."""
        raise NotImplementedError

    def written(self, array: Array, index: Sequence[str], value: str, lanes: int) -> str:
        """Return the statement that writes such elements."""
        return f"{self.read(array, index, 1)} = {value};"

    def fitted(self, kernel: Kernel) -> Dialect:
        """Return the dialect for a kernel: with other words where it has work groups."""
        found = copy(self)
        words = self.grouped if kernel.group else self.launching if kernel.launches else {}
        vars(found).update(words, vectors=kernel.weights)
        if kernel.weights.dtype == "int32":
            found.first = (*self.first, *self.extensions)
        return found

    extensions: tuple[str, ...] = ()

    def group_memory(self, kernel: Kernel) -> list[str]:
        """Return the declarations of memory that a group shares."""
        found = []
        for array in kernel.shared:
            (size,) = array.sizes
            count = size if isinstance(size, int) else size.value
            kind = self.scalars[array.type.dtype]
            found.append(self.shared_array.format(kind=kind, name=array.name, count=count))
        return found

    def launched(self, kernel: Kernel, launch: Launch, counts: Sequence[str]) -> list[str]:
        """Return the first lines of a launch, of a grid of so many columns and rows of items."""
        raise NotImplementedError

    def launch_entry(self, number: int) -> str:
        """Return the entry point of one of several launches."""
        entry = self.entries[DENOISE]
        return entry if self.staged else f"{entry}_{number}"

    def item_place(self) -> list[str]:
        """Return the declarations of where an item is in its group, and of its first pixel."""
        inside = [self.cast("int32", text) for text in self.local_place]
        column, row = (self.cast("int32", text) for text in self.group_place)
        places = {
            "local_x": inside[0],
            "local_y": inside[1],
            "item": "local_y * GROUP_WIDTH + local_x",
            "x": f"{column} * (GROUP_WIDTH * PIXELS) + local_x",
            "y": f"{row} * GROUP_HEIGHT + local_y",
        }
        return [f"    {self.index(name, text)}" for name, text in places.items()]

    def vector_kind(self, dtype: str, lanes: int) -> str:
        """Return the name of a vector type."""
        return self.vector_kinds[dtype].format(lanes=lanes)

    def vector_of(self, kind: str, values: Sequence[str]) -> str:
        """Return a vector of values, or of one in all lanes."""
        return f"{kind}({', '.join(values)})"

    def function_head(self, name: str, takes: Sequence[tuple[str, str]], result: str) -> str:
        """Return the first lines of a function of values."""
        return f"{self.linkage}{result} {name}({', '.join(f'{kind} {each}' for each, kind in takes)})\n{{"

    def component(self, lane: int, lanes: int) -> str:
        """Return the name of a component of a vector."""
        return "xyzw"[lane]

    def transform_head(self, name: str, kind: str) -> str:
        """Return the first lines of a transform: `from` in steps of `step`, `to` in those of `leap`."""
        return f"{self.linkage}void {self.own}{name}(const {kind} *from, int step, {kind} *to, int leap)\n{{"

    def memory(self, kind: str, name: str, sizes: Sequence[str], value: str = "") -> str:
        """Return the declaration of an array, or of a variable."""
        return f"{kind} {name}{''.join(f'[{size}]' for size in sizes)}{f' = {value}' if value else ''};"

    def for_loop(self, name: str, start: str, end: str, step: str) -> str:
        """Return the line that opens a loop."""
        turn = self.turn.format(name=name) if step == "1" else f"{name} += {step}"
        return self.loop.format(name=name, start=start, end=end, turn=turn)

    def index(self, name: str, value: str) -> str:
        """Return the declaration of a place in an image or a window."""
        return self.let.format(kind=self.place_type, name=name, value=value)

    def number(self, value: Any, dtype: str) -> str:
        """Return the text of a number of the given kind."""
        if dtype == "float32":
            return self.literal(float(value))
        if dtype == "bool":
            return "true" if value else "false"
        text = f"{int(value)}{'u' if dtype == 'uint32' else ''}"
        return f"({text})" if text.startswith("-") else text

    def table_declaration(self, name: str, array: NDArray[Any]) -> str:
        """Return the declaration of a constant table."""
        dtype = str(array.dtype)
        texts = [self.number(value, dtype) for value in array]
        values = ", ".join(texts)
        if len(texts) > LONG_TABLE:
            rows = (", ".join(texts[i : i + TABLE_ROW]) for i in range(0, len(texts), TABLE_ROW))
            values = "\n    " + ",\n    ".join(rows)
        return self.table.format(type=self.scalars[dtype], name=name, count=len(array), values=values)

    @staticmethod
    def literal(value: float) -> str:
        """Return a float32 constant: nine digits name it, also for a reader that goes through double."""
        digits = f"{float(np.float32(value)):.9g}"
        text = digits + ("f" if "." in digits or "e" in digits else ".0f")
        return f"({text})" if text.startswith("-") else text
