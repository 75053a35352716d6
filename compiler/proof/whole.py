"""Programs in which no operation rounds: a proof, one rule an operation [`RULES`].

Known of a value are its ends over all inputs, and that it is an integer multiple of 2**grain [`Known`].

1. float32 holds every multiple of 2**g up to 2**(g + 24) in magnitude. An operation on floats whose result is
   such a number is exact, in any rounding mode, fused with another or not; a sum of products is if all its
   partial sums are, for which the sum of magnitudes is a bound in any order [`_affine`].
2. Arithmetic on uint32 is modulo 2**32 in every language; on int32 it must stay inside [`_wrapped`].
3. A number that becomes one of another kind must be one that the other kind holds; int32 and uint32 wrap.

Then the interpreter, every kernel and every schedule that only reorders sums compute the same numbers,
whatever a compiler does with floats: fuses, reorders, flushes, rounds in another mode. They have the same
bits where no output is a zero that may have either sign [`has_one_zero`]. A program with an operation that is
not here, or whose numbers may be too large, is not of this kind [`Rounds`]: bounds.py is for it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..core import intervals
from ..core.ir import Node, Program
from .bounds import window_box

Array = NDArray[np.float64]

DIGITS = 24
"""Binary digits of a float32."""

INTEGERS: Mapping[str, tuple[int, int]] = {"int32": (-(2**31), 2**31 - 1), "uint32": (0, 2**32 - 1)}
"""Least and largest number of each kind of integer."""


class Rounds(Exception):
    """A sentence that says which operation of a program may round, or leave its kind of number."""


@dataclass(frozen=True)
class Known:
    """Least and largest value (...) over all inputs, each an integer multiple of 2**grain.

    `two_zeros`: a zero among them may have either sign, by the order of a sum or the rounding mode.
    """

    low: Array
    high: Array
    grain: int = 0
    two_zeros: bool = False

    @property
    def largest(self) -> float:
        """Return the largest magnitude."""
        return float(max(np.abs(self.low).max(), np.abs(self.high).max()))


@dataclass(frozen=True)
class Context:
    """What a rule may look at beside its operands."""

    node: Node
    program: Program

    def refuse(self, why: str) -> Rounds:
        """Return the sentence about this operation."""
        return Rounds(f"{self.node.op} (%{self.program.nodes.index(self.node)}) {why}")

    def held(self, known: Known, largest: float | None = None) -> Known:
        """Return a float that float32 holds, with partial sums up to `largest`, or refuse it."""
        size = (known.largest if largest is None else largest) / 2.0**known.grain
        if not size <= 2**DIGITS:
            raise self.refuse(f"may be {size:g} times 2^{known.grain}: float32 is exact up to 2^{DIGITS}")
        return known

    def array(self, name: str) -> Array:
        """Return a parameter of the node in float64."""
        found: Array = self.program.parameters[str(self.node[name])].astype(np.float64)
        return found


Rule = Callable[[Context, Sequence[Known]], Known]


def grain_of(values: Array) -> int:
    """Return the largest exponent of 2 of which all values (...) are multiples, at most 0."""
    for grain in range(-DIGITS, 1)[::-1]:
        scaled = values * 2.0**-grain
        if np.array_equal(scaled, np.floor(scaled)):
            return grain
    raise Rounds(f"a constant or a weight is not a multiple of 2^-{DIGITS}")


def _constant(context: Context, operands: Sequence[Known]) -> Known:
    """A constant is what it is."""
    value: Array = np.asarray(context.node["value"], np.float64)
    return Known(value, value, grain_of(value))


def _parameter(context: Context, operands: Sequence[Known]) -> Known:
    """Parameters are float32."""
    values = context.array("name")
    return Known(values, values, grain_of(values))


def magnitudes(program: Program, node: Node, x: Known) -> Array:
    """Return the magnitudes of all terms of each row, added up (D_out,): no partial sum is larger."""
    weight = program.parameters[str(node["weight"])].astype(np.float64)
    found: Array = np.abs(weight) @ np.maximum(np.abs(x.low), np.abs(x.high))
    if node.get("bias") is not None:
        found = found + np.abs(program.parameters[str(node["bias"])].astype(np.float64))
    return found


def _affine(context: Context, operands: Sequence[Known]) -> Known:
    """Step 1: no partial sum is larger than the sum of all magnitudes."""
    (x,), weight = operands, context.array("weight")
    bias = context.array("bias") if context.node.get("bias") is not None else np.zeros(len(weight))
    up, down = np.maximum(weight, 0.0), np.minimum(weight, 0.0)
    low, high = (bias + up @ a + down @ b for a, b in ((x.low, x.high), (x.high, x.low)))
    sizes = magnitudes(context.program, context.node, x)
    grain = min(x.grain + grain_of(weight), grain_of(bias))
    return context.held(Known(low, high, grain, two_zeros=True), float(sizes.max()))


def _wrapped(context: Context, known: Known) -> Known:
    """Return an integer that stays in its kind, wraps as uint32 does, or is refused as int32 (step 2)."""
    least, most = INTEGERS[context.node.type.dtype]
    if known.low.min() >= least and known.high.max() <= most:
        return known
    if context.node.type.dtype == "int32":
        raise context.refuse(f"may be {known.largest:g}, which int32 does not hold")
    return Known(np.zeros_like(known.low), np.full_like(known.high, most))


def _arithmetic(ends: intervals.Image, grain: Callable[[int, int], int]) -> Rule:
    """Return the rule of a sum, a difference or a product."""

    def rule(context: Context, operands: Sequence[Known]) -> Known:
        a, b = operands
        low, high = (np.asarray(e, np.float64) for e in ends((a.low, a.high), (b.low, b.high)))
        found = Known(low, high, grain(a.grain, b.grain), _has_two_zeros(context, a, b))
        return context.held(found) if context.node.type.dtype == "float32" else _wrapped(context, found)

    return rule


def _has_two_zeros(context: Context, a: Known, b: Known) -> bool:
    """A product of floats has one zero where neither factor is below 0; a sum has two, as x - x shows."""
    if context.node.type.dtype != "float32":
        return False
    positive = all(not known.two_zeros and known.low.min() >= 0 for known in (a, b))
    return not (context.node.op == "multiply" and positive)


def _convert(context: Context, operands: Sequence[Known]) -> Known:
    """Step 3."""
    (a,), kind = operands, context.node.type.dtype
    given = context.program.nodes[context.node.args[0]].type.dtype
    if kind == "float32":
        return context.held(a)
    if a.grain < 0:
        raise context.refuse("cuts off a number that need not be whole")
    if given == "float32" or kind == "int32":
        least, most = INTEGERS[kind]
        if not (a.low.min() >= least and a.high.max() <= most):
            raise context.refuse(
                f"may be given {a.low.min():g} or {a.high.max():g}, which {kind} does not hold"
            )
        return a
    return _wrapped(context, a)


def _bits(context: Context, operands: Sequence[Known]) -> Known:
    """An `and` is no larger than either operand, an exclusive or has the bits of both."""
    a, b = (operand.high for operand in operands)
    if context.node.op == "bitwise_and":
        high = np.minimum(a, b)
    else:
        high = 2.0 ** np.ceil(np.log2(np.maximum(a, b) + 1.0)) - 1.0
    return Known(np.zeros_like(high), high)


def _shift(context: Context, operands: Sequence[Known]) -> Known:
    """A constant number of digits is cut off; languages shift by fewer than 32 only."""
    a, by = operands
    if not (np.array_equal(by.low, by.high) and by.low.min() >= 0 and by.high.max() < 32):
        raise context.refuse("shifts by a number that is not a constant below 32")
    return Known(np.floor(a.low / 2.0**by.low), np.floor(a.high / 2.0**by.low))


def _least(context: Context, operands: Sequence[Known]) -> Known:
    """One of the operands."""
    a, b = operands
    choose = np.minimum if context.node.op == "minimum" else np.maximum
    two_zeros = a.two_zeros or b.two_zeros
    return Known(choose(a.low, b.low), choose(a.high, b.high), min(a.grain, b.grain), two_zeros)


RULES: Mapping[str, Rule] = {
    "constant": _constant,
    "parameter": _parameter,
    "affine": _affine,
    "add": _arithmetic(lambda a, b: (a[0] + b[0], a[1] + b[1]), min),
    "subtract": _arithmetic(intervals.subtract, min),
    "multiply": _arithmetic(intervals.multiply, int.__add__),
    "convert": _convert,
    **dict.fromkeys(("bitwise_and", "bitwise_xor"), _bits),
    "right_shift": _shift,
    **dict.fromkeys(("minimum", "maximum"), _least),
}
"""One rule an operation; the window is given."""


def known(program: Program) -> list[Known]:
    """Return what is known of each value of a program in which nothing rounds, or raise [`Rounds`]."""
    gather = program.gather
    if gather is None or not gather.whole:
        raise Rounds("the images do not hold integers")
    found: list[Known] = []
    for node in program.nodes:
        if node.op == "input":
            found.append(Known(*window_box(gather), two_zeros=True))
            continue
        context = Context(node, program)
        if node.op not in RULES:
            raise context.refuse("may round")
        found.append(RULES[node.op](context, [found[arg] for arg in node.args]))
    return found


def has_one_zero(program: Program) -> bool:
    """Return whether the outputs of a program in which nothing rounds are the same to the bit, zeros too."""
    found = known(program)
    return not any(found[index].two_zeros for _, index in program.outputs)


def holds(program: Program) -> bool:
    """Return whether no operation of a program rounds: then all devices compute the same bits."""
    try:
        known(program)
    except Rounds:
        return False
    return True
