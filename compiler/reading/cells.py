"""The memory of a kernel of tiles under test: arrays whose elements many turns use at once.

Turns that are run at once must have nothing to do with each other: `Race` where one writes an element that
another reads or writes. An array that is declared inside them has a column for each. What only some lanes
have written is read by these alone.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..kernel.kernel import Type
from .field import P, hashed
from .lanes import Wrong
from .terms import Term, drawn_or_zero

NOBODY, SEVERAL = -1, -2
"""Instead of the number of a turn that has used an element."""

EMPTY, SHAPE, SUM, BOTH = range(4)
"""What an element holds: nothing, a shape, a sum on its way, or a sum that is an expression as well."""


class Race(Exception):
    """Turns of a loop, or items of a launch, one of which uses what another writes."""

    def __init__(self) -> None:
        super().__init__("turns have to do with each other")


class Turns:
    """The turns that are run at once: `count`, and the `slot` of each, of a launch; `mask`: what is active.

    `mask` (lanes, turns) has axes of one where all are alike; None is all.
    """

    def __init__(self, count: int, slot: NDArray[np.intp] | None = None) -> None:
        self.count, self.slot, self.who = count, slot, np.arange(count, dtype=np.int32)
        self.used: dict[int, tuple[Cells, NDArray[np.int32], NDArray[np.int32]]] = {}
        self.saved: dict[int, tuple[Cells, tuple[NDArray[Any], ...]]] = {}
        self.undoes = self.ordered = False

    def users(self, cells: Cells) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
        """Return who has written and who has read an array's elements."""
        if id(cells) not in self.used:
            blank = np.full(cells.state.shape, NOBODY, np.int32)
            self.used[id(cells)] = cells, blank, blank.copy()
        return self.used[id(cells)][1:]

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
        """Let the turns around these have used what these have."""
        for key, (cells, arrays) in self.saved.items():
            if outer.undoes:
                outer.saved.setdefault(key, (cells, arrays))
        if outer.count == 1:
            return
        of = self.count // outer.count
        for cells, writer, reader in self.used.values():
            if cells.columns == outer.count:
                continue
            before = outer.users(cells)
            for user, other in ((writer, before[1]), (reader, before[0]), (writer, before[0])):
                own = np.where(user >= 0, user // of, user)
                if ((user != NOBODY) & (other != NOBODY) & (own != other)).any():
                    raise Race
            for user, kept in ((writer, before[0]), (reader, before[1])):
                own = np.where(user >= 0, user // of, user)
                kept[...] = np.where(
                    user == NOBODY, kept, np.where((kept == NOBODY) | (kept == own), own, SEVERAL)
                )


class Cells:
    """An array of `count` floats in `columns`: shapes, sums on their way, and the lanes that have written."""

    def __init__(self, name: str, count: int, columns: int) -> None:
        self.name, self.count, self.columns = name, count, columns
        size = count, columns
        self.state, self.lanes = np.zeros(size, np.uint8), np.zeros(size, np.int32)
        self.shape, self.sums = np.zeros(size, np.uint64), np.zeros((2, *size), np.uint64)
        self.has_sums = self.partial = False

    @property
    def arrays(self) -> tuple[NDArray[Any], ...]:
        """All that it holds."""
        return self.state, self.lanes, self.shape, self.sums

    def at(self, place: Any, width: int, turns: Turns, active: NDArray[np.bool_] | None) -> Any:
        """Return rows and columns of an access: slices, or (width, turns); place 0 if not active."""
        if type(place) is int:
            if 0 <= place <= self.count - width:
                rows: Any = slice(place, place + width)
                if self.columns in (1, turns.count):
                    return rows, slice(None)
            elif active is None or active.any():
                raise Wrong(f"{self.name} has no number {place}: it has {self.count}")
            place = np.full((1, 1), place)
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

    def load(self, place: Any, width: int, turns: Turns, active: Any, readable: Any) -> Term:
        """Return numbers that have been written, in the lanes that run: `readable` by a number of lanes."""
        at = self.at(place, width, turns, active)
        state = self.state[at]
        if not state.all() or self.partial:
            bad = (state == EMPTY) | ~readable(self.lanes[at])
            if (bad if active is None else bad & active).any():
                raise Wrong(f"{self.name} is read before it is written")
        if self.columns < turns.count:
            self._reads(at, turns, active)
        shape = self.shape[at]
        one = width == 1
        if not self.has_sums or not (state >= SUM).any():
            return Term(shape.copy() if one else shape[:, None].copy())
        sums = self.sums[:, at[0], at[1]]
        if not (state >= SUM).all():
            sums = np.where(state >= SUM, sums, drawn_or_zero(shape))
        sums = sums.copy() if one else sums[:, :, None].copy()
        if (state == SUM).all():
            return Term(None, sums)
        if not one:
            state, shape = state[:, None], shape[:, None]
        return Term(np.where(state == SUM, hashed("sum", *sums % P), shape), sums)

    def store(self, place: Any, width: int, value: Term, turns: Turns, active: Any, lanes: int) -> None:
        """Write numbers of active turns (turns,), in the lanes of a number."""
        at = self.at(place, width, turns, active)
        if turns.undoes:
            turns.save(self)
        known: Any = np.uint64(0) if value.shape is None else value.shape
        shape = known if known.ndim < 3 else known[:, 0]
        begins = value.begins
        if begins:
            term = value.term
            term = term if term.ndim == 3 else term[:, :, 0]
            self.has_sums = True
        state = SHAPE if not begins else SUM if value.shape is None else BOTH
        self.partial |= lanes > 0
        if self.columns < turns.count or active is not None:
            rows, columns, who = self._items(at, turns, None)
            keep = np.ones(rows.shape, bool) if active is None else np.broadcast_to(active, rows.shape)
            if self.columns < turns.count:
                keep = self._writes((rows, columns, who), keep, turns)
            at = rows[keep], np.broadcast_to(columns, rows.shape)[keep]
            shape = np.broadcast_to(shape, rows.shape)[keep]
            if begins:
                term = np.broadcast_to(term, (2, *rows.shape))[:, keep]
        elif isinstance(at[0], np.ndarray):
            at = at[0], np.broadcast_to(at[1], at[0].shape)
        self.shape[at] = shape
        self.lanes[at] = lanes
        self.state[at] = state
        if begins:
            self.sums[:, at[0], at[1]] = term

    def _items(self, at: Any, turns: Turns, active: Any) -> tuple[Any, Any, Any]:
        """Return rows, columns and numbers of turns (width, turns) of an access, those of active turns."""
        rows, columns = at
        if isinstance(rows, slice):
            rows = np.arange(rows.start, rows.stop)[:, None]
            columns = 0 if self.columns == 1 else np.arange(turns.count)
        rows = np.broadcast_to(rows, (len(rows), turns.count))
        who = turns.who
        if active is not None:
            rows, columns, who = (
                rows[:, active],
                np.broadcast_to(columns, (turns.count,))[active],
                who[active],
            )
        return rows, columns, who

    def _reads(self, at: Any, turns: Turns, active: Any) -> None:
        """Note who reads; `Race` where another turn has written."""
        rows, columns, who = self._items(at, turns, active)
        writer, reader = turns.users(self)
        wrote, read = writer[rows, columns], reader[rows, columns]
        if ((wrote != NOBODY) & (wrote != who)).any():
            raise Race
        reader[rows, columns] = np.where((read == NOBODY) | (read == who), who, SEVERAL)
        now = reader[rows, columns]
        others = (now != who) & (now != SEVERAL)
        if others.any():
            reader[rows[others], np.broadcast_to(columns, rows.shape)[others]] = SEVERAL

    def _writes(self, at: Any, keep: NDArray[np.bool_], turns: Turns) -> NDArray[np.bool_]:
        """Return what is written, where a later turn has not written; `Race` where another one has read."""
        rows, columns, who = (np.broadcast_to(each, keep.shape)[keep] for each in at)
        writer, reader = turns.users(self)
        wrote, read = writer[rows, columns], reader[rows, columns]
        if ((read != NOBODY) & (read != who)).any():
            raise Race
        last = np.maximum(wrote, who)
        writer[rows, columns] = last
        others = (wrote != NOBODY) & (wrote != who)
        if (writer[rows, columns] != last).any() or (others.any() and not turns.ordered):
            raise Race
        kept = keep.copy()
        kept[keep] = wrote <= who
        return kept


class Slice:
    """An array of a kernel: elements of a kind in memory, from a place on; a view has sizes (None,)."""

    def __init__(self, cells: Cells, first: Any, kind: Type, sizes: tuple[int | None, ...]) -> None:
        self.cells, self.first, self.kind, self.sizes = cells, first, kind, sizes

    def each(self, _: Any, two: Any) -> Slice:
        """Return the same from changed places on."""
        return Slice(self.cells, two(self.first), self.kind, self.sizes)


class Tile:
    """An integer `values` (1, turns) that a tile's number, or how many there are, goes into: an index.

    Nothing is compared with it, so that what is true of the tiles that are computed is true of all.
    """

    def __init__(self, values: NDArray[np.int64]) -> None:
        self.values = values

    def each(self, _: Any, two: Any) -> Tile:
        """Return the same of changed arrays."""
        return Tile(two(self.values))

    @classmethod
    def operated(cls, what: str, a: Any, b: Any, count: int, slots: int) -> Tile:
        """Return a sum, a difference or a product, or the tiles in groups of as many as are computed."""
        va, vb = (each.values if isinstance(each, Tile) else each for each in (a, b))
        if what in ("add", "subtract", "multiply") and not any(hasattr(each, "form") for each in (a, b)):
            function = {"add": np.add, "subtract": np.subtract, "multiply": np.multiply}[what]
            found = function(va, vb)
            if (np.abs(function(np.asarray(va, float), vb)) > 2.0**62).any():
                raise Wrong("an index leaves 32 bits, whatever the number of tiles")
        elif what == "divide" and type(b) is int and b == slots and va.size == 1 and va.item() == count:
            found = va // b
        else:
            raise Wrong("it uses the number of a tile otherwise than in an index")
        return cls(found)


class Device:
    """An array of the device: `count` numbers for each tile of a launch, of which some tiles are computed."""

    def __init__(self, name: str, kind_lanes: int, count: int, tiles: NDArray[np.int64], of: int) -> None:
        self.cells = Cells(name, count * kind_lanes * len(tiles), 1)
        self.name, self.width, self.count, self.tiles, self.of = name, kind_lanes, count, tiles, of

    def place(self, index: Any, active: Any) -> Any:
        """Return the place of an element of a tile that is computed, one of its numbers after the other."""
        if not isinstance(index, Tile):
            raise Wrong(f"{self.name} has an index that is not of its tile")
        at, tile = np.divmod(index.values[0], self.of)
        slot = np.searchsorted(self.tiles, tile)
        slot = np.minimum(slot, len(self.tiles) - 1)
        bad = (at < 0) | (at >= self.count) | (self.tiles[slot] != tile)
        if np.any(bad if active is None else bad & active):
            raise Wrong(f"{self.name} has an index beyond it, or of another tile")
        return np.where(bad, 0, (at * len(self.tiles) + slot) * self.width)[None]
