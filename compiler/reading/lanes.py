"""Coordinates of a text under test: lanes, each with a pixel and a picture of its own, stand for all others.

A text may compare a coordinate with a border, or an extent with a constant, as long as the difference is a
small constant. Which comparisons hold then depends on how far a pixel is from the borders, up to that
constant: there is a lane for every such case of a row, far from the other borders, and of a column.

No lane is near borders of both axes. None is needed: an integer is of one axis [`Place`], and a condition on
it holds far from all borders or nowhere [`Lanes.far`], so what is read of an image is its pixel (row, column)
where a condition of the row and one of the column hold, else 0; two of these that agree in a row and in a
column far from borders agree everywhere (spec/text.md, TXT-5).

Elsewhere coordinates are drawn, so that an index is the same polynomial of them or differs [Schwartz and
Zippel, as in field.py]. All integers are of 32 bits, and no larger than an index may be.
"""

from __future__ import annotations

import itertools
import secrets
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..parsing.parse import Unread as Unread

FAR = 1000
"""Coordinates that stand for all that are far from a border lie between one and two times this."""


class Wrong(Exception):
    """What a text does and may not do."""


@dataclass
class Lanes:
    """Pixels under test: `known` (4, lanes) are x, width, y and height, the first ones far from all borders.

    No constant beyond `caps`, of a row and of a column, may be compared with them. Of work groups `known` has
    the first pixel's x and y, multiples of `steps`, and `inside` (2, lanes) are the items' places in their
    group, one group behind the other. `channels`: the most of an image, so that no index is larger [`most`].
    `batch`: how many tiles launches have, and of how many this is a multiple.
    """

    known: NDArray[np.int64]
    caps: tuple[int, int]
    inside: NDArray[np.int64] | None = None
    steps: tuple[int, int] | None = None
    channels: int = 1
    batch: tuple[int, int] = (0, 1)

    @cached_property
    def most(self) -> NDArray[np.int64]:
        """The largest integer (lanes,) that a kernel needs: an index, with a border, or of its own memory."""
        _, width, _, height = self.known + np.array(sum(self.caps) + 1)
        return np.asarray(2**17 + self.channels * width * height)

    @cached_property
    def least(self) -> int:
        """The least of these."""
        return int(self.most.min())

    @property
    def count(self) -> int:
        """How many there are."""
        return int(self.known.shape[1])

    @cached_property
    def items(self) -> int:
        """How many of them are one case: the items of a group."""
        return 1 if self.inside is None else int(self.inside[0].max() + 1) * int(self.inside[1].max() + 1)

    def far(self, truth: NDArray[np.bool_]) -> bool:
        """Return whether a condition (lanes, turns) of an item holds far from all borders, or nowhere."""
        cases = truth.reshape(-1, self.items, truth.shape[1])
        return bool((cases[0] | ~cases.any(axis=0)).all())

    def alike(self, truth: NDArray[np.bool_]) -> bool:
        """Return whether a condition (lanes, turns), or (1, turns), is that of an item in its group alone."""
        cases = truth.reshape(-1, self.items, truth.shape[1]) if len(truth) > 1 else truth
        return bool((cases == cases[0]).all())

    @property
    def x(self) -> NDArray[np.int64]:
        """The column (lanes,) of each lane's first pixel."""
        return np.asarray(self.known[0] if self.inside is None else self.known[0] + self.inside[0])

    @property
    def y(self) -> NDArray[np.int64]:
        """The row (lanes,) of each lane's pixels."""
        return np.asarray(self.known[2] if self.inside is None else self.known[2] + self.inside[1])


def lanes_for(caps: tuple[int, int], step: int) -> Lanes:
    """Return lanes of all cases: x a multiple of `step`, constants up to `caps`."""
    firsts = [range(0, cap + 1, each) for cap, each in zip(caps, (step, 1), strict=True)]
    return Lanes(_cases(caps, (step, 1), firsts), caps)


def group_lanes(group: tuple[int, int], pixels: int, window: int) -> Lanes:
    """Return the items of groups of all cases, `pixels` of a row to an item.

    A group's first column is 0 or far: the next, one group on, is as far as any from constants smaller than a
    group [`Place.compared`]. Its distance from the right border is each that the group and the window reach,
    or far. So for rows.
    """
    lanes = tile_lanes((group[0] * pixels, group[1]), window)
    y, x = np.divmod(np.arange(group[0] * group[1]), group[0])
    inside = np.tile([x, y], lanes.count)
    return Lanes(np.repeat(lanes.known, len(x), axis=1), lanes.caps, inside, lanes.steps)


def tile_lanes(steps: tuple[int, int], window: int, beyond: bool = False) -> Lanes:
    """Return work items of all cases, of so many columns and rows of pixels, as `group_lanes` has groups.

    `beyond`: and tiles below the picture, at each distance from it, or far.
    """
    caps = steps[0] + window, steps[1] + window
    known = _cases(caps, steps, [(0,), (0,)])
    if beyond:
        near, far = np.arange(caps[1] + 2), 2 * FAR // steps[1] * steps[1]
        y = np.concatenate([(near // steps[1] + 1) * steps[1], np.full(len(near), far)])
        height = y - np.tile(near, 2)
        height[len(near) - 1 :: len(near)] = 1
        x, width = (np.full(len(y), known[axis, 0]) for axis in (0, 1))
        known = np.concatenate([known, [x, width, y, height]], axis=1)
    return Lanes(known, caps, steps=steps)


def _cases(
    caps: tuple[int, int], steps: tuple[int, int], firsts: Sequence[Iterable[int]]
) -> NDArray[np.int64]:
    """Return x, width, y and height (4, cases): of an axis first columns or rows, each with each distance.

    The other axis is far from its borders.
    """

    def drawn(before: int | None, behind: int | None, step: int) -> tuple[int, int]:
        at = (FAR + secrets.randbelow(FAR)) // step * step if before is None else before
        return at, at + (FAR + secrets.randbelow(FAR) if behind is None else behind)

    across, down = (
        [*itertools.product((None, *first), (None, *range(1, cap + 2)))]
        for first, cap in zip(firsts, caps, strict=True)
    )
    cases = [(a, down[0]) for a in across] + [(across[0], b) for b in down[1:]]
    found = [(*drawn(*a, steps[0]), *drawn(*b, steps[1])) for a, b in cases]
    return np.array(found, dtype=np.int64).T
