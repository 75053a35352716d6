"""The memory of a kernel under test: arrays whose elements many turns use at once.

Turns that are run at once must have nothing to do with each other: `Race` where one writes an element that
another reads or writes. An array that is declared inside them has a column for each. A number of an image
that lanes write by themselves is kept for each lane, and folded when it is read. Any other number is one of
all lanes, and is read by those alone that have written it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..kernel.kernel import Type
from .field import P, Words, drawn, hashed
from .lanes import Unread, Wrong
from .terms import Term

NOBODY, SEVERAL = -1, -2
"""Instead of the number of a turn that has used an element."""

EMPTY, WIDE, SHAPE, SUM, BOTH = range(5)
"""What an element holds: nothing, a number of each lane, a shape, a sum on its way, or both of them."""


Fold = Callable[[Term], Term]
"""Returns a number of all lanes together."""


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
            for array, before in zip(cells.arrays, arrays, strict=False):
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
    """An array of `count` numbers in `columns`: shapes, sums, spans, and `wide` shapes of each lane.

    `lanes`: the index in `masks` of those lanes that have written a number.
    """

    def __init__(
        self, name: str, count: int, columns: int, kind: str = "float32", masks: Sequence[Any] = ()
    ) -> None:
        self.name, self.count, self.columns, self.kind, self.masks = name, count, columns, kind, masks
        size = count, columns
        self.state, self.lanes = np.zeros(size, np.uint8), np.zeros(size, np.int32)
        self.shape, self.sums = np.zeros(size, np.uint64), np.zeros((2, *size), np.uint64)
        whole = kind != "float32"
        self.span = np.zeros((2, *(size if whole else (0, 0))), np.int64)
        self.has_sums = whole
        self.wide: Words | None = None
        self.written = np.zeros(0, bool)

    @property
    def arrays(self) -> tuple[NDArray[Any], ...]:
        """All that it holds."""
        return (
            self.state,
            self.lanes,
            self.shape,
            self.sums,
            self.span,
            *(() if self.wide is None else (self.wide, self.written)),
        )

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

    def load(self, place: Any, width: int, turns: Turns, active: Any, fold: Fold, lanes: int = 0) -> Term:
        """Return numbers that have been written, for the lanes of a number."""
        at = self.at(place, width, turns, active)
        if self.wide is not None and (self.state[at] == WIDE).any():
            self._settle(at, turns, active, fold)
        state = self.state[at]
        bad = state == EMPTY
        for number in {*np.unique(self.lanes[at]).tolist()} - {0, lanes} if len(self.masks) > 1 else ():
            if not (self.masks[number] | ~self.masks[lanes]).all():
                bad |= self.lanes[at] == number
        if (bad if active is None else bad & active).any():
            raise Wrong(f"{self.name} is read before it is written")
        if self.columns < turns.count:
            self._reads(at, turns, active)
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

    def _settle(self, at: Any, turns: Turns, active: Any, fold: Fold) -> None:
        """Fold what each lane has written for itself."""
        assert self.wide is not None
        if turns.undoes:
            turns.save(self)
        rows, columns, _ = self._items(at, turns, active)
        columns = np.broadcast_to(columns, rows.shape)
        own = self.state[rows, columns] == WIDE
        at = rows[own], columns[own]
        if not self.written[at].all():
            raise Wrong(f"{self.name} is read before it is written, in some lanes")
        shape = np.ascontiguousarray(self.wide[at].T)
        term = Term(shape)
        if self.kind != "float32":
            span = self.span[0][at][None], self.span[1][at][None]
            term = Term(shape, self.sums[:, at[0], at[1]][:, None], kind=self.kind, span=span, leaf=shape)
        term = fold(term)
        if self.kind != "float32":
            assert term.sums is not None
            self.sums[:, at[0], at[1]] = term.sums[:, 0]
        self.shape[at], self.state[at] = term.known[0], SHAPE if self.kind == "float32" else BOTH

    def store(self, place: Any, width: int, value: Term, turns: Turns, active: Any, lanes: int) -> None:
        """Write numbers of active turns (turns,), in the lanes of a number."""
        rows, columns, keep = self._kept(self.at(place, width, turns, active), turns, active)
        if turns.undoes:
            turns.save(self)
        at = rows[keep], columns[keep]

        def own(values: Any, axis: int) -> Any:
            """Return the values of what is kept: the axis of lanes is one."""
            flat = values if values.ndim == axis + 2 else values.take(0, axis=axis + 1)
            return np.broadcast_to(flat, (*flat.shape[:axis], *keep.shape))[..., keep]

        self.shape[at] = 0 if value.shape is None else own(value.shape, 0)
        self.lanes[at] = lanes
        self.state[at] = SHAPE if not value.begins else SUM if value.shape is None else BOTH
        if value.begins:
            self.sums[:, at[0], at[1]] = own(value.term, 1)
            self.has_sums = True
        if value.span is not None and self.span.size:
            for end in (0, 1):
                self.span[end][at] = own(value.span[end], 0)

    def store_wide(
        self, place: Any, width: int, value: Term, turns: Turns, active: Any, mask: Any, others: Any
    ) -> None:
        """Write numbers of an image in lanes (lanes, turns): in all, or those that all have written.

        `others`: lanes that only look at what is written, and write the same later; or None.
        """
        rows, columns, keep = self._kept(self.at(place, width, turns, active), turns, active, apart=True)
        if turns.undoes:
            turns.save(self)
        if self.wide is None:
            size = self.count, self.columns, len(mask)
            self.wide, self.written = np.zeros(size, np.uint64), np.zeros(size, bool)
        shape = value.shape if self.kind == "float32" else value.leaf
        if shape is None:
            raise Unread("integers, in some lanes, that are not an image's")

        def own(values: Any) -> Any:
            """Return lines (elements, lanes) of arrays (lanes, turns), or (width, lanes, turns)."""
            return np.broadcast_to(np.swapaxes(values, -1, -2), (*keep.shape, len(mask)))[keep]

        at = rows[keep], columns[keep]
        where, new = own(np.broadcast_to(mask, (len(mask), turns.count))), own(shape)
        later = np.zeros_like(where) if others is None else own(np.broadcast_to(others, mask.shape))
        really, whole, fresh = where & ~later, where.all(axis=1), self.state[at] != WIDE
        if (fresh & ~whole).any():
            raise Wrong(f"{self.name} is read before it is written, in some lanes")
        if (~whole[:, None] & where & (self.wide[at] != new)).any():
            raise Wrong(f"{self.name} has another number far from borders than near them")
        # Two conditions on borders of two axes leave out a corner that no lane has.
        if (~whole[:, None] & ~(really | later | self.written[at])).any():
            raise Wrong(f"{self.name} is written by several conditions on borders")
        self.wide[at] = np.where(whole[:, None], new, self.wide[at])
        self.state[at], self.lanes[at] = WIDE, 0
        self.written[at] = really | (self.written[at] & ~whole[:, None])
        if self.kind != "float32":
            self._offset(at, whole, value, keep)

    def _offset(self, at: Any, fresh: Any, value: Term, keep: Any) -> None:
        """Keep what integers of some lanes are more than an image's: the same in all lanes."""
        assert value.sums is not None
        assert value.span is not None
        size = keep.shape if value.sums.ndim < 4 else (len(keep), 1, keep.shape[1])
        more = np.broadcast_to(value.sums, (2, *size)).reshape(2, *keep.shape)[:, keep]
        if (~fresh & (more != self.sums[:, at[0], at[1]]).any(axis=0)).any():
            raise Unread("integers that differ between lanes by more than an image's")
        self.sums[:, at[0], at[1]] = more
        for end, hull in enumerate((np.minimum, np.maximum)):
            new = np.broadcast_to(value.span[end], size).reshape(keep.shape)[keep]
            self.span[end][at] = np.where(fresh, new, hull(new, self.span[end][at]))

    def _kept(self, at: Any, turns: Turns, active: Any, apart: bool = False) -> Any:
        """Return rows and columns (width, turns) of an access, and which of them are written.

        `apart`: no two turns may write one element.
        """
        rows, columns, who = self._items(at, turns, None)
        columns = np.broadcast_to(columns, rows.shape)
        keep = np.ones(rows.shape, bool) if active is None else np.broadcast_to(active, rows.shape)
        if self.columns < turns.count:
            kept = self._writes((rows, columns, who), keep, turns)
            if apart and (kept != keep).any():
                raise Race
            keep = kept
        return rows, columns, keep

    def _items(self, at: Any, turns: Turns, active: Any) -> tuple[Any, Any, Any]:
        """Return rows, columns and numbers of turns (width, turns) of an access, those of active turns."""
        rows, columns = np.broadcast_to(at[0], (len(at[0]), turns.count)), at[1]
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
        leaf = np.moveaxis(self.shape[every], -1, 0)
        span = self.span[0], self.span[1]
        return Term(leaf, np.zeros((2, 4, 1, 1), np.uint64), kind="word", span=span, leaf=leaf)

    def store(self, place: Any, value: Term, turns: Turns, mask: Any) -> None:
        """Write numbers, each lane into its group's memory."""
        if turns.count > 1:
            raise Race
        leaf = self._leaf(value)
        every, at, item, active = self._at(place, mask)
        writer = self.writer[at]
        if self.reader[at].any():
            raise Wrong(f"{self.name}: an item writes what another reads, without a barrier between")
        self.writer[at] = item
        if (self.writer[at] != item).any() or ((writer != NOBODY) & (writer != item)).any():
            raise Wrong(f"{self.name}: two items write one number")
        self.shape[at] = np.moveaxis(np.broadcast_to(leaf, (self.bytes, *every.shape)), 0, -1)[active]
        self.held[at] = self.writes = True

    def _leaf(self, value: Term) -> Any:
        """Return the shapes of an image's numbers, and note their spans."""
        if self.bytes == 1:
            if value.shape is None or (not value.is_wide and value.literal is None):
                raise Unread(f"numbers behind a sum in {self.name}")
            return value.shape
        if value.kind != "word" or value.leaf is None or value.span is None or np.any(value.sums):
            raise Unread(f"anything but words of an image in {self.name}")
        for end, hull in enumerate((np.minimum, np.maximum)):
            own = np.broadcast_to(value.span[end], self.span[end].shape)
            self.span[end] = own if self.blank else hull(self.span[end], own)
        self.blank = False
        return value.leaf


class Slice:
    """An array of a kernel: elements of a kind in memory, from a place on; a view has sizes (None,)."""

    def __init__(self, cells: Any, first: Any, kind: Type, sizes: tuple[int | None, ...]) -> None:
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
