"""What a target's language looks like: templates and a table of operations, no decisions.

emit.py fills the templates in. Names in braces: `image`, `channels` and `binding` of a feature image,
`entry`, `images`, their `names`, `results`, `starts` and `defines` of the whole kernel (`number` and
`result` of each result), `unordered` (what stands where the language cannot keep operations in order:
without an error bound, with one), `index` into the weights, `i` and `value` of an output channel, `0`, `1`,
`2` the operands of one, `type` the type of its result, `table` the name of its table, `name`, `count` and
`values` of a table's declaration. The text between is the language's own, its braces doubled. An
operation's template may differ for a kind of operand: `minimum.int32`. More channels than
`channels_per_result` go into several results.
`exact` are the lines that an exact kernel needs at its top, `magnitude` the absolute value of a number,
`clamp` the name of the function that limits an index. `first` are the lines that the language wants before
any comment; `indexes_results` says whether a variable may choose a result's channel; `counted` opens a loop
on a counter from 0 on, `define` names a number, `choice` is one between two numbers; `assumes` says what a
bound rests on that the language itself does not promise.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .ir import LEAST, Node
from .profiles import SineContract

LONG_TABLE, TABLE_ROW = 200, 8
"""Numbers of a constant table from which on it stands in rows, and the numbers of a row."""


class Dialect:
    """One language; a subclass sets every attribute that has no value here."""

    target: str
    language: str
    suffix: str
    entry: str
    image_declaration: str
    image_separator: str
    first_binding: int = 0
    begin: str
    end = "}}"
    pixel: str
    weight: str
    weights_table: bool = False
    store: str
    result_declaration: str = ""
    result_start: str = ""
    arguments: str
    max_output_channels: int
    channels_per_result: int | None = None
    indexes_results: bool = True
    native_sine: SineContract
    unordered: tuple[str, str] = ("", "")
    assumes: str = ""
    first: tuple[str, ...] = ()
    counted: str = "for (int {i} = 0; {i} < {count}; ++{i}) {{"
    define: str = "#define {name} {value}"
    choice: str = "{0} ? {1} : {2}"
    exact: tuple[str, ...] = ()
    magnitude: str = "fabs({0})"
    clamp: str = "clamp"
    types: Mapping[str, str] = {"float32": "float", "int32": "int", "uint32": "uint", "bool": "bool"}
    qualifiers: Mapping[str, str] = {}
    table: str
    operations: Mapping[str, str] = {
        "add": "{0} + {1}",
        "subtract": "{0} - {1}",
        "multiply": "{0} * {1}",
        "divide": "{0} / {1}",
        "negative": "-{0}",
        "floor": "floor({0})",
        "sqrt": "sqrt({0})",
        "power": "pow({0}, {1})",
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
        "select": "{0} ? {1} : {2}",
        "take": "{table}[{0}]",
        "row": "{table}[{0}]",
    }

    def results(self, channels: int) -> list[str]:
        """Return what is written into, in order; a language with one result for all channels has one."""
        most = self.channels_per_result
        if most is None or channels <= most:
            return ["result"]
        return [f"result_{number}" for number in range(-(-channels // most))]

    def variable(self, dtype: str) -> str:
        """Return the words before the name of a variable of this kind."""
        return self.qualifiers.get(dtype, "") + self.types[dtype]

    def let(self, dtype: str, name: str, value: str, kept: bool = False) -> str:
        """Return the declaration of a value; `kept`: its operations stay in order where the language can."""
        return f"{self.variable(dtype) if kept else self.types[dtype]} {name} = {value};"

    def single(self, name: str, value: str) -> str:
        """Return the declaration of one number, also in a language whose values are vectors."""
        return f"float {name} = {value};"

    def index(self, name: str, value: str) -> str:
        """Return the declaration of a place in an image or a window."""
        return f"int {name} = {value};"

    def var(self, dtype: str, name: str, value: str = "", kept: bool = False) -> str:
        """Return the declaration of a variable that is assigned later, or again."""
        kind = self.variable(dtype) if kept else self.types[dtype]
        return f"{kind} {name}{f' = {value}' if value else ''};"

    def array(self, dtype: str, name: str, count: int, kept: bool = False) -> str:
        """Return the declaration of an array."""
        return f"{self.variable(dtype) if kept else self.types[dtype]} {name}[{count}];"

    def loop(self, counter: str, count: int | str) -> str:
        """Return the line that opens a loop of a counter from 0 on."""
        return self.counted.format(i=counter, count=count)

    def select(self, condition: str, yes: str, no: str) -> str:
        """Return the text of a choice between two numbers."""
        return self.choice.format(condition, yes, no)

    def expression(self, node: Node, kind: str, operands: Sequence[str]) -> str:
        """Return the text of an operation on operands, the last of which is of the given kind."""
        template = self.operations.get(f"{node.op}.{kind}") or self.operations[node.op]
        return template.format(*operands, type=self.types[node.type.dtype], table=node.get("table"))

    def kept(self, value: str) -> str:
        """Return the text of a number as an exact program reads it."""
        return self.select(f"{self.magnitude.format(value)} < {self.literal(LEAST)}", "0.0f", value)

    def constant(self, node: Node) -> str:
        """Return the text of a constant."""
        return self.number(node["value"], node.type.dtype)

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
        return self.table.format(type=self.types[dtype], name=name, count=len(array), values=values)

    @staticmethod
    def literal(value: float) -> str:
        """Return a float32 constant: nine digits name it, also for a reader that goes through double."""
        digits = f"{float(np.float32(value)):.9g}"
        text = digits + ("f" if "." in digits or "e" in digits else ".0f")
        return f"({text})" if text.startswith("-") else text
