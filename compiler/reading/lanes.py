"""Coordinates of a text under test: lanes, each with a pixel and a picture of its own, stand for all others.

A text may compare a coordinate with a border, or an extent with a constant, as long as the difference is a
small constant. Which comparisons hold then depends on how far a pixel is from the borders, up to that
constant: there is a lane for every such case of a row with every one of a column. Elsewhere coordinates are
drawn, so that an index is the same polynomial of them or differs [Schwartz and Zippel, as in field.py]. All
integers are of 32 bits, and no larger than an index may be.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...refimpl.rng import pcg4d
from ..parsing.parse import Unread as Unread

Mask = NDArray[np.bool_]

FAR = 1000
"""Coordinates that stand for all that are far from a border lie between one and two times this."""


class Wrong(Exception):
    """What a text does and may not do."""


@dataclass
class Lanes:
    """Pixels under test: `known` (4, lanes) are x, width, y and height; `active` (lanes,) still run.

    No constant beyond `caps`, of a row and of a column, may be compared with them. Of work groups `known` has
    the first pixel's x and y, multiples of `steps`, and `inside` (2, lanes) are the items' places in their
    group. `mask` (lanes,) are those that a branch runs in. `channels`: the most of an image, so that no index
    is larger [`most`].
    """

    known: NDArray[np.int64]
    caps: tuple[int, int]
    active: Mask
    inside: NDArray[np.int64] | None = None
    steps: tuple[int, int] | None = None
    mask: Mask | None = None
    channels: int = 1

    @cached_property
    def most(self) -> NDArray[np.int64]:
        """The largest integer (lanes,) that a kernel needs: an index, with a border, or of its own memory."""
        _, width, _, height = self.known + np.array(sum(self.caps) + 1)
        return np.asarray(2**17 + self.channels * width * height)

    @property
    def running(self) -> Mask:
        """The lanes (lanes,) in which a statement has an effect now."""
        return self.active if self.mask is None else self.mask & self.active

    @property
    def count(self) -> int:
        """How many there are."""
        return len(self.active)

    @property
    def x(self) -> NDArray[np.int64]:
        """The column (lanes,) of each lane's first pixel."""
        return np.asarray(self.known[0] if self.inside is None else self.known[0] + self.inside[0])

    @property
    def y(self) -> NDArray[np.int64]:
        """The row (lanes,) of each lane's pixels."""
        return np.asarray(self.known[2] if self.inside is None else self.known[2] + self.inside[1])

    def place(self, axis: int) -> Place:
        """Return x, width, y or height."""
        return Place(self, self.known[axis], np.eye(4)[axis])

    def constant(self, value: Any) -> Place:
        """Return an integer, or one for each lane, that no coordinate goes into."""
        return Place(self, np.broadcast_to(value, (self.count,)), np.zeros(4))


class Place:
    """An integer that differs between lanes: `values` (lanes,), and the linear `form` (4, lanes) of each.

    That is of x, width, y and height, without a constant; NaN where it is not linear.
    """

    def __init__(self, lanes: Lanes, values: Any, form: Any) -> None:
        self.lanes, self.values = lanes, np.asarray(values, dtype=np.int64)
        self.form = np.reshape(np.asarray(form, dtype=np.float64), (4, -1))

    def plus(self, other: Any, sign: int = 1) -> Place:
        """Return the sum with an integer, or the difference."""
        values, form = (other.values, other.form) if isinstance(other, Place) else (other, 0.0)
        return Place(self.lanes, self.values + sign * values, self.form + sign * form)

    def times(self, other: Any) -> Place:
        """Return the product with an integer."""
        if not isinstance(other, Place):
            form, near = self.form * other, np.round(self.form * other)
            return Place(self.lanes, self.values * other, np.where(np.abs(form - near) < 1e-9, near, form))
        for one, by in ((self, other), (other, self)):
            if not one.form.any() and len(set(one.values.tolist())) == 1:
                return by.times(int(one.values[0]))
        return Place(self.lanes, self.values * other.values, np.full(4, np.nan))

    def against(self, other: Any) -> NDArray[np.int64]:
        """Return the difference (lanes,) from another integer; `Wrong` unless lanes decide its sign."""
        found, running = self.plus(other, -1), self.lanes.running
        form, values, known = found.form, found.values, self.lanes.known
        if not running.all():
            form = form if form.shape[1] == 1 else form[:, running]
            values, known = values[running], known[:, running]
        (a, b), (c, d) = form[:2], form[2:]
        one_axis = (np.abs(a) + np.abs(b) == 0) | (np.abs(c) + np.abs(d) == 0)
        plain = np.isin(form, (-1, 0, 1)).all(axis=0) & (a * b <= 0) & (c * d <= 0)
        if not (one_axis & plain).all():
            raise Wrong("it compares coordinates in a way that no lane decides")
        rest = values - (form * known).sum(axis=0)
        for axis, cap in enumerate(self.lanes.caps):
            own, extent = form[2 * axis : 2 * axis + 2]
            if not (own.any() or extent.any()):
                continue
            if (np.abs(rest) * ((own != 0) | (extent != 0))).max(initial=0) > cap:
                raise Wrong(f"it compares a coordinate with a constant beyond {cap}")
            alone = rest * (own + extent) * (own * extent == 0)
            if self.lanes.steps and (alone <= -self.lanes.steps[axis]).any():
                raise Wrong("it compares a coordinate with a constant as large as a group")
        return found.values


def plus(a: Any, b: Any, sign: int = 1) -> Any:
    """Return a + b or a - b of integers."""
    if isinstance(a, Place):
        return a.plus(b, sign)
    return (b if sign == 1 else b.times(-1)).plus(a) if isinstance(b, Place) else a + sign * b


def times(a: Any, b: Any) -> Any:
    """Return a * b of integers."""
    if isinstance(b, Place) and not isinstance(a, Place):
        a, b = b, a
    return a.times(b) if isinstance(a, Place) else a * b


def clamped(value: Any, end: Any, sign: int) -> Any:
    """Return the larger (sign 1) or the smaller (-1) of two integers."""
    if not isinstance(value, Place) and not isinstance(end, Place):
        return max(value, end) if sign == 1 else min(value, end)
    value = value if isinstance(value, Place) else end.lanes.constant(value)
    return chosen(value.lanes, value.against(end) * sign >= 0, value, end)


def chosen(lanes: Lanes, where: Mask, a: Any, b: Any) -> Any:
    """Return integer a in some lanes and b in the others."""
    if not isinstance(a, Place) and not isinstance(b, Place) and a == b:
        return a
    one, other = (v if isinstance(v, Place) else lanes.constant(v) for v in (a, b))
    return Place(lanes, np.where(where, one.values, other.values), np.where(where, one.form, other.form))


def words(seed: int) -> Iterator[int]:
    """Yield words of 32 bits."""
    for n in itertools.count():
        yield int(pcg4d(*np.array([[n], [seed], [0], [0]], dtype=np.uint32))[0][0])


def lanes_for(caps: tuple[int, int], step: int, seed: int) -> Lanes:
    """Return lanes of all cases: x a multiple of `step`, constants up to `caps`.

    The first is far from all borders. Each case of a row meets each of a column.
    """
    random = words(seed)

    def pairs(cap: int, step: int) -> list[tuple[int | None, int | None]]:
        return [(a, b) for a in (*range(0, cap + 1, step), None) for b in (*range(1, cap + 2), None)]

    def drawn(pair: tuple[int | None, int | None], step: int) -> tuple[int, int]:
        before, behind = pair
        at = (FAR + next(random) % FAR) // step * step if before is None else before
        return at, at + (FAR + next(random) % FAR if behind is None else behind)

    cases = itertools.product(pairs(caps[0], step), pairs(caps[1], 1))
    found = [(*drawn(p, step), *drawn(q, 1)) for p, q in cases]
    found.insert(0, (*drawn((None, None), step), *drawn((None, None), 1)))
    return Lanes(np.array(found, dtype=np.int64).T, caps, np.ones(len(found), dtype=bool))
