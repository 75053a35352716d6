"""How far a kernel may be from the reference: a bound for every value of a program, one rule an operation.

1. For each value we keep an interval that holds the reference's value (float64, the same float32 weights and
   inputs) and a bound of |kernel's value - reference's value| [`Enclosure`].
2. Each operation has a rule: from the enclosures of its operands to its own [`RULES`]. A rule adds the
   error that it passes on and the error that it makes itself, in the arithmetic of profiles.py: any order
   of summation, with or without fused multiply-add, results below 2**-126 flushed or not.
3. Over a box of inputs that gives an a-priori bound [`over_box`]; at given inputs, with intervals of one
   point and all pixels at once, a sharper a-posteriori one [`at_inputs`].
4. A number on the way that may be too large for float32 leaves no bound: the kernel may hold an infinity
   there, and NaN after it [`held`].
5. The rules themselves are computed in float64; what that rounding and the reference's own could change is
   below 2**-28 of each term, and every result is widened by more [`_outward`].

A target may fuse a product with the sum that reads it, also across nodes. That leaves out the product's
rounding for this one reader: an error of 0 in place of one that the product's rule allows.

Sums, and their order: sums.py. The programs analysed are those before `expand_sine`: a sine is one node,
with the contract that its profile gives.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..core.enclosure import OUTWARD as OUTWARD
from ..core.enclosure import OVERFLOW
from ..core.enclosure import Enclosure as Enclosure
from ..core.intervals import RANGE_OUTWARD, Ends
from ..core.ir import Gather, Node, Program
from ..core.ops import LOOPS, OPS, image
from ..core.profiles import (
    EXP2_ULPS,
    EXP_ULPS,
    FLUSH,
    LARGEST_DIVISOR,
    LOG2_ABSOLUTE,
    LOG2_RELATIVE,
    RELATIVE_ERROR,
    UNIT_ROUNDOFF,
    SineContract,
)
from ..core.sums import gamma, parts, rounding
from . import adjoint, scaled

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Context:
    """What a rule may look at beside its operands: the node, the parameters in float64, sine and cosine.

    `cosine` None: nothing is promised of it. `gather`: how the node's operand is filled, if it is a window.
    """

    node: Node
    parameters: Mapping[str, Array]
    sine: SineContract
    cosine: SineContract | None = None
    gather: Gather | None = None


Rule = Callable[[Context, list[Enclosure]], Enclosure]


# ---- rules ------------------------------------------------------------------------------------------


def _rounded(context: Context, low: Array, high: Array, passed_on: Array) -> Enclosure:
    """Add to the error that is passed on the error of rounding the result."""
    magnitude = np.maximum(np.abs(low), np.abs(high)) + passed_on
    relative = RELATIVE_ERROR[OPS[context.node.op].rounding]
    return held(low, high, passed_on + relative * magnitude + FLUSH, (1 + relative) * magnitude + FLUSH)


def held(low: Array, high: Array, error: Array, size: Array) -> Enclosure:
    """Give no bound where numbers of this size may overflow, or where their size is not known (NaN)."""
    return Enclosure(low, high, np.where(size < OVERFLOW, error, np.inf), size)


def _constant(context: Context, operands: list[Enclosure]) -> Enclosure:
    """A constant is rounded to float32 when it is emitted."""
    value = np.asarray(context.node["value"], np.float64)
    return Enclosure(value, value, np.abs(value.astype(np.float32) - value))


def _parameter(context: Context, operands: list[Enclosure]) -> Enclosure:
    """Parameters are float32 already."""
    vector = context.parameters[str(context.node["name"])]
    return Enclosure(vector, vector, np.zeros_like(vector))


def _affine(context: Context, operands: list[Enclosure]) -> Enclosure:
    """|W| times x's error, and what rounding the sums in their parts adds [sums.py]."""
    (x,) = operands
    weight = context.parameters[str(context.node["weight"])]
    bias = np.zeros(weight.shape[0])
    if context.node.get("bias") is not None:
        bias = context.parameters[str(context.node["bias"])]
    n = weight.shape[1] + 1
    size = np.abs(weight).T
    # Range: the centre's image, and what the radius of each input adds; float64 rounds sums of n terms.
    outward = max(RANGE_OUTWARD, n * 2.0**-52)
    middle = (x.low + x.high) / 2 @ weight.T + bias
    reach = ((x.high - x.low) / 2 + outward * x.largest) @ size + outward * np.abs(bias)
    # Error: x's own, rounding, and underflow of a weight, of a product and of a sum.
    blocks = parts(context.gather, weight.shape[1])
    own = rounding(weight, bias, x.low - x.read, x.high + x.read, blocks)
    underflow = FLUSH * (np.sum(x.seen, axis=-1, keepdims=True) + 4 * n)
    # In any order of summation no partial sum is larger than the sum of all magnitudes.
    whole = ((x.seen + FLUSH) @ size + np.abs(bias)) * (1 + gamma(n)) + n * FLUSH
    return held(middle - reach, middle + reach, x.read @ size + own + underflow, whole)


def _image(context: Context, operands: Sequence[Enclosure]) -> Ends:
    """Return the range of the reference's value."""
    return image(context.node, [(operand.low, operand.high) for operand in operands])


def _sum(context: Context, operands: list[Enclosure]) -> Enclosure:
    """Errors add up, of a sum and of a difference."""
    a, b = operands
    return _rounded(context, *_image(context, operands), a.read + b.read)


def _multiply(context: Context, operands: list[Enclosure]) -> Enclosure:
    """(a + da)(b + db) - a b = a db + b da + da db."""
    a, b = operands
    passed_on = a.largest * b.read + b.largest * a.read + a.read * b.read
    return _rounded(context, *_image(context, operands), passed_on)


def _divide(context: Context, operands: list[Enclosure]) -> Enclosure:
    """(a + da) / (b + db) - a / b = (da - (a / b) db) / (b + db); no bound for b near 0, or huge.

    Of a reciprocal a is 1, and da, even flushed, no more than a number that is read.
    """
    b, low_high = operands[-1], _image(context, operands)
    moved = operands[0].read if len(operands) == 2 else FLUSH
    nearest = np.where((b.low > 0) | (b.high < 0), np.minimum(np.abs(b.low), np.abs(b.high)), 0.0)
    safe = (nearest > b.read) & (b.seen <= LARGEST_DIVISOR)
    with np.errstate(divide="ignore", invalid="ignore"):
        low, high = np.where(safe, low_high[0], -np.inf), np.where(safe, low_high[1], np.inf)
        quotient = np.maximum(np.abs(low), np.abs(high))
        passed_on = np.where(safe, (moved + quotient * b.read) / (nearest - b.read), np.inf)
    return _rounded(context, low, high, passed_on)


def _kept(context: Context, operands: list[Enclosure]) -> Enclosure:
    """Exact; -a is as far from -a' as a from a', and |a| no farther from |a'|."""
    return Enclosure(*_image(context, operands), operands[0].error)


def _chosen(context: Context, operands: list[Enclosure]) -> Enclosure:
    """Exact; the error of the operand that is least or largest, and of both where either may be."""
    a, b = operands
    if context.node.op == "maximum":
        a, b = (Enclosure(-o.high, -o.low, o.error) for o in operands)
    # An operand above the other by more than both errors is never the least.
    a_error = np.where(a.low - a.read > b.high + b.read, 0.0, a.error)
    b_error = np.where(b.low - b.read > a.high + a.read, 0.0, b.error)
    return Enclosure(*_image(context, operands), np.maximum(a_error, b_error))


def _floor(context: Context, operands: list[Enclosure]) -> Enclosure:
    """Exact; the error counts the integers between the reference's operand and the kernel's."""
    (a,) = operands
    steps = np.floor(a.high + a.read) - np.floor(a.low - a.read)
    return Enclosure(*_image(context, operands), np.minimum(steps, np.ceil(a.read)))


def _sqrt(context: Context, operands: list[Enclosure]) -> Enclosure:
    """|sqrt(a') - sqrt(a)| = |a' - a| / (sqrt(a') + sqrt(a)); no bound when the kernel's a may be below 0."""
    (a,) = operands
    safe = a.low >= a.error
    low, high = _image(context, operands)
    least = low + np.sqrt(np.maximum(a.low - a.error, 0.0))
    with np.errstate(divide="ignore", invalid="ignore"):
        moved = np.where(a.error > 0, a.error / least, 0.0)
    # A number that is flushed before the root loses at most sqrt(FLUSH).
    return _rounded(context, low, high, np.where(safe, moved + np.sqrt(FLUSH), np.inf))


def _power(context: Context, operands: list[Enclosure]) -> Enclosure:
    """x^y = exp(y ln x) for x > 0: what moves y ln x by d moves it by a factor of exp(d) at most.

    |y' ln x' - y ln x| <= |y'| |ln x' - ln x| + |y' - y| |ln x|, and |ln x' - ln x| <= e / (x - e). No bound
    when the kernel's x may be 0 or below.
    """
    x, y = operands
    least = x.low - x.read
    safe = least > 0
    low, high = _image(context, operands)
    with np.errstate(all="ignore"):
        exponent = y.largest + y.read
        logarithm = np.maximum(np.abs(np.log(least)), np.abs(np.log(x.high + x.read)))
        moved = np.expm1(exponent * x.read / least + y.read * logarithm)
        passed_on = np.where(safe, high * moved, np.inf)
        relative = power_error(exponent, logarithm / np.log(2.0))
    magnitude = np.abs(high) + passed_on
    error = np.where(safe, passed_on + relative * magnitude + FLUSH, np.inf)
    return held(low, high, error, (1 + relative) * magnitude + FLUSH)


def power_error(exponent: Array, logarithm: Array) -> Array:
    """Return the largest relative error of pow(x, y) over all targets; |y|, |log2 x| (...) at most these.

    They compute exp2(y log2(x)), or something as good: an error d of y log2(x) is a factor of 2^d.
    """
    product = exponent * logarithm
    d = exponent * np.maximum(LOG2_RELATIVE * logarithm, LOG2_ABSOLUTE) * (1 + UNIT_ROUNDOFF)
    d = d + UNIT_ROUNDOFF * product
    own = 2 * UNIT_ROUNDOFF * (EXP2_ULPS[0] + EXP2_ULPS[1] * (product + d))
    error: Array = np.expm1(d * np.log(2.0) + np.log1p(own))
    return error


def _exp(context: Context, operands: list[Enclosure]) -> Enclosure:
    """|exp(x') - exp(x)| <= exp(x) (exp(e) - 1), and neither is above exp(x + e)."""
    (x,) = operands
    low, high = _image(context, operands)
    # Of an argument far below 0 the first is 0 times an infinity.
    with np.errstate(all="ignore"):
        passed_on = np.fmin(high * np.expm1(x.read), np.exp(x.high + x.read))
    relative = exp_error(x.seen)
    magnitude = high + passed_on
    return held(low, high, passed_on + relative * magnitude + FLUSH, (1 + relative) * magnitude + FLUSH)


def exp_error(argument: Array) -> Array:
    """Return the largest relative error of exp(x) over all targets; |x| (...) at most the argument."""
    return 2 * UNIT_ROUNDOFF * (EXP_ULPS[0] + EXP_ULPS[1] * argument)


def _wave(context: Context, operands: list[Enclosure]) -> Enclosure:
    """The mean value theorem, and the contract's error on its domain; without a contract no bound."""
    (a,), contract = operands, context.sine if context.node.op == "sin" else context.cosine
    if contract is None:
        return _no_rule(context, operands)
    (slope,) = adjoint.slopes(context.node, operands, secant=False)
    moved = np.reshape(slope.largest, np.shape(a.low)) * a.read
    # Both values lie in [-1, 1], up to the contract's error, for all finite arguments in its domain.
    error = np.minimum(moved, 2.0) + (np.inf if contract.error is None else contract.error) + FLUSH
    reach = argument_reach(a)
    safe = np.isfinite(reach) & (reach <= contract.domain)
    return Enclosure(*_image(context, operands), np.where(safe, error, np.inf))


def argument_reach(a: Enclosure) -> Array:
    """Return the largest |argument| that the kernel's sine may be given."""
    return a.largest + a.read


def _stack(context: Context, operands: list[Enclosure]) -> Enclosure:
    """Each number with its own bound."""
    parts = [np.broadcast_arrays(*(getattr(o, name) for o in operands)) for name in ("low", "high", "error")]
    return Enclosure(*(np.stack(part, axis=-1) for part in parts))


def _component(context: Context, operands: list[Enclosure]) -> Enclosure:
    """The component's own bound."""
    (a,), i = operands, int(context.node["index"])  # type: ignore[arg-type]
    return Enclosure(a.low[..., i], a.high[..., i], a.error[..., i])


def _compare(context: Context, operands: list[Enclosure]) -> Enclosure:
    """A boolean is 1 or 0; its error is 0 where ranges are farther apart than both errors, else 1."""
    a, b = operands
    both = a.read + b.read
    with np.errstate(invalid="ignore"):
        low, high = _image(context, operands)
        sure, maybe = image(context.node, [(a.low - both, a.high + both), (b.low, b.high)])
    ends = np.where(low, 1.0, 0.0), np.where(high, 1.0, 0.0)
    return Enclosure(*ends, np.where(sure | ~maybe, 0.0, 1.0))


def _select(context: Context, operands: list[Enclosure]) -> Enclosure:
    """That of the value chosen; where the choice is not sure, either; where it may differ, their distance."""
    condition, a, b = operands
    sure = condition.error == 0.0
    first, second = sure & (condition.low > 0.5), sure & (condition.high < 0.5)
    low, high = image(context.node, [(first, ~second), (a.low, a.high), (b.low, b.high)])
    apart = np.where(sure, 0.0, np.maximum(np.abs(a.high - b.low), np.abs(b.high - a.low)))
    error = np.where(first, a.error, np.where(second, b.error, np.maximum(a.error, b.error) + apart))
    return Enclosure(low, high, error)


def _no_rule(context: Context, operands: list[Enclosure]) -> Enclosure:
    """No bound: a decision may fall differently in the kernel, and nothing is said of what follows."""
    shape = np.broadcast_shapes(*(np.shape(operand.low) for operand in operands))
    return Enclosure(np.full(shape, -np.inf), np.full(shape, np.inf), np.full(shape, np.inf))


NO_BOUND = (
    *("cos", "equal", "not_equal", "logical_and", "logical_or", "logical_not"),
    *("bitwise_and", "bitwise_xor", "right_shift", "convert", "take"),
)
"""Operations without a rule: a program whose output depends on one has no bound, and says so.

A cosine has one where its caller states a contract, as that of a training step does.
"""

RULES: Mapping[str, Rule] = {
    "constant": _constant,
    "parameter": _parameter,
    "affine": _affine,
    "add": _sum,
    "subtract": _sum,
    "multiply": _multiply,
    "divide": _divide,
    "negative": _kept,
    "absolute": _kept,
    "minimum": _chosen,
    "maximum": _chosen,
    "floor": _floor,
    "sqrt": _sqrt,
    "power": _power,
    "exp": _exp,
    "stack": _stack,
    "component": _component,
    "reciprocal": _divide,
    **dict.fromkeys(("less", "less_equal", "greater", "greater_equal"), _compare),
    "select": _select,
    **dict.fromkeys((*NO_BOUND, *LOOPS), _no_rule),
    **dict.fromkeys(("sin", "cos"), _wave),
}
"""One rule an operation; inputs are given."""


# ---- programs ---------------------------------------------------------------------------------------


def enclose(
    program: Program,
    inputs: Mapping[str, tuple[Any, Any]],
    sine: SineContract,
    cosine: SineContract | None = None,
    known: Mapping[int, Enclosure] | None = None,
    local: bool = True,
) -> list[Enclosure]:
    """Return the enclosure of every node for inputs in the given boxes (low, high), each (..., n).

    `known`: those of nodes by index, whose rule is not asked. `local`: with each operation's own error, on
    which the sharper bounds of outputs rest; it takes every rule twice.
    """
    parameters = {name: array.astype(np.float64) for name, array in program.parameters.items()}
    found: list[Enclosure] = []
    for index, node in enumerate(program.nodes):
        if known and index in known:
            found.append(known[index])
            continue
        if node.op == "input":
            low, high = (np.asarray(end, np.float64) for end in inputs[str(node["name"])])
            found.append(Enclosure(low, high, np.zeros_like(low)))
            continue
        operands = [_spread(found[arg], program.nodes[arg], node) for arg in node.args]
        windowed = bool(node.args) and program.nodes[node.args[0]].op == "input"
        context = Context(node, parameters, sine, cosine, program.gather if windowed else None)
        # An infinite bound may meet a weight of 0: _outward reads the NaN as no bound.
        with np.errstate(invalid="ignore"):
            enclosure = _outward(RULES[node.op](context, operands))
            found.append(replace(enclosure, own=_own(context, operands, enclosure)) if local else enclosure)
    return found


def _own(context: Context, operands: Sequence[Enclosure], enclosure: Enclosure) -> Array:
    """Return the error that the operation adds to what the kernel gives it: that of exact operands there."""
    if not any(np.any(operand.error) for operand in operands):
        return enclosure.error
    given = [Enclosure(o.low - o.error, o.high + o.error, np.zeros_like(o.error)) for o in operands]
    return _outward(RULES[context.node.op](context, given)).error


def _spread(found: Enclosure, operand: Node, node: Node) -> Enclosure:
    """Let a number (...) meet the vectors (..., n) of an elementwise operation."""
    if not OPS[node.op].elementwise or not node.type.shape or operand.type.shape or not np.ndim(found.low):
        return found
    return Enclosure(found.low[..., None], found.high[..., None], found.error[..., None])


def _outward(e: Enclosure) -> Enclosure:
    """Widen an enclosure by more than float64 can have rounded it; what is not a number becomes no bound."""
    low = e.low - RANGE_OUTWARD * np.abs(e.low)
    high = e.high + RANGE_OUTWARD * np.abs(e.high)
    error = e.error * (1 + OUTWARD)
    return Enclosure(
        np.where(np.isnan(low), -np.inf, low),
        np.where(np.isnan(high), np.inf, high),
        np.where(np.isnan(error), np.inf, error),
        e.size,
    )


def window_box(gather: Gather) -> tuple[Array, Array]:
    """Return the smallest and largest window vectors (n,); a zero border adds 0 to each range."""
    outside = [0.0] if gather.window.border == "zero" else []
    taps = gather.rows * gather.columns
    low = [min([image.low, *outside]) for image in gather.images for _ in range(image.channels)]
    high = [max([image.high, *outside]) for image in gather.images for _ in range(image.channels)]
    return np.tile(np.array(low), taps), np.tile(np.array(high), taps)


def output_errors(program: Program, found: list[Enclosure]) -> dict[str, Array]:
    """Return the bound (..., n) of each output, which may be flushed when it is written.

    The least of three: what the rules say going forwards, the sum of all operations' own errors times their
    sensitivities [adjoint.py], and, over boxes, the scaled norms of a network's layers [scaled.py].
    """
    errors = {}
    for name, index in program.outputs:
        least = found[index].error
        for sharper in (adjoint.output_error, scaled.output_error):
            error = sharper(program, found, index)
            # What may overflow has no bound, whatever its slopes are.
            least = least if error is None else np.where(np.isfinite(least), np.fmin(least, error), least)
        errors[name] = np.atleast_1d(least + FLUSH)
    return errors


def over_box(program: Program, inputs: Mapping[str, tuple[Any, Any]], sine: SineContract) -> dict[str, Array]:
    """Return the bound (n,) of each output for all inputs in the boxes (low, high): a-priori."""
    return output_errors(program, enclose(program, inputs, sine))


def at_inputs(program: Program, inputs: Mapping[str, Any], sine: SineContract) -> dict[str, Array]:
    """Return the bound (..., n) of each output at the given inputs (..., n): a-posteriori."""
    return output_errors(program, enclose(program, {name: (x, x) for name, x in inputs.items()}, sine))
