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

import numpy as np
from numpy.typing import NDArray

from ...refimpl.rng import pcg4d
from ..parsing.parse import Unread as Unread

FAR = 1000
"""Coordinates that stand for all that are far from a border lie between one and two times this."""

SOME = 32
"""How many pairs of distances of a group from two borders are drawn in each run."""


class Wrong(Exception):
    """What a text does and may not do."""


@dataclass
class Lanes:
    """Pixels under test: `known` (4, lanes) are x, width, y and height.

    No constant beyond `caps`, of a row and of a column, may be compared with them. Of work groups `known` has
    the first pixel's x and y, multiples of `steps`, and `inside` (2, lanes) are the items' places in their
    group. `channels`: the most of an image, so that no index is larger [`most`].
    """

    known: NDArray[np.int64]
    caps: tuple[int, int]
    inside: NDArray[np.int64] | None = None
    steps: tuple[int, int] | None = None
    channels: int = 1

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

    @property
    def x(self) -> NDArray[np.int64]:
        """The column (lanes,) of each lane's first pixel."""
        return np.asarray(self.known[0] if self.inside is None else self.known[0] + self.inside[0])

    @property
    def y(self) -> NDArray[np.int64]:
        """The row (lanes,) of each lane's pixels."""
        return np.asarray(self.known[2] if self.inside is None else self.known[2] + self.inside[1])


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
    return Lanes(np.array(found, dtype=np.int64).T, caps)


def group_lanes(group: tuple[int, int], pixels: int, window: int, seed: int) -> Lanes:
    """Return the items of groups of all cases, `pixels` of a row to an item.

    A group's first column is 0 or far: the next, one group on, is as far as any from constants smaller than a
    group [`Place.compared`]. Its distance from the right border is each that the group and the window reach,
    or far. So for rows, with the columns far from all borders. Last are groups at both axes' borders.
    """
    steps = group[0] * pixels, group[1]
    known, caps = _cases(steps, window, seed, every=False)
    y, x = np.divmod(np.arange(group[0] * group[1]), group[0])
    inside = np.tile([x, y], len(known[0]))
    return Lanes(np.repeat(known, len(x), axis=1), caps, inside=inside, steps=steps)


def tile_lanes(steps: tuple[int, int], window: int, seed: int, beyond: bool) -> Lanes:
    """Return work items of all cases, of so many columns and rows of pixels.

    The cases are those of groups of as many pixels [`group_lanes`]. `beyond`: and tiles below the picture, at
    each distance from it, or far.
    """
    known, caps = _cases(steps, window, seed, every=True)
    if beyond:
        near = np.arange(caps[1] + 2)
        down = np.concatenate(
            [(near // steps[1] + 1) * steps[1], np.full(len(near), 2 * FAR // steps[1] * steps[1])]
        )
        cases = known[:, np.arange(len(down)) * 7 % known.shape[1]].copy()
        cases[2], cases[3] = down, down - np.concatenate([near, near])
        cases[3, len(near) - 1], cases[3, -1] = 1, 1
        known = np.concatenate([known, cases], axis=1)
    return Lanes(known, caps, steps=steps)


def _cases(
    steps: tuple[int, int], window: int, seed: int, every: bool
) -> tuple[NDArray[np.int64], tuple[int, int]]:
    """Return x, width, y and height (4, cases) of all cases, and the largest constants for both axes.

    Near two borders are `every` pair of distances, first columns and rows being 0 or far, or some, each
    distance with the first group, and a whole group, whose items have every pair of their own.
    """
    random, caps = words(seed), (steps[0] + window, steps[1] + window)

    def drawn(case: tuple[int | None, int | None], step: int) -> tuple[int, int]:
        before, behind = case
        at = (FAR + next(random) % FAR) // step * step if before is None else before
        return at, at + (FAR + next(random) % FAR if behind is None else behind)

    across, down = ([(b, n) for b in (None, 0) for n in (None, *range(1, cap + 2))] for cap in caps)
    cases = [(a, down[0]) for a in across] + [(across[0], b) for b in down[1:]]
    near = range(1, caps[0] + 2), range(1, caps[1] + 2)
    corners = [*itertools.product((None, 0), repeat=2)]
    chosen = [*itertools.product(itertools.product(*near), corners)]
    if not every:
        some = [(1 + next(random) % a[-1], 1 + next(random) % b[-1]) for a, b in [near] * SOME]
        chosen = [(steps, c) for c in corners] + [(pair, corners[next(random) % 4]) for pair in some]
        # Each place of the far border of one axis in a group meets the first group of the other.
        cases += [((None, n), (0, None)) for n in near[0][: steps[0]]]
        cases += [((0, None), (None, n)) for n in near[1][: steps[1]]]
    cases += [((x, b), (y, d)) for (b, d), (x, y) in chosen]
    for a, c in corners:
        cases += [((a, None), (c, None)), ((a, None), (c, steps[1])), ((a, steps[0]), (c, None))]
    return np.array([(*drawn(a, steps[0]), *drawn(b, steps[1])) for a, b in cases], dtype=np.int64).T, caps
