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


TILE = 2
"""The axis of an index that a tile's number, or how many there are, goes into.

Nothing is compared with these, so that what is true of the tiles that are computed is true of all.
"""


class Place:
    """An integer `values` (lanes, turns) of one `axis`: 0 along a row, 1 along a column, None in a group.

    `form` (2, lanes, turns): how often the coordinate and the extent of that axis go into it; 0 of tiles.
    """

    def __init__(self, values: NDArray[np.int64], form: NDArray[np.int64], axis: int | None) -> None:
        self.values, self.form, self.axis = values, form, axis

    @classmethod
    def inside(cls, lanes: Lanes, axis: int) -> Place:
        """Return the place of an item in its group."""
        assert lanes.inside is not None
        return cls(lanes.inside[axis][:, None], NOTHING, None)

    @classmethod
    def of(cls, lanes: Lanes, number: int) -> Place:
        """Return x, width, y or height."""
        form = np.eye(2, dtype=np.int64)[number % 2]
        return cls(lanes.known[number][:, None], form.reshape(2, 1, 1), number // 2)

    @staticmethod
    def values_of(value: Any, axis: int | None = None) -> NDArray[np.int64]:
        """Return the values of any integer: `Wrong` for a coordinate of another axis."""
        if isinstance(value, Place):
            if value.axis not in (None, axis):
                raise Wrong("an index, or a row or a column, has a coordinate of another axis")
            return value.values
        return np.asarray(value, dtype=np.int64).reshape(1, -1)

    def each(self, _: Any, two: Any) -> Place:
        """Return a place of changed arrays."""
        return Place(two(self.values), two(self.form), self.axis)

    @classmethod
    def operated(cls, lanes: Lanes, what: str, a: Any, b: Any, mask: Any) -> Place:
        """Return what arithmetic makes of two integers: `Wrong` for one that may not fit 32 bits."""
        (va, fa), (vb, fb), axis = _both(a, b)
        if axis == TILE:
            return cls._of_tiles(lanes, what, va, vb)
        if what in ("minimum", "maximum"):
            first = cls.compared(lanes, "less_equal" if what == "minimum" else "greater_equal", a, b, mask)
            found = cls(np.where(first, va, vb), np.where(first, fa, fb), axis)
        elif what in ("add", "subtract"):
            sign = 1 if what == "add" else -1
            found = cls(va + sign * vb, fa + sign * fb, axis)
        elif what == "multiply" and not (isinstance(a, Place) and isinstance(b, Place)):
            found = cls(va * vb, fa * vb + fb * va, axis)
        elif what in ("divide", "remainder") and type(b) is int and not fa.any():
            bad = va < 0
            if b <= 0 or (bad if mask is None else bad & mask).any():
                raise Wrong("it divides a negative integer, or by one")
            found = cls(va // b if what == "divide" else va % b, fa, axis)
        else:
            raise Unread(f"{what} of coordinates")
        if axis is not None and not found.form.any():
            raise Wrong("coordinates that cancel")
        if max(-found.values.min(), found.values.max()) > lanes.least:
            large = np.abs(found.values) > lanes.most[:, None]
            if (large if mask is None else large & mask).any():
                raise Wrong("an integer is larger than an index of an image")
        own, extent = found.form  # of a coordinate from 0 to the extent
        if (np.maximum(np.maximum(abs(own), abs(extent)), abs(own + extent)) > lanes.channels).any():
            raise Wrong("a coordinate is multiplied by more than the channels of an image")
        return found

    @classmethod
    def _of_tiles(cls, lanes: Lanes, what: str, a: Any, b: Any) -> Place:
        """Return an index of tiles, or how many groups of tiles there are."""
        if what == "divide" and (a.tolist(), b.tolist()) == ([[lanes.batch[0]]], [[lanes.batch[1]]]):
            return cls(a // b, NOTHING, TILE)
        if what not in ("add", "subtract", "multiply"):
            raise Wrong(OTHERWISE)
        if (np.abs(ARRAYS[what](a.astype(float), b)) > 2.0**62).any():
            raise Wrong("an index leaves 32 bits, whatever the number of tiles")
        return cls(ARRAYS[what](a, b), NOTHING, TILE)

    @classmethod
    def compared(cls, lanes: Lanes, what: str, a: Any, b: Any, mask: Any) -> NDArray[np.bool_]:
        """Return a comparison (lanes, turns): `Wrong` unless lanes decide its sign."""
        (va, fa), (vb, fb), axis = _both(a, b)
        if axis == TILE:
            raise Wrong(OTHERWISE)
        values, (own, extent) = va - vb, fa - fb

        def refuse(bad: Any, why: str, kind: type[Exception] = Wrong) -> None:
            if np.any(bad if mask is None else np.logical_and(bad, mask)):
                raise kind(why)

        if axis is not None:
            plain = (np.abs(own) <= 1) & (np.abs(extent) <= 1) & (own * extent <= 0)
            refuse(~plain, "it compares coordinates in a way that no lane decides")
            at, size = (lanes.known[2 * axis + k][:, None] for k in (0, 1))
            rest, cap = values - own * at - extent * size, lanes.caps[axis]
            there = (own != 0) | (extent != 0)
            refuse(there & (np.abs(rest) > cap), f"it compares a coordinate with a constant beyond {cap}")
            if lanes.steps:
                alone = rest * (own + extent) * (own * extent == 0)
                why = "coordinates that are compared with a constant as large as a group"
                refuse(alone <= -lanes.steps[axis], why, Unread)
        found: NDArray[np.bool_] = COMPARES[what](values, 0)
        return found


OTHERWISE = "it uses the number of a tile otherwise than in an index"
"""Why what is done with tiles' numbers is refused."""

NOTHING: NDArray[np.int64] = np.zeros((2, 1, 1), np.int64)
"""The form of an integer that no coordinate goes into."""


def _both(a: Any, b: Any) -> tuple[tuple[Any, Any], tuple[Any, Any], int | None]:
    """Return values and forms of two integers, and their axis."""
    axes = {each.axis for each in (a, b) if isinstance(each, Place)} - {None}
    if len(axes) > 1:
        raise Wrong("it compares, or adds up, coordinates of both axes")
    axis = axes.pop() if axes else None
    pairs = [
        (Place.values_of(each, axis), each.form if isinstance(each, Place) else NOTHING) for each in (a, b)
    ]
    return pairs[0], pairs[1], axis


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
