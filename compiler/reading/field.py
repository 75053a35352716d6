"""Numbers of a text under test: elements of a prime field at random points, and shapes of expressions.

A sum of products of weights and inputs is a polynomial. Two polynomials that agree at a random point of a
field of P elements are the same but with a probability of their degree over P (Schwartz and Zippel, 1980), in
every lane. The second row of a `Number` is the polynomial with every coefficient's magnitude, so that a text
which adds and takes away what cancels is another one. Neither depends on the order of a sum.

Whatever is not such a sum has a `shape`: a hash of its operation and its operands' shapes, the order of two
operands of a sum or a product apart. Its two field elements are drawn from that hash.

Sums are not kept for each lane but added up over all lanes, each times a random factor [`add_up_lanes`]: sums
that differ in any lane then differ, but with a probability of 1 / P. One that is a sum of the program is a
number without lanes from there on: it is the same function of each lane's own pixels.
"""

from __future__ import annotations

import secrets
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .lanes import Unread

P = np.uint64(2013265921)
"""15 * 2^27 + 1, a prime: products of two elements fit 64 bits."""

Words = NDArray[np.uint64]

Span = tuple[Any, Any]
"""The least and the largest value of an integer, or of a vector's (width,), in any lane."""

HALF, MASK = np.uint64(16), np.uint64(0xFFFF)
"""Half the bits of a field element, and which these are."""


@dataclass(eq=False)
class Number:
    """What a text holds in one variable, in all lanes: `value` (2, lanes) or (2, lanes, width).

    `given` is that value, None where it is drawn from the shape. `shape` (lanes, ...) is None for sums under
    way, whose value is not reduced. `kind` is its type. `weight`: it was read from the weights. `literal`:
    what a constant is. `held` (lanes,): where it has been written, None for everywhere. `compared`: a and b
    of a < b. `source`: the vector that it is a number of, and which. `span`, `parts`: of integers [words.py].
    """

    given: Words | None
    shape: Words | None = None
    kind: str = "float32"
    weight: bool = False
    literal: float | None = None
    held: NDArray[np.bool_] | None = None
    compared: tuple[Number, Number] | None = None
    source: tuple[Number, int] | None = None
    span: Span | None = None
    parts: tuple[tuple[Number | None, bool], ...] | None = None

    @cached_property
    def value(self) -> Words:
        """Its field elements."""
        if self.given is None:
            assert self.shape is not None
            return drawn(self.shape)
        return self.given

    @cached_property
    def made(self) -> dict[Any, Number]:
        """What operators of bits have made of it, so that it is made once."""
        return {}

    @property
    def axes(self) -> int:
        """How many axes its value has: 3 for vectors."""
        return self.value.ndim if self.shape is None else self.shape.ndim + 1

    @cached_property
    def term(self) -> Words:
        """What goes into a sum: the value, added up over lanes while a source is run."""
        if self.shape is None or not FACTORS:
            return self.value
        if self.source:
            vector, k = self.source
            return vector.term[..., k]
        if self.value.shape[1] == 1:
            return np.asarray(self.value % P * FACTORS["sum"] % P)
        return added_up(self.value, FACTORS["lanes"])

    @property
    def known(self) -> Words:
        """Its shape; of a sum under way, which is no number of the program, one that nothing else has."""
        return hashed("sum", *self.value % P) if self.shape is None else self.shape


FACTORS: dict[str, Words] = {}
"""The factors (lanes,) of "lanes", 0 of those that do not count, and their "sum"."""


def add_up_lanes(count: NDArray[np.bool_] | None) -> None:
    """Add up sums over the lanes that count from now on; None after a source has been run."""
    FACTORS.clear()
    if count is not None:
        FACTORS["lanes"] = hashed("factor", secrets.randbits(63), np.arange(len(count))) % P * count
        FACTORS["sum"] = FACTORS["lanes"].sum() % P


def added_up(value: Words, factors: Words) -> Words:
    """Return the sums (2, 1, ...) over lanes of values (2, lanes, ...) times factors, in the field.

    Halves of 16 bits times 31: 2^16 of these stay below 2^63.
    """
    lanes = len(factors)
    found = np.zeros((2, 1, *value.shape[2:]), dtype=np.uint64)
    for at in range(0, lanes, 2**16):
        part, by = value[:, at : at + 2**16] % P, factors[at : at + 2**16]
        low, high = (np.einsum("rl...,l->r...", h, by)[:, None] for h in (part & MASK, part >> HALF))
        found += low % P + (high % P << HALF) % P
    return found % P


SHIFTS, FACTOR, OTHER = (
    tuple(np.array([30, 27, 31], dtype=np.uint64)),
    np.uint64(0xBF58476D1CE4E5B9),
    np.uint64(0x94D049BB133111EB),
)
"""The numbers of `mixed`."""


def mixed(words: Words) -> Words:
    """Scramble 64 bits (Stafford's thirteenth variant of the finaliser of MurmurHash3)."""
    words = words ^ (words >> SHIFTS[0])
    words *= FACTOR
    words ^= words >> SHIFTS[1]
    words *= OTHER
    words ^= words >> SHIFTS[2]
    return words


MOST = 2**64 - 1
"""The largest word."""


def _mixed_one(word: int) -> int:
    """Return the same of one word: numbers of all lanes folded into one take half of a check's time."""
    word ^= word >> 30
    word = word * 0xBF58476D1CE4E5B9 & MOST
    word ^= word >> 27
    word = word * 0x94D049BB133111EB & MOST
    return word ^ word >> 31


SALT: dict[Any, Any] = {}
"""Random words of one run, by name: nobody can write a text for them."""


def hashed(name: str, *parts: Any) -> Words:
    """Return a hash of integers of 64 bits, elementwise, under a name."""
    if name not in SALT:
        SALT[name] = np.uint64(secrets.randbits(64))
    with np.errstate(over="ignore"):
        found: Any = SALT[name]
        for part in parts:
            word = np.asarray(part).astype(np.uint64, copy=False)
            found = mixed(found * np.uint64(0x9E3779B97F4A7C15) + word)
        return np.asarray(found, dtype=np.uint64)


def drawn(shape: Words) -> Words:
    """Return the field elements (2, ...) of a shape."""
    return np.stack([hashed(f"draw {row}", shape) % P for row in range(2)])


def leaf(shape: Words, kind: str = "float32", **other: Any) -> Number:
    """Return a number that is nothing but its shape."""
    return Number(None, shape, kind, **other)


def literal(value: float, kind: str) -> Number:
    """Return a constant (2, 1) of a text.

    A nonzero float in a sum counts as an independent unknown: constants that cancel in the field need not
    cancel in float32. Integers keep their value and have no magnitude: their sums are exact [words.py].
    """
    is_float = kind == "float32"
    value = (
        float(np.float32(value))
        if is_float
        else float(int(value) % 2**32 if kind == "uint32" else int(value))
    )
    shape = hashed(f"literal {kind}", np.float64(value + 0.0).view(np.uint64))[None]
    exact = np.full((2, 1), int(value) % int(P), dtype=np.uint64) if not is_float or value == 0.0 else None
    return Number(
        drawn(shape) if exact is None else exact, shape, kind, literal=value,
        span=(int(value), int(value)) if value.is_integer() and abs(value) <= 2**32 else None,
    )  # fmt: skip


def alike(*parts: Words) -> list[Words]:
    """Return arrays with as many axes as any has: a number goes with all numbers of a vector."""
    axes = max(part.ndim for part in parts)
    return [part if part.ndim == axes else part[..., None] for part in parts]


def is_sum(a: Number) -> bool:
    """Return whether a number is part of a sum under way, or a weight, which begins one."""
    return a.shape is None or a.weight


def product(a: Number, b: Number) -> Number:
    """Return a * b: of a weight and anything a term of a sum, else an expression."""
    if (a.weight or b.weight) and a.kind == "float32":
        weight, other = (a, b) if a.weight else (b, a)
        va, vb = alike(weight.value, other.term % P if other.shape is None else other.term)
        return Number(va * vb % P)
    return expression("multiply", a, b, commutes=True)


def total(a: Number, b: Number) -> Number:
    """Return a + b: of a sum under way and anything a sum, else an expression."""
    if a.kind == "float32" and (is_sum(a) or is_sum(b)):
        for one, other in ((a, b), (b, a)):
            if one.literal == 0.0 and other.axes >= one.axes:
                return other
        va, vb = alike(a.term, b.term)
        return Number(va + vb)
    return expression("add", a, b, commutes=True)


def difference(a: Number, b: Number) -> Number:
    """Return a - b, whose magnitudes add up."""
    if a.kind == "float32" and (is_sum(a) or is_sum(b)):
        va, vb = alike(a.term % P, b.term % P)
        rows = va + (P - vb)
        rows[1] = va[1] + vb[1]
        return Number(rows)
    return expression("subtract", a, b)


def expression(name: str, *operands: Number, commutes: bool = False, kind: str | None = None) -> Number:
    """Return what an operation makes of numbers: equal where name, kinds and operands are."""
    kinds = tuple([operand.kind for operand in operands])
    parts = [operand.known for operand in operands]
    if len({part.ndim for part in parts}) > 1:
        parts = alike(*parts)
    return leaf(combined(name, kinds, parts, commutes), kind or operands[-1].kind)


def combined(name: str, kinds: tuple[str, ...], parts: Sequence[Words], commutes: bool) -> Words:
    """Return the shapes of an operation's results, of the kinds and the shapes of its operands."""
    if (name, kinds) not in SALT:
        SALT[name, kinds] = hashed(f"{name} {'/'.join(sorted(set(kinds)))}", np.arange(2, dtype=np.uint64))
        SALT[name, kinds] = (*SALT[name, kinds], *SALT[name, kinds].tolist())
    first, second, *whole = SALT[name, kinds]
    # The sum of two shapes is that of no two others, but with a probability of 2^-64.
    if max([part.size for part in parts]) == 1:
        one, *others = [part.item() for part in parts]
        for other in others:
            one = (one if commutes else _mixed_one(one + whole[0] & MOST)) + other & MOST
        shape = max([part.shape for part in parts], key=len)
        return np.full(shape, _mixed_one(one ^ whole[1]), dtype=np.uint64)
    found = sum(parts[1:], parts[0]) if commutes else parts[0]
    for part in [] if commutes else parts[1:]:
        found = mixed(found + first) + part
    return mixed(found ^ second)


def choice(condition: Number, a: Number, b: Number) -> Number:
    """Return condition ? a : b, which is the minimum or the maximum where these two were compared.

    Of NaN they differ; no number of a certified program is NaN.
    """
    if condition.compared:
        less, more = (part.known for part in condition.compared)
        for one, other, name in ((less, more, "minimum"), (more, less, "maximum")):
            if equal(a.known, one) and equal(b.known, other):
                return expression(name, a, b, commutes=True)
    return expression("select", condition, a, b, kind=a.kind)


def equal(a: Words, b: Words) -> bool:
    """Return whether two arrays are equal, as far as both go."""
    return bool(np.all(np.equal(*alike(a, b))))


def blended(new: Number, old: Number | None, active: NDArray[np.bool_]) -> Number:
    """Return `new` where lanes are active, and what was there before elsewhere."""
    if new.shape is None or (old is not None and old.shape is None):
        raise Unread("sums that some items of a group make and others do not")
    if old is None:
        where = active if new.held is None else active & new.held
        return Number(new.given, new.shape, new.kind, held=where, span=new.span)
    va, vb = alike(new.value, old.value)
    value = np.where(active.reshape((-1,) + (1,) * (va.ndim - 2)), va, vb)
    shape = None
    if new.shape is not None and old.shape is not None:
        sa, sb = alike(new.shape, old.shape)
        shape = np.where(active.reshape((-1,) + (1,) * (sa.ndim - 1)), sa, sb)
    held: NDArray[np.bool_] | None = None
    if old.held is not None or new.held is not None:
        ones = np.ones(len(active), dtype=bool)
        held = np.where(
            active, ones if new.held is None else new.held, ones if old.held is None else old.held
        )
        held = None if held.all() else held
    span = hull(new.span, old.span) if new.span and old.span else None
    return Number(value, shape, new.kind, held=held, span=span)


def hull(a: Span, b: Span) -> Span:
    """Return the span of what lies in one of two."""
    low, high = np.minimum(a[0], b[0]), np.maximum(a[1], b[1])
    return (low, high) if low.ndim else (int(low), int(high))


def wide(value: Any) -> int:
    """Return how many numbers a value has."""
    if not isinstance(value, Number) or value.axes < 3:
        return 1
    return int(value.value.shape[2] if value.shape is None else value.shape.shape[1])


def part_of(value: Any, k: int | None) -> Any:
    """Return one number of a vector; anything else is itself."""
    if k is None or wide(value) == 1:
        return value
    if "parts" in value.made:
        return value.made["parts"][k]
    shape = None if value.shape is None else value.shape[..., k]
    given = None if value.given is None else value.given[..., k]
    ends = value.span
    span = (int(ends[0][k]), int(ends[1][k])) if ends and np.ndim(ends[0]) else ends
    return Number(given, shape, value.kind, value.weight, held=value.held, source=(value, k), span=span)


def repeated(number: Number, width: int) -> Number:
    """Return a vector that has a number `width` times."""
    shape, given = (
        None if part is None else np.repeat(part[..., None], width, axis=-1)
        for part in (number.shape, number.given)
    )
    return Number(given, shape, number.kind, held=number.held, span=number.span)


def stacked(parts: list[Number]) -> Number:
    """Return a vector of numbers, and of vectors' numbers, which keeps the former."""
    found = _stacked(parts)
    if all(wide(part) == 1 for part in parts):
        found.made["parts"] = parts  # type: ignore[assignment]
    return found


def _stacked(parts: list[Number]) -> Number:
    """Return a vector of numbers.

    Where sums are added up over lanes and one part is done, the others are: sums that nothing adds to.
    """
    if any(part.shape is not None and part.given is None for part in parts):
        parts = [leaf(part.known) if part.shape is None else part for part in parts]
    shape, done = None, all(part.shape is not None for part in parts)
    span = _spans(parts) if all(part.span for part in parts) else None
    if done:
        shape = _joined([np.asarray(part.shape)[None] for part in parts])[0]
        if all(part.given is None for part in parts):
            return Number(None, shape, parts[0].kind, span=span)
    values = [part.value if done else part.term for part in parts]
    return Number(_joined(values), shape, parts[0].kind, all(p.weight for p in parts), span=span)


def _spans(parts: list[Number]) -> Span:
    """Return the spans of numbers and of vectors' numbers behind each other."""
    low, high = (
        np.concatenate([np.broadcast_to(part.span[k], (wide(part),)) for part in parts if part.span])
        for k in (0, 1)
    )
    return low, high


def _joined(parts: list[Words]) -> Words:
    """Return arrays (rows, lanes) and (rows, lanes, n) behind each other, as many lanes as any has."""
    lanes = max(part.shape[1] for part in parts)
    wider = [part if part.ndim == 3 else part[..., None] for part in parts]
    if any(part.shape[1] != lanes for part in wider):
        wider = [np.broadcast_to(part, (len(part), lanes, part.shape[2])) for part in wider]
    return np.concatenate(wider, axis=-1)
