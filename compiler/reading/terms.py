"""Values of a kernel under test, many at once: shapes of field.py, sums on their way, and integers.

A `Term` has one value for each lane and each turn: an array (lanes, turns), or (width, lanes, turns) of a
vector, where an axis of one stands for all. Lanes are images of all cases [lanes.py]; turns are turns of
loops that are run at once, or items of a launch. What is read of an image differs between lanes. Whatever an
operation or an array is given is folded into one number for all lanes first [`Fold`].
"""

from __future__ import annotations

import secrets
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .field import P, Words, combined, drawn, hashed, literal, zero
from .lanes import Unread, Wrong

Span = tuple[NDArray[np.int64], NDArray[np.int64]]
"""The least and the largest value of integers, in any lane; of one that is not known these are 1 and 0."""


class Fold:
    """Random factors (lanes, slots): the sum of all lanes' shapes, times these, is one number's shape.

    Numbers that differ in any lane that counts have different ones, but with a probability of about 2^-60. A
    slot is a tile of those that a launch computes: what is folded into one is not what is in another.
    """

    def __init__(self, counts: NDArray[np.bool_], slots: int) -> None:
        random = np.frombuffer(secrets.token_bytes(8 * len(counts) * slots), dtype=np.uint64)
        self.factors: Words = (random | np.uint64(1)).reshape(-1, slots) * counts[:, None]
        self.slots = slots

    def of(self, shape: Words, slot: Any) -> Words:
        """Return the shapes (..., turns) of all lanes together; `slot`: that of all turns, or of each."""
        factors = self.factors[:, slot]
        if factors.ndim == 1:
            return hashed("fold", np.einsum("...lt,l->...t", shape, factors))
        return hashed("fold", np.einsum("...lt,lt->...t", shape, factors))

    def term(self, term: Term, slot: Any, near: Any = None) -> Term:
        """Return a term that all lanes share; `near`: with a second line of those lanes (lanes, turns)."""
        if not term.is_wide:
            return term
        if term.folded is None or term.folded[0] is not near:
            shape = term.known
            lines = [shape] if near is None else [shape, shape * near]
            # A number that is 0 in all lanes fills up a word.
            nothing = shape[..., :1, :] == zero()
            if nothing.any():
                nothing = (shape == zero()).all(axis=-2, keepdims=True)
            found = np.stack([self.of(line, slot) for line in lines], axis=-2)
            term.folded = near, replace(term, shape=np.where(nothing, zero(), found))
        return term.folded[1]


@dataclass(eq=False)
class Term:
    """Shapes, None of a sum on its way; `sums` (2, ...): its values; `draw` (2, ...): those of a weight.

    `kind` is its type. `literal`: what a constant is. `factors`: of a product with that, which is a term of a
    sum if need be. `span`: of an integer, whose value is that of its `sums`, with signs in both rows, and of
    a float that is one. `folded`: the same for all lanes, once it has been made, and for which near borders.
    """

    shape: Words | None
    sums: Words | None = None
    draw: Words | None = None
    kind: str = "float32"
    literal: float | None = None
    factors: tuple[Term, Term] | None = None
    span: Span | None = None
    folded: tuple[Any, Term] | None = None

    @property
    def known(self) -> Words:
        """Its shape; of a sum on its way one that nothing else has."""
        if self.shape is not None:
            return self.shape
        assert self.sums is not None
        return hashed("sum", *self.sums % P)

    @cached_property
    def value(self) -> Words:
        """Its field elements (2, ...) as a factor."""
        if self.draw is not None:
            return self.draw
        if self.shape is None:
            assert self.sums is not None
            return self.sums % P
        return drawn(self.shape)

    @property
    def term(self) -> Words:
        """Its field elements (2, ...) as part of a sum."""
        return self.value if self.sums is None else self.sums

    @property
    def begins(self) -> bool:
        """Return whether it is part of a sum, or begins one."""
        return self.sums is not None or self.draw is not None

    @property
    def is_wide(self) -> bool:
        """Return whether it differs between lanes, which are more than two."""
        return self.shape is not None and self.shape.shape[-2] > 2

    def part(self, index: Any) -> Term:
        """Return some of a vector's numbers."""
        return self.each(lambda a: a[index], lambda a: a[:, index])

    def each(self, one: Any, two: Any) -> Term:
        """Return a term of changed arrays: of shapes, and of values."""
        sums, draw = (None if a is None else two(a) for a in (self.sums, self.draw))
        shape = None if self.shape is None else one(self.shape)
        span = self.span and (one(self.span[0]), one(self.span[1]))
        return Term(shape, sums, draw, self.kind, self.literal, span=span)


def constant(value: float, kind: str = "float32") -> Term:
    """Return a constant (1, 1)."""
    if kind == "float32":
        value = float(np.float32(value))
        ends = np.full((1, 1), int(value) if value == int(value) and abs(value) < 2**31 else 1)
        span = ends, np.where(ends == value, ends, 0)
        return Term(literal(value, kind)[None, None], literal=value, span=span)
    return replace(known_integers(np.full((1, 1), value), kind), literal=value)


def known_integers(values: NDArray[Any], kind: str) -> Term:
    """Return integers that are known."""
    values = np.asarray(values, dtype=np.int64)
    row = (values % np.int64(P)).astype(np.uint64)
    return Term(literal(values, kind), np.stack([row, row]), kind=kind, span=(values, values))


def known_floats(values: NDArray[Any]) -> Term:
    """Return weights that are known: each value is an unknown, but 0."""
    shape = literal(values, "float32")
    return Term(shape, draw=drawn(shape))


def stacked(terms: Sequence[Term]) -> Term:
    """Return a vector of single numbers."""

    def together(arrays: Sequence[Any], axis: int = 0) -> Any:
        return np.stack(np.broadcast_arrays(*arrays), axis=axis)

    kind, spans = terms[0].kind, [term.span for term in terms if term.span]
    if any(term.kind != kind for term in terms):
        raise Unread("a vector of numbers of several kinds")
    shape, span = together([term.known for term in terms]), None
    if len(spans) == len(terms):
        span = together([low for low, _ in spans]), together([high for _, high in spans])
        if kind != "float32":
            return Term(shape, together([term.term for term in terms], 1), kind=kind, span=span)
    if any(term.begins for term in terms):
        raise Unread("a vector of weights, or of sums on their way")
    return Term(shape, kind=kind, span=span)


def operate(name: str, a: Term, b: Term, dual: bool = False) -> Term:
    """Return a sum, a difference or a product of floats; `dual`: a sum may be an expression as well."""
    sums: Words | None = None
    nothing, given = vanishing(a, b, name) | vanishing(b, a, name), (a, b)
    if name == "multiply":
        if any(each.shape is not None and _is_zero(each.shape) for each in (a, b)):
            raise Wrong("a product with 0, which is no number where the other factor is infinite")
        if a.draw is not None or b.draw is not None:
            sums = _product(a, b)
        elif a.literal is not None or b.literal is not None:
            return Term(expression(name, a, b, commutes=True), factors=(a, b))
    elif a.begins or b.begins:
        for one, other in ((a, b), (b, a)):
            if name == "add" and one.shape is not None and not one.begins and _is_zero(one.shape):
                return other
        a, b = (
            each if each.factors is None else Term(each.shape, _product(*each.factors)) for each in (a, b)
        )
        if name == "add":
            sums = aligned(np.add, a.term, b.term)
        else:  # magnitudes add up
            sums = aligned(lambda x, y: np.stack([x[0] + (P - y[0]), x[1] + y[1]]), a.term % P, b.term % P)
    if sums is not None and nothing.any():
        sums = np.where(nothing, drawn(expression("nothing", *given)), sums)
    dual = dual or any(each.shape is not None and each.sums is not None for each in (a, b))
    if sums is not None and not dual:
        return Term(None, sums)
    return Term(expression(name, a, b, commutes=name != "subtract"), sums)


def _product(a: Term, b: Term) -> Words:
    return aligned(lambda x, y: x * y % P, a.value, b.value)


def _is_zero(shape: Words) -> bool:
    return bool(shape.flat[0] == zero()) and bool((shape == zero()).all())


def vanishing(term: Term, other: Term, name: str) -> NDArray[np.bool_]:
    """Return in which turns a number of a sum is 0: a weight that fills up a vector, or its product.

    That is no number where the other factor is infinite, so what is made of it is unknown. A vector is 0
    where all of its lanes are, or, as a factor of another one, any of them.
    """
    if not term.begins or term.kind != "float32":
        return np.zeros(1, bool)
    found = np.asarray((term.term % P == 0).all(axis=0))
    alike = name == "multiply" and other.known.ndim == 3
    return found if found.ndim < 3 or alike else np.asarray(found.all(axis=0))


def aligned(function: Any, a: Words, b: Words) -> Words:
    """Return a function of values (2, ...), of which one may be of a vector and the other not."""
    if a.ndim != b.ndim:
        a, b = (x if x.ndim >= max(a.ndim, b.ndim) else x[:, None] for x in (a, b))
    found: Words = function(a, b)
    return found


def expression(name: str, *operands: Term, commutes: bool = False) -> Words:
    """Return the shape of an operation on numbers."""
    kinds = tuple([operand.kind for operand in operands])
    return combined(name, kinds, [operand.known for operand in operands], commutes)


def select(where: Term, a: Term, b: Term) -> Term:
    """Return one of two numbers by a truth of numbers."""
    return Term(expression("select", where, a, b), kind=a.kind)


COMMUTE = ("minimum", "maximum", "bitwise_and", "bitwise_xor", "bitwise_or")
"""Operations whose operands may be exchanged, sums and products apart."""


def applied(what: str, *terms: Term, dual: bool = False) -> Term:
    """Return what an operation makes of numbers: equal where its name, kinds and operands are."""
    if what.startswith("greater"):
        terms, what = terms[::-1], what.replace("greater", "less")
    if what.startswith("less") or what in ("equal", "not_equal"):
        return Term(expression(what, *terms), kind="bool")
    arithmetic = what in ("add", "subtract", "multiply")
    if arithmetic and terms[0].kind == "float32":
        return operate(what, terms[0], terms[1], dual)
    commutes = what in COMMUTE or (arithmetic and what != "subtract")
    return Term(expression(what, *terms, commutes=commutes), kind=terms[-1].kind)


def chosen(where: NDArray[np.bool_], a: Term, b: Term) -> Term:
    """Return a number of an image in some lanes and turns, and 0 in the others."""
    if where.shape[0] == 1 or not a.is_wide or a.kind != "float32" or b.literal != 0:
        raise Unread("a choice, by lanes, of anything but a number of an image or 0")
    return Term(np.where(where, a.known, b.known), span=hull(a.span, b.span))


def hull(a: Span | None, b: Span | None) -> Span | None:
    """Return the span of what lies in one of two."""
    if a is None or b is None:
        return None
    both = (a[0] <= a[1]) & (b[0] <= b[1])
    return np.where(both, np.minimum(a[0], b[0]), 1), np.where(both, np.maximum(a[1], b[1]), 0)
