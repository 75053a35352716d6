"""Coordinates of a kernel under test: `Place`, for all lanes and turns at once [lanes.py]."""

from __future__ import annotations

import operator
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..kernel.kernel import BATCH, INTEGERS, Body, Let, name
from .lanes import Lanes, Unread, Wrong

ARRAYS: Mapping[str, Any] = {
    "add": np.add, "subtract": np.subtract, "multiply": np.multiply, "divide": np.floor_divide,
    "remainder": np.remainder, "minimum": np.minimum, "maximum": np.maximum,
}  # fmt: skip
"""Arithmetic of arrays of integers."""

COMPARES: Mapping[str, Callable[[Any, Any], Any]] = {
    "less": operator.lt, "greater": operator.gt, "less_equal": operator.le,
    "greater_equal": operator.ge, "equal": operator.eq, "not_equal": operator.ne,
}  # fmt: skip
"""Comparisons of two integers."""


class Place:
    """An integer `values` (lanes, turns), and the linear `form` (4, lanes, turns) of x, width, y and height.

    The form has no constant, and is NaN where the integer is not linear.
    """

    def __init__(self, values: NDArray[np.int64], form: NDArray[np.float64]) -> None:
        self.values, self.form = values, form

    @classmethod
    def inside(cls, lanes: Lanes, axis: int) -> Place:
        """Return the place of an item in its group."""
        assert lanes.inside is not None
        return cls(lanes.inside[axis][:, None], np.zeros((4, 1, 1)))

    @classmethod
    def of(cls, lanes: Lanes, axis: int) -> Place:
        """Return x, width, y or height."""
        return cls(lanes.known[axis][:, None], np.eye(4)[axis].reshape(4, 1, 1))

    @staticmethod
    def values_of(value: Any) -> NDArray[np.int64]:
        """Return the values of any integer."""
        return value.values if isinstance(value, Place) else np.asarray(value, dtype=np.int64).reshape(1, -1)

    @staticmethod
    def form_of(value: Any) -> NDArray[np.float64]:
        """Return the form of any integer."""
        return value.form if isinstance(value, Place) else np.zeros((4, 1, 1))

    def each(self, _: Any, two: Any) -> Place:
        """Return a place of changed arrays."""
        return Place(two(self.values), two(self.form))

    @classmethod
    def operated(cls, lanes: Lanes, what: str, a: Any, b: Any, mask: Any) -> Place:
        """Return what arithmetic makes of two integers: `Wrong` for one that may not fit 32 bits."""
        (va, fa), (vb, fb) = ((cls.values_of(each), cls.form_of(each)) for each in (a, b))
        if what in ("minimum", "maximum"):
            first = cls.compared(lanes, "less_equal" if what == "minimum" else "greater_equal", a, b, mask)
            return chosen(lanes, first, a, b)  # type: ignore[no-any-return]
        if what in ("add", "subtract"):
            sign = 1 if what == "add" else -1
            found = cls(va + sign * vb, fa + sign * fb)
        elif what == "multiply":
            both = isinstance(a, Place) and isinstance(b, Place)
            form = np.full((4, 1, 1), np.nan) if both else fa * vb if isinstance(a, Place) else fb * va
            near = np.round(form)
            found = cls(va * vb, np.where(np.abs(form - near) < 1e-9, near, form))
        elif what in ("divide", "remainder") and type(b) is int and not fa.any():
            bad = va < 0
            if b <= 0 or (bad if mask is None else bad & mask).any():
                raise Wrong("it divides a negative integer, or by one")
            found = cls(va // b if what == "divide" else va % b, fa)
        else:
            raise Unread(f"{what} of coordinates")
        if max(-found.values.min(), found.values.max()) > lanes.least:
            large = np.abs(found.values) > lanes.most[:, None]
            if (large if mask is None else large & mask).any():
                raise Wrong("an integer is larger than an index of an image")
        if (np.abs(found.form) > lanes.channels).any():
            raise Wrong("a coordinate is multiplied by more than the channels of an image")
        return found

    @classmethod
    def compared(cls, lanes: Lanes, what: str, a: Any, b: Any, mask: Any) -> NDArray[np.bool_]:
        """Return a comparison (lanes, turns): `Wrong` unless lanes decide its sign."""
        values = cls.values_of(a) - cls.values_of(b)
        form = cls.form_of(a) - cls.form_of(b)
        known = lanes.known[:, :, None]

        def refuse(bad: Any, why: str) -> None:
            if np.any(bad if mask is None else np.logical_and(bad, mask)):
                raise Wrong(why)

        one_axis = (form[:2] == 0).all(axis=0) | (form[2:] == 0).all(axis=0)
        plain = np.isin(form, (-1, 0, 1)).all(axis=0) & (form[0] * form[1] <= 0) & (form[2] * form[3] <= 0)
        refuse(~(one_axis & plain), "it compares coordinates in a way that no lane decides")
        rest = values - (np.nan_to_num(form) * known).sum(axis=0)
        for axis, cap in enumerate(lanes.caps):
            own, extent = form[2 * axis : 2 * axis + 2]
            there = (own != 0) | (extent != 0)
            refuse(there & (np.abs(rest) > cap), f"it compares a coordinate with a constant beyond {cap}")
            alone = rest * (own + extent) * (own * extent == 0)
            if lanes.steps:
                why = "it compares a coordinate with a constant as large as a group"
                refuse(alone <= -lanes.steps[axis], why)
        found: NDArray[np.bool_] = COMPARES[what](values, 0)
        return found


def chosen(lanes: Lanes, where: NDArray[np.bool_], a: Any, b: Any) -> Any:
    """Return integer a in some lanes and turns, and b in the others."""
    va, vb = Place.values_of(a), Place.values_of(b)
    if where.shape[0] == 1 and not isinstance(a, Place) and not isinstance(b, Place):
        return np.where(where, va, vb)
    form = np.where(where, Place.form_of(a), Place.form_of(b))
    return Place(np.where(where, va, vb), form)


def indices(what: str, a: Any, b: Any, wrong: Callable[[Any, str], None]) -> Any:
    """Return what an operation makes of two integers, or arrays (1, turns); `wrong` refuses where it is."""
    if not all(type(each) is not bool and getattr(each, "dtype", np.int64) == np.int64 for each in (a, b)):
        raise Unread(f"{what} of truths")
    if what in COMPARES:
        return COMPARES[what](a, b)
    if what in ("divide", "remainder"):
        bad = np.asarray((np.asarray(a) < 0) | (np.asarray(b) <= 0))
        wrong(bad, "it divides a negative integer, or by one")
        if bad.any():
            a, b = np.where(bad, 0, a), np.where(bad, 1, b)
    found = (INTEGERS if type(a) is int and type(b) is int else ARRAYS)[what](a, b)
    large = (found < -(2**31)) | (found >= 2**31)
    if large is not False:
        wrong(large, f"{what} leaves 32 bits")
    return found


def corner(tile: str) -> Body:
    """Return the statements that give the first pixel of a tile of a batch."""
    number, across, out, width = map(name, ("number", "across", "OUT", "width"))
    return (
        Let("number", name(BATCH[0]) + name(tile)),
        Let("across", (width + out - 1) // out),
        Let("tile_x", number % across * out),
        Let("tile_y", number // across * out),
    )
