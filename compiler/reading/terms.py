"""Values of a kernel of tiles under test, many at once: shapes of field.py, and sums on their way.

A `Term` has one value for each lane and each turn: an array (lanes, turns), or (width, lanes, turns) of a
vector, where an axis of one stands for all. Lanes are images of all cases [lanes.py]; turns are turns of
loops that are run at once, or items of a launch. What is read of an image differs between lanes. Whatever an
operation or an array is given is folded into one number for all lanes first [`Fold`].
"""

from __future__ import annotations

import secrets
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .field import P, Words, combined, drawn, hashed, literal
from .lanes import Wrong


class Fold:
    """Random factors (lanes, slots): the sum of all lanes' shapes, times these, is one number's shape.

    Numbers that differ in any lane that counts have different ones, but with a probability of about 2^-60. A
    slot is a tile of those that a launch computes: what is folded into one is not what is in another.
    """

    def __init__(self, counts: NDArray[np.bool_], slots: int) -> None:
        rows = [[secrets.randbits(64) | 1 for _ in range(slots)] for _ in counts]
        self.factors: Words = np.array(rows, dtype=np.uint64) * counts[:, None]
        self.slots = slots

    def of(self, shape: Words, slot: Any) -> Words:
        """Return the shapes (..., turns) of all lanes together; `slot`: that of all turns, or of each."""
        factors = self.factors[:, slot]
        if factors.ndim == 1:
            return hashed("fold", np.einsum("...lt,l->...t", shape, factors))
        if shape.shape[-1] == 1:
            return hashed("fold", np.einsum("...l,lt->...t", shape[..., 0], factors))
        return hashed("fold", np.einsum("...lt,lt->...t", shape, factors))


@dataclass(eq=False)
class Term:
    """Shapes, None of a sum on its way; `sums` (2, ...): its values; `draw` (2, ...): those of a weight.

    `literal`: it is one constant. `factors`: of a product with that, which is a term of a sum if need be.
    """

    shape: Words | None
    sums: Words | None = None
    draw: Words | None = None
    literal: bool = False
    factors: tuple[Term, Term] | None = None

    @property
    def known(self) -> Words:
        """Its shape; of a sum on its way one that nothing else has."""
        if self.shape is not None:
            return self.shape
        assert self.sums is not None
        return hashed("sum", *self.sums % P)

    @property
    def value(self) -> Words:
        """Its field elements (2, ...) as a factor."""
        if self.draw is not None:
            return self.draw
        if self.shape is None:
            assert self.sums is not None
            return self.sums % P
        return drawn_or_zero(self.shape)

    @property
    def term(self) -> Words:
        """Its field elements (2, ...) as part of a sum."""
        return self.value if self.sums is None else self.sums

    @property
    def begins(self) -> bool:
        """Return whether it is part of a sum, or begins one."""
        return self.sums is not None or self.draw is not None

    def part(self, index: Any) -> Term:
        """Return some of a vector's numbers."""
        return self.each(lambda a: a[index], lambda a: a[:, index])

    def each(self, one: Any, two: Any) -> Term:
        """Return a term of changed arrays: of shapes, and of values."""
        sums, draw = (None if a is None else two(a) for a in (self.sums, self.draw))
        return Term(None if self.shape is None else one(self.shape), sums, draw)


def drawn_or_zero(shape: Words) -> Words:
    """Return the field elements (2, ...) of shapes: 0 of a zero."""
    zero = literal(0.0, "float32").known[0]
    return np.where(shape == zero, np.uint64(0), drawn(shape))


def constant(value: float) -> Term:
    """Return a constant (1, 1)."""
    return Term(literal(value, "float32").known[:, None], literal=True)


def stacked(terms: Sequence[Term]) -> Term:
    """Return a vector of single numbers."""

    def together(arrays: Sequence[Words], axis: int) -> Words:
        return np.stack(np.broadcast_arrays(*arrays), axis=axis)

    if any(term.shape is None for term in terms):
        return Term(None, together([term.term for term in terms], 1))
    shape = together([term.known for term in terms], 0)
    sums = draw = None
    if any(term.sums is not None for term in terms):
        sums = together([term.term for term in terms], 1)
    elif any(term.draw is not None for term in terms):
        draw = together([term.value for term in terms], 1)
    return Term(shape, sums, draw)


def operate(name: str, a: Term, b: Term, dual: bool) -> Term:
    """Return a sum, a difference or a product; `dual`: a sum may be an expression as well."""
    sums: Words | None = None
    if name == "multiply":
        if any(each.shape is not None and _is_zero(each.shape) for each in (a, b)):
            raise Wrong("a product with 0, which is no number where the other factor is infinite")
        if a.draw is not None or b.draw is not None:
            sums = _product(a, b)
        elif a.literal or b.literal:
            return Term(expression(name, a, b, commutes=True), factors=(a, b))
    elif a.begins or b.begins:
        for one, other in ((a, b), (b, a)):
            if name == "add" and one.shape is not None and not one.begins and _is_zero(one.shape):
                return other
        a, b = (
            each if each.factors is None else Term(each.shape, _product(*each.factors)) for each in (a, b)
        )
        if name == "add":
            sums = _aligned(np.add, a.term, b.term)
        else:  # magnitudes add up
            va, vb = a.term % P, b.term % P
            sums = np.stack([_aligned(np.add, va[0], P - vb[0]), _aligned(np.add, va[1], vb[1])])
    dual = dual or any(each.shape is not None and each.sums is not None for each in (a, b))
    if sums is not None and not dual:
        return Term(None, sums)
    return Term(expression(name, a, b, commutes=name != "subtract"), sums)


def _product(a: Term, b: Term) -> Words:
    return _aligned(lambda x, y: x * y % P, a.value, b.value)


def _is_zero(shape: Words) -> bool:
    zero = literal(0.0, "float32").known[0]
    return shape.flat[0] == zero and bool((shape == zero).all())


def _aligned(function: Any, a: Words, b: Words) -> Words:
    """Return a function of values (2, ...) or shapes, of which one may be of a vector and the other not."""
    if a.ndim != b.ndim and a.shape[0] == b.shape[0] == 2:
        a, b = (x if x.ndim >= max(a.ndim, b.ndim) else x[:, None] for x in (a, b))
    found: Words = function(a, b)
    return found


def expression(name: str, *operands: Term, commutes: bool = False) -> Words:
    """Return the shape of an operation on floats."""
    return combined(name, ("float32",) * len(operands), [each.known for each in operands], commutes)


def select(where: Term, a: Term, b: Term) -> Term:
    """Return one of two numbers by a truth of numbers."""
    return Term(combined("select", ("bool", "float32", "float32"), [where.known, a.known, b.known], False))
