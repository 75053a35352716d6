"""The memory of a kernel under test: arrays whose elements many turns use at once.

Turns that are run at once must have nothing to do with each other: `Race` where one writes an element that
another reads or writes, unless several add sums to it, in any order. An array that is declared inside them
has a column for each. A number is one of all lanes, and is read by those alone that have written it; of an
image's, which all lanes have written near borders, those that are far from them have to write the same.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..kernel.kernel import Type
from .field import P, Words, drawn, hashed
from .lanes import Unread, Wrong
from .places import TILE, Place
from .terms import Term

NOBODY, ADDED, AGAIN = -1, -2, -3
"""Instead of the number of a turn that has written an element: none has, or all add to it, once or again."""

EMPTY, SHAPE, SUM, BOTH = range(4)
"""What an element holds: nothing, a shape, a sum on its way, or both of them."""


class Race(Exception):
    """Turns of a loop, or items of a launch, one of which uses what another writes."""

    def __init__(self) -> None:
        super().__init__("turns have to do with each other")


class Turns:
    """The turns that are run at once: `count`, and the `slot` of each, of a launch.

    `owners`: of each array the last turn that has written an element, and who has read which. `ordered`: of
    those that write an element the last turn does; else there may be only one.
    """

    def __init__(
        self, count: int, slot: NDArray[np.intp] | None = None, undoes: bool = False, ordered: bool = False
    ) -> None:
        self.count, self.slot, self.undoes, self.ordered = count, slot, undoes, ordered
        self.who = np.arange(count, dtype=np.int32)
        self.owners: dict[int, tuple[Cells, NDArray[np.int32], list[Any]]] = {}
        self.saved: dict[int, tuple[Cells, tuple[NDArray[Any], ...]]] = {}

    def users(self, cells: Cells) -> tuple[Cells, NDArray[np.int32], list[Any]]:
        """Return who uses an array's elements."""
        if id(cells) not in self.owners:
            self.owners[id(cells)] = cells, np.full(cells.state.size, NOBODY, np.int32), []
        return self.owners[id(cells)]

    def read(self, cells: Cells, element: Any, who: Any) -> None:
        """Note who reads elements; `Race` where another turn has written."""
        _, owner, reads = self.users(cells)
        found = owner[element]
        if ((found != NOBODY) & (found != who)).any():
            raise Race
        reads.append((element, who))

    def written(self, cells: Cells, element: Any, who: Any) -> Any:
        """Note who writes elements; return where no later turn has; `Race` where several may not.

        They may not where one has read an element, even the last: it would have read what one before wrote.
        """
        _, owner, reads = self.users(cells)
        before = owner[element]
        if ((before == ADDED) | (before == AGAIN)).any():
            raise Race
        last = np.maximum(before, who)
        owner[element] = last
        others = (before != NOBODY) & (before != who)
        if (owner[element] != last).any() or (others.any() and not self.ordered):
            raise Race
        if others.any() and any(np.isin(element[others], own).any() for own, _ in reads):
            raise Race
        return before <= who

    def added(self, cells: Cells, element: Any, again: bool) -> None:
        """Note elements that all turns add to; `Race` where one has used these.

        `again`: of which they may add several, products or integers; others, such as partial sums, would be
        between those of other turns.
        """
        _, owner, reads = self.users(cells)
        used = ((owner[element] != NOBODY) & ((owner[element] != AGAIN) | (not again))).any()
        if element.size and (used or any(np.isin(element, own).any() for own, _ in reads)):
            raise Race
        owner[element] = AGAIN if again else ADDED

    def save(self, cells: Cells) -> None:
        """Keep what an array holds, in case that the turns race."""
        if self.undoes and id(cells) not in self.saved:
            self.saved[id(cells)] = cells, tuple(a.copy() for a in cells.arrays)

    def restore(self) -> None:
        """Undo all writes."""
        for cells, arrays in self.saved.values():
            for array, before in zip(cells.arrays, arrays, strict=True):
                array[...] = before

    def end(self, outer: Turns) -> None:
        """Let the turns around these have used what these have; `Race` where one has read before another."""
        of = self.count // outer.count
        for cells, owner, reads in self.owners.values():
            for element, who in reads:
                found = owner[element]
                if ((found != NOBODY) & (found != who)).any():
                    raise Race
            if cells.columns < outer.count:
                element = np.flatnonzero(owner > NOBODY)
                outer.written(cells, element, owner[element] // of)
                outer.added(cells, np.flatnonzero(owner == ADDED), False)
                outer.added(cells, np.flatnonzero(owner == AGAIN), True)
                for element, who in reads:
                    outer.read(cells, element, who // of)
        if outer.undoes:
            self.saved.update(outer.saved)
            outer.saved = self.saved


class Cells:
    """An array of `count` numbers in `columns`: shapes, sums and spans.

    `condition`: the one on lanes in which a number was written, or 0: nothing outside it reads the number.
    `expected`: what lanes far from borders have to write before it is read, or 0.
    """

    def __init__(self, name: str, count: int, columns: int, kind: str = "float32") -> None:
        self.name, self.count, self.columns, self.kind = name, count, columns, kind
        size, whole = (count, columns), kind != "float32"
        self.state, self.condition = np.zeros(size, np.uint8), np.zeros(size, np.int32)
        self.shape, self.sums = np.zeros(size, np.uint64), np.zeros((2, *size), np.uint64)
        self.expected = np.zeros(size, np.uint64)
        self.span = np.zeros((2, *(size if whole else (0, 0))), np.int64)
        self.has_sums, self.has_expected = whole, False

    @property
    def arrays(self) -> tuple[NDArray[Any], ...]:
        """All that it holds."""
        return self.state, self.condition, self.shape, self.sums, self.expected, self.span

    def at(self, place: Any, width: int, turns: Turns, active: NDArray[np.bool_] | None) -> Any:
        """Return rows and columns (width, turns) of an access; place 0 if not active."""
        place = np.full((1, 1), place) if type(place) is int else place
        if not isinstance(place, np.ndarray) or place.shape[0] != 1:
            raise Wrong(f"{self.name} has an index that differs between lanes")
        beyond = (place < 0) | (place > self.count - width)
        if beyond.any():
            if (beyond if active is None else beyond & active).any():
                raise Wrong(f"{self.name} has no number {place.max()}: it has {self.count}")
            place = np.where(beyond, 0, place)
        rows = place + np.arange(width)[:, None]
        if self.columns == 1:
            return rows, 0
        return rows, np.arange(turns.count) // (turns.count // self.columns)

    def load(self, place: Any, width: int, turns: Turns, active: Any, conditions: Sequence[int] = ()) -> Term:
        """Return numbers that have been written, in one of the conditions on lanes that hold."""
        at = self.at(place, width, turns, active)
        state = self.state[at]
        bad, condition = state == EMPTY, self.condition[at]
        if condition.any():
            bad |= ~np.isin(condition, (0, *conditions))
        if (bad if active is None else bad & active).any():
            raise Wrong(f"{self.name} is read before it is written")
        if self.has_expected and self.expected[at].any():
            raise Wrong(f"{self.name} is read before it is written, in some lanes")
        if self.columns < turns.count:
            element = np.broadcast_to(at[0] * self.columns + at[1], (width, turns.count))
            own = ... if active is None else active
            turns.read(self, element[:, own], turns.who[own])
        shape = self.shape[at]
        one = width == 1
        if not self.has_sums or not (state >= SUM).any():
            return Term(shape if one else shape[:, None], kind=self.kind)
        sums = self.sums[:, at[0], at[1]]
        if not (state >= SUM).all():
            sums = np.where(state >= SUM, sums, drawn(shape))
        sums = sums if one else sums[:, :, None]
        if self.kind != "float32":
            return self._integers(at, one, sums)
        if (state == SUM).all():
            return Term(None, sums)
        if not one:
            state, shape = state[:, None], shape[:, None]
        return Term(np.where(state == SUM, hashed("sum", *sums % P), shape), sums)

    def _integers(self, at: Any, one: bool, sums: Any) -> Term:
        """Return integers; one that is not a sum is not known."""
        good, shape = self.state[at] == BOTH, self.shape[at]
        low, high = (np.where(good, self.span[end, at[0], at[1]], 1 - end) for end in (0, 1))
        if not one:
            shape, low, high = shape[:, None], low[:, None], high[:, None]
        return Term(shape, sums, kind=self.kind, span=(low, high))

    def store(
        self,
        place: Any,
        width: int,
        value: Term,
        turns: Turns,
        active: Any,
        condition: int = 0,
        expected: Words | None = None,
    ) -> None:
        """Write numbers of active turns (turns,), in a condition on lanes."""
        at, own = self._written(place, width, turns, active)
        self.shape[at] = 0 if value.shape is None else own(value.shape, 0)
        self.condition[at], self.expected[at] = condition, 0 if expected is None else own(expected, 0)
        self.has_expected = self.has_expected or expected is not None
        self.state[at] = SHAPE if not value.begins else SUM if value.shape is None else BOTH
        if value.begins:
            self.sums[:, at[0], at[1]] = own(value.term, 1)
            self.has_sums = True
        if value.span is not None and self.span.size:
            for end in (0, 1):
                self.span[end][at] = own(value.span[end], 0)

    def complete(self, place: Any, width: int, expected: Words, turns: Turns, active: Any) -> None:
        """Write in some lanes what all of them have written before: the others read that later."""
        at, own = self._written(place, width, turns, active, kept=True)
        if (self.state[at] == EMPTY).any():
            raise Wrong(f"{self.name} is read before it is written, in some lanes")
        # Two conditions on borders of two axes leave out a corner that no lane has.
        if (self.expected[at] != own(expected, 0)).any():
            why = "is written by several conditions on borders, or has another number far from borders than"
            raise Wrong(f"{self.name} {why} near them")
        self.expected[at] = 0

    def _written(self, place: Any, width: int, turns: Turns, active: Any, kept: bool = False) -> Any:
        """Return rows and columns that active turns write (others `kept` these), and a function of values."""
        rows, columns = self.at(place, width, turns, active)
        turns.save(self)
        keep = np.ones((width, turns.count), bool) if active is None else np.tile(active, (width, 1))
        rows, columns = (np.broadcast_to(each, keep.shape)[keep] for each in (rows, columns))
        if self.columns < turns.count:
            who = np.broadcast_to(turns.who, keep.shape)[keep]
            if kept:
                turns.read(self, rows * self.columns + columns, who)
            last = turns.written(self, rows * self.columns + columns, who)
            keep[keep], rows, columns = last, rows[last], columns[last]

        def own(values: Any, axis: int) -> Any:
            """Return the values of what is written: the axis of lanes is one, or the first is meant."""
            flat = values[..., :1, :] if values.ndim == axis + 2 else values[..., 0, :]
            return np.broadcast_to(flat, (*flat.shape[:axis], *keep.shape))[..., keep]

        return (rows, columns), own


class Shared:
    """An array that the items of each group share, and which of these have used its elements in this phase.

    Lanes are the items of a few groups, one group behind the other. Items race for an element where one
    writes it and another reads or writes it with no barrier between both; nor may an item write what it has
    read itself. An element is a number of an image, or a word of four of these.
    """

    def __init__(self, name: str, size: int, kind: str, lanes: int, items: int) -> None:
        self.name, self.size, self.kind, self.blank = name, size, kind, True
        group, self.item = np.divmod(np.arange(lanes, dtype=np.int32)[:, None], np.int32(items))
        count = lanes // items * size
        self.bytes = 1 if kind == "float32" else 4
        self.shape, self.held = np.zeros((count, self.bytes), np.uint64), np.zeros(count, bool)
        self.writer, self.reader = np.full(count, NOBODY, np.int32), np.zeros(count, bool)
        self.span = [np.zeros((self.bytes, 1, 1), np.int64) for _ in range(2)]
        self.first = group.astype(np.int64) * size
        self.writes = self.full = False

    def wait(self) -> None:
        """Begin another phase."""
        self.writer.fill(NOBODY)
        self.reader.fill(False)
        self.writes, self.full = False, bool(self.held.all())

    def _at(self, place: Any, mask: Any) -> Any:
        """Return the places (lanes, turns) of elements in all groups' memory, and those of active lanes."""
        place = np.broadcast_to(place, np.broadcast_shapes(np.shape(place), self.first.shape, np.shape(mask)))
        if place.min() < 0 or place.max() >= self.size:
            beyond = (place < 0) | (place >= self.size)
            if mask is None or (beyond & mask).any():
                raise Wrong(f"{self.name} is read or written beyond its {self.size} numbers")
            place = np.where(beyond, 0, place)
        every, item = self.first + place, np.broadcast_to(self.item, place.shape)
        if mask is None:
            return every, every, item, ...
        active = np.broadcast_to(mask, place.shape)
        return every, every[active], item[active], active

    def load(self, place: Any, mask: Any) -> Term:
        """Return numbers, each lane those of its group."""
        every, at, item, _ = self._at(place, mask)
        if not self.full and not self.held[at].all():
            raise Wrong(f"{self.name} is read before it is written")
        if self.writes and ((self.writer[at] != NOBODY) & (self.writer[at] != item)).any():
            raise Wrong(f"{self.name}: an item reads what another writes, without a barrier between")
        self.reader[at] = True
        if self.bytes == 1:
            return Term(self.shape[:, 0][every])
        return Term(np.moveaxis(self.shape[every], -1, 0), kind="word", span=(self.span[0], self.span[1]))

    def store(self, place: Any, value: Term, turns: Turns, mask: Any) -> None:
        """Write numbers, each lane into its group's memory."""
        if turns.count > 1:
            raise Race
        shape = self._shape(value)
        every, at, item, active = self._at(place, mask)
        writer = self.writer[at]
        if self.reader[at].any():
            raise Wrong(f"{self.name}: an item writes what another reads, without a barrier between")
        self.writer[at] = item
        if (self.writer[at] != item).any() or ((writer != NOBODY) & (writer != item)).any():
            raise Wrong(f"{self.name}: two items write one number")
        self.shape[at] = np.moveaxis(np.broadcast_to(shape, (self.bytes, *every.shape)), 0, -1)[active]
        self.held[at] = self.writes = True

    def _shape(self, value: Term) -> Any:
        """Return the shapes of an image's numbers, and note their spans."""
        if self.bytes == 1:
            if value.shape is None or (not value.is_wide and value.literal is None):
                raise Unread(f"numbers behind a sum in {self.name}")
            return value.shape
        if value.kind != "word" or not value.is_wide or value.span is None:
            raise Unread(f"anything but words of an image in {self.name}")
        for end, hull in enumerate((np.minimum, np.maximum)):
            own = np.broadcast_to(value.span[end], self.span[end].shape)
            self.span[end] = own if self.blank else hull(self.span[end], own)
        self.blank = False
        return value.shape


class Slice:
    """An array of a kernel: elements of a kind in memory, from a place on; a view has sizes (None,)."""

    def __init__(self, cells: Any, first: Any, kind: Type, sizes: tuple[int | None, ...]) -> None:
        self.cells, self.first, self.kind, self.sizes = cells, first, kind, sizes

    def each(self, _: Any, two: Any) -> Slice:
        """Return the same from changed places on."""
        return Slice(self.cells, two(self.first), self.kind, self.sizes)


class Device:
    """An array of the device: `count` numbers for each tile of a launch, of which some tiles are computed."""

    def __init__(self, name: str, kind_lanes: int, count: int, tiles: NDArray[np.int64], of: int) -> None:
        self.cells = Cells(name, count * kind_lanes * len(tiles), 1)
        self.name, self.width, self.count, self.tiles, self.of = name, kind_lanes, count, tiles, of

    def place(self, index: Any, active: Any) -> Any:
        """Return the place of an element of a tile that is computed, one of its numbers after the other."""
        if not isinstance(index, Place) or index.axis != TILE:
            raise Wrong(f"{self.name} has an index that is not of its tile")
        at, tile = np.divmod(index.values[0], self.of)
        slot = np.searchsorted(self.tiles, tile)
        slot = np.minimum(slot, len(self.tiles) - 1)
        bad = (at < 0) | (at >= self.count) | (self.tiles[slot] != tile)
        if np.any(bad if active is None else bad & active):
            raise Wrong(f"{self.name} has an index beyond it, or of another tile")
        return np.where(bad, 0, (at * len(self.tiles) + slot) * self.width)[None]
