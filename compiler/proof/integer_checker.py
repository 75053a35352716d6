"""Check a certificate of integers: follow the program's text with Python's integers, which have no size.

1. Digests of files, program and weights agree, as evidence.py finds them [`evidence.read`].
2. The window's numbers lie in its images' ranges and are integers. Each line of the text gives the least and
   the largest value of each number, in units of 2^grain [`_value`]: exact, since nothing is rounded here.
3. A float must be an integer multiple of 2^grain whose magnitude, and for a sum that of all products
   together, is at most 2^24 such units. Products and sums of int32 must stay in it; uint32 wraps; a
   conversion must be of a number that the other kind holds. Anything else is refused.
4. The sums and the ranges that the certificate states are those found.

It shares no code with whole.py, which wrote the certificate.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from fractions import Fraction
from typing import Any

from .evidence import NODE, Refused, same

Range = tuple[list[int], list[int], int]
"""Least and largest values of a vector's numbers, or of one, in units of 2 to the power of the third."""

EXACT = 2**24
"""Units that float32 holds."""

KINDS = {"int32": (-(2**31), 2**31 - 1), "uint32": (0, 2**32 - 1)}
"""Ends of integers."""


def check_integers(held: Mapping[str, Any], text: str, arrays: Mapping[str, Any]) -> list[Range]:
    """Refuse a certificate of integers, a step of which does not hold; return its values' ranges."""
    lines = [m for m in map(NODE.fullmatch, text.splitlines()) if m]
    found: list[Range] = []
    for number, line in enumerate(lines):
        same("program: number of a line", int(line[1]), number)
        found.append(_value(Line(line, lines, found), text, arrays, held["sums"]))
    ends = [[float(Fraction(2) ** g * v) for v in (min(low), max(high))] for low, high, g in found]
    same("ranges", held["ranges"], ends)
    same("bound: output", held["bound"]["output"], [0.0] * len(held["bound"]["output"]))
    return found


class Line:
    """A line of the text: its operation, kind of number, attributes, operands with their kinds."""

    def __init__(self, found: re.Match[str], lines: Sequence[re.Match[str]], known: Sequence[Range]) -> None:
        self.number, self.op, self.kind = found[1], found[2], _kind(found)
        self.name = f"%{self.number}: {self.op}"
        self.named = dict(pair.split("=") for pair in (found[4] or "").split(", ") if pair)
        places = [int(i) for i in re.findall(r"%(\d+)", found[3])]
        self.kinds = [_kind(lines[i]) for i in places]
        length = max((len(known[i][0]) for i in places), default=0)
        # A number goes with every number of a vector.
        self.operands = [
            (low * length, high * length, grain) if len(low) < length else (low, high, grain)
            for low, high, grain in (known[i] for i in places)
        ]


def _kind(found: re.Match[str]) -> str:
    """Return the kind of number of a line's value."""
    return found[0].rpartition(" : ")[2].partition("[")[0]


def _value(line: Line, text: str, arrays: Mapping[str, Any], sums: Mapping[str, Any]) -> Range:
    """Return the range of one line's value."""
    if line.op == "input":
        return _window(text)
    if line.op == "constant":
        return _exact([float(line.named["value"])])
    if line.op == "parameter":
        return _exact(arrays[line.named["name"]].tolist())
    if line.op == "affine":
        return _affine(line, arrays, sums.get(line.number))
    if line.op not in OPERATIONS:
        raise Refused(f"{line.name} may round")
    return OPERATIONS[line.op](line)


def _arithmetic(line: Line) -> Range:
    """Return the range of a sum, a difference, the smaller or the larger of two values."""
    least = min(grain for _, _, grain in line.operands)
    (a, b), (c, d) = (
        ([v << (grain - least) for v in low], [v << (grain - least) for v in high])
        for low, high, grain in line.operands
    )
    if line.op == "subtract":
        c, d = [-v for v in d], [-v for v in c]
    low, high = list(zip(a, c, strict=True)), list(zip(b, d, strict=True))
    if line.op in ("minimum", "maximum"):
        choose: Callable[[tuple[int, int]], int] = min if line.op == "minimum" else max
        return _held(line, ([choose(pair) for pair in low], [choose(pair) for pair in high], least))
    return _held(line, ([sum(pair) for pair in low], [sum(pair) for pair in high], least))


def _multiply(line: Line) -> Range:
    """Return the range of a product."""
    (low, high, grain), (other_low, other_high, other_grain) = line.operands
    pairs = zip(low, high, other_low, other_high, strict=True)
    corners = [sorted((a * c, a * d, b * c, b * d)) for a, b, c, d in pairs]
    return _held(line, ([c[0] for c in corners], [c[-1] for c in corners], grain + other_grain))


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
    if by != same_by or not all(0 <= v < 32 for v in by):
        raise Refused(f"{line.name}: by a number that is not a constant below 32")
    shifted = ([v >> s for v, s in zip(side, by, strict=True)] for side in (low, high))
    return (*shifted, 0)  # type: ignore[return-value]


def _bits(line: Line) -> Range:
    """Return the range of two words' bits together."""
    (_, a, grain), (_, b, _) = line.operands
    _whole(line, grain)
    pairs = zip(a, b, strict=True)
    both = [min(x, y) if line.op == "bitwise_and" else (1 << max(x, y).bit_length()) - 1 for x, y in pairs]
    return [0] * len(both), both, 0


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
    (taps,) = re.findall(r"(?m)^  window (\d+)x(\d+), border (\w+)$", text)
    images = re.findall(r"(?m)^  image \w+: (\d+)( whole)? in \[(\S+), (\S+)\]$", text)
    if not images or not all(image[1] for image in images):
        raise Refused("program: an image is not of integers")
    zero, count = taps[2] == "zero", int(taps[0]) * int(taps[1])
    ends = [(int(n), int(float(a)), int(float(b))) for n, _, a, b in images]
    low = [min(a, 0) if zero else a for n, a, _ in ends for _ in range(n)]
    high = [max(b, 0) if zero else b for n, _, b in ends for _ in range(n)]
    return low * count, high * count, 0


def _exact(values: Sequence[float]) -> Range:
    """Return numbers as integers of the largest unit that holds all."""
    exact = [Fraction(value) for value in values]
    grain = -max(value.denominator.bit_length() - 1 for value in exact)
    units = [int(value / Fraction(2) ** grain) for value in exact]
    return units, units, grain


def _affine(line: Line, arrays: Mapping[str, Any], stated: Any) -> Range:
    """Return the range of sums; the magnitudes of all products of a row together must be exact."""
    ((low, high, grain),) = line.operands
    rows, _, unit = _exact(arrays[line.named["weight"]].ravel().tolist())
    columns = len(low)
    if "bias" in line.named:
        raise Refused(f"{line.name}: a bias in floats")
    least, most, sums = [], [], []
    for start in range(0, len(rows), columns):
        row = rows[start : start + columns]
        corners = [sorted((w * a, w * b)) for w, a, b in zip(row, low, high, strict=True)]
        least.append(sum(c[0] for c in corners))
        most.append(sum(c[1] for c in corners))
        sums.append(sum(max(-c[0], c[1]) for c in corners))
    if max(sums) > EXACT:
        raise Refused(f"{line.name}: a sum may be {max(sums)} units of 2^{grain + unit}, of at most 2^24")
    same(f"{line.name}: sums", stated, [float(value * Fraction(2) ** (grain + unit)) for value in sums])
    return least, most, grain + unit


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
    return [0] * len(low), [most] * len(low), 0


def _whole(line: Line, grain: int) -> None:
    """Refuse what need not be an integer."""
    if grain != 0:
        raise Refused(f"{line.name}: of multiples of 2^{grain}, not of integers")
