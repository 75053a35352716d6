"""From a NumPy function to a program: call it once with values that write down what is done to them.

1. Each input becomes a tracing value [`Traced`]; the function is called with them [`trace`].
2. NumPy hands every ufunc and function on such a value to it (`__array_ufunc__`, `__array_function__`); the
   operation's row in ops.py gives the node. Numbers become constants, arrays become parameters.
3. `x @ W.T` with a constant matrix becomes one affine node; np.clip becomes maximum and minimum; np.where a
   selection; np.take from a constant table (made one by `np.asarray(table, like=index)`) a look-up;
   `x[..., i]` a component; `x[..., None]` nothing, since a number goes with every component anyway.
4. A fold over the rows of constant tables (refimpl/vectors.py: fold_rows) is unrolled up to a number of rows,
   and a loop (loops.py) above it [`Tracer`]. A table with traced numbers in it is always unrolled, and a
   look-up in it selects them one by one.
5. A Python number takes the kind of the values beside it; other kinds are never mixed.
6. Anything else raises: the closed list of operations is what makes one definition serve every executor.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from itertools import chain
from pathlib import Path
from types import FrameType
from typing import Any, NoReturn

import numpy as np
from numpy.lib.mixins import NDArrayOperatorsMixin
from numpy.typing import NDArray

from ...refimpl import vectors
from ...refimpl.errors import CompileError
from .ir import DTYPES, Attribute, Builder, Gather, Node, Program, Type, attributes
from .ops import ELEMENTWISE, OPS, TypeRuleError

_UFUNCS: Mapping[Any, str] = {
    **{op.definition: op.name for op in ELEMENTWISE if isinstance(op.definition, np.ufunc)},
    np.bitwise_and: "bitwise_and",
    np.bitwise_or: "logical_or",
    np.invert: "logical_not",
}
"""NumPy's ufuncs that are operations; `|` and `~` are those of booleans, `&` also that of words."""

TRACEABLE = (
    *(f"np.{name}" for name in dict.fromkeys(_UFUNCS.values())),
    *("np.matmul", "np.clip", "np.where", "np.stack", "np.moveaxis(np.stack(...), 0, -1)", "np.take"),
    *("np.sum(..., axis=-1, keepdims=True)", "np.concatenate(..., axis=-1)"),
    *("np.full_like", "np.zeros_like", "np.ones_like", "x ** 1", "x ** 2", "x.astype", "x[..., i]"),
    "vectors.fold_rows",
    "x ** y with a positive constant y (x >= 0)",
)
"""The closed list, as error messages and the spec show it."""


class Tracer(Builder):
    """A builder that knows how many rows of a fold are unrolled at most, and counts the loops.

    `keeps_places`: nodes get the lines of the reference that are being executed.
    """

    def __init__(self, most_unrolled: int | None = None, keeps_places: bool = False) -> None:
        super().__init__()
        self.most_unrolled = most_unrolled
        self.keeps_places = keeps_places
        self.loops = 0

    def where(self) -> tuple[str, ...]:
        """Return the lines of the reference that are being executed, callers first."""
        places = []
        frame: FrameType | None = sys._getframe(1) if self.keeps_places else None
        while frame is not None:
            if name := _reference_file(frame.f_code.co_filename):
                places.append(f"{name}:{frame.f_lineno}")
            frame = frame.f_back
        return tuple(places[::-1])


class Traced(NDArrayOperatorsMixin):
    """A value of the program being traced; it shows the shape of one lane."""

    __array_priority__ = 1000.0

    def __init__(self, builder: Builder, index: int) -> None:
        self.builder, self.index = builder, index

    @property
    def type(self) -> Type:
        """Return the value's type in the program."""
        return self.builder.nodes[self.index].type

    @property
    def shape(self) -> tuple[int, ...]:
        """Return the shape in one lane."""
        return self.type.shape

    @property
    def ndim(self) -> int:
        """Return the number of axes in one lane."""
        return len(self.shape)

    def __array_ufunc__(self, ufunc: Any, method: str, *operands: Any, **options: Any) -> Traced:
        name = f"np.{ufunc.__name__}"
        if method != "__call__" or options:
            _refuse(
                f"{name}{'' if method == '__call__' else '.' + method} with {sorted(options) or 'no options'}"
            )
        if ufunc is np.matmul:
            return _matmul(self.builder, *operands)
        if ufunc is np.power:
            return _power(self.builder, *operands)
        if ufunc not in _UFUNCS:
            _refuse(name)
        truth = ufunc is np.bitwise_and and self.type.dtype == "bool"
        return emit(self.builder, "logical_and" if truth else _UFUNCS[ufunc], *operands)

    def __array_function__(self, function: Any, types: Any, args: Any, options: Any) -> Any:
        return _call(self.builder, function, args, options)

    def __fold_rows__(self, step: Any, tables: Any, start: Any) -> Any:
        builder = self.builder
        if not isinstance(builder, Tracer) or builder.most_unrolled is None or any(map(_is_mixed, tables)):
            return NotImplemented
        # Over more rows than are unrolled it is a loop, whose body is one step.
        if len(tables[0]) <= builder.most_unrolled:
            return NotImplemented
        number, carried = _carried(builder, start)
        after = _stepped(builder, step, tables, number, carried)
        return _results(builder, number, len(tables[0]), carried, after, {})

    def astype(self, dtype: Any) -> Traced:
        """Return the value in another kind of number."""
        wanted = np.dtype(dtype).name
        return self if wanted == self.type.dtype else emit(self.builder, "convert", self, dtype=wanted)

    def __getitem__(self, key: Any) -> Traced:
        if not isinstance(key, tuple) or len(key) != 2 or key[0] is not Ellipsis:
            return _refuse(f"indexing with {key!r}")
        if key[1] is None and not self.shape:
            return self
        if type(key[1]) is int:
            from_end = self.shape[0] if self.shape and key[1] < 0 else 0
            return emit(self.builder, "component", self, index=key[1] + from_end)
        return _refuse(f"indexing with {key!r}")

    def __getattr__(self, name: str) -> Any:
        # NumPy probes for protocols by name; those must look absent, everything else is a mistake.
        if name.startswith("__"):
            raise AttributeError(name)
        _refuse(f"the array method .{name}")

    def __bool__(self) -> bool:
        _refuse("a decision (if, while, and, or) on a value")

    def __float__(self) -> float:
        _refuse("conversion to a Python float (math.sin and the like)")

    def __index__(self) -> int:  # noqa: PLE0305 - it refuses
        _refuse("conversion to a Python integer")

    def __len__(self) -> int:  # noqa: PLE0303 - it refuses
        _refuse("len()")

    def __array__(self, dtype: Any = None, copy: Any = None) -> NoReturn:
        _refuse("conversion to an array")

    def __iter__(self) -> NoReturn:
        _refuse("iteration over a value")


@dataclass(frozen=True)
class Planes:
    """Components stacked on the first axis, on their way to the last one by np.moveaxis."""

    builder: Builder
    held: Any

    def __array_function__(self, function: Any, types: Any, args: Any, options: Any) -> Any:
        return _call(self.builder, function, args, options)


class Table(Planes):
    """A constant table (K,) that np.take looks up at a traced index."""


def trace(
    function: Callable[..., Any],
    inputs: Mapping[str, Type],
    gather: Gather | None = None,
    output: str = "color",
    info: Mapping[str, str] | None = None,
    most_unrolled: int | None = None,
    keep_places: bool = False,
) -> Program:
    """Return the program of `function`, called with one tracing value for each of `inputs`, in their order.

    A mapping that `function` returns gives several outputs by name; anything else is the one named `output`.
    Folds over more rows than `most_unrolled` become loops; None unrolls all of them. `keep_places`: nodes
    know the lines of the reference that they came from, for listings.
    """
    builder = Tracer(most_unrolled, keep_places)
    values = [Traced(builder, _add(builder, "input", (), name=n, type=t)) for n, t in inputs.items()]
    result = function(*values)
    results = result if isinstance(result, Mapping) else {output: result}
    outputs = tuple((name, _operand(builder, value)) for name, value in results.items())
    pairs = tuple(sorted((info or {}).items()))
    return Program(tuple(builder.nodes), outputs, builder.parameters, gather, pairs)


def emit(builder: Builder, op: str, *operands: Any, **named: Attribute | None) -> Traced:
    """Add one operation on traced values, numbers and arrays."""
    chosen = operands[1:] if op == "select" else operands
    beside = next((value.type.dtype for value in chosen if isinstance(value, Traced)), None)
    args = tuple(_operand(builder, operand, beside) for operand in operands)
    return Traced(builder, _add(builder, op, args, **named))


def _add(builder: Builder, op: str, args: tuple[int, ...], **named: Attribute | None) -> int:
    """Add a node, with the type that its row gives."""
    given = attributes(**named)
    try:
        kind = OPS[op].type_rule([builder.nodes[arg].type for arg in args], dict(given), builder.parameters)
    except TypeRuleError as error:
        raise CompileError(f"{_place()}: {op}: {error}") from None
    return builder.add(Node(op, args, kind, given))


def _operand(builder: Builder, value: Any, beside: str | None = None) -> int:
    """Return the index of a traced value, or of the constant or parameter that a plain one becomes.

    `beside` is the kind of number of the values beside it, which a Python number takes.
    """
    if isinstance(value, Traced):
        return value.index
    if type(value) is Planes:
        _refuse("np.stack with axis=0 outside of np.moveaxis(np.stack(...), 0, -1)")
    if _is_mixed(value):
        return _operand(builder, emit(builder, "stack", *value) if value.ndim else value.item(), beside)
    if isinstance(value, np.ndarray) and value.ndim:
        index = _add(builder, "parameter", (), name=builder.parameter(_exact_float32(value)))
        # Kernels keep integers in float32 too, up to 2^24.
        kind = str(value.dtype)
        return _add(builder, "convert", (index,), dtype=kind) if kind in ("int32", "uint32") else index
    if not isinstance(value, int | float | np.number | np.bool_ | np.ndarray):
        _refuse(f"a {type(value).__name__} as an operand")
    return constant_of(builder, value, _kind(value, beside))


def _is_mixed(value: Any) -> bool:
    """Tell whether an array holds objects: traced numbers among constants [scene_inputs.py]."""
    return isinstance(value, np.ndarray) and value.dtype == object


def _kind(value: Any, beside: str | None) -> str:
    """Return the kind of number that a plain value becomes."""
    if isinstance(value, bool | np.bool_):
        if beside not in (None, "bool"):
            _refuse("a bool as an operand of numbers")
        return "bool"
    if isinstance(value, np.integer | np.ndarray) and str(value.dtype) in DTYPES:
        return str(value.dtype)
    if isinstance(value, int) and beside in ("int32", "uint32"):
        return beside
    if isinstance(value, np.integer):
        _refuse(f"an {value.dtype} as an operand")
    return "float32"


def constant_of(builder: Builder, value: Any, dtype: str) -> int:
    """Return the index of a constant."""
    if dtype == "float32":
        return _add(builder, "constant", (), value=float(value))
    plain = bool(value) if dtype == "bool" else int(value)
    return _add(builder, "constant", (), value=plain, dtype=dtype)


def _exact_float32(array: NDArray[Any]) -> NDArray[np.float32]:
    """Return the array as float32, or refuse: a kernel could not hold its numbers."""
    with np.errstate(over="ignore"):
        rounded = np.ascontiguousarray(array, dtype=np.float32)
    if not np.array_equal(rounded, array):
        raise CompileError(
            f"{_place()}: an array of {array.dtype}, shape {array.shape}, has values beyond float32: "
            "kernels keep weights in float32; round the weights first (refimpl.network.denoise.as_dtype)"
        )
    return rounded


def _matmul(builder: Builder, x: Any, matrix: Any) -> Traced:
    """Turn x @ W.T with a constant W into an affine node without bias; it keeps W (D_out, D_in) itself."""
    if not isinstance(x, Traced) or not isinstance(matrix, np.ndarray) or matrix.ndim != 2:
        _refuse("np.matmul of anything but a traced vector and a constant matrix, x @ W.T")
    return emit(builder, "affine", x, weight=builder.parameter(_exact_float32(matrix.T)))


def _stack(builder: Builder, numbers: Any, axis: int = 0) -> Traced | Planes:
    """np.stack of numbers on the last axis, or on the first one before np.moveaxis."""
    if axis == 0:
        return Planes(builder, numbers)
    if axis != -1:
        _refuse(f"np.stack with axis={axis} (components are the last axis: axis=-1)")
    return emit(builder, "stack", *numbers)


def _moveaxis(builder: Builder, planes: Any, source: int, destination: int) -> Traced:
    """np.moveaxis(np.stack(numbers), 0, -1): components side by side."""
    if type(planes) is not Planes or (source, destination) != (0, -1):
        _refuse("np.moveaxis of anything but np.moveaxis(np.stack(...), 0, -1)")
    return emit(builder, "stack", *planes.held)


def _where(builder: Builder, condition: Any, a: Any, b: Any) -> Traced:
    """np.where with a condition is a selection; of two Python numbers NumPy would make 64-bit ones."""
    if all(type(value) in (int, float) for value in (a, b)):
        _refuse("np.where between two Python numbers (one of them needs a kind: np.float32(0))")
    return emit(builder, "select", condition, a, b)


def _power(builder: Builder, x: Any, exponent: Any) -> Traced:
    """Turn x ** 1 and x ** 2 into what NumPy computes for them; another power must be a positive float."""
    if isinstance(x, Traced) and isinstance(exponent, float) and exponent > 0.0:
        return emit(builder, "power", x, exponent)
    if not isinstance(x, Traced) or not isinstance(exponent, int) or exponent not in (1, 2):
        _refuse("a power other than x ** 1, x ** 2 and x ** y with a positive float y")
    return x if exponent == 1 else emit(builder, "multiply", x, x)


def _full_like(builder: Builder, like: Traced, value: Any, dtype: Any = None) -> Traced:
    """np.full_like is a constant for each component."""
    kind = np.dtype(dtype).name if dtype is not None else like.type.dtype
    if kind not in DTYPES:
        _refuse(f"np.full_like with dtype {kind}")
    number = Traced(builder, constant_of(builder, value, kind))
    return emit(builder, "stack", *[number] * like.shape[0]) if like.shape else number


def _asarray(builder: Builder, array: Any) -> Table:
    """np.asarray(table, like=index) is a table that can be looked up."""
    if not isinstance(array, np.ndarray) or array.ndim != 1:
        _refuse("np.asarray(..., like=x) of anything but a constant array of one axis")
    return Table(builder, array)


def _take(builder: Builder, table: Any, index: Any) -> Traced:
    """np.take from a table at a traced index."""
    if not isinstance(table, Table):
        _refuse("np.take from anything but np.asarray(table, like=index)")
    if not _is_mixed(table.held):
        return emit(builder, "take", index, table=builder.table(_known(table.held)))
    # The constants are a table as ever; each traced entry is a selection.
    traced = {i: entry for i, entry in enumerate(table.held) if isinstance(entry, Traced)}
    constants = np.array([0.0 if i in traced else entry for i, entry in enumerate(table.held)], np.float32)
    value = emit(builder, "take", index, table=builder.table(constants))
    for i, entry in traced.items():
        value = emit(builder, "select", emit(builder, "equal", index, i), entry, value)
    return value


def walk_rows(
    parts: Any, start: Any, enters: Any, boxes: Any, first: NDArray[Any], skip: NDArray[Any]
) -> Any:
    """Return what `start`, traced values (...), becomes by a walk along a tree over rows [loops.py: Walk].

    parts: (step, tables) of each part. enters(values, *box) tells in which lanes a node is entered; row i of
    `boxes` (n, ...) is node i's.
    """
    builder = next(value.builder for value in start if isinstance(value, Traced))
    if not isinstance(builder, Tracer):
        _refuse("a walk outside of a traced function")
    number, carried = _carried(builder, start)
    rows = (_row(builder, table, number, "branch") for table in boxes)
    entered = _operand(builder, enters(tuple(carried), *rows))
    after = [_stepped(builder, step, tables, number, carried) for step, tables in parts]
    names = {"first": builder.table(first.reshape(-1)), "skip": builder.table(skip), "parts": len(parts)}
    trips = sum(len(tables[0]) for _, tables in parts)
    return _results(builder, number, trips, carried, [*chain(*after), entered], names)


def _carried(builder: Tracer, start: Any) -> tuple[int, list[Traced]]:
    """Return the number of a new loop, and what it carries."""
    number, builder.loops = builder.loops, builder.loops + 1
    return number, [
        Traced(builder, _add(builder, "carried", (_operand(builder, value),), index=i, loop=number))
        for i, value in enumerate(start)
    ]


def _stepped(builder: Builder, step: Any, tables: Any, number: int, carried: list[Traced]) -> list[int]:
    """Return what the carried numbers become in a trip."""
    stepped = step(tuple(carried), *(_row(builder, table, number) for table in tables))
    if not isinstance(stepped, tuple) or len(stepped) != len(carried):
        _refuse(f"vectors.fold_rows with a step that does not return {len(carried)} values")
    return [_operand(builder, v, c.type.dtype) for v, c in zip(stepped, carried, strict=True)]


def _results(
    builder: Builder, number: int, trips: int, carried: list[Traced], after: list[int], named: Any
) -> tuple[Traced, ...]:
    """Return the carried numbers after all trips."""
    args = (*(value.index for value in carried), *after)
    return tuple(
        Traced(builder, _add(builder, "loop", args, index=i, loop=number, trips=trips, **named))
        for i in range(len(carried))
    )


def _row(builder: Builder, table: NDArray[Any], number: int, op: str = "row") -> Any:
    """Return the entry of a loop's trip: a number of (K,), a vector of (K, n), several of (K, m, n)."""
    if table.ndim == 3:
        return [_row(builder, table[:, i], number, op) for i in range(table.shape[1])]
    if table.ndim == 2:
        return emit(
            builder, "stack", *(_row(builder, table[:, i], number, op) for i in range(table.shape[1]))
        )
    name = builder.table(_known(table))
    return Traced(builder, _add(builder, op, (), loop=number, table=name))


def _known(array: NDArray[Any]) -> NDArray[Any]:
    """Return a table in a kind of number that programs have."""
    return np.ascontiguousarray(array) if str(array.dtype) in DTYPES else _exact_float32(array)


def _numbers(builder: Builder, value: Any) -> list[Traced]:
    """Return the numbers of a traced vector or number."""
    if not isinstance(value, Traced):
        _refuse(f"a {type(value).__name__} among the parts of a vector")
    count = value.shape[0] if value.shape else 0
    return [value[..., i] for i in range(count)] or [value]


def _sum(builder: Builder, x: Any, axis: Any = None, keepdims: bool = False) -> Traced:
    """np.sum over the last axis: in NumPy's order, eight sums beside each other where there are so many."""
    if axis != -1 or not keepdims:
        _refuse("np.sum without axis=-1 and keepdims=True")
    numbers = _numbers(builder, x)
    whole = len(numbers) - len(numbers) % 8
    sums = numbers[:8]
    for i in range(8, whole):
        sums[i % 8] = sums[i % 8] + numbers[i]
    if whole:
        a, b, c, d = (sums[i] + sums[i + 1] for i in (0, 2, 4, 6))
        sums, numbers = [(a + b) + (c + d)], numbers[whole:]
    else:
        sums, numbers = numbers[:1], numbers[1:]
    return sum(numbers, sums[0])


def _concatenate(builder: Builder, parts: Any, axis: int = 0) -> Traced:
    """np.concatenate of vectors and numbers on the last axis."""
    if axis != -1:
        _refuse(f"np.concatenate with axis={axis} (components are the last axis: axis=-1)")
    return emit(builder, "stack", *(number for part in parts for number in _numbers(builder, part)))


_FUNCTIONS: Mapping[Any, Callable[..., Any]] = {
    np.clip: lambda builder, x, low, high: emit(builder, "minimum", emit(builder, "maximum", x, low), high),
    np.sum: _sum,
    np.concatenate: _concatenate,
    np.stack: _stack,
    np.moveaxis: _moveaxis,
    np.where: _where,
    np.full_like: _full_like,
    np.zeros_like: lambda builder, like, dtype=None: _full_like(builder, like, 0, dtype),
    np.ones_like: lambda builder, like, dtype=None: _full_like(builder, like, 1, dtype),
    np.asarray: _asarray,
    np.take: _take,
}
"""NumPy's functions that are not ufuncs and can be traced."""


def _call(builder: Builder, function: Any, args: Any, options: Any) -> Any:
    """Do what a NumPy function does, or refuse it."""
    if function not in _FUNCTIONS:
        _refuse(f"np.{function.__name__}")
    try:
        return _FUNCTIONS[function](builder, *args, **options)
    except TypeError:
        return _refuse(f"np.{function.__name__} with these arguments")


def _refuse(what: str) -> NoReturn:
    """Raise for an operation outside the closed list."""
    raise CompileError(f"{_place()}: {what} cannot be traced; use only {', '.join(TRACEABLE)}")


REFERENCE = Path(vectors.__file__).parent
"""The folder of the reference: lines of its files are the places of nodes."""


@cache
def _reference_file(path: str) -> str:
    """Return the name of a file of the reference, refimpl/network/siren.py; nothing for another file."""
    found = Path(path)
    return found.relative_to(REFERENCE.parent).as_posix() if REFERENCE in found.parents else ""


def _place() -> str:
    """Return folder/file:line of the traced function's line that is being executed."""
    frame = sys._getframe(1)
    numpy_folder = str(Path(np.__file__).parent)
    while frame.f_back and (
        frame.f_code.co_filename == __file__
        or frame.f_code.co_filename.startswith(numpy_folder)
        or frame.f_code is vectors.fold_rows.__code__
    ):
        frame = frame.f_back
    path = Path(frame.f_code.co_filename)
    return f"{path.parent.name}/{path.name}:{frame.f_lineno}"
