"""From a kernel to its source: one walk over the IR for all languages, with the words of a dialect.

1. Expressions have as few parentheses as the order of operations needs [`Renderer.text`]; a dialect's
   template of an operation says how strongly it binds.
2. Images, weights and the result are where a language has them: buffers, textures, tables [`Renderer._load`,
   `Renderer._store`].
3. Statements are printed one by one [`Renderer.statement`]; only the layout of vectors in memory needs a look
   at the whole kernel: an array of vectors that is also read by components [`Renderer.mixed`].
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..kernel import kernel as tree
from ..kernel.interface import (
    DENOISE,
    IMAGE,
    PATH,
    READ,
    RESULT,
    TABLE,
    TRAIN,
    WEIGHTS,
    Interface,
)
from ..kernel.interface import Array as Memory
from ..kernel.sizes import handed_on
from .dialect import Dialect

BINDING: Mapping[str, int] = {
    "||": 2, "&&": 3, "|": 4, "^": 5, "&": 6, "==": 7, "!=": 7, "<": 8, "<=": 8, ">": 8, ">=": 8,
    "<<": 9, ">>": 9, "+": 10, "-": 10, "*": 11, "/": 11, "%": 11,
}  # fmt: skip
"""How strongly operators bind, as in C."""

CHOICE, UNARY, ATOM = 1, 12, 13
"""The same of `a ? b : c`, of operators of one operand, and of what needs no parentheses."""

INFIX = re.compile(r"^\{\d\} (\S+) \{\d\}$|^1\.0f (/) \{0\}$")
"""A template of an operator of two operands."""

SIMPLE = re.compile(r"[^([]*[([](\{\d\})(, \{\w+\})*[)\]]")
"""A template of a function or a table whose arguments stand alone."""


def binding(template: str) -> int:
    """Return how strongly a template binds."""
    if found := INFIX.match(template):
        return BINDING[found[1] or found[2]]
    if " ? " in template and not template.endswith(")"):
        return CHOICE
    return UNARY if template[0] in "-!" else ATOM


NO_WEIGHTS = np.zeros(0, np.float32)
"""The weights of a kernel that is no denoiser."""


def housed(kernel: tree.Kernel, dialect: Dialect, packed: NDArray[np.float32] = NO_WEIGHTS) -> tree.Kernel:
    """Return a kernel whose weights and integers are where a language has them."""
    integers = tuple(dialect.integers[kernel.interface.role])
    if kernel.interface.role != DENOISE:
        return replace(kernel, interface=replace(kernel.interface, integers=integers))
    images = [array for array in kernel.interface.arrays if array.is_image]
    result = kernel.interface.named(RESULT)
    assert result is not None
    weights = [] if dialect.home == TABLE else [Memory(WEIGHTS, READ, (packed.size,), dialect.home)]
    tables = kernel.tables if weights else (*kernel.tables, (WEIGHTS, packed))
    interface = Interface(DENOISE, (*images, *weights, result), integers)
    if kernel.launches and dialect.declares_memory:
        interface = interface.handing_on(handed_on(kernel))
    return replace(kernel, interface=interface, tables=tables)


class Renderer:
    """Prints one kernel in one language."""

    def __init__(
        self, dialect: Dialect, kernel: tree.Kernel, bounded: bool, packed: NDArray[np.float32] = NO_WEIGHTS
    ) -> None:
        self.dialect, self.bounded = dialect.fitted(kernel), bounded
        kernel = self.kernel = housed(kernel, dialect, packed)
        self.lines: list[str] = []
        self.depth = 1
        self.readers: dict[str, None] = {}
        bound, path = kernel.interface, kernel.interface.role == PATH
        self.integers = {each: self.dialect.integer(bound, each) for each in bound.integers if path}
        everything = (*kernel.body, *(s for f in kernel.functions for s in f.body))
        self.arrays = {s.name: s for s in tree.walk(everything) if isinstance(s, tree.Array)}
        if bound.role == TRAIN:
            self.arrays |= {
                a.name: tree.Array(a.name, tree.Type(a.dtype, a.lanes), (1,), "device") for a in bound.arrays
            }
        widths = {name: array.type.lanes for name, array in self.arrays.items()}
        read = tree.accesses(everything) if max(widths.values(), default=1) > 1 else ()
        self.mixed = {a for a, kind in read if kind.lanes < widths.get(a, 0)}

    def source(self, header: Sequence[str]) -> str:
        """Return the whole source, under the lines of a comment."""
        dialect, kernel = self.dialect, self.kernel
        for function in kernel.functions:
            self.function(function)
        functions, self.lines = self.lines, []
        if kernel.launches:
            self.depth = 0
        self.body(kernel.body)
        tables = [dialect.table_declaration(name, array) for name, array in kernel.tables]
        above = [*map(self.constant, kernel.constants), *tables, *self.readers, *self.helpers()]
        top = "\n".join([*above, *functions])
        begin = dialect.begin(kernel, top, self.bounded)
        comment = ["/*", *(f" * {line}".rstrip() for line in header), " */"]
        end = ["#endif"] if dialect.staged else []
        end = end if kernel.launches else [dialect.ends[kernel.interface.role]]
        lines = [*dialect.first, *comment, begin, *self.lines, *end]
        return dialect.finished("\n".join(lines)) + "\n"

    def constant(self, constant: tree.Constant) -> str:
        """Return the definition of a named integer."""
        value = self.text(constant.value)
        value = f"({value})" if constant.value.args else value
        line = self.dialect.define.format(name=constant.name, value=value)
        return f"{line} /* {constant.comment} */" if constant.comment else line

    def helpers(self) -> list[str]:
        """Return the functions that operations on vectors call."""
        used = [e for s in tree.walk(self.kernel.body) for v in tree.values(s) for e in tree.parts(v)]
        operations = {e.op for e in used if max(e.type.lanes, *(a.type.lanes for a in e.args), 1) > 1}
        wanted = [text for operation, text in self.dialect.helpers.items() if operation in operations]
        return list(dict.fromkeys(wanted))

    def function(self, function: tree.Function) -> None:
        """Write a function above the kernel."""
        takes = [(name, self.kind(kind)) for name, kind in function.takes]
        result = function.result
        if result is None:
            self.lines.append(self.dialect.transform_head(function.name, self.kind(function.takes[0][1])))
        else:
            self.lines += [self.dialect.function_head(function.name, takes, self.kind(result.type))]
        self.depth = 1
        self.body(function.body)
        if result is not None:
            self._line(f"return {self.text(result)};")
        self.lines.append("}")

    def _nest(self, head: str, body: tree.Body) -> None:
        """Write statements in braces."""
        self._line(head)
        self.depth += 1
        self.body(body)
        self.depth -= 1
        self._line("}")

    def _line(self, text: str) -> None:
        """Write a line."""
        self.lines.append("    " * self.depth + text)

    # ---- types -------------------------------------------------------------------------------------------

    def kind(self, kind: tree.Type) -> str:
        """Return the name of a type."""
        if kind.lanes == 1:
            return self.dialect.byte if kind.dtype == "uint8" else self.dialect.scalars[kind.dtype]
        return self.dialect.vector_kind(kind.dtype, kind.lanes)

    def variable(self, kind: tree.Type, kept: bool) -> str:
        """Return the words before the name of a variable."""
        return (self.dialect.qualifiers.get(kind.dtype, "") if kept else "") + self.kind(kind)

    # ---- expressions -------------------------------------------------------------------------------------

    def text(self, value: tree.Expr, least: int = 0) -> str:
        """Return the text of an expression that binds at least as strongly as `least`, or in parentheses."""
        form: Callable[[tree.Expr], tuple[str, int]] = getattr(self, f"_{value.op}", self._operation)
        text, binds = form(value)
        return text if binds >= least else f"({text})"

    def _const(self, value: tree.Expr) -> tuple[str, int]:
        """Return a constant."""
        return self.dialect.number(
            value.value, "int32" if value.type.dtype == "uint8" else value.type.dtype
        ), ATOM

    def _name(self, value: tree.Expr) -> tuple[str, int]:
        """Return a name."""
        return self.integers.get(value.value, str(value.value)), ATOM

    def _component(self, value: tree.Expr) -> tuple[str, int]:
        """Return one component of a vector."""
        vector, (lanes,) = self.text(value.args[0], ATOM), {each.type.lanes for each in value.args}
        return f"{vector}.{self.dialect.component(value.value, lanes)}", ATOM

    def _splat(self, value: tree.Expr) -> tuple[str, int]:
        """Return a value in all lanes."""
        number = self.text(value.args[0])
        number = number[1:-1] if number.startswith("(-") else number
        return self.dialect.vector_of(self.kind(value.type), [number]), ATOM

    def _stack(self, value: tree.Expr) -> tuple[str, int]:
        """Return a vector of values."""
        return self.dialect.vector_of(self.kind(value.type), [self.text(each) for each in value.args]), ATOM

    def _call(self, value: tree.Expr) -> tuple[str, int]:
        """Return a call of a function of values."""
        return f"{value.value}({', '.join(self.text(each) for each in value.args)})", ATOM

    def _clamp(self, value: tree.Expr) -> tuple[str, int]:
        """Return an index within limits."""
        return f"{self.dialect.clamp}({', '.join(self.text(each) for each in value.args)})", ATOM

    def _lanes(self, value: tree.Expr) -> tuple[str, int]:
        """Return the numbers of the lanes."""
        return self._filled(self.dialect.vector_operations["lanes"], value)

    def _operation(self, value: tree.Expr) -> tuple[str, int]:
        """Return an operation of the program."""
        dialect, kind = self.dialect, value.args[-1].type
        if min(kind.lanes, value.args[0].type.lanes) > 1 and (vectors := dialect.vector_operations):
            for key in (f"{value.op}.{kind.dtype}", value.op):
                if key in vectors:
                    return self._filled(vectors[key], value)
        template = dialect.operations.get(f"{value.op}.{kind.dtype}") or dialect.operations[value.op]
        return self._filled(template, value)

    def _filled(self, template: str, value: tree.Expr) -> tuple[str, int]:
        """Return a template with operands as strongly bound as their places need."""
        binds, infix = binding(template), bool(INFIX.match(template))
        args = list(value.args)
        if infix:  # a language with such operators widens a single value by itself
            single = [a.args[0] if a.op == "splat" and a.type.dtype != "bool" else a for a in args]
            args = single if any(a.type.lanes > 1 for a in single) else args
        texts = [self.text(a, place) for a, place in zip(args, self._places(template, value), strict=False)]
        shown: dict[str, Any] = {
            "type": self.kind(value.type),
            "lanes": value.type.lanes,
            "table": value.value,
        }
        return template.format(*texts, **shown), binds

    def _places(self, template: str, value: tree.Expr) -> list[int]:
        """Return how strongly each operand of a template must bind."""
        binds = binding(template)
        if INFIX.match(template):
            in_any_order = value.op == "add" and value.type.dtype == "int32"
            return [binds, binds + (not in_any_order), 0]
        if binds in (CHOICE, UNARY):
            return [2 if binds == CHOICE else ATOM] * 3  # two signs side by side would be another operator
        return [0 if SIMPLE.fullmatch(template) else UNARY] * 3

    # ---- memory ------------------------------------------------------------------------------------------

    def _load(self, value: tree.Expr) -> tuple[str, int]:
        """Return an element of an image, of the weights, or of an array."""
        array, index = str(value.value), value.args
        if (given := self.given(array)) is not None:
            lanes = value.type.lanes
            if lanes > 1:
                index = (*index[:-1], index[-1].args[0])
                self.readers[self.dialect.row_reader.format(lanes=lanes)] = None
            return self.dialect.read(given, [self.text(each, UNARY) for each in index], lanes), ATOM
        if array.startswith(IMAGE):
            return self._pixel(array, index, value.type.lanes), ATOM
        if array == WEIGHTS:
            lanes = value.type.lanes
            place = self.text(index[0])
            return (self.dialect.weight if lanes == 1 else self.dialect.weight_vector).format(
                index=place, kind=self.kind(value.type)
            ), ATOM
        return self.element(array, index, value.type.lanes), ATOM

    def given(self, array: str) -> Memory | None:
        """Return an array of the interface, unless it is a denoiser's or a training step's."""
        interface = self.kernel.interface
        return None if interface.role in (DENOISE, TRAIN) else interface.named(array)

    def _pixel(self, array: str, index: Sequence[tree.Expr], lanes: int) -> str:
        """Return a channel of an image's pixel, all of its channels, or the value at a position of a row."""
        found = self.kernel.interface.named(array)
        assert found is not None, array
        channels = int(found.shape[-1])
        if lanes > 1:
            y, x = map(self.text, index)
            return self.dialect.texel.format(
                image=array.removeprefix(IMAGE), row=y, column=x, part="rgba"[:lanes]
            )
        if len(index) == 2:
            row, position = index
            assert position.op == "add", (
                "a position in a row is the first of a pixel's, and a distance from it"
            )
            first, beyond = position.args
            index = [row, first if channels == 1 else first.args[0], beyond]
        y, x, c = map(self.text, index)
        return self.dialect.pixel.format(
            image=array.removeprefix(IMAGE), channels=channels, row=y, column=x, c=c
        )

    def element(self, array: str, index: Sequence[tree.Expr], lanes: int) -> str:
        """Return an element of an array of the kernel."""
        declared = self.arrays.get(array)
        if declared and declared.space == "device" and self.dialect.numbers:
            return self.address(array, index[0], array in self.mixed and lanes == 1)
        if declared and array in self.mixed:
            number = lanes < declared.type.lanes
            form = self.dialect.mixed_number if number else self.dialect.mixed[1]
            return form.format(name=array, index=self.text(index[0]))
        return array + "".join(f"[{self.text(each)}]" for each in index)

    def address(self, array: str, place: tree.Expr, number: bool) -> str:
        """Return an element of memory of the device: what a loop does not change is an address of its own."""
        memory = f"{self.dialect.numbers}{array}" if number else array
        first, beyond = place.args if place.op == "add" else (place, place)
        if beyond.op in ("const", place.op) or first is beyond:
            return f"{f'({memory})' if number else memory}[{self.text(place)}]"
        return f"({memory} + {self.text(first, 10)})[{self.text(beyond)}]"

    # ---- statements --------------------------------------------------------------------------------------

    def body(self, body: tree.Body) -> None:
        """Write statements."""
        for statement in body:
            self.statement(statement)

    def statement(self, statement: tree.Statement) -> None:
        """Write a statement."""
        getattr(self, f"_write_{type(statement).__name__.lower()}")(statement)

    def _write_comment(self, statement: tree.Comment) -> None:
        """Write a comment on a line of its own, after an empty one."""
        self.lines.append("")
        self._line(f"/* {statement.text} */")

    def _write_let(self, statement: tree.Let) -> None:
        """Write a value that never changes."""
        kind = statement.value.type
        if kind == tree.INT and not statement.kept:
            self._line(self.dialect.index(statement.name, self.text(statement.value)))
            return
        if kind.lanes > 1 and self.dialect.calls_vectors:
            self._line(f"wamnet_bytes {statement.name};")
            self._vector_call(f"&{statement.name}", statement.value, False)
            return
        text = self.text(statement.value)
        kind_of = self.variable(kind, statement.kept)
        self._line(self.dialect.let.format(kind=kind_of, name=statement.name, value=text))

    def _write_array(self, statement: tree.Array) -> None:
        """Write a declaration of memory."""
        if statement.space != "item":
            return  # declared where the language wants it [dialects' `shared_array`]
        kind = self.variable(statement.type, statement.kept)
        sizes = [self.text(size) if isinstance(size, tree.Expr) else str(size) for size in statement.sizes]
        if statement.name in self.mixed:
            size = statement.sizes[0]
            count = self.text(size, 11) if isinstance(size, tree.Expr) else str(size)
            shown = {"kind": kind, "name": statement.name, "count": count, "lanes": statement.type.lanes}
            self._line(self.dialect.mixed[0].format(**shown))
            return
        first = self.text(statement.value) if statement.value else ""
        self._line(self.dialect.memory(kind, statement.name, sizes, first))

    def _write_store(self, statement: tree.Store) -> None:
        """Write a change of memory."""
        value, index = statement.value, statement.index
        if (given := self.given(statement.array)) is not None:
            place = [self.text(each, UNARY) for each in index]
            self._line(self.dialect.written(given, place, self.text(value), value.type.lanes))
            return
        if statement.array == RESULT:
            self._result(index, value)
            return
        target = self.element(statement.array, index, value.type.lanes)
        if value.op == "dot4":
            self._line(self._dotted(target, *value.args))
            return
        if value.type.lanes > 1 and self.dialect.calls_vectors:
            self._vector_call(target if statement.array in self.mixed else f"&{target}", value)
            return
        sign = "+" if statement.add else ""
        if sign and value.op == "negative":
            sign, value = "-", value.args[0]
        operation = self.dialect.vector_operations.get({"+": "add", "-": "subtract"}.get(sign, ""))
        if operation and value.type.lanes > 1:
            self._line(f"{target} = {operation.format(target, self.text(value))};")
            return
        self._line(f"{target} {sign}= {self.text(value)};")

    def _dotted(self, total: str, weights: tree.Expr, four: tree.Expr) -> str:
        """Return the statement that adds products of bytes to a sum."""
        if four.op == "load" and four.type.lanes > 1:
            place = f"{four.value} + {self.text(four.args[0], 10)}"
            return self.dialect.dot_of_bytes.format(total=total, weights=self.text(weights), place=place)
        return f"{total} = wamnet_dots({total}, {self.text(weights)}, {self.text(four)});"

    def _pack4(self, value: tree.Expr) -> tuple[str, int]:
        """Return four values as the bytes of a word."""
        return f"wamnet_packed({', '.join(self.text(each) for each in value.args)})", ATOM

    def _bits(self, value: tree.Expr) -> tuple[str, int]:
        """Return words of weights read as floats."""
        function = "wamnet_numbers" if self.kernel.group else f"as_{self.kind(value.type)}"
        return f"{function}({self.text(value.args[0])})", ATOM

    def _convert(self, value: tree.Expr) -> tuple[str, int]:
        """Return values of another kind."""
        sums = value.args[0].type.dtype == "int32" and value.type == tree.FLOAT.of(4)
        if self.kernel.group and self.kernel.weights.dtype == "int32" and sums:
            return f"wamnet_floats({self.text(value.args[0])})", ATOM
        if value.type.lanes == 1 and self.dialect.casts:
            return f"({self.kind(value.type)}){self.text(value.args[0], UNARY)}", UNARY
        return self._operation(value)

    def _vector_call(self, into: str, value: tree.Expr, starts: bool = True) -> None:
        """Write a change of sums of bytes' products as a call of one of the language's own functions.

        `starts`: words of weights are where a sum begins, not factors.
        """
        if value.op == "convert":
            place = self.element(value.args[0].value, value.args[0].args, value.type.lanes)
            self._line(f"wamnet_floats({into}, &{place});")
            return
        call = "start" if starts else "weights"
        self._line(f"wamnet_{call}({into}, weights + {self.text(value.args[0], 11)} * LANES);")

    def _result(self, index: Sequence[tree.Expr], value: tree.Expr) -> None:
        """Write a channel of the result; a language may have lines around those of a pixel."""
        row, column, channel = index
        for line in self.dialect.pixel_begin if channel == tree.const(0) else ():
            self._line(line)
        shown = {"row": self.text(row, 11), "column": self.text(column, 10), "i": self.text(channel, 10)}
        result, channels = RESULT, self.channels
        each = self.dialect.channels_per_result
        if each and channels > each:
            number, of = divmod(int(channel.value), each)
            result, shown["i"] = f"{RESULT}_{number}", str(of)
        self._line(
            self.dialect.store.format(result=result, channels=channels, value=self.text(value), **shown)
        )
        for line in self.dialect.pixel_end if channel == tree.const(channels - 1) else ():
            self._line(line.format(row=self.text(row), column=self.text(column)))

    @property
    def channels(self) -> int:
        """Return the channels of the result."""
        result = self.kernel.interface.named(RESULT)
        assert result is not None
        return int(result.shape[-1])

    def _write_for(self, statement: tree.For) -> None:
        """Write a loop; one over channels of several results is written out."""
        if self._splits(statement):
            for number in range(int(statement.count.value)):
                known = {statement.name: tree.const(number)}
                for each in statement.body:
                    assert isinstance(each, tree.Store)
                    index = tuple(tree.substituted(e, known) for e in each.index)
                    self.statement(replace(each, index=index, value=tree.substituted(each.value, known)))
            return
        if statement.how == "unroll" and self.dialect.unroll:
            self._line(self.dialect.unroll)
        start, count, step = (self.text(e) for e in (statement.start, statement.count, statement.step))
        until = f" && {self.text(statement.until, 4)}" if statement.until else ""
        self._nest(self.dialect.for_loop(statement.name, start, count + until, step), statement.body)

    def _splits(self, statement: tree.For) -> bool:
        """Return whether a loop chooses among results that no variable may choose of."""
        dialect = self.dialect
        stores = all(isinstance(each, tree.Store) and each.array == RESULT for each in statement.body)
        most = dialect.channels_per_result
        return stores and bool((most and self.channels > most) or not dialect.indexes_results)

    def _write_break(self, statement: tree.Break) -> None:
        """Write the end of a loop."""
        for line in (f"if ({self.text(statement.condition)}) {{", "    break;", "}"):
            self._line(line)

    def _write_if(self, statement: tree.If) -> None:
        """Write a branch."""
        self._nest(f"if ({self.text(statement.condition)}) {{", statement.body)
        if statement.otherwise:
            self._nest("else {", statement.otherwise)

    def _write_block(self, statement: tree.Block) -> None:
        """Write statements whose names end with them."""
        self._nest("{", statement.body)

    def _write_barrier(self, statement: tree.Barrier) -> None:
        """Write that all items of a group wait."""
        self._line(self.dialect.wait)

    def _write_launch(self, statement: tree.Launch) -> None:
        """Write a launch as a function, or as a program, which is compiled if STAGE is its number."""
        number = self.kernel.launches.index(statement)
        counts = [self.text(each, 9) for each in statement.counts]
        stage = f"#{'elif' if number else 'if'} STAGE == {number}"
        self.lines += [
            stage if self.dialect.staged else "",
            *self.dialect.launched(self.kernel, statement, counts),
        ]
        self.depth = 1
        self.body(statement.body)
        self.depth = 0
        self.lines.append("}")

    def _write_call(self, statement: tree.Call) -> None:
        """Write a call of a function on views."""
        given = ", ".join(text for view in statement.views for text in self.view(view))
        self._line(f"{self.dialect.own}{statement.function}({given});")

    def view(self, view: tree.View) -> tuple[str, str]:
        """Return the address of a view, and its step."""
        array, index = self.arrays[view.array], view.index
        rows = "".join(f"[{self.text(each)}]" for each in index[:-1])
        last = self.text(index[-1], 10)
        if view.array in self.mixed:
            shown = {"name": view.array, "index": self.text(index[-1], 11), "kind": self.kind(array.type)}
            return self.dialect.mixed[2].format(**shown), self.text(view.step)
        return f"{view.array}{rows}" + (f" + {last}" if last != "0" else ""), self.text(view.step)
