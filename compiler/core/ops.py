"""The operations of the IR, one row each: what the rest of the compiler knows about them in general.

A row says how many operands an operation takes, which attributes, what type comes out, what it computes (a
NumPy function: the definition, used by the interpreter), how the target may round it, what it makes of
intervals [intervals.py], and its slopes: traced they are the gradient pass, on intervals the sensitivities of
adjoint.py. A new operation is a row here, a rule in bounds.py and an entry in each dialect's table; tests
demand all three.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal

import numpy as np

from . import intervals as ends
from .intervals import Ends, Image, monotone
from .ir import DTYPES, Attribute, Node, Parameters, Type

Rounding = Literal["exact", "nearest", "divide", "sqrt", "power", "exp", "sine", "cosine", "dot"]
"""How a target computes it: exactly, correctly rounded, or with its class's error (profiles.py)."""

TypeRule = Callable[[Sequence[Type], Mapping[str, Attribute], Parameters], Type]

Slopes = Callable[..., tuple[Any, ...]]
"""(d, y, *x), d being a derivative by the value y -> those by each operand x, in functions of NumPy."""


class TypeRuleError(Exception):
    """Operands or attributes that an operation does not take; callers turn it into a CompileError."""


@dataclass(frozen=True)
class Op:
    """A row of the table; `arity` None means one operand or more."""

    name: str
    arity: int | None
    type_rule: TypeRule
    definition: Callable[..., Any] | None  # None: the interpreter's own
    required: tuple[str, ...] = ()
    optional: tuple[str, ...] = ()
    rounding: Rounding = "exact"
    elementwise: bool = False
    image: Image | None = None  # None: what it computes is not a matter of the operands' ends
    slopes: Slopes | None = None

    @cached_property
    def parameters(self) -> tuple[str, ...]:
        """Return the attributes that name parameters."""
        return tuple(n for n in (*self.required, *self.optional) if n in NAMING or self.name == "parameter")


NAMING = ("weight", "bias", "table", "first", "skip")
"""Attributes that name parameters; that of an operation `parameter` is its name."""


FLOATS = ("float32",)
"""Operands that must be floats."""

NUMBERS = ("float32", "int32", "uint32")
"""Operands that may be any numbers."""

RANGES = {"int32": (-(2**31), 2**31 - 1), "uint32": (0, 2**32 - 1)}
"""The least and the largest integer of each kind."""

LARGEST = float(np.finfo(np.float32).max)
"""The largest finite number of float32."""

# ---- type rules: (operand types, attributes, parameters) -> type -------------------------------------


def _declared(args: Sequence[Type], attributes: Mapping[str, Attribute], parameters: Parameters) -> Type:
    """An input has the type that it declares."""
    declared = attributes["type"]
    if not isinstance(declared, Type):
        raise TypeRuleError("an input's attribute `type` must be a Type")
    return declared


def _constant(args: Sequence[Type], attributes: Mapping[str, Attribute], parameters: Parameters) -> Type:
    """A constant is one finite float, or by its `dtype` an integer in its range or a boolean."""
    value, dtype = attributes["value"], str(attributes.get("dtype", "float32"))
    if dtype in ("int32", "uint32"):
        low, high = RANGES[dtype]
        if type(value) is not int or not low <= value <= high:
            raise TypeRuleError(f"a constant must be an integer that {dtype} holds, not {value!r}")
    elif dtype == "bool":
        if type(value) is not bool:
            raise TypeRuleError(f"a constant must be True or False, not {value!r}")
    elif not isinstance(value, float) or not abs(value) <= LARGEST:
        raise TypeRuleError(f"a constant must be a float that is finite in float32, not {value!r}")
    return Type(dtype)


def _parameter(args: Sequence[Type], attributes: Mapping[str, Attribute], parameters: Parameters) -> Type:
    """A parameter used as a value is a vector."""
    array = parameters[str(attributes["name"])]
    if array.dtype != np.float32:
        raise TypeRuleError(f"a parameter used as a value must be float32, not {array.dtype}")
    if array.ndim != 1:
        raise TypeRuleError(f"a parameter used as a value must be a vector, not of shape {array.shape}")
    return Type(shape=array.shape)


def _affine(args: Sequence[Type], attributes: Mapping[str, Attribute], parameters: Parameters) -> Type:
    """W (D_out, D_in), x (D_in,), b (D_out,) give (D_out,)."""
    weight = parameters[str(attributes["weight"])]
    if weight.ndim != 2 or args[0] != Type(shape=weight.shape[1:]):
        raise TypeRuleError(f"weight of shape {weight.shape} does not take an operand of type {args[0]}")
    if "bias" in attributes and parameters[str(attributes["bias"])].shape != weight.shape[:1]:
        raise TypeRuleError(f"bias must have shape {weight.shape[:1]} beside a weight of {weight.shape}")
    return Type(shape=weight.shape[:1])


def _shape(args: Sequence[Type]) -> tuple[int, ...]:
    """Return the shape of an elementwise result: a number goes with every component of a vector."""
    shapes = {arg.shape for arg in args} - {()}
    if len(shapes) > 1:
        raise TypeRuleError(f"operands must be of one shape or numbers, not {', '.join(map(str, args))}")
    return shapes.pop() if shapes else ()


def _same(args: Sequence[Type], kinds: Sequence[str]) -> str:
    """Return the one kind of number that all operands have."""
    found = {arg.dtype for arg in args}
    if len(found) > 1 or not found <= set(kinds):
        raise TypeRuleError(f"operands must all be {' or all '.join(kinds)}, not {', '.join(map(str, args))}")
    return found.pop()


def _elementwise(kinds: Sequence[str]) -> TypeRule:
    """Return the rule of operations on equal kinds of numbers that keep the kind."""
    return lambda args, attributes, parameters: Type(_same(args, kinds), _shape(args))


def _comparison(args: Sequence[Type], attributes: Mapping[str, Attribute], parameters: Parameters) -> Type:
    """Equal kinds of numbers give booleans."""
    _same(args, NUMBERS)
    return Type("bool", _shape(args))


def _select(args: Sequence[Type], attributes: Mapping[str, Attribute], parameters: Parameters) -> Type:
    """A boolean chooses between two values of one kind."""
    _same(args[:1], ("bool",))
    return Type(_same(args[1:], DTYPES), _shape(args))


def _convert(args: Sequence[Type], attributes: Mapping[str, Attribute], parameters: Parameters) -> Type:
    """A number becomes one of another kind; a float is cut off, and must lie in the integers' range."""
    _same(args, NUMBERS)
    dtype = str(attributes["dtype"])
    if dtype not in NUMBERS:
        raise TypeRuleError(f"numbers are converted to {', '.join(NUMBERS)}, not to {dtype}")
    return Type(dtype, args[0].shape)


def _take(args: Sequence[Type], attributes: Mapping[str, Attribute], parameters: Parameters) -> Type:
    """An index gives an entry of a table; it must lie inside."""
    table = parameters[str(attributes["table"])]
    if args[0] != Type("int32") or table.ndim != 1:
        raise TypeRuleError(f"a table of shape {table.shape} does not take an index of type {args[0]}")
    return Type(str(table.dtype))


def _carried(args: Sequence[Type], attributes: Mapping[str, Attribute], parameters: Parameters) -> Type:
    """A number that a loop carries from trip to trip has the type of what it starts from."""
    if args[0].shape:
        raise TypeRuleError(f"a loop carries numbers, not {args[0]}")
    return args[0]


def _trip(args: Sequence[Type], attributes: Mapping[str, Attribute], parameters: Parameters) -> Type:
    """A table gives the entry that belongs to a loop's trip."""
    table = parameters[str(attributes["table"])]
    if table.ndim != 1:
        raise TypeRuleError(f"a loop walks along a table of one axis, not of shape {table.shape}")
    return Type(str(table.dtype))


def _loop(args: Sequence[Type], attributes: Mapping[str, Attribute], parameters: Parameters) -> Type:
    """All carried numbers, then what each is after a trip (of each part); a walk's boolean at last."""
    index, parts = attributes["index"], int(attributes.get("parts", 1))  # type: ignore[arg-type]
    if "skip" in attributes:
        if args[-1] != Type("bool"):
            raise TypeRuleError("the last operand of a walk must be a boolean: whether a lane enters a node")
        args = args[:-1]
    count = len(args) // (parts + 1)
    if len(args) != count * (parts + 1) or not isinstance(index, int) or not 0 <= index < count:
        raise TypeRuleError(f"result {index!r} does not exist of a loop with {len(args)} operands")
    for after in (args[i : i + count] for i in range(count, len(args), count)):
        if after != args[:count]:
            before, became = (", ".join(map(str, types)) for types in (args[:count], after))
            raise TypeRuleError(f"a trip must keep the kinds that are carried: {before} became {became}")
    return args[index]


def _stack(args: Sequence[Type], attributes: Mapping[str, Attribute], parameters: Parameters) -> Type:
    """n numbers of one kind give a vector of n."""
    if any(arg.shape for arg in args):
        raise TypeRuleError(f"stack takes numbers, not {', '.join(map(str, args))}")
    return Type(_same(args, DTYPES), (len(args),))


def _component(args: Sequence[Type], attributes: Mapping[str, Attribute], parameters: Parameters) -> Type:
    """A vector gives one of its numbers."""
    index = attributes["index"]
    if not args[0].shape or not isinstance(index, int) or not 0 <= index < args[0].shape[0]:
        raise TypeRuleError(f"component {index!r} does not exist in an operand of type {args[0]}")
    return Type(args[0].dtype)


# ---- definitions that are not a NumPy function by themselves --------------------------------------------


def _affine_value(x: Any, weight: Any, bias: Any = None) -> Any:
    """x (..., D_in), weight (D_out, D_in), bias (D_out,) -> (..., D_out)."""
    product = np.matmul(x, weight.T)
    return product if bias is None else product + bias


def _converted(x: Any, dtype: Any) -> Any:
    """x (...) as numbers of another kind."""
    return np.asarray(x).astype(dtype)


def _row(
    name: str,
    function: Callable[..., Any],
    arity: int,
    rounding: Rounding = "exact",
    kinds: Sequence[str] = FLOATS,
    image: Image | None = None,
    slopes: Slopes | None = None,
) -> Op:
    """Return the row of an elementwise operation whose definition is a NumPy function.

    Without an image of its own it is monotone: its ends are those of its operands.
    """
    image, rule = image or monotone(function), _elementwise(kinds)
    return Op(name, arity, rule, function, (), (), rounding, True, image, slopes)


def _quotient(d: Any, y: Any, a: Any, b: Any) -> tuple[Any, ...]:
    """d(a / b) = da / b - (a / b) db / b."""
    over = d / b
    return over, -(over * y)


def _either(first: Any, d: Any) -> tuple[Any, ...]:
    """The value is the first operand where `first` holds, else the second."""
    return np.where(first, d, 0.0), np.where(first, 0.0, d)


def _compare(name: str, function: Callable[..., Any], image: Image) -> Op:
    """Return the row of a comparison."""
    return Op(name, 2, _comparison, function, elementwise=True, image=image)


OPS: Mapping[str, Op] = {
    op.name: op
    for op in (
        Op("input", 0, _declared, None, ("name", "type")),
        Op("constant", 0, _constant, None, ("value",), ("dtype",)),
        Op("parameter", 0, _parameter, None, ("name",)),
        Op("affine", 1, _affine, _affine_value, ("weight",), ("bias",), "dot"),
        _row("add", np.add, 2, "nearest", NUMBERS, slopes=lambda d, y, a, b: (d, d)),
        _row("subtract", np.subtract, 2, "nearest", NUMBERS, ends.subtract, lambda d, y, a, b: (d, -d)),
        _row(
            "multiply", np.multiply, 2, "nearest", NUMBERS, ends.multiply, lambda d, y, a, b: (d * b, d * a)
        ),
        _row("divide", np.divide, 2, "divide", image=ends.divide, slopes=_quotient),
        _row(
            "reciprocal", np.reciprocal, 1, "divide", FLOATS, ends.reciprocal, lambda d, y, x: (-(d * y * y),)
        ),
        _row("negative", np.negative, 1, image=ends.negative, slopes=lambda d, y, x: (-d,)),
        _row(
            "absolute",
            np.absolute,
            1,
            image=ends.absolute,
            slopes=lambda d, y, x: (np.where(x < 0.0, -d, d),),
        ),
        _row("minimum", np.minimum, 2, kinds=NUMBERS, slopes=lambda d, y, a, b: _either(a < b, d)),
        _row("maximum", np.maximum, 2, kinds=NUMBERS, slopes=lambda d, y, a, b: _either(a > b, d)),
        _row("floor", np.floor, 1),
        _row("sqrt", np.sqrt, 1, "sqrt", image=ends.sqrt, slopes=lambda d, y, x: (0.5 * d / y,)),
        _row("power", np.power, 2, "power", image=ends.power),
        _row("exp", np.exp, 1, "exp", image=ends.exponential),
        _row("sin", np.sin, 1, "sine", image=ends.sine, slopes=lambda d, y, x: (d * np.cos(x),)),
        _row("cos", np.cos, 1, "cosine", image=ends.cosine, slopes=lambda d, y, x: (-(d * np.sin(x)),)),
        _compare("less", np.less, ends.less),
        _compare("less_equal", np.less_equal, ends.opposite(ends.greater)),
        _compare("greater", np.greater, ends.greater),
        _compare("greater_equal", np.greater_equal, ends.opposite(ends.less)),
        _compare("equal", np.equal, ends.equal),
        _compare("not_equal", np.not_equal, ends.opposite(ends.equal)),
        _row("logical_and", np.logical_and, 2, kinds=("bool",)),
        _row("logical_or", np.logical_or, 2, kinds=("bool",)),
        _row("logical_not", np.logical_not, 1, kinds=("bool",), image=ends.logical_not),
        *(
            Op(each.__name__, 2, _elementwise(("uint32",)), each, elementwise=True)
            for each in (np.bitwise_and, np.bitwise_xor, np.right_shift)
        ),
        Op("select", 3, _select, np.where, elementwise=True, image=ends.select),
        Op("convert", 1, _convert, _converted, ("dtype",), (), "nearest", elementwise=True),
        Op("take", 1, _take, lambda index, table: np.take(table, index), ("table",)),
        Op("carried", 1, _carried, None, ("index", "loop")),
        Op("row", 0, _trip, None, ("loop", "table")),
        Op("branch", 0, _trip, None, ("loop", "table")),
        Op("loop", None, _loop, None, ("index", "loop", "trips"), ("first", "parts", "skip")),
        Op("stack", None, _stack, lambda *x: np.stack(np.broadcast_arrays(*x), axis=-1)),
        Op("component", 1, _component, lambda x, index: x[..., index], ("index",)),
    )
}
"""All operations, by name."""

LOOPS = ("carried", "row", "branch", "loop")
"""The operations that make up a loop over the rows of tables (loops.py)."""

ELEMENTWISE = tuple(op for op in OPS.values() if op.elementwise)
"""The operations that work on each component by itself."""


def image(node: Node, operands: Sequence[Ends]) -> Ends:
    """Return the ends of what an operation computes, exactly, of its operands between theirs."""
    if node.op == "multiply" and node.args[0] == node.args[1]:
        return ends.square(operands[0])
    rule = OPS[node.op].image
    if rule is None:
        raise TypeRuleError(f"what {node.op} computes is not a matter of its operands' ends")
    return rule(*operands)
