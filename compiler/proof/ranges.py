"""What an executor may compute: for each value of a program, in each lane, an interval that holds it.

1. A value has a range [low, high] that holds what every executor computes that keeps the promises of an
   `Arithmetic`; inputs are exact, so their ranges are points [`Range`].
2. Each operation has a rule: from the ranges of its operands to its own [`RULES`]. Rounding to nearest is
   monotone, so the ends of a sum, rounded, are the ends of the rounded sums, and what is computed exactly
   stays a point [`_nearest`]. Functions that the target only approximates widen the ends by their promise.
3. A decision is certain where the ranges of what is compared do not overlap; else it is *undecided*: false
   and true, and a selection by it has a range that holds both branches [`_decision`, `_select`]. Booleans are
   ordered, false before true, which makes "and" and "or" Kleene's three-valued ones.
4. Beside its range a value knows whether an undecided decision affects it [`Range.sure`]: a box behind
   the nearest surface may be undecided, and the distance is sure all the same.
5. Beside it goes the float32 reference's own value (`plain`). Evaluated `guided`, decisions that are
   undecided fall as the reference's, which gives the range of the executors that decide as it does.
6. No finite range: an infinity, and NaN after it, may be there. Decisions on it are undecided.

The rules run in float64. Its rounding, 2**-53 of each result, is covered by widening ends by 2**-51 before
they are rounded [`SLACK`]. Interval arithmetic: Moore, "Interval Analysis", 1966, chapter 3; rounding and
fused operations: IEEE 754-2008, sections 4.3 and 5.4.1; Kleene's logic: Kleene, "Introduction to
Metamathematics", 1952, section 64.

The programs evaluated are those before `expand_sine`: a sine is one node, with its contract. Single steps of
a path have useful ranges; a whole path has none, since each bounce multiplies an error by distance over size.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...refimpl.errors import CompileError
from ..core.interpret import apply, element, run
from ..core.intervals import Ends
from ..core.ir import Node, Program
from ..core.ops import image
from ..core.profiles import (
    EMITTED_COSINE,
    EMITTED_SINE,
    FLUSH,
    LARGEST_DIVISOR,
    RELATIVE_ERROR,
    SineContract,
)
from .bounds import OUTWARD, exp_error, power_error

SLACK = 2.0**-51
"""Relative widening of an end: float64's rounding of an operation, and of the widening, twice."""

SINE_SLACK = 2.0**-38
"""Absolute widening of a sine's ends: float64's sine, and pi / 2 added to arguments of [`SLACK_DOMAIN`]."""

SLACK_DOMAIN = 2.0**14
"""Largest argument of a sine, in radians, that has a range: adding pi / 2 in float64 is off by 2**-39."""


@dataclass(frozen=True)
class Arithmetic:
    """What executors promise. `division` and `root`: relative error, None: correctly rounded.

    `fused`: a sum may take a product that it reads unrounded.
    """

    text: str
    division: float | None
    root: float | None
    fused: bool
    sine: SineContract
    cosine: SineContract


PROMISED = Arithmetic(
    "round to nearest, fused multiply-add allowed, a / b to 2.5 ulp, sqrt to 5 ulp, emitted sine and cosine",
    RELATIVE_ERROR["divide"],
    RELATIVE_ERROR["sqrt"],
    True,
    EMITTED_SINE,
    EMITTED_COSINE,
)
"""Profile `ieee` (profiles.py): what every target is checked against, in the order that the program has."""

CORRECT = Arithmetic(
    "every operation correctly rounded, nothing fused", None, None, False, EMITTED_SINE, EMITTED_COSINE
)
"""IEEE 754 without freedom. On programs after `expand_sine` all ranges are points: equality to the bit."""


@dataclass(frozen=True)
class Range:
    """Ranges over lanes (...): ends in float64, integers and booleans in their own kind.

    `plain` (...) is the float32 reference's value. `sure` (...) says that no undecided decision affects it.
    `product` holds the ends before rounding where the value is a product.
    """

    low: Any
    high: Any
    plain: Any
    sure: Any = np.True_
    product: tuple[Any, Any] | None = None

    @property
    def point(self) -> Any:
        """Return where (...) there is one value only."""
        return self.low == self.high

    @property
    def known(self) -> Any:
        """Return where (...) the range is finite."""
        return np.isfinite(self.low) & np.isfinite(self.high)

    def holds(self, found: Any) -> Any:
        """Return where (...) a value found lies in the range; NaN does nowhere."""
        return (self.low <= found) & (found <= self.high)


@dataclass(frozen=True)
class Context:
    """What a rule may look at beside its operands: node, tables, promises, the reference's result.

    `plain` (...) is what the reference computes; `guided` says that undecided decisions fall as there.
    """

    node: Node
    parameters: Mapping[str, Any]
    arithmetic: Arithmetic
    plain: Any
    guided: bool


Rule = Callable[[Context, list[Range]], Range]


def evaluate(
    program: Program, inputs: Mapping[str, Any], arithmetic: Arithmetic = PROMISED, guided: bool = False
) -> dict[str, Range]:
    """Return the range of each output for inputs (...), exact numbers or ranges by name."""
    parameters = program.parameters

    def range_of(node: Node, operands: list[Range], row: int) -> Range:
        """Return the range of one node."""
        if node.op == "input":
            return _given(inputs[str(node["name"])], node.type.dtype)
        if node.op == "constant":
            return _given(np.asarray(node["value"]), node.type.dtype)
        if node.op == "row":
            return _given(parameters[str(node["table"])][row], node.type.dtype)
        if node.op not in RULES or node.type.shape:
            raise CompileError(
                f"operation {node.op!r} giving {node.type} has no rule for ranges; there are rules for "
                f"numbers and for: {', '.join(RULES)}; add one to RULES of compiler/proof/ranges.py"
            )
        plain = apply(node, [o.plain for o in operands], parameters, np.dtype(np.float32))
        return RULES[node.op](Context(node, parameters, arithmetic, plain, guided), operands)

    # Numbers that are too large or no numbers are recognised by their value [`_whole`].
    with np.errstate(all="ignore"):
        return run(program, range_of)


def _given(value: Any, dtype: str) -> Range:
    """Return the point of an exact number, or a range that is given."""
    if isinstance(value, Range):
        return value
    plain = np.asarray(value).astype(element(dtype, np.dtype(np.float32)), copy=False)
    if dtype != "float32":
        return Range(plain, plain, plain)
    return Range(*_flushed(plain.astype(np.float64), plain.astype(np.float64)), plain)


# ---- ends -------------------------------------------------------------------------------------------------


def _wider(low: Any, high: Any, relative: Any = 0.0) -> tuple[Any, Any]:
    """Return ends moved outward, relative to their size, by the given amount and float64's rounding."""
    return low - (relative + SLACK) * np.abs(low), high + (relative + SLACK) * np.abs(high)


def _nearest(low: Any, high: Any) -> tuple[Any, Any]:
    """Return the ends of all numbers of [low, high] rounded to float32; ties may fall on either side."""
    low, high = (end.astype(np.float32).astype(np.float64) for end in _wider(low, high))
    return low, high


def _made(context: Context, low: Any, high: Any, sure: Any, product: Any = None) -> Range:
    """Return a range of floats: zero is in it where a number may be flushed; without end if not finite."""
    low, high = _whole(*_flushed(low, high))
    return Range(low, high, context.plain, (sure & np.isfinite(low)) | (low == high), product)


def _flushed(low: Any, high: Any) -> tuple[Any, Any]:
    """Return ends with 0 between them where a number between them may be flushed."""
    small = (low <= FLUSH) & (high >= -FLUSH)
    return np.where(small, np.minimum(low, 0.0), low), np.where(small, np.maximum(high, 0.0), high)


def _whole(low: Any, high: Any) -> tuple[Any, Any]:
    """Return (-inf, inf) for ends that are not both finite."""
    finite = np.isfinite(low) & np.isfinite(high)
    return np.where(finite, low, -np.inf), np.where(finite, high, np.inf)


def _all_sure(operands: list[Range]) -> Any:
    """Return where (...) all operands are sure, and finite: what may be NaN follows no rule."""
    sure: Any = np.True_
    for operand in operands:
        sure = sure & operand.sure & operand.known
    return sure


def _decided(context: Context, low: Any, high: Any, sure: Any) -> Range:
    """Return the range of an integer or boolean; guided, an undecided one is the reference's."""
    point = low == high
    if context.guided:
        low, high = np.where(point, low, context.plain), np.where(point, high, context.plain)
    return Range(low, high, context.plain, sure | point)


# ---- arithmetic -------------------------------------------------------------------------------------------


def _numbers(real: Rule) -> Rule:
    """Return the rule of an operation on floats or integers: integers are computed exactly."""

    def rule(context: Context, operands: list[Range]) -> Range:
        return (real if context.node.type.dtype == "float32" else _integers)(context, operands)

    return rule


def _integers(context: Context, operands: list[Range]) -> Range:
    """Exact for points, modulo 2**32; else every integer of the kind."""
    limits = np.iinfo(context.node.type.dtype)
    exact = [
        apply(context.node, [getattr(o, end) for o in operands], {}, np.dtype(np.float32))
        for end in ("low", "high")
    ]
    points = np.logical_and.reduce(np.broadcast_arrays(*(o.point for o in operands)))
    low = np.where(points, exact[0], exact[0].dtype.type(limits.min))
    high = np.where(points, exact[1], exact[1].dtype.type(limits.max))
    return _decided(context, low, high, _all_sure(operands))


def _image(context: Context, operands: list[Range]) -> Ends:
    """Return the ends of what the operation makes of its operands, before any rounding."""
    return image(context.node, [(operand.low, operand.high) for operand in operands])


def _sum(context: Context, operands: list[Range]) -> Range:
    """Sums and differences, rounded; products may come unrounded."""
    ends = image(context.node, [_read(context, operand) for operand in operands])
    return _made(context, *_nearest(*ends), _all_sure(operands))


def _read(context: Context, operand: Range) -> tuple[Any, Any]:
    """Return the ends of what a sum may read: with fusing, a product before or after its rounding."""
    if operand.product is None or not context.arithmetic.fused:
        return operand.low, operand.high
    return np.minimum(operand.low, operand.product[0]), np.maximum(operand.high, operand.product[1])


def _multiply(context: Context, operands: list[Range]) -> Range:
    """The image, rounded; and before that, for a sum that reads it."""
    (a, b), (low, high) = operands, _image(context, operands)
    # Products of two float32 numbers are exact in float64: 2 u - 1 stays a point.
    ends = np.broadcast_arrays(a.low, a.high, b.low, b.high)
    slack = np.where(np.logical_and.reduce([end.astype(np.float32) == end for end in ends]), -SLACK, 0.0)
    product = _whole(*_wider(low, high, slack))
    return _made(context, *_nearest(low, high), _all_sure(operands), product)


def _within(context: Context, operands: list[Range], ends: tuple[Any, Any], allowed: Any) -> Range:
    """Return a range with these ends where operands are allowed, else without end."""
    low, high = np.where(allowed, ends[0], -np.inf), np.where(allowed, ends[1], np.inf)
    return _made(context, low, high, _all_sure(operands) & allowed)


def _divide(context: Context, operands: list[Range]) -> Range:
    """The image and the promise, of a reciprocal too; none where the divisor may be 0, or huge."""
    b, relative = operands[-1], context.arithmetic.division
    allowed = (b.low > 0) | (b.high < 0)
    if relative is not None:
        allowed = allowed & (np.maximum(np.abs(b.low), np.abs(b.high)) <= LARGEST_DIVISOR)
    return _within(context, operands, _approximate(*_image(context, operands), relative), allowed)


def _approximate(low: Any, high: Any, relative: float | None) -> tuple[Any, Any]:
    """Return ends rounded, or moved outward by the promised error."""
    return _nearest(low, high) if relative is None else _wider(low, high, relative)


def _sqrt(context: Context, operands: list[Range]) -> Range:
    """Monotone, and the promise; none where the operand may be negative."""
    ends = _approximate(*_image(context, operands), context.arithmetic.root)
    return _within(context, operands, ends, operands[0].low >= 0)


def _power(context: Context, operands: list[Range]) -> Range:
    """Monotone in both, so of the powers of ends, and the promise; none where x may be 0 or below."""
    x, y = operands
    exponent = np.maximum(np.abs(y.low), np.abs(y.high))
    logarithm = np.maximum(np.abs(np.log2(x.low)), np.abs(np.log2(x.high)))
    # Float64's own logarithms and powers are right to a few of its units: far below 2**-20 of the promise.
    relative = power_error(exponent, logarithm) * (1 + OUTWARD)
    return _within(context, operands, _wider(*_image(context, operands), relative), x.low > 0)


def _exp(context: Context, operands: list[Range]) -> Range:
    """Monotone, and the promise."""
    (x,) = operands
    relative = exp_error(np.maximum(np.abs(x.low), np.abs(x.high))) * (1 + OUTWARD)
    with np.errstate(over="ignore", invalid="ignore"):
        ends = _wider(*_image(context, operands), relative)
    return _made(context, *ends, _all_sure(operands))


def _wave(context: Context, operands: list[Range]) -> Range:
    """The range of a sine or cosine between both arguments, and the contract's error on its domain."""
    (a,), arithmetic = operands, context.arithmetic
    contract = arithmetic.sine if context.node.op == "sin" else arithmetic.cosine
    own = np.inf if contract.error is None else contract.error + SINE_SLACK
    domain = min(contract.domain, SLACK_DOMAIN)
    inside = (np.maximum(np.abs(a.low), np.abs(a.high)) <= domain) & np.isfinite(own)
    low, high = _image(context, operands)
    return _within(context, operands, (low - own, high + own), inside)


# ---- exact operations -------------------------------------------------------------------------------------


def _sign(context: Context, operands: list[Range]) -> Range:
    """Exact; a product that is negated may be fused still."""
    (a,) = operands
    product = None if a.product is None else (-a.product[1], -a.product[0])
    ends = _whole(*_image(context, operands))
    return Range(*ends, context.plain, a.sure, product if context.node.op == "negative" else None)


def _extreme(context: Context, operands: list[Range]) -> Range:
    """Exact; only an operand that may be the least, or largest, affects the result, and beside NaN either."""
    (a, b), (low, high) = operands, _image(context, operands)
    first, second = a.high <= b.low, b.high <= a.low
    if context.node.op == "maximum":
        first, second = a.low >= b.high, b.low >= a.high
    sure, known = (a.sure & (b.sure | first)) | (b.sure & second), a.known & b.known
    if context.node.type.dtype == "float32":
        low, high = np.where(known, low, -np.inf), np.where(known, high, np.inf)
    return Range(low, high, context.plain, (sure & known) | (low == high))


def _floor(context: Context, operands: list[Range]) -> Range:
    """Monotone; two integers in the range are a decision."""
    (a,) = operands
    low, high = _image(context, operands)
    return _decided(context, low, high, a.sure & (low == high))


def _convert(context: Context, operands: list[Range]) -> Range:
    """To float: rounded. To an integer: cut off, which is a decision; outside its range it may be any."""
    (a,), target = operands, context.node.type.dtype
    if target == "float32":
        low, high = (np.asarray(end).astype(np.float64) for end in (a.low, a.high))
        return _made(context, *_nearest(low, high), _all_sure(operands))
    limits = np.iinfo(target)
    low, high = (np.trunc(np.asarray(end).astype(np.float64)) for end in (a.low, a.high))
    inside = (low >= limits.min) & (high <= limits.max)
    kind = np.dtype(target).type
    low, high = (np.where(inside, end, 0).astype(np.int64).astype(target) for end in (low, high))
    low, high = np.where(inside, low, kind(limits.min)), np.where(inside, high, kind(limits.max))
    return _decided(context, low, high, a.sure & (low == high))


def _take(context: Context, operands: list[Range]) -> Range:
    """The entry at a known index; else from the table's least to its largest."""
    (index,) = operands
    table = context.parameters[str(context.node["table"])]
    wide = table.astype(np.float64) if table.dtype == np.float32 else table
    last = len(table) - 1
    at = np.clip(index.low, 0, last)
    safe = index.point & (index.low == at)
    low, high = np.where(safe, wide[at], wide.min()), np.where(safe, wide[at], wide.max())
    return Range(low, high, context.plain, index.sure | (low == high))


# ---- decisions --------------------------------------------------------------------------------------------


def _decision(context: Context, operands: list[Range]) -> Range:
    """False and true are the ends of what is not certain; on what may be NaN nothing is."""
    (low, high), known = _image(context, operands), operands[0].known & operands[-1].known
    return _decided(context, low & known, high | ~known, False)


def _select(context: Context, operands: list[Range]) -> Range:
    """The branch that is chosen, or the hull of both."""
    condition, a, b = operands
    low, high = _image(context, operands)
    sure = np.where(condition.low, a.sure, ~condition.high & b.sure)
    return Range(low, high, context.plain, sure | (low == high))


RULES: Mapping[str, Rule] = {
    **dict.fromkeys(("add", "subtract"), _numbers(_sum)),
    "multiply": _numbers(_multiply),
    **dict.fromkeys(("divide", "reciprocal"), _divide),
    **dict.fromkeys(("negative", "absolute"), _sign),
    **dict.fromkeys(("minimum", "maximum"), _extreme),
    "floor": _floor,
    "sqrt": _sqrt,
    "power": _power,
    "exp": _exp,
    **dict.fromkeys(("sin", "cos"), _wave),
    **dict.fromkeys(("less", "less_equal", "greater", "greater_equal", "equal", "not_equal"), _decision),
    **dict.fromkeys(("logical_and", "logical_or", "logical_not"), _decision),
    **dict.fromkeys(("bitwise_xor", "bitwise_and", "right_shift"), _integers),
    "select": _select,
    "convert": _convert,
    "take": _take,
}
"""One rule an operation; inputs, constants and rows are `evaluate`'s own. Vectors are taken apart before, by
`scalarize`."""


def where(condition: Any, a: Range, b: Range) -> Range:
    """Return ranges (...): a where the condition (...) holds, else b."""
    pairs = (a.low, b.low), (a.high, b.high), (a.plain, b.plain), (a.sure, b.sure)
    return Range(*(np.where(condition, first, second) for first, second in pairs))
