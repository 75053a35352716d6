"""The operations of the IR, one row each: what the rest of the compiler knows about them in general.

A row says how many operands an operation takes, which attributes, what type comes out, what it computes (a
NumPy function: the definition, used by the interpreter), and how the target may round it. A new operation is
a row here, a rule in bounds.py and an entry in each dialect's table; tests demand all three.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from .ir import Attribute, Parameters, Type

Rounding = Literal["exact", "nearest", "divide", "sqrt", "sine", "dot"]
"""How a target computes it: exactly, correctly rounded, or with its class's error (profiles.py)."""

TypeRule = Callable[[Sequence[Type], Mapping[str, Attribute], Parameters], Type]


class TypeRuleError(Exception):
    """Operands or attributes that an operation does not take; callers turn it into a CompileError."""


@dataclass(frozen=True)
class Op:
    """A row of the table; `arity` None means one operand or more."""

    name: str
    arity: int | None
    type_rule: TypeRule
    definition: Callable[..., Any]
    rounding: Rounding
    required: tuple[str, ...] = ()
    optional: tuple[str, ...] = ()
    parameters: tuple[str, ...] = ()  # the attributes that name parameters
    elementwise: bool = False


# ---- type rules: (operand types, attributes, parameters) -> type -------------------------------------


def _declared(args: Sequence[Type], attributes: Mapping[str, Attribute], parameters: Parameters) -> Type:
    """An input has the type that it declares."""
    declared = attributes["type"]
    if not isinstance(declared, Type):
        raise TypeRuleError("an input's attribute `type` must be a Type")
    return declared


def _constant(args: Sequence[Type], attributes: Mapping[str, Attribute], parameters: Parameters) -> Type:
    """A constant is one finite float."""
    value = attributes["value"]
    if not isinstance(value, float) or not abs(value) <= float(np.finfo(np.float32).max):
        raise TypeRuleError(f"a constant must be a float that is finite in float32, not {value!r}")
    return Type()


def _parameter(args: Sequence[Type], attributes: Mapping[str, Attribute], parameters: Parameters) -> Type:
    """A parameter used as a value is a vector."""
    array = parameters[str(attributes["name"])]
    if array.ndim != 1:
        raise TypeRuleError(f"a parameter used as a value must be a vector, not of shape {array.shape}")
    return Type(shape=array.shape)


def _affine(args: Sequence[Type], attributes: Mapping[str, Attribute], parameters: Parameters) -> Type:
    """W (D_out, D_in), x (D_in,), b (D_out,) give (D_out,)."""
    weight = parameters[str(attributes["weight"])]
    if weight.ndim != 2 or args[0].shape != weight.shape[1:]:
        raise TypeRuleError(f"weight of shape {weight.shape} does not take an operand of type {args[0]}")
    if "bias" in attributes and parameters[str(attributes["bias"])].shape != weight.shape[:1]:
        raise TypeRuleError(f"bias must have shape {weight.shape[:1]} beside a weight of {weight.shape}")
    return Type(shape=weight.shape[:1])


def _elementwise(args: Sequence[Type], attributes: Mapping[str, Attribute], parameters: Parameters) -> Type:
    """Equal shapes; a number goes with every component of a vector."""
    shapes = {arg.shape for arg in args} - {()}
    if len(shapes) > 1:
        raise TypeRuleError(f"operands must be of one shape or numbers, not {', '.join(map(str, args))}")
    return Type(shape=shapes.pop() if shapes else ())


def _stack(args: Sequence[Type], attributes: Mapping[str, Attribute], parameters: Parameters) -> Type:
    """n numbers give a vector of n."""
    if any(arg.shape for arg in args):
        raise TypeRuleError(f"stack takes numbers, not {', '.join(map(str, args))}")
    return Type(shape=(len(args),))


def _component(args: Sequence[Type], attributes: Mapping[str, Attribute], parameters: Parameters) -> Type:
    """A vector gives one of its numbers."""
    index = attributes["index"]
    if not args[0].shape or not isinstance(index, int) or not 0 <= index < args[0].shape[0]:
        raise TypeRuleError(f"component {index!r} does not exist in an operand of type {args[0]}")
    return Type()


# ---- definitions that are no NumPy function by themselves --------------------------------------------


def _affine_value(x: Any, weight: Any, bias: Any = None) -> Any:
    """x (..., D_in), weight (D_out, D_in), bias (D_out,) -> (..., D_out)."""
    product = np.matmul(x, weight.T)
    return product if bias is None else product + bias


def _stack_value(*numbers: Any) -> Any:
    """n arrays (...) -> (..., n)."""
    return np.stack(np.broadcast_arrays(*numbers), axis=-1)


def _component_value(x: Any, index: int) -> Any:
    """x (..., n) -> (...)."""
    return x[..., index]


def _no_definition(*_: Any, **__: Any) -> Any:
    """Inputs, constants and parameters are given to the interpreter, not computed."""
    raise NotImplementedError


def _row(name: str, function: Callable[..., Any], arity: int, rounding: Rounding) -> Op:
    """Return the row of an elementwise operation whose definition is a NumPy function."""
    return Op(name, arity, _elementwise, function, rounding, elementwise=True)


OPS: Mapping[str, Op] = {
    op.name: op
    for op in (
        Op("input", 0, _declared, _no_definition, "exact", required=("name", "type")),
        Op("constant", 0, _constant, _no_definition, "exact", required=("value",)),
        Op("parameter", 0, _parameter, _no_definition, "exact", required=("name",), parameters=("name",)),
        Op(
            "affine",
            1,
            _affine,
            _affine_value,
            "dot",
            required=("weight",),
            optional=("bias",),
            parameters=("weight", "bias"),
        ),
        _row("add", np.add, 2, "nearest"),
        _row("subtract", np.subtract, 2, "nearest"),
        _row("multiply", np.multiply, 2, "nearest"),
        _row("divide", np.divide, 2, "divide"),
        _row("negative", np.negative, 1, "exact"),
        _row("absolute", np.absolute, 1, "exact"),
        _row("minimum", np.minimum, 2, "exact"),
        _row("maximum", np.maximum, 2, "exact"),
        _row("floor", np.floor, 1, "exact"),
        _row("sqrt", np.sqrt, 1, "sqrt"),
        _row("sin", np.sin, 1, "sine"),
        Op("stack", None, _stack, _stack_value, "exact"),
        Op("component", 1, _component, _component_value, "exact", required=("index",)),
    )
}
"""All operations, by name."""

ELEMENTWISE = tuple(op for op in OPS.values() if op.elementwise)
"""The operations that work on each component alone."""
