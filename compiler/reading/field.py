"""Numbers of a text under test: elements of a prime field at random points, and shapes of expressions.

A sum of products of weights and inputs is a polynomial. Two polynomials that agree at a random point of a
field of P elements are the same but with a probability of their degree over P (Schwartz and Zippel, 1980).
The second row of field elements is the polynomial with every coefficient's magnitude, so that a text
which adds and takes away what cancels is another one. Neither depends on the order of a sum.

Whatever is not such a sum has a shape: a hash of its operation and its operands' shapes, the order of two
operands of a sum or a product apart. Its two field elements are drawn from that hash.
"""

from __future__ import annotations

import secrets
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

P = np.uint64(2013265921)
"""15 * 2^27 + 1, a prime: products of two elements fit 64 bits."""

Words = NDArray[np.uint64]

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
    """Return the field elements (2, ...) of shapes: 0 of a zero."""
    found = np.stack([hashed(f"draw {row}", shape) % P for row in range(2)])
    return np.where(shape == zero(), np.uint64(0), found)


def zero() -> Words:
    """Return the shape of a float that is 0."""
    if "zero" not in SALT:
        SALT["zero"] = literal(0.0, "float32")
    return SALT["zero"]  # type: ignore[no-any-return]


def literal(value: Any, kind: str) -> Words:
    """Return the shapes of constants of a text, float32 or integers of a kind.

    A nonzero float in a sum counts as an independent unknown: constants that cancel in the field need not
    cancel in float32.
    """
    given = np.asarray(value, dtype=np.float32 if kind == "float32" else np.int64)
    return hashed(f"literal {kind}", (given.astype(np.float64) + 0.0).view(np.uint64))


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
