"""Work groups: which groups are run, the memory that their items share, and barriers.

Lanes are the items of a few groups, one group behind the other. Two items race for an element of the shared
memory where one writes it and another reads or writes it with no barrier between both; nor may an item write
what it has read itself.
"""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from .field import Number, Span, hull, part_of, stacked
from .lanes import FAR, Lanes, Place, Unread, Wrong, plus, words
from .words import apart, joined

if TYPE_CHECKING:
    from .machine import Machine

NOBODY = -1
"""Who has written an element since the last barrier, where no item has."""

SOME = 32
"""How many pairs of distances of a group from two borders are drawn in each run."""


def group_lanes(group: tuple[int, int], pixels: int, window: int, seed: int) -> Lanes:
    """Return the items of groups of all cases, `pixels` of a row to an item.

    A group's first column is 0 or far: the next, one group on, is as far as any from constants smaller than a
    group [`Place.against`]. Its distance from the right border is each that the group's pixels and the window
    reach, or far. So for rows, with the columns far from all borders. Last are groups at both axes' borders.
    """
    steps = group[0] * pixels, group[1]
    known, caps = _cases(steps, window, seed, every=False)
    y, x = np.divmod(np.arange(group[0] * group[1]), group[0])
    count = len(x) * len(known[0])
    return Lanes(
        np.repeat(known, len(x), axis=1), caps, np.ones(count, dtype=bool),
        inside=np.tile([x, y], len(known[0])), steps=steps,
    )  # fmt: skip


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
    return Lanes(known, caps, np.ones(known.shape[1], dtype=bool), steps=steps)


def _cases(
    steps: tuple[int, int], window: int, seed: int, every: bool
) -> tuple[NDArray[np.int64], tuple[int, int]]:
    """Return x, width, y and height (4, cases) of all cases, and the largest constants for both axes.

    Near two borders are `every` pair of distances, first columns and rows being 0 or far, or some, and
    a whole group, whose items have every pair of their own.
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
    cases += [((x, b), (y, d)) for (b, d), (x, y) in chosen]
    for a, c in corners:
        cases += [((a, None), (c, None)), ((a, None), (c, steps[1])), ((a, steps[0]), (c, None))]
    return np.array([(*drawn(a, steps[0]), *drawn(b, steps[1])) for a, b in cases], dtype=np.int64).T, caps


class Shared:
    """An array that the items of a group share: its numbers, and who read and wrote them in this phase."""

    def __init__(self, name: str, size: int, kind: str, lanes: Lanes, items: int) -> None:
        groups = lanes.count // items
        self.name, self.size, self.kind, self.blank = name, size, kind, True
        self.span: Span | None = None
        self.value = np.zeros((2, groups * size), dtype=np.uint64)
        self.shape = np.zeros(groups * size, dtype=np.uint64)
        self.held = np.zeros(groups * size, dtype=bool)
        self.writer, self.writes = np.full(groups * size, NOBODY, dtype=np.int32), False
        self.reader = np.zeros(groups * size, dtype=bool)
        group, self.item = np.divmod(np.arange(lanes.count, dtype=np.int32), np.int32(items))
        self.first = group.astype(np.int64) * size

    def wait(self) -> None:
        """Begin another phase."""
        self.writer.fill(NOBODY)
        self.reader.fill(False)
        self.writes = False

    def load(self, offset: Any, width: int, machine: Machine) -> Number:
        """Return numbers, each lane those of its group."""
        parts = [self._load(plus(offset, k), machine) for k in range(width)]
        return parts[0] if width == 1 else stacked(parts)

    def store(self, offset: Any, width: int, value: Any, machine: Machine) -> None:
        """Write numbers, each lane into its group's memory."""
        for k in range(width):
            self._store(plus(offset, k), part_of(value, k if width > 1 else None), machine)

    def _index(self, offset: Any, machine: Machine) -> NDArray[np.int64]:
        """Return the place (lanes,) of an element in all groups' memory."""
        values = offset.values if isinstance(offset, Place) else np.full(len(self.item), offset)
        beyond = (values < 0) | (values >= self.size)
        if beyond.any():
            if (beyond & machine.running).any():
                raise Wrong(f"{self.name} is read or written beyond its {self.size} numbers")
            values = np.where(beyond, 0, values)
        place: NDArray[np.int64] = self.first + values
        return place

    def _load(self, offset: Any, machine: Machine) -> Number:
        every, running = self._index(offset, machine), machine.running
        at, item = (every, self.item) if running.all() else (every[running], self.item[running])
        if not self.held[at].all():
            raise Wrong(f"{self.name} is read before it is written")
        writer = self.writer[at] if self.writes else item
        if ((writer != NOBODY) & (writer != item)).any():
            raise Wrong(f"{self.name}: an item reads what another writes, without a barrier between")
        self.reader[at] = True
        found = Number(self.value.take(every, axis=1), self.shape[every], self.kind, span=self.span)
        return found if found.axes < 3 else joined(found)

    def _store(self, offset: Any, value: Any, machine: Machine) -> None:
        if not isinstance(value, Number) or value.shape is None or value.kind != self.kind:
            raise Unread(f"anything but numbers of one kind, or sums, in {self.name}")
        if value.shape.shape[0] == 1 and value.literal is None:
            raise Unread(f"numbers behind a sum in {self.name}")
        machine.written(value, self.name)
        value = self._apart(value)
        running = machine.running
        at, item = self._index(offset, machine)[running], self.item[running]
        writer = self.writer[at]
        if self.reader[at].any():
            raise Wrong(f"{self.name}: an item writes what another reads, without a barrier between")
        self.writes = True
        self.writer[at] = item
        if (self.writer[at] != item).any() or ((writer != NOBODY) & (writer != item)).any():
            raise Wrong(f"{self.name}: two items write one number")
        tail = self.shape.shape[1:]
        self.value[:, at] = np.broadcast_to(value.value, (2, len(running), *tail))[:, running]
        self.shape[at] = np.broadcast_to(value.shape, (len(running), *tail))[running]
        self.held[at] = True

    def _apart(self, value: Number) -> Number:
        """Return a number, a word as its bytes, for which there is room; note its span."""
        value = apart(value)
        if self.blank and value.axes == 3:
            self.value, self.shape = (np.repeat(a[..., None], 4, axis=-1) for a in (self.value, self.shape))
        if self.shape.ndim != value.axes - 1:
            raise Unread(f"words and other numbers in {self.name}")
        both = value.span and self.span and hull(value.span, self.span)
        self.span, self.blank = value.span if self.blank else both, False
        return value


class Group:
    """What the items of a group have in common: `share` makes its memory, `wait` is a barrier."""

    def __init__(self, lanes: Lanes, items: int) -> None:
        self.lanes, self.items = lanes, items
        self.memories: list[Shared] = []

    def share(self, name: str, size: int, kind: str) -> Shared:
        """Return an array of so many numbers of a kind in each group."""
        self.memories.append(Shared(name, size, kind, self.lanes, self.items))
        return self.memories[-1]

    def wait(self, machine: Machine) -> None:
        """Begin another phase of the shared memories; all items must be here."""
        if machine.mask is not None or not machine.running.all():
            raise Wrong("a barrier that not all items of a group reach")
        for memory in self.memories:
            memory.wait()
