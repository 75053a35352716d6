"""Compute operations on constants (in float64, rounded when emitted); drop operations that do nothing.

x * 1, x / 1, x - 0 and x + (-0) are x for every x; x + 0 is not (it turns -0 into 0) and stays.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from ..interpret import apply
from ..ir import Builder, Node, Program, Type, attributes
from ..ops import OPS
from .rewrite import rewrite

NEUTRAL: Mapping[str, tuple[float, bool]] = {
    "multiply": (1.0, True),
    "divide": (1.0, False),
    "subtract": (0.0, False),
    "add": (-0.0, True),
}
"""The right operand that changes nothing, and whether it may stand on the left too."""


def fold(program: Program) -> Program:
    """Return the program with constant operations computed and neutral ones removed."""
    return rewrite(program, _rule)


def _rule(builder: Builder, node: Node, args: tuple[int, ...]) -> int | None:
    """Return a constant, or the operand that the operation leaves unchanged."""
    if not OPS[node.op].elementwise:
        return None
    constants = [_constant(builder.nodes[arg]) for arg in args]
    if all(value is not None for value in constants):
        return _computed(builder, node, constants)
    if node.op in NEUTRAL:
        value, commutes = NEUTRAL[node.op]
        for keep, other in ((0, 1), (1, 0)) if commutes else ((0, 1),):
            if _same(constants[other], value) and builder.nodes[args[keep]].type == node.type:
                return args[keep]
    return None


def _computed(builder: Builder, node: Node, constants: list[float | None]) -> int | None:
    """Return the constant that the operation gives, or None when it is not finite in float32."""
    with np.errstate(all="ignore"):
        value = float(apply(node, [np.float64(c) for c in constants], {}))
    if not abs(value) <= float(np.finfo(np.float32).max):
        return None
    return builder.add(Node("constant", (), Type(), attributes(value=value)))


def _constant(node: Node) -> float | None:
    """Return the value of a constant, None for anything else."""
    return float(node["value"]) if node.op == "constant" else None  # type: ignore[arg-type]


def _same(found: float | None, wanted: float) -> bool:
    """Return whether two constants are the same number, sign of zero included."""
    return found == wanted and math.copysign(1.0, found) == math.copysign(1.0, wanted)
