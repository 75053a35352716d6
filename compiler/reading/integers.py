"""Integers that a text adds up, and words of 32 bits that hold four of them as bytes.

1. An integer with a span [terms.py] lies in it, in every lane, and its two field elements are that integer's.
   Its sums stay exact while they stay in 32 bits, which the span shows [`operate`]. Nothing rounds: both rows
   have signs.
2. The weights of such kernels are known: they are read bit by bit, as what a text takes them for [`Stored`].
3. A word is a vector of the four floats that its bytes are made of, the lowest first [`packed`].
4. What instructions add to a sum is four products of bytes [`dots`].

Spans come from the claim: those of its images' numbers, and of what its affine maps read [`Ranges`], as the
checker of the certificate finds them again.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..proof.evidence import inputs_of
from ..proof.integer_checker import check_integers, ranges
from .field import P, Words, drawn, hashed
from .lanes import Unread, Wrong
from .terms import Span, Term, aligned, constant, expression, known_floats, known_integers, stacked

Wrongs = Callable[[Any, str], None]
"""Refuses what is wrong in a lane and turn that are active."""

LIMITS: Mapping[str, tuple[int, int]] = {
    "int8": (-(2**7), 2**7 - 1), "uint8": (0, 2**8 - 1),
    "int32": (-(2**31), 2**31 - 1), "uint32": (0, 2**32 - 1),
}  # fmt: skip
"""Least and largest of each kind of integer."""

TYPES: Mapping[str, str] = {"int32": "<i4", "uint32": "<u4", "float32": "<f4"}
"""How numbers of each kind lie in memory."""

EXACT = 2**24
"""float32 holds all integers up to this magnitude."""


def within(span: Span, limits: tuple[int, int]) -> NDArray[np.bool_]:
    """Return which integers are known to lie between two ends."""
    low, high = span
    return (low <= high) & (limits[0] <= low) & (high <= limits[1])


def spans(ok: NDArray[np.bool_], low: Any, high: Any) -> Span | None:
    """Return a span where it holds; None if it does nowhere."""
    return (np.where(ok, low, 1), np.where(ok, high, 0)) if ok.any() else None


def operate(what: str, a: Term, b: Term, wrong: Wrongs) -> Term:
    """Return the sum, difference or product of two integers: a sum is exact where their spans show it."""
    kind = "uint32" if "uint32" in (a.kind, b.kind) else "int32"
    shape = expression(what, a, b, commutes=what != "subtract")
    if what != "add" or a.span is None or b.span is None or a.sums is None or b.sums is None:
        return Term(shape, kind=kind)
    low, high = (x + y for x, y in zip(a.span, b.span, strict=True))
    both, (least, most) = (a.span[0] <= a.span[1]) & (b.span[0] <= b.span[1]), LIMITS[kind]
    beyond = both & ((low < least) | (high > most))
    if kind == "int32":
        wrong(beyond, "an integer may be beyond what int32 holds")
    if not both.all() or beyond.any():
        return Term(shape, kind=kind)
    return Term(shape, aligned(np.add, a.sums, b.sums) % P, kind=kind, span=(low, high))


def added(read: Term, number: Term, total: Words, parts: Callable[[Any], Any]) -> Term | None:
    """Return what turns add to an integer that was read; None if a sum of some may leave int32."""
    if number.span is None or read.span is None or not (number.span[0] <= number.span[1]).all():
        return None
    low, high = map(parts, number.span)
    reach = np.maximum(np.abs(low), np.abs(high)).sum(axis=-1).max() + np.abs(read.span).max()
    if not (read.span[0] <= read.span[1]).all() or reach > LIMITS["int32"][1]:
        return None
    span = low.sum(axis=-1), high.sum(axis=-1)
    return Term(hashed("sum", *total), total, kind=number.kind, span=span)


# ---- conversions ------------------------------------------------------------------------------------------


def convert(term: Term, kind: str, ranges: Ranges) -> Term:
    """Return a number of all lanes as an integer of a kind: the same if that holds it, or another unknown."""
    if term.literal is not None:
        value = int(term.literal)
        if not LIMITS[kind][0] <= value <= LIMITS[kind][1]:
            raise Wrong(f"{term.literal} as {kind}")
        return constant(value, kind)
    whole = term.kind != "float32"
    if kind == "int8" or (kind == "uint8" and not whole):
        raise Unread(f"a {term.kind} as {kind}")
    span = ranges.of(term)
    good = span is not None and bool(within(span, LIMITS[kind]).all())
    good = good and (term.shape is not None or whole)
    if kind == "uint8" and not good:
        raise Wrong("it makes a byte of an integer that is not one")
    sums = term.sums if whole else drawn(term.known)
    if sums is None or not good:
        return Term(expression("convert", term), kind=kind)
    return Term(expression("convert", term), sums, kind=kind, span=span)


def as_float(term: Term, found: Callable[[Term], Term], wrong: Wrongs) -> Term:
    """Return an integer as a float, which holds it; a sum may be one of the program's."""
    shape = expression("convert", term)
    if term.span is None:
        return Term(shape)
    beyond = (term.span[0] <= term.span[1]) & ~within(term.span, (-EXACT, EXACT))
    wrong(beyond, f"a sum may be beyond {EXACT}, where float32 does not hold all integers")
    if term.sums is not None:
        shape = np.where((term.sums % P).any(axis=0), shape, hashed("sum", 0, 0))
    return replace(found(Term(shape, term.sums)), sums=None)


def bits(term: Term) -> Term:
    """Return the bits of known words as floats."""
    if term.span is None or not (term.span[0] == term.span[1]).all():
        raise Unread("bits of the picture as floats")
    return known_floats(term.span[0].astype("<i4").view("<f4"))


# ---- bytes ------------------------------------------------------------------------------------------------


def packed(four: Sequence[Term], ranges: Ranges, wrong: Wrongs) -> Term:
    """Return a word of four numbers that are known to be bytes, of an image in each lane or of all lanes."""
    if len({each.is_wide for each in four if each.literal is None}) > 1:
        raise Unread("a word of numbers of an image and others")
    for each in four:
        span = ranges.of(each)
        bad = True if span is None else ~within(span, LIMITS["int8"])
        wrong(bad, "it makes a byte of an integer that is not one")
    return replace(stacked([replace(each, span=ranges.of(each)) for each in four]), kind="word")


def dots(weights: Term, four: Term, wrong: Wrongs) -> Term:
    """Return the products of the bytes of known words, which have a sign, with four bytes, added up."""
    if weights.span is None or not (weights.span[0] == weights.span[1]).all():
        raise Unread("products of bytes that are not weights")
    if four.span is None or four.kind not in ("uint8", "word"):
        raise Unread("products of bytes of the picture")
    wrong(four.span[0] > four.span[1], "it multiplies bytes that are not known")
    sums: Any = np.uint64(0)
    low: Any = np.int64(0)
    high: Any = np.int64(0)
    for k in range(4):
        byte = (weights.span[0] >> 8 * k & 255 ^ 128) - 128
        one = four.part(k)
        assert one.span is not None
        row = (byte % np.int64(P)).astype(np.uint64)
        factor = drawn(one.known) if four.kind == "word" else one.term % P
        sums = (sums + aligned(lambda x, y: x * y % P, np.stack([row, row]), factor)) % P
        ends = byte * one.span[0], byte * one.span[1]
        low, high = low + np.minimum(*ends), high + np.maximum(*ends)
    return Term(hashed("sum", *sums), sums, kind="int32", span=(low, high))


# ---- what a claim says ------------------------------------------------------------------------------------


class Stored:
    """The file of weights, bit by bit."""

    def __init__(self, raw: NDArray[np.float32]) -> None:
        self.raw = np.ascontiguousarray(raw)

    def at(self, place: NDArray[np.int64], kind: str) -> Term:
        """Return its numbers at places, as those of a kind."""
        if kind not in TYPES:
            raise Unread(f"weights as {kind}")
        values = self.raw.view(TYPES[kind])[place]
        return known_floats(values) if kind == "float32" else known_integers(values, kind)


def filled(text: str, name: str, array: NDArray[Any], value: Any = 0) -> NDArray[Any]:
    """Return a parameter with the weights of one more neuron in each layer, all 0: they fill vectors up."""
    window = re.search(rf"= affine %0 \{{.*weight={name}\b", text) is not None
    pads = [(0, 1), (0, not window)][: array.ndim]
    return np.pad(array, pads, constant_values=value)


class Ranges:
    """Which numbers of a program are known to lie in a span, by their shapes."""

    def __init__(self, held: Any, arrays: Mapping[str, NDArray[np.float32]], stated: bool) -> None:
        self.stated, text = stated, str(held["program"])
        self.noted: dict[int, tuple[int, int]] = {}
        self.keys, self.ends = np.zeros(0, np.uint64), np.zeros((0, 2), np.int64)
        self.found: Any = []
        if arrays:
            check_integers(held, text, arrays)
            self.found, _ = ranges(text, {name: filled(text, name, a) for name, a in arrays.items()})

    def note(self, node: str, numbers: Term) -> None:
        """Keep the spans of what an affine map reads, as the checker finds them, if it is whole."""
        low, high, grain = self.found[int(node)] if self.stated else ([], [], -1)
        if grain < 0 or numbers.shape is None:
            return
        for k, shape in enumerate(numbers.shape[0].tolist()):
            one = k % len(low)
            self.noted.setdefault(shape, (low[one] << grain, high[one] << grain))

    def of(self, number: Term) -> Span | None:
        """Return the span of a number: its own, or one that has been noted."""
        if number.span is not None or number.kind != "float32" or not self.noted:
            return number.span
        if len(self.keys) < len(self.noted):
            self.keys = np.array(sorted(self.noted), dtype=np.uint64)
            self.ends = np.array([self.noted[key] for key in self.keys.tolist()], dtype=np.int64)
        at = np.minimum(np.searchsorted(self.keys, number.known), len(self.keys) - 1)
        return spans(self.keys[at] == number.known, self.ends[at, 0], self.ends[at, 1])

    def images(self, text: str) -> dict[str, tuple[int, int]]:
        """Return the spans of the images' numbers by name, where a program's text is one of these."""
        found = inputs_of(text)[1] if self.stated else []
        return {name: (int(low), int(high)) for name, _, whole, low, high in found if whole}
