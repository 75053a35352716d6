"""The kernel IR: loops, arrays, loads and stores of one work item, as data.

    Program (what one pixel computes) -> Kernel (in which order, from which memory) -> source

1. A schedule builds a kernel from a program and names no language. A renderer prints a kernel in one language
   and knows no schedule [languages/renderer.py].
2. A kernel is a tree of statements. Memory changes by `Store` alone; `add=True` is the only way to sum, so
   the order of each sum can be read from the kernel.
3. Every kernel runs in NumPy [run.py], and is checked for names, types and constant indices [verify.py].

Indices count elements of an array's own type. An array of vectors may also be read as single components: then
the one index counts components. An image has the indices (row, column, channel), or (row, position) where a
position counts the components of a row. Planes have (plane, row, column); several elements of a row are
accessed from the index of the first one on, or read at an index with as many lanes.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any, Literal

from .interface import BATCH as BATCH
from .interface import READ, Interface

Index = tuple["Expr", ...]


@dataclass(frozen=True)
class Type:
    """`lanes` values of one kind."""

    dtype: str = "float32"
    lanes: int = 1

    def of(self, lanes: int) -> Type:
        """Return the type of so many of these."""
        return Type(self.dtype, lanes)


BYTES = {"float32": 4, "int32": 4, "uint32": 4, "bool": 4, "uint8": 1, "int8": 1}
"""Bytes of a value of each kind."""

FLOAT, INT, WORD, BOOL, BYTE = Type(), Type("int32"), Type("uint32"), Type("bool"), Type("uint8")


Operator = Callable[["Expr", "Expr | int"], "Expr"]


def _binary(what: str) -> Operator:
    """Return the method of an operator."""
    return lambda self, other: apply(what, self, other)


def _reflected(what: str) -> Operator:
    """Return the method of an operator whose left operand is a Python number."""
    return lambda self, other: apply(what, other, self)


@dataclass(frozen=True)
class Expr:
    """A value without effect.

    `const` and `name` have a `value`; `load` has an array's name and its index as arguments; `component` has
    the lane, `convert` the kind, `call` a function's name; `splat` repeats a value in all lanes, `lanes` are
    their numbers, and `any` tells whether one of them is true. `clamp` limits an index, or several that
    follow each other, one per lane. All others are rows of core/ops.py.
    """

    op: str
    args: tuple[Expr, ...] = ()
    type: Type = INT
    value: Any = None

    __add__, __radd__ = _binary("add"), _reflected("add")
    __sub__, __rsub__ = _binary("subtract"), _reflected("subtract")
    __mul__, __rmul__ = _binary("multiply"), _reflected("multiply")
    __floordiv__, __mod__ = _binary("divide"), _binary("remainder")
    __lt__, __le__, __ge__ = _binary("less"), _binary("less_equal"), _binary("greater_equal")
    __and__ = _binary("logical_and")

    def lane(self, lane: int) -> Expr:
        """Return one component of a vector."""
        return Expr("component", (self,), self.type.of(1), lane)


# ---- statements ------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Comment:
    """A line of comment; the listing reads the nodes that it names [core/listing.py]."""

    text: str


@dataclass(frozen=True)
class Let:
    """A value that never changes; `kept`: its operations must stay in order (`precise`)."""

    name: str
    value: Expr
    kept: bool = False


@dataclass(frozen=True)
class Array:
    """Memory of an item, of its group, or of all; without `sizes` it is one variable, with its first value.

    `register`: all of its indices are known once its loops are unrolled, so that compilers keep it in
    registers.
    """

    name: str
    type: Type
    sizes: tuple[int | Expr, ...] = ()
    space: Literal["item", "group", "device"] = "item"
    kept: bool = False
    value: Expr | None = None
    register: bool = False


@dataclass(frozen=True)
class Store:
    """array[index] = value, or += value."""

    array: str
    index: Index
    value: Expr
    add: bool = False


@dataclass(frozen=True)
class For:
    """A counted loop; `how`: `loop` as it stands, `unroll` as a demand on the compiler.

    `until`: it ends before the first turn in which this is false.
    """

    name: str
    count: Expr
    body: tuple[Statement, ...]
    how: Literal["loop", "unroll"] = "loop"
    start: Expr = field(default_factory=lambda: const(0))
    step: Expr = field(default_factory=lambda: const(1))
    until: Expr | None = None


@dataclass(frozen=True)
class Break:
    """The end of the loop in whose own body it is, where its condition holds."""

    condition: Expr


@dataclass(frozen=True)
class If:
    """A branch."""

    condition: Expr
    body: tuple[Statement, ...]
    otherwise: tuple[Statement, ...] = ()


@dataclass(frozen=True)
class Block:
    """Statements whose names end with them."""

    body: tuple[Statement, ...]


@dataclass(frozen=True)
class Barrier:
    """All items of a group wait here for each other."""


@dataclass(frozen=True)
class Launch:
    """A grid of items, which start when all items of the previous launch have ended.

    `place`: names of an item's column and row, or of its column alone; `counts`: how many there are. `name`:
    that of its function, where a source has one for each launch.
    """

    place: tuple[str, ...]
    counts: tuple[Expr, ...]
    body: tuple[Statement, ...]
    name: str = ""


@dataclass(frozen=True)
class View:
    """Part of an array as a function's argument: from `index` on, in steps of `step` elements."""

    array: str
    index: Index
    step: Expr = field(default_factory=lambda: const(1))


@dataclass(frozen=True)
class Call:
    """A call of a function on views."""

    function: str
    views: tuple[View, ...]


Statement = Comment | Let | Array | Store | For | Break | If | Block | Barrier | Launch | Call
Body = tuple[Statement, ...]


@dataclass(frozen=True)
class Function:
    """A function of values (`takes`: names and types, with a `result`), or of views."""

    name: str
    takes: tuple[tuple[str, Type], ...]
    body: Body
    result: Expr | None = None


@dataclass(frozen=True)
class Constant:
    """A named integer of the source."""

    name: str
    value: Expr
    comment: str = ""


@dataclass(frozen=True)
class Kernel:
    """Statements of one work item.

    `step`: columns and rows of pixels of an item; `group`: the items (x, y) of a work group, which share
    memory, or none; `place`: names of an item's first column and row; `weights`: the type of an element of
    the weights. `batch`: tiles of a picture, where launches may compute some after others: the names
    `first_tile` and `tile_count` say which.
    """

    interface: Interface
    body: Body
    constants: tuple[Constant, ...] = ()
    functions: tuple[Function, ...] = ()
    step: tuple[Expr, Expr] = field(default_factory=lambda: (const(1), const(1)))
    group: tuple[int, int] | None = None
    place: tuple[str, str] = ("x", "y")
    weights: Type = FLOAT
    tables: tuple[tuple[str, Any], ...] = ()
    batch: Expr | None = None

    @property
    def launches(self) -> tuple[Launch, ...]:
        """Return the launches, of a kernel that is several of them."""
        return tuple(s for s in self.body if isinstance(s, Launch))

    def interface_of(self, launch: Launch) -> Interface:
        """Return the arrays and integers that a launch uses."""
        every = [launch, *walk(launch.body)]
        used = {
            each.value for s in every for v in values(s) for each in parts(v) if each.op in ("load", "name")
        }
        stored = {s.array for s in every if isinstance(s, Store)}
        integers = tuple(each for each in self.interface.integers if each in used)
        arrays = [each for each in self.interface.arrays if each.name in used | stored]
        found = [each if each.name in stored else replace(each, access=READ) for each in arrays]
        return replace(self.interface, arrays=tuple(found), integers=integers)

    @property
    def shared(self) -> tuple[Array, ...]:
        """Return the arrays that a group shares."""
        return tuple(s for s in self.body if isinstance(s, Array) and s.space == "group")


# ---- making expressions ----------------------------------------------------------------------------------

COMPARISONS = ("less", "less_equal", "greater", "greater_equal", "equal", "not_equal")
"""Operations on numbers that give truth."""

LOGICAL = ("logical_and", "logical_or", "logical_not")
"""Operations on truth."""


def _quotient(a: int, b: int) -> tuple[int, int]:
    """Return quotient and remainder where rounding down is rounding to 0, as it is in every language."""
    if a < 0 or b <= 0:
        raise ArithmeticError(f"{a} / {b}: of a negative integer, or by 0")
    return divmod(a, b)


INTEGERS: Mapping[str, Callable[[int, int], int]] = {
    "add": lambda a, b: a + b,
    "subtract": lambda a, b: a - b,
    "multiply": lambda a, b: a * b,
    "divide": lambda a, b: _quotient(a, b)[0],
    "remainder": lambda a, b: _quotient(a, b)[1],
    "minimum": min,
    "maximum": max,
}
"""Arithmetic of indices, which are never negative where they are divided."""


def const(value: float, kind: Type | None = None) -> Expr:
    """Return a constant: of a bool, an int or a float."""
    if kind is None:
        kind = BOOL if isinstance(value, bool) else INT if isinstance(value, int) else FLOAT
    return Expr("const", (), kind, value)


def name(text: str, kind: Type = INT) -> Expr:
    """Return a value by its name."""
    return Expr("name", (), kind, text)


def load(array: str, *index: Expr | int, kind: Type = FLOAT) -> Expr:
    """Return an element of an array."""
    return Expr("load", tuple(map(expr, index)), kind, array)


def call(function: str, args: Sequence[Expr], kind: Type) -> Expr:
    """Return what a function of values returns."""
    return Expr("call", tuple(args), kind, function)


def splat(value: Expr, lanes: int) -> Expr:
    """Return a value in all lanes."""
    return value if value.type.lanes == lanes else Expr("splat", (value,), value.type.of(lanes))


def lanes(count: int) -> Expr:
    """Return the number of each lane."""
    return Expr("lanes", (), WORD.of(count)) if count > 1 else const(0, WORD)


def any_lane(mask: Expr) -> Expr:
    """Return whether a condition holds in any lane."""
    return Expr("any", (mask,), BOOL)


def stack(values: Sequence[Expr]) -> Expr:
    """Return a vector of single values."""
    return Expr("stack", tuple(values), values[0].type.of(len(values)))


def expr(value: Expr | float) -> Expr:
    """Return an expression; a Python number is a constant."""
    return value if isinstance(value, Expr) else const(value)


def apply(what: str, *args: Expr | float, value: Any = None) -> Expr:
    """Return an operation on values; integers that are known are computed."""
    given = tuple(map(expr, args))
    kinds = [each.type for each in given[what == "select" :]]
    kind = max(kinds, key=lambda each: each.lanes)
    if what in (*COMPARISONS, *LOGICAL):
        kind = Type("bool", kind.lanes)
    elif what == "convert":
        kind = Type(value, kind.lanes)
    elif kind == INT and len(given) == 2 and (folded := _folded(what, *given)) is not None:
        return folded
    return Expr(what, given, kind, value)


def _folded(what: str, a: Expr, b: Expr) -> Expr | None:
    """Return what is known of an operation on integers, if anything is."""
    one, other = (each.value if each.op == "const" else None for each in (a, b))
    if one is not None and other is not None and what in INTEGERS:
        if what in ("divide", "remainder") and (one < 0 or other <= 0):
            return None
        found = INTEGERS[what](one, other)
        return const(found) if -(2**31) <= found < 2**31 else None
    if (what == "add" and one == 0) or (what == "multiply" and one == 1):
        return b
    if (what in ("add", "subtract") and other == 0) or (what in ("multiply", "divide") and other == 1):
        return a
    return const(0) if what == "multiply" and 0 in (one, other) else None


# ---- walking ---------------------------------------------------------------------------------------------


def inside(statement: Statement) -> tuple[Body, ...]:
    """Return the bodies of a statement."""
    if isinstance(statement, For | Block | Launch):
        return (statement.body,)
    return (statement.body, statement.otherwise) if isinstance(statement, If) else ()


def walk(body: Body) -> list[Statement]:
    """Return all statements, outer ones first."""
    found: list[Statement] = []
    for statement in body:
        found.append(statement)
        for inner in inside(statement):
            found += walk(inner)
    return found


def values(statement: Statement) -> list[Expr]:
    """Return the expressions of a statement itself."""
    found: list[Expr] = []

    def note(part: Any) -> None:
        if isinstance(part, Expr):
            found.append(part)
        elif isinstance(part, tuple | View):
            for each in part if isinstance(part, tuple) else (part.index, part.step):
                note(each)

    for each in vars(statement).values():
        note(each)
    return found


def parts(value: Expr) -> list[Expr]:
    """Return an expression and all inside it."""
    found = [value]
    for each in value.args:
        found += parts(each)
    return found


def accesses(body: Body) -> list[tuple[str, Type]]:
    """Return the arrays that statements read and write, and the types of what is read and written."""
    statements = walk(body)
    found = [(s.array, s.value.type) for s in statements if isinstance(s, Store)]
    every = (each for s in statements for v in values(s) for each in parts(v))
    return found + [(each.value, each.type) for each in every if each.op == "load"]


def operations(kernel: Kernel) -> set[str]:
    """Return the names of all operations of a kernel's body."""
    return {each.op for statement in walk(kernel.body) for v in values(statement) for each in parts(v)}


def rewritten(body: Body, change: Callable[[Expr], Expr]) -> Body:
    """Return statements with a function applied to each of their expressions."""

    def anew(part: Any) -> Any:
        if isinstance(part, Expr):
            return change(part)
        if isinstance(part, tuple):
            return tuple(map(anew, part))
        if isinstance(part, Statement | View):
            return replace(part, **{each.name: anew(getattr(part, each.name)) for each in fields(part)})
        return part

    return tuple(map(anew, body))


def substituted(value: Expr, known: Mapping[str, Expr]) -> Expr:
    """Return an expression with names replaced, and integers computed that are now known."""
    if value.op == "name":
        return known.get(value.value, value)
    if not value.args:
        return value
    args = tuple(substituted(each, known) for each in value.args)
    if value.op in INTEGERS and value.type == INT:
        found = apply(value.op, *args)
        if found.op != "const" or all(each.op == "const" for each in args):
            return found  # else 0 times what may be no integer of 32 bits
    return replace(value, args=args)


def integer(kernel: Kernel, value: Expr | int) -> int:
    """Return an integer that the kernel's constants determine."""
    if isinstance(value, int):
        return value
    if value.op == "const":
        return int(value.value)
    if value.op == "name":
        return integer(kernel, next(each.value for each in kernel.constants if each.name == value.value))
    found = INTEGERS[value.op](*(integer(kernel, each) for each in value.args))
    if not -(2**31) <= found < 2**31:
        raise ArithmeticError(f"{found}, which int32 does not hold")
    return found


def terms(value: Expr) -> list[tuple[Expr, int]]:
    """Return the terms of a sum of integers, each with 1 or -1; a difference that is subtracted stays one."""
    if value.op == "add" and value.type == INT:
        return [*terms(value.args[0]), *terms(value.args[1])]
    if value.op == "subtract" and value.type == INT:
        return [*terms(value.args[0]), (value.args[1], -1)]
    return [(value, 1)]


def total(values: list[tuple[Expr, int]]) -> Expr:
    """Return the sum of terms, from the left."""
    (result, _), *rest = values
    for value, sign in rest:
        result = Expr("add" if sign > 0 else "subtract", (result, value), INT)
    return result
