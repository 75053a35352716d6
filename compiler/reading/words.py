"""Integers that a text adds up, and words of 32 bits that hold four of them as bytes.

1. A number with a `span` [field.Number] is an integer that lies in it, in every lane, and its two field
   elements are that integer's. Its sums and products with integers stay exact while they stay in 32 bits,
   which the span shows [`operate`]. Nothing rounds: what cancels may, so that both rows have signs.
2. A word's `parts` are its bytes, the lowest first: (n, False) is the low byte of an integer n, (n, True) one
   that n's sign fills, (None, False) is 0 and (None, True) not known. Shifts by whole bytes, masks and `or`
   move bytes about [`moved`]; what is one integer again has its span [`word`].
3. The weights of such kernels are known: they are read bit by bit, as what a text takes them for
   [`Stored`]. Their products with an integer are terms of a sum.
4. What instructions add to a sum is four products of bytes [`dots`].

Spans come from the claim: those of its images' numbers, and of what its affine maps read [`Ranges`], as the
checker of the certificate finds them again.
"""

from __future__ import annotations

import base64
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import reduce
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..proof.evidence import INTEGERS
from ..proof.integer_checker import check_integers
from .field import Number, P, Span, expression, hashed, leaf, literal, part_of, stacked
from .lanes import Unread, Wrong

if TYPE_CHECKING:
    from .machine import Machine

Parts = tuple[tuple[Number | None, bool], ...]

LIMITS: Mapping[str, tuple[int, int]] = {
    "int8": (-(2**7), 2**7 - 1), "uint8": (0, 2**8 - 1),
    "int32": (-(2**31), 2**31 - 1), "uint32": (0, 2**32 - 1),
}  # fmt: skip
"""Least and largest of each kind of integer."""

TYPES: Mapping[str, str] = {"int8": "<i1", "uint8": "<u1", "int32": "<i4", "uint32": "<u4", "float32": "<f4"}
"""How numbers of each kind lie in memory."""

EXACT = 2**24
"""float32 holds all integers up to this magnitude."""

ZERO, OTHER = (None, False), (None, True)
"""Bytes of a word that are 0, and that are not known."""


# ---- integers ---------------------------------------------------------------------------------------------


def integers(values: Any, kind: str, weight: bool = False) -> Number:
    """Return known integers (...), at most one axis, as numbers (2, 1, ...)."""
    values = np.asarray(values, dtype=np.int64)
    row = (values % np.int64(P)).astype(np.uint64)
    shape = hashed(f"literal {kind}", (values + 0.0).view(np.uint64))
    ends = values if values.ndim else int(values)
    return Number(np.stack([row, row])[:, None], shape[None], kind, weight, span=(ends, ends))


def floats(values: Any) -> Number:
    """Return known floats (n,) as numbers (2, 1, n), and one float as one."""
    if np.ndim(values) == 0:
        return replace(literal(float(values), "float32"), literal=None, span=None, weight=True)
    distinct, at = np.unique(np.asarray(values, dtype=np.float32), return_inverse=True)
    held = [literal(float(value), "float32") for value in distinct]
    value = np.concatenate([one.value for one in held], axis=1)[:, at]
    shape = np.concatenate([one.known for one in held])[at]
    return Number(value[:, None], shape[None], weight=True)


def known(number: Number) -> Any:
    """Return the integers that a number is, None where it is not one in all lanes."""
    if number.span is None:
        return None
    low, high = number.span
    if isinstance(low, int) and isinstance(high, int):
        return low if low == high else None
    return low if low is high or np.all(low == high) else None


def within(span: Span, limits: tuple[int, int]) -> bool:
    """Return whether a span lies between two ends."""
    if isinstance(span[0], int) and isinstance(span[1], int):
        return limits[0] <= span[0] and span[1] <= limits[1]
    return bool(np.min(span[0]) >= limits[0] and np.max(span[1]) <= limits[1])


def ends(op: str, a: Span, b: Span) -> Span:
    """Return the span of a sum, a difference or a product."""
    if op == "add":
        return a[0] + b[0], a[1] + b[1]
    if op == "subtract":
        return a[0] - b[1], a[1] - b[0]
    corners = [x * y for x in a for y in b]
    if all(isinstance(corner, int) for corner in corners):
        return min(corners), max(corners)
    return reduce(np.minimum, corners), reduce(np.maximum, corners)


def operate(op: str, a: Number, b: Number) -> Number | None:
    """Return the sum, difference or product of two integers with spans, None of others."""
    if (
        a.span is None
        or b.span is None
        or op not in ("add", "subtract", "multiply")
        or "float32" in (a.kind, b.kind)
    ):
        return None
    kind = "uint32" if "uint32" in (a.kind, b.kind) else "int32"
    span = ends(op, a.span, b.span)
    if not within(span, LIMITS[kind]):
        if kind == "uint32":
            return None
        raise Wrong(f"an integer may be {np.min(span[0])} or {np.max(span[1])}, which int32 does not hold")
    factors = [known(a), known(b)]
    if factors[0] is not None and factors[1] is not None:
        return integers(span[0], kind, a.weight or b.weight)
    if op == "multiply" and factors[0] is None:
        if factors[1] is None:
            return None
        a, b = b, a
    is_sum = a.shape is None or b.shape is None or (op == "multiply" and a.weight)
    va, vb = (n.term if is_sum else n.value for n in (a, b))
    if op == "multiply":
        va, vb = a.value, vb % P
    axes = max(va.ndim, vb.ndim)
    va, vb = (v if v.ndim == axes else v[..., None] for v in (va, vb))
    value = va * vb % P if op == "multiply" else va + vb if op == "add" else va % P + (P - vb % P)
    shape = None if is_sum else expression(op, a, b, commutes=op != "subtract").shape
    return Number(value, shape, kind, span=span)


def cast(value: Number, kind: str, machine: Machine) -> Number | None:
    """Return a number as one of another kind, where it is an integer or a byte is wanted; else None."""
    if value.literal is not None or kind not in TYPES:
        return None
    if value.kind == "float32":
        return _whole(value, kind, machine)
    if kind == "float32":
        return None if value.span is None else _float(value, machine)
    numbers = known(value)
    if numbers is not None:
        return integers(np.asarray(numbers).astype(TYPES[kind]), kind, value.weight)
    if value.span is not None and within(value.span, LIMITS[kind]):
        return replace(value, kind=kind)
    if kind == "uint8":
        return leaf(hashed("byte", value.known), kind, span=LIMITS[kind])
    if kind == "int8":
        raise Unread("a number that may be no byte, as one with a sign")
    parts = parts_of(value)
    return Number(None, expression("convert", value).shape, kind, parts=parts) if parts else None


def _whole(value: Number, kind: str, machine: Machine) -> Number | None:
    """Return a float as an integer: the same where it is whole, else one whose low byte is its own."""
    if machine.span_of is None:
        return None
    if kind not in ("int32", "uint32"):
        raise Unread(f"a float as {kind}")
    span = value.span or machine.span_of(value, machine.running)
    shape = expression("convert", value, kind=kind).shape
    if span is None or not within(span, LIMITS[kind]):
        low = leaf(hashed("low byte", shape), "int32", span=LIMITS["int8"])
        return Number(None, shape, kind, parts=((low, False), OTHER, OTHER, OTHER))
    return Number(value.value, shape, kind, held=value.held, source=value.source, span=span)


def _float(value: Number, machine: Machine) -> Number:
    """Return an integer as a float, which holds it; a sum may be one of the program's."""
    assert value.span is not None
    if not within(value.span, (-EXACT, EXACT)):
        raise Wrong(f"a sum may be beyond {EXACT}, where float32 does not hold all integers")
    if value.shape is None:
        return machine.added(Number(value.value, None))
    return expression("convert", value, kind="float32")


# ---- words ------------------------------------------------------------------------------------------------


def parts_of(number: Number) -> Parts | None:
    """Return the bytes of an integer, where that is known."""
    if number.parts or number.span is None:
        return number.parts
    if within(number.span, (0, 0)):
        return (ZERO,) * 4
    if within(number.span, LIMITS["int8"]):
        return ((number, False), *[(number, True)] * 3)
    return ((number, False), *[ZERO] * 3) if within(number.span, LIMITS["uint8"]) else None


def word(parts: Parts, kind: str, shape: Any) -> Number:
    """Return the word of four bytes: an integer where they are one."""
    first, sign = parts[0]
    if first is not None and not sign and first.span is not None:
        negative = kind == "int32" and all(n is first and fills for n, fills in parts[1:])
        if negative or (parts[1:] == (ZERO,) * 3 and within(first.span, LIMITS["uint8"])):
            return Number(first.value, shape, kind, source=first.source, span=first.span, parts=parts)
    return Number(None, shape, kind, parts=parts)


def moved(name: str, a: Number, b: Number) -> Number | None:
    """Return what an operator of bits makes of words whose bytes are known; None of others."""
    one, other = known(a), known(b)
    unsigned = "uint32" in ((a.kind,) if name.endswith("shift") else (a.kind, b.kind))
    kind = "uint32" if unsigned else "int32"
    if one is not None and other is not None:
        return integers(getattr(np, name)(one, other).astype(TYPES[kind]), kind, a.weight or b.weight)
    if name == "bitwise_or":
        found = _both(parts_of(a), parts_of(b))
        return word(found, kind, expression(name, a, b, commutes=True).shape) if found else None
    if not isinstance(other, int):
        return None
    if (name, other, kind) not in a.made:
        parts = parts_of(a)
        left = parts and _shifted(name, parts, other, kind)
        if not left:
            return None
        a.made[name, other, kind] = word(left, kind, expression(name, a, b).shape)
    return a.made[name, other, kind]


def _both(a: Parts | None, b: Parts | None) -> Parts | None:
    """Return the bytes of two words together, None where both have one at a place."""
    if not a or not b or any(ZERO not in pair for pair in zip(a, b, strict=True)):
        return None
    return tuple(q if p == ZERO else p for p, q in zip(a, b, strict=True))


def _shifted(name: str, parts: Parts, by: int, kind: str) -> Parts | None:
    """Return the bytes that a shift or a mask leaves, None where it cuts through one."""
    if name == "bitwise_and":
        masks = [by >> k & 255 for k in (0, 8, 16, 24)]
        whole = all(mask in (0, 255) for mask in masks)
        return tuple(p if m else ZERO for p, m in zip(parts, masks, strict=True)) if whole else None
    if by not in (0, 8, 16, 24) or not name.endswith("shift"):
        return None
    n = by // 8
    if name == "left_shift":
        return ((ZERO,) * n + parts)[:4]
    top, filled = parts[3]
    fill = (top, True)
    if kind == "uint32" or parts[3] == ZERO:
        fill = ZERO
    elif not filled and not within(top.span, LIMITS["int8"]):  # type: ignore[union-attr, arg-type]
        fill = OTHER
    return (parts + (fill,) * n)[n:]


def bytes_of(number: Number, signed: bool) -> list[Number]:
    """Return the four bytes of a word as integers, with a sign or without."""
    kind = "int8" if signed else "uint8"
    numbers = known(number)
    if numbers is not None:
        if kind not in number.made:
            four = np.asarray(numbers).astype("<i4")[..., None].view(TYPES[kind])
            parts = [integers(four[..., k], "int32", number.weight) for k in range(4)]
            number.made[kind] = parts  # type: ignore[assignment]
        return number.made[kind]  # type: ignore[return-value]
    found = []
    for part, fills in parts_of(number) or [OTHER]:
        if fills or (part is not None and not within(part.span, LIMITS[kind])):  # type: ignore[arg-type]
            raise Wrong(f"it multiplies bytes that are not known as {kind}")
        found.append(literal(0, "int32") if part is None else part)
    return found


def dots(one: Sequence[Number], other: Sequence[Number]) -> Number:
    """Return the sum of the products of four integers and four others."""
    total: Number | None = None
    for a, b in zip(one, other, strict=True):
        term = operate("multiply", a, b)
        found = operate("add", total, term) if total is not None and term is not None else term
        if found is None:
            raise Unread("products of bytes of the picture")
        total = found
    assert total is not None
    return total


def packed(given: Sequence[Number]) -> Number:
    """Return a word of the low bytes of four integers."""
    parts = [parts_of(one) for one in given]
    if len(parts) != 4 or not all(parts):
        raise Unread("a word of other numbers")
    shape = hashed("word", *(one.known for one in given))
    return word(tuple(part[0] for part in parts if part), "int32", shape)


def joined(four: Number) -> Number:
    """Return a word of four bytes in memory."""
    bytes_ = [part_of(four, k) for k in range(4)]
    return word(tuple((one, False) for one in bytes_), "int32", hashed("word", *(b.known for b in bytes_)))


def apart(value: Number) -> Number:
    """Return a word as a vector of its bytes, as memory holds it that a group shares; others as they are."""
    if not value.parts or OTHER in value.parts or any(fills for _, fills in value.parts):
        return value
    return stacked([literal(0, "int32") if n is None else n for n, _ in value.parts])


# ---- memory and types -------------------------------------------------------------------------------------


class Stored:
    """The file of weights, bit by bit, as numbers of a `kind`."""

    def __init__(self, raw: NDArray[np.float32], kind: str = "float32") -> None:
        self.raw, self.kind, self.held = raw, kind, np.ascontiguousarray(raw).view(TYPES[kind])
        self.size = len(self.held)

    def seen_as(self, kind: str) -> Stored:
        """Return the same numbers as some of another kind."""
        return Stored(self.raw, kind)

    def load(self, offset: Any, width: int, machine: Machine) -> Number:
        """Return numbers of the file."""
        if not isinstance(offset, int) or not 0 <= offset <= len(self.held) - width:
            raise Wrong(f"the weights are read at {offset}: there are {len(self.held)}")
        found = self.held[offset : offset + width] if width > 1 else self.held[offset]
        if self.kind == "float32":
            return floats(found)
        return integers(found, self.kind, weight=True)

    def store(self, *given: Any) -> None:
        """Refuse."""
        raise Wrong("the weights are written")


# ---- what a claim says ------------------------------------------------------------------------------------


def stated(held: Any) -> dict[str, NDArray[np.float32]]:
    """Return the parameters that a certificate of integers has itself; none where weights.bin has them."""
    places = held["parameters"].items()
    inside = [name for name, place in places if "base64" in place]
    if not inside or held["schema"] != INTEGERS:
        return {}
    if len(inside) < len(places):
        raise Unread("weights that the file does not hold")
    return {
        name: np.frombuffer(base64.b64decode(place["base64"], validate=True), "<f4").reshape(place["shape"])
        for name, place in places
    }


class Ranges:
    """Which numbers of a program are known to lie in a span, by the first lane's shapes."""

    def __init__(self, held: Any, arrays: Mapping[str, NDArray[np.float32]]) -> None:
        self.first: dict[int, tuple[Any, Span]] = {}
        self.found: Any = check_integers(held, str(held["program"]), arrays) if arrays else []

    def note(self, node: str, numbers: Number) -> None:
        """Keep the spans of what an affine map reads, as the checker finds them, if it is whole."""
        low, high, grain = self.found[int(node)] if self.found else ([], [], -1)
        for k, first in enumerate(
            numbers.known[0].tolist() if grain >= 0 and numbers.shape is not None else ()
        ):
            self.first.setdefault(first, (numbers.known[:, k], (low[k] << grain, high[k] << grain)))

    def of(self, number: Number, running: Any) -> Span | None:
        """Return the span of a number; None of one that is not known to be the same in all lanes that run."""
        if number.shape is None or number.shape.ndim > 1:
            return None
        held, span = self.first.get(int(number.shape[0]), (None, None))
        if held is None:
            return None
        same = np.broadcast_to(number.shape == held, running.shape)
        return span if same[running].all() else None

    def images(self, text: str) -> dict[str, Span]:
        """Return the spans of the images' numbers by name, where a program's text is one of these."""
        found = re.findall(r"(?m)^  image (\w+): \d+ whole in \[(\S+), (\S+)\]$", text if self.found else "")
        return {name: (int(float(low)), int(float(high))) for name, low, high in found}
