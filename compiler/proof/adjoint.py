"""Errors of outputs by what each operation adds itself: running error analysis, backwards.

1. Let e be the errors of an operation's operands. Its own is
   f'(x') - f(x) = [f'(x') - f(x')] + [f(x') - f(x)]: what it makes itself of what the kernel gives it
   [`Enclosure.own`], and slopes times e, the slopes being those of f somewhere between x and x' (the mean
   value theorem) [`SLOPES`].
2. So an output's error is, exactly, the sum over all operations of their own errors times a sensitivity: the
   product of all slopes on the way, added up over all ways. From the last operation to the first it is
   enclosed in [middle - radius, middle + radius] [`output_error`]: sums of products keep their signs, where
   bounds that go forwards add magnitudes.
3. Clamps at the end are left out: they enlarge no difference [`unclamped`].
4. An operation without a rule for its slopes keeps the error that the rules of bounds.py give it, and passes
   nothing on.

Higham, "Accuracy and Stability of Numerical Algorithms", 2002, section 3.3 (running error analysis); backward
sums of sensitivities: Linnainmaa, "Taylor expansion of the accumulated rounding error", BIT 16, 1976.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..core.enclosure import OUTWARD, Enclosure
from ..core.intervals import RANGE_OUTWARD, sine_range
from ..core.ir import Program
from ..core.ops import OPS

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Near:
    """Numbers (...) that lie in [middle - radius, middle + radius]."""

    middle: Array
    radius: Array

    @property
    def largest(self) -> Array:
        """Return the largest magnitude."""
        return np.abs(self.middle) + self.radius


def _within(low: Array, high: Array) -> Near:
    """Return numbers between these ends; float64 rounds the middle."""
    radius = (high - low) / 2 + RANGE_OUTWARD * np.maximum(np.abs(low), np.abs(high))
    return Near((low + high) / 2, radius)


def _always(value: float) -> Callable[[Sequence[Enclosure]], list[Near]]:
    """Return the rule of one operand's slope that is the same everywhere."""
    return lambda operands: [Near(np.full(1, value), np.zeros(1))]


def _multiply(operands: Sequence[Enclosure]) -> list[Near]:
    """a'b' - a b = b' (a' - a) + a (b' - b)."""
    a, b = operands
    return [_within(b.low - b.error, b.high + b.error), _within(a.low, a.high)]


def _minimum(operands: Sequence[Enclosure]) -> list[Near]:
    """Between 0 and 1 for each; 0 for one that is chosen by neither side."""
    a, b = operands
    reach = a.read + b.read
    halves = [np.where(never, 0.0, 0.5) for never in (a.low - reach > b.high, b.low - reach > a.high)]
    return [Near(half, half) for half in halves]


def _maximum(operands: Sequence[Enclosure]) -> list[Near]:
    """As the minimum of the negated."""
    return _minimum([Enclosure(-o.high, -o.low, o.error) for o in operands])


def sine_slope(a: Enclosure) -> Near:
    """sin a' - sin a = 2 cos((a + a') / 2) sin(d / 2), d = a' - a; |2 sin(d / 2) - d| <= |d|^3 / 24."""
    quarter, half = np.pi / 2, a.read / 2
    cosine = _within(*sine_range(a.low - half + quarter, a.high + half + quarter))
    return Near(cosine.middle, cosine.radius + np.minimum(half**2 / 6, 2.0))


SLOPES: Mapping[str, Callable[[Sequence[Enclosure]], list[Near]]] = {
    "add": lambda operands: [Near(np.ones(1), np.zeros(1))] * 2,
    "subtract": lambda operands: [Near(np.full(1, sign), np.zeros(1)) for sign in (1.0, -1.0)],
    "multiply": _multiply,
    "negative": _always(-1.0),
    "absolute": lambda operands: [Near(np.zeros(1), np.ones(1))],
    "minimum": _minimum,
    "maximum": _maximum,
    "sin": lambda operands: [sine_slope(operands[0])],
}
"""The slopes (..., n) of an elementwise operation between its operands' two values, one for each operand."""


def output_error(program: Program, found: Sequence[Enclosure], output: int) -> Array | None:
    """Return the bound (..., n) of one value's error; None where operations' own errors are not known."""
    output = unclamped(program, found, output)
    if found[output].own is None:
        return None
    kind = program.nodes[output].type
    unit = np.eye(kind.shape[0] if kind.shape else 1)
    waiting: dict[int, Near] = {output: Near(unit, np.zeros_like(unit))}
    total = np.zeros(len(unit))
    # Infinite errors and NaN become no bound at the end.
    with np.errstate(invalid="ignore", over="ignore"):
        for index in range(output, -1, -1):
            if index not in waiting:
                continue
            sensitivity, passed = waiting.pop(index), _passed(program, found, index)
            own = found[index].error if passed is None else found[index].own
            total = total + np.sum(sensitivity.largest * _vector(program, index, own)[..., None, :], axis=-1)
            for arg, slope in zip(program.nodes[index].args, passed or (), strict=False):
                more = _through(program, index, arg, sensitivity, slope)
                waiting[arg] = _added(waiting.get(arg), more)
    total = total * (1 + OUTWARD)
    error: Array = np.where(np.isnan(total), np.inf, total)
    return error if kind.shape else error[..., 0]


def unclamped(program: Program, found: Sequence[Enclosure], index: int) -> int:
    """Return the value that clamps with exact constants make this one of: they enlarge no difference."""
    node = program.nodes[index]
    while node.op in ("minimum", "maximum"):
        others = [arg for arg in node.args if program.nodes[arg].op != "constant" or np.any(found[arg].error)]
        if len(others) != 1 or program.nodes[others[0]].type != node.type:
            return index
        (index,) = others
        node = program.nodes[index]
    return index


def _passed(program: Program, found: Sequence[Enclosure], index: int) -> list[Near | None] | None:
    """Return what an operation passes of its operands' errors; None for nothing: its own is the whole."""
    node = program.nodes[index]
    if found[index].own is None:
        return None
    if node.op in ("affine", "stack", "component"):
        return [None] * len(node.args)
    if node.op not in SLOPES:
        return None
    operands = []
    for arg in node.args:
        e = found[arg]
        operands.append(Enclosure(*(_vector(program, arg, part) for part in (e.low, e.high, e.error))))
    return list(SLOPES[node.op](operands))


def _vector(program: Program, index: int, part: Array) -> Array:
    """Return an array (..., n) of a value's, n = 1 for a number's (...)."""
    return np.asarray(part) if program.nodes[index].type.shape else np.asarray(part)[..., None]


def _through(program: Program, index: int, arg: int, sensitivity: Near, slope: Near | None) -> Near:
    """Return the sensitivity (..., K, n) of an operand, along the way through one operation."""
    node, kind = program.nodes[index], program.nodes[arg].type
    middle, radius = sensitivity.middle, sensitivity.radius
    if slope is not None:
        factor, spread = slope.middle[..., None, :], slope.radius[..., None, :]
        found = Near(middle * factor, np.abs(middle) * spread + radius * (np.abs(factor) + spread))
        alone = OPS[node.op].elementwise and node.type.shape and not kind.shape
        return (
            Near(*(part.sum(-1, keepdims=True) for part in (found.middle, found.radius))) if alone else found
        )
    if node.op == "affine":
        weight = program.parameters[str(node["weight"])].astype(np.float64)
        return Near(middle @ weight, (radius + RANGE_OUTWARD * np.abs(middle)) @ np.abs(weight))
    if node.op == "component":
        places = np.zeros((1, kind.shape[0]))
        places[0, int(node["index"])] = 1.0  # type: ignore[arg-type]
        return Near(middle @ places, radius @ places)
    at = [i for i, other in enumerate(node.args) if other == arg]
    return Near(*(part[..., at].sum(-1, keepdims=True) / len(at) for part in (middle, radius)))


def _added(a: Near | None, b: Near) -> Near:
    """Return the sum of two ways' sensitivities."""
    if a is None:
        return b
    rounded = RANGE_OUTWARD * (np.abs(a.middle) + np.abs(b.middle))
    return Near(a.middle + b.middle, a.radius + b.radius + rounded)
