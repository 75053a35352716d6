"""Compute operations on constants; drop operations that do nothing.

Two ways to compute: `fold` in float64, rounded when emitted (the denoiser, whose reference is float64), and
`fold_float32` with a rounding after each operation, which gives the bits that the float32 reference has.

x * 1, x / 1, x - 0 and x + (-0) are x for every x; x + 0 is not (it turns -0 into 0) and stays. Integers have
one zero. A selection with a known condition, or between two equal values, is one of them; a look-up at a
known index, or in a table of equal entries, is a constant.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from ..interpret import apply, element
from ..ir import Builder, Node, Program, Type
from ..ops import OPS
from ..trace import constant_of
from .rewrite import rewrite

NEUTRAL: Mapping[str, tuple[float, bool]] = {
    "multiply": (1.0, True),
    "divide": (1.0, False),
    "subtract": (0.0, False),
    "add": (-0.0, True),
    "bitwise_and": (0xFFFFFFFF, True),
    "bitwise_xor": (0, True),
    "right_shift": (0, False),
    "logical_and": (True, True),
    "logical_or": (False, True),
}
"""The right operand that changes nothing, and whether it may be the left one too."""

DECISIVE: Mapping[str, bool] = {"logical_and": False, "logical_or": True}
"""The operand that decides the result, whatever the other one is."""


def fold(program: Program) -> Program:
    """Return the program with constant operations computed in float64 and neutral ones removed."""
    return _folded(program, np.dtype(np.float64))


def fold_float32(program: Program) -> Program:
    """Return the program with constant operations computed in float32 and neutral ones removed."""
    return _folded(program, np.dtype(np.float32))


def _folded(program: Program, kind: np.dtype[Any]) -> Program:
    """Return the program with every node replaced by what is known of it."""

    def rule(builder: Builder, node: Node, args: tuple[int, ...]) -> int | None:
        if node.op == "constant" and node.type.dtype == "float32":
            value = float(kind.type(node["value"]))
            return None if node.attributes == (("value", value),) else constant_of(builder, value, "float32")
        operands = [builder.nodes[arg] for arg in args]
        constants: Known = [each["value"] if each.op == "constant" else None for each in operands]  # type: ignore[misc]
        number = not node.type.shape and (OPS[node.op].elementwise or node.op == "take")
        if args and number and all(value is not None for value in constants):
            return _computed(builder, node, args, kind)
        found = (simplify(builder, node, args, constants) for simplify in _SIMPLER.get(node.op, ()))
        return next((index for index in found if index is not None), None)

    return rewrite(program, rule)


Known = list[bool | int | float | None]
"""The values of a node's operands, None for those that are not constants."""


def _computed(builder: Builder, node: Node, args: tuple[int, ...], kind: np.dtype[Any]) -> int | None:
    """Return the constant that the operation gives, or None when it is not finite in float32."""
    constants = [builder.nodes[arg] for arg in args]
    operands = [element(each.type.dtype, kind).type(each["value"]) for each in constants]
    with np.errstate(all="ignore"):
        value = apply(node, operands, builder.parameters, kind)
    if node.type.dtype == "float32" and not abs(float(value)) <= float(np.finfo(np.float32).max):
        return None
    return constant_of(builder, value, node.type.dtype)


def _neutral(builder: Builder, node: Node, args: tuple[int, ...], constants: Known) -> int | None:
    """Return the operand that the operation leaves unchanged."""
    value, commutes = NEUTRAL[node.op]
    for keep, other in ((0, 1), (1, 0)) if commutes else ((0, 1),):
        if _same(constants[other], value) and builder.nodes[args[keep]].type == node.type:
            return args[keep]
    return None


def _decided(builder: Builder, node: Node, args: tuple[int, ...], constants: Known) -> int | None:
    """Return the constant of `and` with False, and of `or` with True."""
    if node.type.shape or DECISIVE[node.op] not in constants:
        return None
    return constant_of(builder, DECISIVE[node.op], "bool")


def _selected(builder: Builder, node: Node, args: tuple[int, ...], constants: Known) -> int | None:
    """Return the value that is always chosen; between booleans, what the choice amounts to."""
    condition, a, b = args
    chosen = a if constants[0] or a == b else b if constants[0] is False else None
    if chosen is not None:
        return chosen if builder.nodes[chosen].type == node.type else None
    if node.type != Type("bool") or builder.nodes[condition].type != node.type:
        return None
    if constants[1] is True:
        return builder.add(Node("logical_or", (condition, b), node.type))
    if constants[2] is False:
        return builder.add(Node("logical_and", (condition, a), node.type))
    return None


def _looked_up(builder: Builder, node: Node, args: tuple[int, ...], constants: Known) -> int | None:
    """Return the constant of a table whose entries are all the same bits."""
    table = builder.parameters[str(node["table"])]
    same = len({entry.tobytes() for entry in table}) == 1
    return constant_of(builder, table[0], node.type.dtype) if same else None


def _negated(builder: Builder, node: Node, args: tuple[int, ...], constants: Known) -> int | None:
    """Return x of `not not x` and of -(-x)."""
    inner = builder.nodes[args[0]]
    return inner.args[0] if inner.op == node.op else None


_SIMPLER = {
    **dict.fromkeys(NEUTRAL, (_neutral,)),
    **dict.fromkeys(DECISIVE, (_neutral, _decided)),
    **dict.fromkeys(("take", "row", "branch"), (_looked_up,)),
    **dict.fromkeys(("logical_not", "negative"), (_negated,)),
    "select": (_selected,),
}
"""What may be simpler of an operation, in the order in which it is tried."""


def _same(found: bool | int | float | None, wanted: float) -> bool:
    """Return whether two constants are the same number; a float's zero must have the same sign."""
    if found is None or found != wanted:
        return False
    return not isinstance(found, float) or math.copysign(1.0, found) == math.copysign(1.0, wanted)
