"""Programs in which no operation rounds, and the check of their certificates.

It follows the program's text with Python's integers, which have no size. Known of a line's numbers are the
least and the largest value over all inputs, in units of 2^grain [`ranges`].

1. The window's numbers lie in its images' ranges and are integers.
2. float32 holds every multiple of 2^g up to 2^(g + 24) in magnitude. An operation on floats whose result is
   such a number is exact, in any rounding mode, fused with another or not; a sum of products is if the sum
   of all magnitudes is, which is a bound of its partial sums in any order.
3. Products and sums of int32 must stay in it; uint32 wraps, as it does in every language.
4. A conversion must be of a number that the other kind holds; int32 and uint32 wrap. All else is refused.

Then every kernel and every schedule that only reorders sums compute the same numbers. It imports nothing of
the compiler, which asks it whether a program is one of these [whole.py].
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from .evidence import Refused, ends_of_window, inputs_of, nodes_of, same

Range = tuple[Any, Any, int]
"""Least and largest values of a vector's numbers, or of one, as Python's integers: of units of 2^grain."""

EXACT = 2**24
"""Units that float32 holds."""

KINDS = {"int32": (-(2**31), 2**31 - 1), "uint32": (0, 2**32 - 1)}
"""Ends of integers."""


def check_integers(held: Mapping[str, Any], text: str, arrays: Mapping[str, Any]) -> list[Range]:
    """Refuse a certificate of integers, a step of which does not hold; return its values' ranges."""
    found, sums = ranges(text, arrays)
    for number, stated in sums.items():
        same(f"%{number}: affine: sums", held["sums"].get(number), stated)
    same("ranges", held["ranges"], [ends_of(each) for each in found])
    same("bound: output", held["bound"]["output"], [0.0] * len(held["bound"]["output"]))
    return found


def ends_of(each: Range) -> list[float]:
    """Return the ends of a range as a certificate states them."""
    low, high, grain = each
    return [float(min(low)) * 2.0**grain, float(max(high)) * 2.0**grain]


def ranges(text: str, arrays: Mapping[str, Any]) -> tuple[list[Range], dict[str, list[float]]]:
    """Return the range of each line's value, and the magnitudes of all products of each sum, added up."""
    lines = nodes_of(text)
    found: list[Range] = []
    sums: dict[str, list[float]] = {}
    for each in lines:
        line = Line(each, lines, found)
        if line.op == "input":
            found.append(_window(text))
        elif line.op == "constant":
            found.append(_exact([float(line.named["value"])]))
        elif line.op == "parameter":
            found.append(_exact(arrays[line.named["name"]].tolist()))
        elif line.op == "affine":
            value, sums[line.number] = _affine(line, arrays)
            found.append(value)
        elif line.op in OPERATIONS:
            found.append(OPERATIONS[line.op](line))
        else:
            raise Refused(f"{line.name} may round")
    return found, sums


class Line:
    """A line of the text: its operation, kind of number, attributes, operands with their kinds."""

    def __init__(self, found: re.Match[str], lines: Sequence[re.Match[str]], known: Sequence[Range]) -> None:
        self.number, self.op, self.kind = found[1], found[2], _kind(found)
        self.name = f"%{self.number}: {self.op}"
        self.named = dict(pair.split("=") for pair in (found[4] or "").split(", ") if pair)
        places = [int(i) for i in re.findall(r"%(\d+)", found[3])]
        self.kinds = [_kind(lines[i]) for i in places]
        self.operands = [known[i] for i in places]


def _kind(found: re.Match[str]) -> str:
    """Return the kind of number of a line's value."""
    return found[0].rpartition(" : ")[2].partition("[")[0]


def _arithmetic(line: Line) -> Range:
    """Return the range of a sum, a difference, the smaller or the larger of two values."""
    least = min(grain for _, _, grain in line.operands)
    (a, b), (c, d) = ((low << grain - least, high << grain - least) for low, high, grain in line.operands)
    if line.op == "subtract":
        c, d = -d, -c
    choose = {"minimum": np.minimum, "maximum": np.maximum}.get(line.op, np.add)
    return _held(line, (choose(a, c), choose(b, d), least))


def _multiply(line: Line) -> Range:
    """Return the range of a product."""
    (a, b, grain), (c, d, other) = line.operands
    corners = np.stack(np.broadcast_arrays(a * c, a * d, b * c, b * d))
    return _held(line, (corners.min(axis=0), corners.max(axis=0), grain + other))


def _convert(line: Line) -> Range:
    """Return the range of a number in another kind, which must hold it; integers wrap."""
    ((low, high, grain),) = line.operands
    if line.kind != "float32":
        _whole(line, grain)
        least, most = KINDS[line.kind]
        if line.kinds[0] == "float32" and not (least <= min(low) and max(high) <= most):
            raise Refused(f"{line.name}: {min(low)} or {max(high)} is not in {line.kind}")
    return _held(line, (low, high, grain))


def _shift(line: Line) -> Range:
    """Return the range of a word that is shifted by a constant."""
    (low, high, grain), (by, same_by, _) = line.operands
    _whole(line, grain)
    if (by != same_by).any() or not all(0 <= v < 32 for v in by):
        raise Refused(f"{line.name}: by a number that is not a constant below 32")
    return low >> by, high >> by, 0


def _bits(line: Line) -> Range:
    """Return the range of two words' bits together."""
    (_, a, grain), (_, b, _) = line.operands
    _whole(line, grain)
    a, b = np.broadcast_arrays(a, b)
    high = np.minimum(a, b)
    if line.op == "bitwise_xor":
        high = np.array([(1 << max(pair).bit_length()) - 1 for pair in zip(a, b, strict=True)], object)
    return 0 * high, high, 0


OPERATIONS: Mapping[str, Callable[[Line], Range]] = {
    **dict.fromkeys(("add", "subtract", "minimum", "maximum"), _arithmetic),
    "multiply": _multiply,
    "convert": _convert,
    "right_shift": _shift,
    **dict.fromkeys(("bitwise_and", "bitwise_xor"), _bits),
}
"""What is known of the operations that follow the sums."""


def _window(text: str) -> Range:
    """Return the range of the window, all of whose images must be of integers."""
    _, images = inputs_of(text)
    if not images or not all(whole for _, _, whole, *_ in images):
        raise Refused("program: an image is not of integers")
    low, high = (np.array([int(end) for end in ends], object) for ends in ends_of_window(text))
    return low, high, 0


def _exact(values: Sequence[float]) -> Range:
    """Return numbers as integers of the largest unit that holds all."""
    pairs = [value.as_integer_ratio() for value in values]
    unit = max(below for _, below in pairs)
    units = np.array([above * (unit // below) for above, below in pairs], object)
    return units, units, 1 - unit.bit_length()


def _affine(line: Line, arrays: Mapping[str, Any]) -> tuple[Range, list[float]]:
    """Return the range of sums; the magnitudes of all terms of a row together must be exact."""
    ((low, high, grain),) = line.operands
    rows, _, unit = _exact(arrays[line.named["weight"]].ravel().tolist())
    rows, grain = rows.reshape(-1, len(low)), grain + unit
    up, down = np.maximum(rows, 0), np.minimum(rows, 0)
    ends, sums = (up @ low + down @ high, up @ high + down @ low), (up - down) @ np.maximum(-low, high)
    if "bias" in line.named:
        bias, _, unit = _exact(arrays[line.named["bias"]].tolist())
        least = min(grain, unit)
        bias, by, grain = bias << unit - least, grain - least, least
        ends, sums = ((ends[0] << by) + bias, (ends[1] << by) + bias), (sums << by) + abs(bias)
    if max(sums) > EXACT:
        raise Refused(f"{line.name}: a sum may be {max(sums)} units of 2^{grain}, of at most 2^24")
    return (*ends, grain), [float(value) * 2.0**grain for value in sums]


def _held(line: Line, value: Range) -> Range:
    """Return a value that its kind of number holds; uint32 wraps."""
    low, high, grain = value
    if line.kind == "float32":
        if (largest := max(-min(low), *high)) > EXACT:
            raise Refused(f"{line.name}: {largest} units of 2^{grain}, of at most 2^24")
        return value
    _whole(line, grain)
    least, most = KINDS[line.kind]
    if least <= min(low) and max(high) <= most:
        return low, high, 0
    if line.kind == "int32":
        raise Refused(f"{line.name}: {min(low)} or {max(high)} is not in int32")
    return 0 * low, 0 * high + most, 0


def _whole(line: Line, grain: int) -> None:
    """Refuse what need not be an integer."""
    if grain != 0:
        raise Refused(f"{line.name}: of multiples of 2^{grain}, not of integers")
