"""What operations of a kernel under test make of values: a kernel's expressions on terms and coordinates.

1. A float, and an integer that is computed from an image, is a `Term` [terms.py]; an index is Python's
   integer, an array (1, turns), or a `Place` where it depends on coordinates; a truth is Python's, or one for
   each lane and turn.
2. Whatever is computed is folded over lanes first, but what is chosen, or made an integer.
3. A sum that is one of the program's is the number that this is from there on [`_found`].
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..kernel.kernel import Expr, Kernel
from ..kernel.walker import Walker
from . import integers
from .cells import Turns
from .claim import Claim, renamed, word_of
from .field import P, hashed
from .lanes import Unread, Wrong
from .places import COMPARES, Place, indices
from .terms import Term, applied, chosen, constant, select, stacked


class Values(Walker):
    """Values of one run of a kernel for a claim, for the lanes and turns that are active (`mask`)."""

    claim: Claim
    turns: Turns
    mask: NDArray[np.bool_] | None
    looking: NDArray[np.bool_] | None

    def __init__(self, kernel: Kernel, claim: Claim) -> None:
        self.kernel, self.claim, self.lanes = kernel, claim, claim.lanes
        self.dual, self.turns, self.mask, self.looking = bool(kernel.launches), Turns(1), None, None
        self.numbers: dict[Any, Any] = {}
        methods = (key for key in dir(self) if key.startswith("_value_"))
        self.evaluators = {key.removeprefix("_value_"): getattr(self, key) for key in methods}
        self.keys = np.array(sorted(claim.first), dtype=np.uint64)
        self.ids = np.array([claim.first[key] for key in self.keys.tolist()], dtype=np.int64)
        parts = np.array([kind == "part" for kind, _ in claim.tables], bool)
        self.is_part = parts[self.ids // claim.together]

    # ---- lanes and turns -----------------------------------------------------------------------------------

    @property
    def active(self) -> NDArray[np.bool_] | None:
        """The turns (turns,) that are active in any lane; None for all."""
        if self.mask is None:
            return None
        found: NDArray[np.bool_] = np.broadcast_to(self.mask.any(axis=0), (self.turns.count,))
        return None if found.all() else found

    def _wrong(self, bad: Any, what: str) -> None:
        """Refuse what is wrong in a lane and turn that are active."""
        found = bad is not False and (bad is True or bad.any())
        if found and (self.mask is None or np.logical_and(bad, self.mask).any()):
            raise Wrong(what)

    def _doubt(self, bad: Any, what: str) -> None:
        """Refuse what is wrong of a number of all lanes, in a turn that is active."""
        bad = np.atleast_2d(bad)
        self._wrong(bad.reshape(-1, bad.shape[-1]).any(axis=0)[None], what)

    def folded(self, term: Term) -> Term:
        """Return a number of all lanes together; near borders, with what other lanes write."""
        slot, near = self.turns.slot, self.looking
        if near is None and self.mask is not None and self.mask.shape[0] > 1:
            near = self.mask
        return self.claim.fold.term(term, 0 if slot is None else slot, near)

    def _truth(self, value: Any) -> Any:
        if isinstance(value, bool) or (isinstance(value, np.ndarray) and value.dtype == bool):
            return value
        raise Wrong("it branches on a number of the image, or on an integer")

    # ---- operations ----------------------------------------------------------------------------------------

    def _operation(self, value: Expr, args: list[Any]) -> Any:
        """Return an operation on values."""
        return self.operate(value.op, *args)

    def operate(self, what: str, *args: Any) -> Any:
        """Return what an operation makes of values: an integer goes with numbers of the image."""
        kinds = [each.kind for each in args if isinstance(each, Term)]
        if kinds:
            return self._of_terms(what, *[self._term(each, kinds[0]) for each in args])
        if len(args) != 2:
            raise Unread(f"{what} of integers")
        return self._of_indices(what, *args)

    def _term(self, value: Any, kind: str) -> Term:
        """Return a number of the image, or a constant."""
        if type(value) is int:
            return constant(value, kind)
        if not isinstance(value, Term):
            raise Wrong("it mixes coordinates, or truths, and numbers of the image")
        return value

    def _of_indices(self, what: str, a: Any, b: Any) -> Any:
        """Return what an operation makes of two integers, none beyond 32 bits."""
        if isinstance(a, Place) or isinstance(b, Place):
            if what not in COMPARES:
                return Place.operated(self.lanes, what, a, b, self.mask)
            found = Place.compared(self.lanes, what, a, b, self.mask)
            if not self.lanes.far(found if self.mask is None else found & self.mask):
                raise Wrong("a condition on coordinates holds near a border only")
            return found
        return indices(what, a, b, self._wrong)

    def _of_terms(self, what: str, *terms: Term) -> Term:
        """Return what an operation makes of numbers."""
        if what in ("add", "subtract", "multiply") and terms[0].kind != "float32":
            a, b = terms
            found = integers.operate(what, a, b, self._doubt)
            return self._defined(found) if found.kind == "int32" else found
        if any(each.kind == "word" for each in terms):
            raise Unread(f"{what} of words")
        terms = tuple(self.folded(each) for each in terms)
        if (
            what.endswith("shift")
            and not 0 <= (terms[1].literal if terms[1].literal is not None else -1) < 32
        ):
            raise Unread("a shift by anything but a constant below 32")
        if what in ("divide", "remainder") and terms[0].kind != "float32":
            raise Unread(f"{what} of integers of an image, which may be by 0")
        made = applied(what, *terms, dual=self.dual)
        return self._found(made) if what == "add" and made.sums is not None else made

    def _found(self, term: Term) -> Term:
        """Return a sum; one of the program as the number that it is, a part as another unknown."""
        assert term.sums is not None
        value = term.sums % P
        word = word_of(value)
        at = np.minimum(np.searchsorted(self.keys, word), len(self.keys) - 1)
        good = self.keys[at] == word
        if not good.any():
            return term
        self.claim.found.update(np.unique(self.ids[at[good]]).tolist())
        part = good & self.is_part[at]
        if part.any():
            return Term(None, np.where(part, renamed(value), value))
        return Term(np.where(good, hashed("found", *value), term.known))

    # ---- expressions ---------------------------------------------------------------------------------------

    def _value_const(self, value: Expr) -> Any:
        """Return a constant."""
        kind = value.type.dtype
        if kind in ("int32", "bool"):
            return value.value
        if (kind, value.value) not in self.numbers:
            self.numbers[kind, value.value] = constant(value.value, kind)
        return self.numbers[kind, value.value]

    def _value_clamp(self, value: Expr) -> Any:
        """Return an integer within two others, the first of which is not above the second."""
        given, low, high = map(self.value, value.args)
        if any(isinstance(each, Term) for each in (given, low, high)):
            raise Unread("a number of the image between two others")
        order = self._of_indices("less_equal", low, high)
        self._wrong(
            not order if isinstance(order, bool) else ~order, "a value between two others in no order"
        )
        return self._of_indices("minimum", self._of_indices("maximum", given, low), high)

    def _value_select(self, value: Expr) -> Any:
        """Return one of two values, for each lane and turn."""
        where, a, b = map(self.value, value.args)
        if any(isinstance(each, Term) for each in (where, a, b)) and type(where) is not bool:
            a, b = (self._term(each, value.type.dtype) for each in (a, b))
        if isinstance(where, Term):
            return select(self.folded(where), self.folded(a), self.folded(b))
        where = self._truth(where)
        if isinstance(where, bool):
            return a if where else b
        if isinstance(a, Term):
            return chosen(where, a, b)
        if where.shape[0] > 1 or isinstance(a, Place) or isinstance(b, Place):
            raise Unread("a choice of coordinates, or by them")
        return np.where(where, a, b)

    def _value_logical_and(self, value: Expr) -> Any:
        """Return whether both hold; the second is not asked where the first does not."""
        a = self._truth(self.value(value.args[0]))
        if isinstance(a, bool) and not a:
            return a
        b = self._truth(self.value(value.args[1]))
        return b if isinstance(a, bool) else np.logical_and(a, b)

    def _value_component(self, value: Expr) -> Any:
        """Return one number of a vector."""
        given = self.value(value.args[0])
        return given.part(value.value) if isinstance(given, Term) and given.known.ndim == 3 else given

    def _value_stack(self, value: Expr) -> Any:
        """Return a vector of numbers."""
        key = id(value)
        if key in self.numbers:
            return self.numbers[key]
        found = stacked([self._term(self.value(each), value.type.dtype) for each in value.args])
        if all(each.op == "const" for each in value.args):
            if (self.dual or not self.claim.count) and any(each.value for each in value.args):  # weights
                found = Term(found.shape, draw=found.value)
            self.numbers[key] = found
        return found

    def _value_convert(self, value: Expr) -> Any:
        """Return a value as one of another kind."""
        given, kind = self.value(value.args[0]), value.type.dtype
        if isinstance(given, Term):
            return self._converted(given, kind)
        raise Unread(f"a coordinate, or {given!r}, as {kind}")

    def _converted(self, term: Term, kind: str) -> Term:
        """Return a number as one of another kind."""
        if term.kind == kind:
            return term
        if kind == "float32" and term.kind in integers.LIMITS:
            return integers.as_float(term, self._found, self._doubt)
        if kind not in integers.LIMITS or term.kind not in ("float32", *integers.LIMITS):
            raise Unread(f"a {term.kind} as {kind}")
        found = integers.convert(self.folded(term), kind, self.claim.ranges)
        return self._defined(found) if term.kind == "float32" else found

    def _defined(self, term: Term) -> Term:
        """Return an integer that its kind is known to hold, or that is one of the program's."""
        good: Any = False if term.span is None else term.span[0] <= term.span[1]
        if not np.all(good):
            made = [word in self.claim.made for word in term.known.ravel().tolist()]
            good = np.logical_or(good, np.reshape(made, term.known.shape))
            missing = self.claim.missing()
            why = missing and f": {missing} are never made"
            self._doubt(~good, f"a number that is not the program's may be beyond {term.kind}{why or ''}")
        return term

    def _value_bits(self, value: Expr) -> Any:
        """Return the bits of words that are known as floats."""
        return integers.bits(self._term(self.value(value.args[0]), "int32"))

    def _value_pack4(self, value: Expr) -> Any:
        """Return the bytes of four floats as a word, the first one the lowest."""
        four = [self._term(self.value(each), "float32") for each in value.args]
        return integers.packed(four, self.claim.ranges, self._doubt)

    def _value_dot4(self, value: Expr) -> Any:
        """Return products of the bytes of words, which have a sign, with four bytes or those of a word."""
        weights, four = (self.folded(self._term(self.value(each), "int32")) for each in value.args)
        return integers.dots(weights, four, self._doubt)
