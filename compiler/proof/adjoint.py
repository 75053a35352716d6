"""Errors of outputs by what each operation adds itself: running error analysis, backwards.

1. Let e be the errors of an operation's operands. Its own is
   f'(x') - f(x) = [f'(x') - f(x')] + [f(x') - f(x)]: what it makes itself of what the kernel gives it
   [`Enclosure.own`], and slopes times e, the slopes being those of f somewhere between x and x' (the mean
   value theorem) [`slopes`].
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

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.lib.mixins import NDArrayOperatorsMixin
from numpy.typing import NDArray

from ..core.enclosure import OUTWARD, Enclosure
from ..core.intervals import RANGE_OUTWARD, Image
from ..core.ir import Node, Program
from ..core.ops import OPS, image

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


class Interval(NDArrayOperatorsMixin):
    """Numbers (...) between two ends; NumPy's functions of them give their images [ops.py]."""

    def __init__(self, low: Any, high: Any) -> None:
        self.low, self.high = low, high

    def __array_ufunc__(self, ufunc: Any, method: str, *operands: Any) -> Interval:
        ends = ((o.low, o.high) if isinstance(o, Interval) else (o, o) for o in operands)
        return Interval(*IMAGES[ufunc](*ends))

    def __array_function__(self, function: Any, types: Any, args: Any, options: Any) -> Interval:
        return self.__array_ufunc__(function, "", *args)


IMAGES: Mapping[Any, Image] = {op.definition: op.image for op in OPS.values() if op.image is not None}
"""The images of operations, by the functions that define them."""


def slopes(node: Node, operands: Sequence[Enclosure], secant: bool = True) -> list[Near]:
    """Return an operation's slopes (..., n) between its operands' two values; none if its row has none.

    f(x') - f(x) is what each operand changes by itself, those before it being the reference's, those after it
    the kernel's: of a product b' (a' - a) + a (b' - b). `secant`: of a sine it is the slope in the middle of
    both values times 2 sin(d / 2), d = a' - a, and |2 sin(d / 2) - d| <= |d|^3 / 24.
    """
    rule, found, is_wave = OPS[node.op].slopes, list[Near](), secant and node.op in ("sin", "cos")
    reach = [o.read / 2 if is_wave else o.read for o in operands]
    both = [Interval(o.low - r, o.high + r) for o, r in zip(operands, reach, strict=True)]
    if rule is None:
        return []
    for i in range(len(operands)):
        x = [*(Interval(o.low, o.high) for o in operands[:i]), *both[i:]]
        y = image(node, [(each.low, each.high) for each in x])
        slope = rule(Interval(1.0, 1.0), Interval(*y), *x)[i]
        near = _within(*(np.atleast_1d(end) for end in (slope.low, slope.high)))
        found.append(
            Near(near.middle, near.radius + (np.minimum(reach[i] ** 2 / 6, 2.0) if is_wave else 0.0))
        )
    return found


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
            sensitivity, (own, passed) = waiting.pop(index), _passed(program, found, index)
            total = total + np.sum(sensitivity.largest * own[..., None, :], axis=-1)
            for arg, slope in zip(program.nodes[index].args, passed, strict=False):
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


def _passed(program: Program, found: Sequence[Enclosure], index: int) -> tuple[Array, Sequence[Near | None]]:
    """Return the error (..., n) that an operation adds itself, and how it passes on that of its operands.

    Where slopes have no end it is the whole error, and nothing is passed on.
    """
    node, (error, own) = program.nodes[index], (found[index].error, found[index].own)
    whole = _vector(program, index, error)
    if own is not None and node.op in ("affine", "stack", "component"):
        return _vector(program, index, own), [None] * len(node.args)
    operands = []
    for arg in node.args if own is not None else ():
        e = found[arg]
        operands.append(Enclosure(*(_vector(program, arg, part) for part in (e.low, e.high, e.error))))
    passed = slopes(node, operands) if operands else []
    if not passed:
        return whole, ()
    finite = np.isfinite(sum(each.largest for each in passed))
    kept = [Near(*(np.where(finite, part, 0.0) for part in (each.middle, each.radius))) for each in passed]
    return np.where(finite, _vector(program, index, own), whole), kept


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
