"""From a NumPy function to a program: call it once with values that write down what is done to them.

1. Each input becomes a tracing value [`Traced`]; the function is called with them [`trace`].
2. NumPy hands every ufunc and function on such a value to it (`__array_ufunc__`, `__array_function__`); the
   operation's row in ops.py gives the node. Numbers become constants, arrays become parameters.
3. `x @ W.T` with a constant matrix becomes one affine node; np.clip becomes maximum and minimum;
   `x[..., i]` a component; `x[..., None]` nothing, since a number goes with every component anyway.
4. Anything else raises: the closed list of operations is what makes one definition serve every executor.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
from numpy.lib.mixins import NDArrayOperatorsMixin
from numpy.typing import NDArray

from ..refimpl.errors import CompileError
from .ir import Attribute, Builder, Gather, Node, Program, Type, attributes
from .ops import ELEMENTWISE, OPS, TypeRuleError

_UFUNCS: Mapping[Any, str] = {op.definition: op.name for op in ELEMENTWISE}
"""NumPy's ufuncs that are operations."""

TRACEABLE = (*(f"np.{op.name}" for op in ELEMENTWISE), "np.matmul", "np.clip", "np.stack", "x[..., i]")
"""The closed list, as error messages and the spec show it."""


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
        if ufunc not in _UFUNCS:
            _refuse(name)
        return emit(self.builder, _UFUNCS[ufunc], *operands)

    def __array_function__(self, function: Any, types: Any, args: Any, options: Any) -> Traced:
        if function not in _FUNCTIONS:
            _refuse(f"np.{function.__name__}")
        try:
            return _FUNCTIONS[function](self.builder, *args, **options)
        except TypeError:
            return _refuse(f"np.{function.__name__} with these arguments")

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


def trace(
    function: Callable[..., Any],
    inputs: Mapping[str, Type],
    gather: Gather | None = None,
    output: str = "color",
    info: Mapping[str, str] | None = None,
) -> Program:
    """Return the program of `function`, called with one tracing value for each of `inputs`, in their order.

    A mapping that `function` returns gives several outputs by name; anything else is the one named `output`.
    """
    builder = Builder()
    values = [Traced(builder, _add(builder, "input", (), name=n, type=t)) for n, t in inputs.items()]
    result = function(*values)
    results = result if isinstance(result, Mapping) else {output: result}
    outputs = tuple((name, _operand(builder, value)) for name, value in results.items())
    pairs = tuple(sorted((info or {}).items()))
    return Program(tuple(builder.nodes), outputs, builder.parameters, gather, pairs)


def emit(builder: Builder, op: str, *operands: Any, **named: Attribute | None) -> Traced:
    """Add one operation on traced values, numbers and arrays."""
    args = tuple(_operand(builder, operand) for operand in operands)
    return Traced(builder, _add(builder, op, args, **named))


def _add(builder: Builder, op: str, args: tuple[int, ...], **named: Attribute | None) -> int:
    """Add a node, with the type that its row gives."""
    given = attributes(**named)
    try:
        kind = OPS[op].type_rule([builder.nodes[arg].type for arg in args], dict(given), builder.parameters)
    except TypeRuleError as error:
        raise CompileError(f"{_place()}: {op}: {error}") from None
    return builder.add(Node(op, args, kind, given))


def _operand(builder: Builder, value: Any) -> int:
    """Return the index of a traced value, or of the constant or parameter that a plain one becomes."""
    if isinstance(value, Traced):
        return value.index
    if isinstance(value, np.ndarray) and value.ndim:
        return _add(builder, "parameter", (), name=builder.parameter(_exact_float32(value)))
    if isinstance(value, bool) or not isinstance(value, int | float | np.number | np.ndarray):
        _refuse(f"a {type(value).__name__} as an operand")
    return _add(builder, "constant", (), value=float(value))


def _exact_float32(array: NDArray[Any]) -> NDArray[np.float32]:
    """Return the array as float32, or refuse: a kernel could not hold its numbers."""
    with np.errstate(over="ignore"):
        rounded = np.ascontiguousarray(array, dtype=np.float32)
    if not np.array_equal(rounded, array):
        raise CompileError(
            f"{_place()}: an array of {array.dtype}, shape {array.shape}, holds numbers that float32 cannot: "
            "kernels keep weights in float32; round the weights first (refimpl.denoise.as_dtype)"
        )
    return rounded


def _matmul(builder: Builder, x: Any, matrix: Any) -> Traced:
    """Turn x @ W.T with a constant W into an affine node without bias; it keeps W (D_out, D_in) itself."""
    if not isinstance(x, Traced) or not isinstance(matrix, np.ndarray) or matrix.ndim != 2:
        _refuse("np.matmul of anything but a traced vector and a constant matrix, x @ W.T")
    return emit(builder, "affine", x, weight=builder.parameter(_exact_float32(matrix.T)))


def _clip(builder: Builder, x: Any, low: Any, high: Any) -> Traced:
    """np.clip is maximum, then minimum."""
    return emit(builder, "minimum", emit(builder, "maximum", x, low), high)


def _stack(builder: Builder, numbers: Any, axis: int = 0) -> Traced:
    """np.stack of numbers on the last axis."""
    if axis != -1:
        _refuse(f"np.stack with axis={axis} (components are the last axis: axis=-1)")
    return emit(builder, "stack", *numbers)


_FUNCTIONS: Mapping[Any, Callable[..., Traced]] = {np.clip: _clip, np.stack: _stack}
"""NumPy's functions that are no ufuncs and can be traced."""


def _refuse(what: str) -> NoReturn:
    """Raise for an operation outside the closed list."""
    raise CompileError(f"{_place()}: {what} cannot be traced; use only {', '.join(TRACEABLE)}")


def _place() -> str:
    """Return folder/file:line of the traced function's line that is being executed."""
    frame = sys._getframe(1)
    numpy_folder = str(Path(np.__file__).parent)
    while frame.f_back and (
        frame.f_code.co_filename == __file__ or frame.f_code.co_filename.startswith(numpy_folder)
    ):
        frame = frame.f_back
    path = Path(frame.f_code.co_filename)
    return f"{path.parent.name}/{path.name}:{frame.f_lineno}"
