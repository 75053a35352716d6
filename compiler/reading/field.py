"""Numbers of a text under test: elements of a prime field at random points, and shapes of expressions.

A sum of products of weights and inputs is a polynomial. Two polynomials that agree at a random point of a
field of P elements are the same but with a probability of their degree over P (Schwartz and Zippel, 1980), in
every lane. The second row of a `Number` is the polynomial with every coefficient's magnitude, so that a text
which adds and takes away what cancels is another one. Neither depends on the order of a sum.

Whatever is not such a sum has a `shape`: a hash of its operation and its operands' shapes, the order of two
operands of a sum or a product apart. Its two field elements are drawn from that hash.
"""

from __future__ import annotations

import secrets
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

P = np.uint64(2013265921)
"""15 * 2^27 + 1, a prime: products of two elements fit 64 bits."""

Words = NDArray[np.uint64]


@dataclass(frozen=True)
class Number:
    """What a text holds in one variable, in all lanes: `value` (2, lanes) or (2, lanes, width).

    `shape` (lanes, ...) is None for sums under way, whose value is not reduced. `kind` is its type. `weight`:
    it was read from the weights. `literal`: what a constant is. `held` (lanes,): where it has been written,
    None for everywhere. `compared`: a and b of a < b.
    """

    value: Words
    shape: Words | None = None
    kind: str = "float32"
    weight: bool = False
    literal: float | None = None
    held: NDArray[np.bool_] | None = None
    compared: tuple[Number, Number] | None = None

    @property
    def known(self) -> Words:
        """Its shape; of a sum under way, which is no number of the program, one that nothing else has."""
        return hashed("sum", *self.value % P) if self.shape is None else self.shape


def mixed(words: Words) -> Words:
    """Scramble 64 bits (Stafford's thirteenth variant of the finaliser of MurmurHash3)."""
    words = (words ^ (words >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    words = (words ^ (words >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return words ^ (words >> np.uint64(31))


SALT: dict[str, Any] = {}
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
    return Number(drawn(shape), shape, kind, **other)


def literal(value: float, kind: str) -> Number:
    """Return a constant (2, 1) of a text: exact, since a float32 is an integer times a power of two."""
    value = float(np.float32(value)) if kind == "float32" else float(value)
    numerator, denominator = value.as_integer_ratio()
    inverse = pow(denominator, -1, int(P))
    rows = [[n * inverse % int(P)] for n in (numerator, abs(numerator))]
    bits = np.float64(value + 0.0).view(np.uint64)
    return Number(np.array(rows, dtype=np.uint64), hashed(f"literal {kind}", bits)[None], kind, literal=value)


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
        va, vb = alike(*(n.value % P if n.shape is None else n.value for n in (a, b)))
        return Number(va * vb % P)
    return expression("multiply", a, b, commutes=True)


def total(a: Number, b: Number) -> Number:
    """Return a + b: of a sum under way and anything a sum, else an expression."""
    if a.kind == "float32" and (is_sum(a) or is_sum(b)):
        for one, other in ((a, b), (b, a)):
            if one.literal == 0.0 and other.value.ndim >= one.value.ndim:
                return other
        va, vb = alike(a.value, b.value)
        return Number(va + vb)
    return expression("add", a, b, commutes=True)


def difference(a: Number, b: Number) -> Number:
    """Return a - b, whose magnitudes add up."""
    if a.kind == "float32" and (is_sum(a) or is_sum(b)):
        va, vb = alike(a.value % P, b.value % P)
        rows = va + (P - vb)
        rows[1] = va[1] + vb[1]
        return Number(rows)
    return expression("subtract", a, b)


def expression(name: str, *operands: Number, commutes: bool = False, kind: str | None = None) -> Number:
    """Return what an operation makes of numbers: equal where name, kinds and operands are."""
    kinds = {operand.kind for operand in operands}
    parts = alike(*(operand.known for operand in operands))
    if commutes:
        parts = [np.minimum(*parts), np.maximum(*parts)]
    name = f"{name} {'/'.join(sorted(kinds))}"
    return leaf(hashed(name, *parts), kind or operands[-1].kind)


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
    if old is None:
        where = active if new.held is None else active & new.held
        return Number(new.value, new.shape, held=where)
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
    return Number(value, shape, new.kind, held=held)


def wide(value: Any) -> int:
    """Return how many numbers a value has."""
    return value.value.shape[2] if isinstance(value, Number) and value.value.ndim == 3 else 1


def part_of(value: Any, k: int | None) -> Any:
    """Return one number of a vector; anything else is itself."""
    if k is None or wide(value) == 1:
        return value
    shape = None if value.shape is None else value.shape[..., k]
    return Number(value.value[..., k], shape, value.kind, value.weight, held=value.held)


def stacked(parts: list[Number]) -> Number:
    """Return a vector of numbers."""
    size = max(part.value.shape[1] for part in parts)
    value = np.stack([np.broadcast_to(part.value, (2, size)) for part in parts], axis=-1)
    shapes = [np.broadcast_to(part.shape, (size,)) for part in parts if part.shape is not None]
    shape = np.stack(shapes, axis=-1) if len(shapes) == len(parts) else None
    return Number(value, shape, parts[0].kind, all(part.weight for part in parts))
