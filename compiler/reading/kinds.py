"""Kinds of values in a source: what a constant is, and what becomes of a value that is of another kind.

Nothing is converted that no kernel converts: a coordinate is an int32, a truth is a bool, and no operator is
of two kinds. Integers are of 32 bits, and no larger than an index may be.
"""

from __future__ import annotations

from fractions import Fraction
from typing import Any

import numpy as np

from . import words
from .field import Number, expression, literal, wide
from .lanes import Lanes, Place, Raw, Unread, Wrong
from .memory import Pointer
from .tokens import Type

PROMOTED = {"int8": "int32", "uint8": "int32"}
"""Kinds of integers that operators take for larger ones."""


WIDENED = {("int32", "uint32"), ("int32", "float32"), ("uint32", "float32")}
"""Conversions that GLSL makes without a word."""


class Kinds:
    """What a machine knows of kinds [machine.py]."""

    lanes: Lanes
    mixes: int

    def converted(self, value: Any, type_: Type, stated: bool = False) -> Any:
        """Return what a variable of a type holds of a value; `stated`: a conversion is written."""
        kind = type_.kind
        plain = (isinstance(value, Number) and value.kind == kind) or (type(value) is int and kind == "int32")
        if plain and not type_.pointer and (kind != "int32" or type_.width <= 2):
            return value
        if isinstance(value, list):
            return [self.converted(one, type_, stated) for one in value]
        address = isinstance(value, Pointer) and value.sizes != ()
        if type_.pointer != address and kind != "auto" and not type_.reference:
            raise Unread(f"an address, or none, as {kind}")
        if kind == "auto" or value is None or isinstance(value, (Pointer, dict)):
            return value.declared(type_) if address and kind != "auto" else value
        if isinstance(value, Number):
            return self._becomes(value, type_, stated)
        if kind == "bool" or (isinstance(value, np.ndarray) and not isinstance(value, Place)):
            if kind != "bool" or not isinstance(value, (bool, np.ndarray)):
                raise Unread(f"a truth, or an integer, as {kind}")
            return value
        if not stated and self.mixes < (2 if isinstance(value, Raw) else kind in ("float32", "uint32")):
            raise Unread(f"an integer as {kind} without a conversion")
        if kind == "int32" and type_.width <= 2:
            return value.place if isinstance(value, Raw) else int(value) if isinstance(value, bool) else value
        limits = words.LIMITS.get(kind, (-words.EXACT, words.EXACT))
        if type(value) is not int or not limits[0] <= value <= limits[1]:
            raise Unread(f"a coordinate, or {value!r}, as {kind}")
        return literal(value, kind)

    def _becomes(self, value: Number, type_: Type, stated: bool) -> Number:
        """Return a number as one of a type; of vectors no language makes others without a word."""
        kind = type_.kind
        if "bool" in (kind, value.kind) and self._is_truth(value, kind, type_.width):
            return value
        implied = value.kind == kind or (self.mixes == 2 and 1 in (type_.width, wide(value)))
        if not stated and not implied and not (self.mixes == 1 and (value.kind, kind) in WIDENED):
            raise Unread(f"{value.kind} as {kind} without a conversion")
        return self.cast(value, kind)

    def _is_truth(self, value: Number, kind: str, width: int) -> bool:
        """Refuse a truth as a number, and a number as a truth; vectors of truths are vectors of integers."""
        alike = (kind == "bool") == (value.kind == "bool")
        if not alike and (width == 1 or kind != "int32"):
            raise Unread(f"{value.kind} as {kind}")
        return True

    def cast(self, value: Number, kind: str) -> Number:
        """Return a number as one of another kind: `Wrong` for a constant that it does not hold."""
        limits = words.LIMITS.get(kind)
        whole = int(value.literal) if value.literal is not None and value.kind == "float32" else 0
        if limits and not limits[0] <= whole <= limits[1]:
            raise Wrong(f"{value.literal} as {kind}")
        if value.kind != kind and (other := words.cast(value, kind, self)) is not None:  # type: ignore[arg-type]
            return other
        if kind not in ("float32", "int32", "uint32") or value.kind == kind:
            return value
        return (
            expression("convert", value, kind=kind) if value.literal is None else literal(value.literal, kind)
        )

    def _constant(self, text: str) -> Any:
        if text[:2] in ("0x", "0X") or not any(c in text for c in ".eEfF"):
            value = int(text.rstrip("uU"), 0)
            if value >= 2**31 and (text[-1] not in "uU" or value >= 2**32):
                raise Wrong(f"{text} is no integer of 32 bits")
            return literal(value, "uint32") if text[-1] in "uU" else value
        exact, nearest = Fraction(text.rstrip("fF")), np.float32(text.rstrip("fF"))
        if not np.isfinite(nearest) or 4 * abs(exact - Fraction(float(nearest))) > Fraction(
            float(np.spacing(abs(nearest)))
        ):
            raise Unread(f"{text}, which is no number that float32 holds")
        return literal(float(nearest), "float32")

    def whole(self, value: Any) -> Any:
        """Return an integer, or a truth: `Wrong` for one that may not fit 32 bits."""
        if type(value) is int:
            if not -(2**31) <= value < 2**31:
                raise Wrong(f"{value} is no integer of 32 bits")
        elif isinstance(value, Place) and (np.abs(value.values) > self.lanes.most)[self.lanes.running].any():
            raise Wrong("an integer is larger than an index of an image")
        return value

    def both(self, a: Any, b: Any) -> tuple[Number, Number]:
        """Return two numbers of one kind: an integer of the text becomes one of the other's."""
        if isinstance(a, Number) and isinstance(b, Number):
            return a, b
        if any(isinstance(n, bool) or not isinstance(n, (int, Number)) for n in (a, b)):
            raise Wrong("it mixes coordinates, or truths, and numbers of the image")
        kind = next(n.kind for n in (a, b) if isinstance(n, Number))
        if not self.mixes and kind in ("float32", "uint32"):
            raise Unread(f"an integer and a number of {kind}")
        kind = "int32" if kind in ("int8", "uint8") else kind
        one, other = (n if isinstance(n, Number) else literal(n, kind) for n in (a, b))
        return one, other

    def alike(self, a: Any, b: Any) -> tuple[Number, Number]:
        """Return two numbers of one kind; `Unread` of two kinds."""
        if type(a) is Number and type(b) is Number and a.kind == b.kind:
            return a, b
        one, other = self.both(a, b)
        if PROMOTED.get(one.kind, one.kind) != PROMOTED.get(other.kind, other.kind):
            raise Unread(f"numbers of {one.kind} and {other.kind}")
        return one, other
