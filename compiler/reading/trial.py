"""Runs a kernel on terms: run.py with other values [values.py], and turns of a loop at once if they may be.

1. Reading what was not written, reading or writing beyond an array or an image, and branching on a number of
   the image raise `Wrong`, what this has no rule for `Unread`.
2. A loop over known turns is run for all of them at once. Where these have to do with each other [cells.py],
   what was written is undone, and they are run one after another.
3. Launches compute a few tiles, of an odd number that no source can know: an index is that of its own tile
   only if it is written with the number of tiles.
"""

from __future__ import annotations

import itertools
import secrets
from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..kernel.interface import IMAGE, RESULT, WEIGHTS
from ..kernel.kernel import (
    BATCH,
    Array,
    Body,
    Call,
    Expr,
    For,
    If,
    Kernel,
    Launch,
    Statement,
    Store,
    Type,
    integer,
    name,
    walk,
)
from ..kernel.verify import STEPS
from .cells import Cells, Device, Race, Shared, Slice, Turns
from .claim import Claim
from .field import P, Words, hashed
from .integers import Stored, added
from .lanes import Unread, Wrong
from .places import NOTHING, TILE, Place, corner
from .terms import Term, constant, vanishing
from .values import Values

MOST = 2**20
"""Most numbers of all arrays: no kernel comes near."""

TOGETHER = 64
"""Turns of loops are run at once while there are fewer of them than this."""

LARGEST = 2**22
"""Turns of loops are run at once if there are no more numbers than this, one for each turn and lane."""

LONGEST = 2**12
"""Most turns of a loop."""

TRIES = 3
"""How often turns of a loop that have to do with each other are run at once."""


class Trial(Values):
    """One run of a kernel for a claim.

    `texels`: a channel beyond a pixel's own is not that of the next pixel, but wrong.
    """

    def __init__(self, kernel: Kernel, claim: Claim, texels: bool) -> None:
        super().__init__(kernel, claim)
        lanes, self.texels = claim.lanes, texels
        self.functions = {each.name: each for each in kernel.functions}
        self.constants = {each.name: integer(kernel, each.value) for each in kernel.constants}
        self.memory: dict[str, Any] = {}
        self.shared: list[Shared] = []
        self.size: dict[int, int] = {}
        self.apart: Counter[tuple[int, int]] = Counter()
        self.conditions: tuple[int, ...] = (0,)
        self.condition_numbers = itertools.count(1)
        self.ran: set[int] = set()
        self.pixels: dict[tuple[int, int, str], Any] = {}
        width, height = Place.of(lanes, 1), Place.of(lanes, 3)
        self.names: dict[str, Any] = {**self.constants, "width": width, "height": height}
        self.start = self._start()
        self.spans = claim.ranges.images(claim.text)
        self.images = {f"{IMAGE}{key}": n for key, n in claim.images}
        self.outputs = claim.expected
        slots, pixels, channels = self.outputs.shape
        self.written = np.zeros((slots, pixels, channels, lanes.count), bool)
        of, slots = 2**36 + secrets.randbelow(2**36), claim.fold.slots
        lanes.batch = of * slots, slots
        self.tiles = secrets.randbelow(of) + of * np.arange(slots)
        if kernel.launches:
            self.names[BATCH[1]] = Place(np.array([[of * slots]]), NOTHING, TILE)
        else:
            self.names |= dict(zip(kernel.place, self.start, strict=True))

    def _start(self) -> tuple[Place, Place]:
        """Return the first pixel of an item, and name its place in its group."""
        x, y = Place.of(self.lanes, 0), Place.of(self.lanes, 2)
        if self.lanes.inside is None or not self.kernel.group:
            return x, y
        local_x, local_y = Place.inside(self.lanes, 0), Place.inside(self.lanes, 1)
        item = Place(local_y.values * self.kernel.group[0] + local_x.values, NOTHING, None)
        self.names |= {"local_x": local_x, "local_y": local_y, "item": item}
        return (
            Place(x.values + local_x.values, x.form, x.axis),
            Place(y.values + local_y.values, y.form, y.axis),
        )

    # ---- lanes and turns -----------------------------------------------------------------------------------

    def _narrow(self, mask: NDArray[np.bool_]) -> bool:
        """Leave some of the lanes and turns active; return whether any are."""
        self.mask = mask if self.mask is None else mask & self.mask
        if mask.shape[0] > 1 and not mask.all():
            self.conditions = (*self.conditions, next(self.condition_numbers))
        return bool(self.mask.any())

    def _only(self, mask: NDArray[np.bool_], body: Body) -> None:
        """Run statements for some lanes and turns."""
        outer = self.mask, self.conditions
        if self._narrow(mask):
            self.body(body)
        self.mask, self.conditions = outer

    # ---- statements ----------------------------------------------------------------------------------------

    def statement(self, statement: Statement) -> None:
        """Run a statement, and note that it was."""
        self.ran.add(id(statement))
        super().statement(statement)

    def _run_array(self, statement: Array) -> None:
        """Make new memory, of which nothing is written."""
        kind = statement.type
        if statement.space == "device":
            self._device(statement)
            return
        sizes = tuple(integer(self.kernel, each) for each in statement.sizes)
        count = int(np.prod(sizes, dtype=object)) * kind.lanes
        self.size[id(statement)] = count
        if not 0 < count <= MOST or sum(self.size.values()) > MOST:
            raise Wrong(f"{statement.name} is an array of {count} numbers: at most {MOST} in all")
        self.names.pop(statement.name, None)
        if statement.space == "group":
            self.memory[statement.name] = self._share(statement.name, count, kind, sizes)
            return
        cells = Cells(statement.name, count, self.turns.count, kind.dtype)
        self.memory[statement.name] = Slice(cells, 0, kind, sizes)
        if statement.value is not None:
            self._put(statement.name, (), kind, self.value(statement.value))

    def _share(self, key: str, count: int, kind: Type, sizes: tuple[int, ...]) -> Slice:
        """Return an array that the items of a group share."""
        if self.kernel.group is None or self.lanes.inside is None or self.turns.count > 1:
            raise Unread("memory that a group shares, without groups")
        if kind.lanes > 1 or kind.dtype not in ("float32", "int32"):
            raise Unread(f"{key}, which a group shares, of {kind.lanes} x {kind.dtype}")
        items = self.kernel.group[0] * self.kernel.group[1]
        self.shared.append(Shared(key, count, kind.dtype, self.lanes.count, items))
        return Slice(self.shared[-1], 0, kind, sizes)

    def _run_store(self, statement: Store) -> None:
        """Write an element, or add to it."""
        value, kind = statement.value, statement.value.type
        index = [self.value(each) for each in statement.index]
        if statement.add:
            away = value.op == "negative"
            number = self.value(value.args[0] if away else value)
            if not away and self._added(statement.array, index, kind, number, value.op == "multiply"):
                return
            read = self._load(statement.array, index, kind)
            total = self.operate("subtract" if away else "add", read, number)
            self._put(statement.array, index, kind, total)
        else:
            self._put(statement.array, index, kind, self.value(value))

    def _added(self, array: str, index: Sequence[Any], kind: Type, number: Any, product: bool) -> bool:
        """Add sums of all turns at once to a number that all of them add to; return whether this was done.

        Sums of some turns are left out: where one is the program's, that of all is not. No sum of integers in
        any order may leave int32.
        """
        turns, whole = self.turns, isinstance(number, Term) and number.kind == "int32"
        sums = number.sums if isinstance(number, Term) and (whole or number.shape is None) else None
        if sums is None or self.mask is not None or self.dual or vanishing(number, number, "add").any():
            return False
        cells, place = self._place_of(array, index, kind)
        if not isinstance(cells, Cells) or np.size(place) > 1 or cells.columns == turns.count:
            return False

        def parts(a: Any) -> Any:
            """Return what the turns inside each turn of the sum's own add to it, along the last axis."""
            return np.broadcast_to(a, (*a.shape[:-1], turns.count)).reshape(*a.shape[:-1], cells.columns, -1)

        total = parts(sums % P).sum(axis=-1)
        self.turns = Turns(cells.columns)
        read = self._load(array, index, kind)
        term = added(read, number, total, parts) if whole else Term(None, total)
        if term is None:
            self.turns = turns
            return False
        rows = np.arange(kind.lanes)[:, None] + place
        turns.save(cells)
        turns.added(cells, rows * cells.columns + np.arange(cells.columns), product or whole)
        self._put(array, index, kind, self.operate("add", read, term))
        self.turns = turns
        return True

    def _put(self, array: str, index: Sequence[Any], kind: Type, value: Any) -> None:
        if array == RESULT:
            self._alike(array)
            self._result(index, value)
            return
        cells, place = self._place_of(array, index, kind)
        value = constant(value, kind.dtype) if type(value) is int else value
        if isinstance(cells, Shared) and isinstance(value, Term):
            self._alike(array)
            if self.mask is not None and not self.lanes.alike(self.mask):
                raise Wrong(f"{array} is written in some groups only")
            cells.store(place, value, self.turns, self.mask)
            return
        if not isinstance(value, Term) or value.kind != cells.kind:
            raise Unread(f"anything but numbers of type {cells.kind} in {array}")
        value, at = self.folded(value), (self.turns, self.active)
        if value.known.shape[-2] == 1:
            self._alike(array)
            cells.store(place, kind.lanes, value, *at, self.conditions[-1])
            return
        # A number that was made in a condition around this one is that of more lanes.
        lanes = np.asarray(self.mask if self.looking is None else self.looking, np.uint64)
        lanes = self.claim.fold.of(lanes, 0 if self.turns.slot is None else self.turns.slot)
        expected = hashed("expected", value.known[..., 1:, :], lanes)
        if self.looking is None:
            cells.complete(place, kind.lanes, expected, *at)
        elif self.conditions[-1]:
            raise Wrong(f"{array} is read before it is written, in some lanes")
        else:
            cells.store(place, kind.lanes, value, *at, expected=expected)

    def _alike(self, array: str) -> None:
        """Refuse what is written near borders only, where all lanes look at it [`_run_if`]."""
        if self.looking is not None:
            raise Wrong(f"{array} is written near borders only")

    def _place_of(self, array: str, index: Sequence[Any], kind: Type) -> tuple[Any, Any]:
        """Return an array's memory, and the place of an element."""
        memory = self.memory.get(array)
        if isinstance(memory, Device):
            if kind.lanes != memory.width or len(index) != 1:
                raise Wrong(f"{array} holds other elements")
            return memory.cells, memory.place(index[0], self.active)
        if not isinstance(memory, Slice):
            raise Wrong(f"{array} is not an array of items")
        if kind.dtype != memory.kind.dtype:
            raise Unread(f"{array} as {kind.dtype}")
        if isinstance(memory.cells, Shared):
            if len(index) != 1 or kind.lanes != 1:
                raise Wrong(f"{array} is an array of single numbers")
            return memory.cells, Place.values_of(index[0])
        index = [self._plain(each) for each in index]
        return memory.cells, memory.first + self._element(array, memory, index, kind)

    def _element(self, array: str, memory: Slice, index: Sequence[Any], kind: Type) -> Any:
        """Return the place of an element in an array, counted in numbers."""
        sizes, lanes = memory.sizes, memory.kind.lanes
        if len(index) == len(sizes) and (kind.lanes == lanes or len(sizes) > 1):
            if kind.lanes != lanes:
                raise Unread(f"numbers of vectors of {array}")
            element: Any = 0
            for each, size in zip(index, sizes, strict=True):
                if size is not None:
                    self._wrong((each < 0) | (each >= size), f"{array} has no such element")
                element = element * (size or 0) + each
            return element * lanes
        if len(index) == len(sizes) == 1 and 1 in (kind.lanes, lanes):
            return index[0]
        raise Wrong(f"{array} has {len(sizes)} indices")

    def _plain(self, index: Any) -> Any:
        """Return an index that no coordinate goes into."""
        if isinstance(index, Place):
            raise Wrong("an array has an index that differs between lanes, or tiles")
        return index

    def _run_for(self, statement: For) -> None:
        """Run a loop: all turns at once, or one after another, each for the lanes that are in it."""
        start, count, step = map(self.value, (statement.start, statement.count, statement.step))
        if type(start) is type(count) is int and statement.until is None:
            turns = range(start, count, step)
            for last in turns[-1:]:
                self._of_indices("add", last, step)
            most = LARGEST // 2 if self.claim.stated else LARGEST  # words have four numbers
            together = 1 < len(turns) <= most // (self.lanes.count * self.turns.count)
            key = id(statement), self.turns.count
            together = together and self.turns.count < TOGETHER and self.apart[key] < TRIES
            if together and self._at_once(statement, turns):
                return
        outer, turn = (self.mask, self.conditions), start
        for _ in range(LONGEST):
            self.names[statement.name] = turn
            if not self._goes_on(self._of_indices("less", turn, count)):
                break
            if statement.until is not None and not self._goes_on(self.value(statement.until)):
                break
            self.body(statement.body)
            turn = self._of_indices("add", turn, step)
        else:
            raise Wrong(f"a loop runs more than {LONGEST} times")
        self.mask, self.conditions = outer

    def _goes_on(self, condition: Any) -> bool:
        """Leave those lanes and turns in a loop in which a condition holds; return whether there are any."""
        going = self._truth(condition)
        return going if isinstance(going, bool) else self._narrow(going)

    def _at_once(self, loop: For, turns: range) -> bool:
        """Run all turns of a loop at once, if they have nothing to do with each other."""
        outer, names, memory, size = self.turns, self.names, self.memory, dict(self.size)
        lanes, conditions = (self.mask, self.looking), self.conditions
        writes = any(isinstance(each, Store) and each.array == RESULT for each in walk(loop.body))
        count, written = len(turns), self.written.copy() if writes else None
        slot = None if outer.slot is None else np.repeat(outer.slot, count)
        self.turns = own = Turns(outer.count * count, slot, undoes=True, ordered=outer.count == 1)
        self.names = {key: _repeated(value, count) for key, value in names.items()}
        self.names[loop.name] = np.tile(np.array(turns, dtype=np.int64), outer.count)[None]
        self.mask, self.looking = (_repeated(each, count) for each in lanes)
        self.memory = {key: _repeated(each, count) for key, each in memory.items()}
        try:
            self.body(loop.body)
            own.end(outer)
            return True
        except (Race, Wrong, Unread):  # the last two may be of turns that need the one before
            own.restore()  # `self.turns` may be those of a sum
            self.apart[id(loop), outer.count] += 1
            self.size = size
            if written is not None:
                self.written = written
            return False
        finally:
            self.turns, self.names, self.memory, (self.mask, self.looking) = outer, names, memory, lanes
            self.conditions = conditions

    def _run_if(self, statement: If) -> None:
        """Run each branch for the turns that take it.

        Where lanes differ all of them look at what the second does; far from borders the first does the same.
        """
        found = self._truth(self.value(statement.condition))
        if isinstance(found, bool):
            self.body(statement.body if found else statement.otherwise)
            return
        if found.shape[0] == 1:
            self._only(~found, statement.otherwise)
        elif statement.otherwise:
            if self.looking is not None:
                raise Unread("branches near borders in each other")
            self.looking = found
            self._only(np.ones_like(found), statement.otherwise)
            self.looking = None
        self._only(found, statement.body)

    def _run_barrier(self, statement: Any) -> None:
        """Let all items of a group wait for each other."""
        if self.turns.count > 1:
            raise Race
        if self.mask is not None:
            raise Wrong("a barrier that not all items of a group reach")
        for memory in self.shared:
            memory.wait()

    def _run_call(self, statement: Call) -> None:
        """Run a function on views."""
        function = self.functions[statement.function]
        names: dict[str, Any] = {}
        memory: dict[str, Any] = {}
        for (array, kind), view, step in zip(function.takes, statement.views, STEPS, strict=False):
            names[step] = self.value(view.step)
            cells, place = self._place_of(view.array, [self.value(each) for each in view.index], kind)
            memory[array] = Slice(cells, place, kind, (None,))
        self._inside(function, names, memory)

    # ---- launches ------------------------------------------------------------------------------------------

    def _device(self, statement: Array) -> None:
        """Make an array of the device: so many elements for each tile."""
        (size,) = statement.sizes
        if not isinstance(size, Expr) or size.op != "multiply" or size.args[0] != name(BATCH[1]):
            raise Unread(f"{statement.name} of a size that is not so many elements for each tile")
        count = integer(self.kernel, size.args[1])
        if not 0 < count < MOST:
            raise Wrong(f"{statement.name} has {count} elements for each tile")
        lanes = statement.type.lanes
        self.memory[statement.name] = Device(statement.name, lanes, count, self.tiles, self.lanes.batch[0])

    def _run_launch(self, statement: Launch) -> None:
        """Run the items of a launch for the tiles that are computed; the end is a barrier."""
        across, down = statement.counts
        (count, slots), lines = self.lanes.batch, integer(self.kernel, down)
        items = self.value(across)
        if not isinstance(items, Place) or items.values.tolist() not in ([[count]], [[count // slots]]):
            raise Unread("a launch of other items than tiles, or than groups of tiles")
        tiles = self.tiles if items.values == count else self.tiles[:1]
        outer = self.turns, self.names
        self.turns = Turns(lines * len(tiles), np.tile(np.arange(len(tiles)), lines))
        column, row = statement.place
        self.names = {**self.names, row: np.repeat(np.arange(lines), len(tiles))[None]}
        self.names[column] = Place(np.tile(tiles, lines)[None], NOTHING, TILE)
        body = statement.body
        first = corner(column)
        if body[: len(first)] == first and self.constants.get("OUT") == self.claim.rows:
            self.ran |= {*map(id, body[: len(first)])}
            body = body[len(first) :]
            self.names |= dict(zip(("tile_x", "tile_y"), self.start, strict=True))
        try:
            self.body(body)
            self.turns.end(outer[0])
        except Race as error:
            raise Wrong("items of a launch read and write one element") from error
        self.turns, self.names = outer

    # ---- memory --------------------------------------------------------------------------------------------

    def _value_load(self, value: Expr) -> Any:
        """Return an element of an array."""
        return self._load(value.value, [self.value(each) for each in value.args], value.type)

    def _load(self, array: str, index: Sequence[Any], kind: Type) -> Any:
        if array in self.images:
            return self._pixel(array, index, kind)
        if array == WEIGHTS:
            return self._of_weights(index, kind)
        cells, place = self._place_of(array, index, kind)
        if isinstance(cells, Shared):
            return cells.load(place, self.mask)
        return cells.load(place, kind.lanes, self.turns, self.active, self.conditions)

    def _of_weights(self, index: Sequence[Any], kind: Type) -> Term:
        """Return numbers of the file: of spectra no sums are made."""
        (place,) = map(self._plain, index)
        place = np.asarray(place * (1 if self.kernel.weights.lanes == 1 else kind.lanes))
        if place.ndim and place.shape[0] != 1:
            raise Wrong("the weights have an index that differs between lanes")
        weights, spectra = self.claim.weights, self.claim.spectra
        bad = (place < 0) | (place > self.claim.count - kind.lanes)
        self._wrong(bad, f"the weights are read at {np.max(place)}: there are {self.claim.count}")
        place = np.where(bad, 0, place).reshape(1, -1)
        at = place + np.arange(kind.lanes)[:, None]
        at = at if kind.lanes == 1 else at[:, None]
        if isinstance(weights, Stored):
            return weights.at(at, kind.dtype)
        if kind.dtype != "float32":
            raise Unread(f"weights as {kind.dtype}")
        inside = (at >= spectra.start) & (at < spectra.stop)
        if inside.any() and not inside.all():
            raise Wrong("numbers of spectra and others in one vector, or loop")
        return Term(weights.known[0][at], draw=None if inside.any() else weights.draw[:, 0][:, at])

    def _pixel(self, array: str, index: Sequence[Any], kind: Type) -> Term:
        """Return numbers of an image: of a row, a column, and a channel or what lies behind."""
        row, column, *behind = index
        channel, channels = behind[0] if behind else 0, self.images[array]
        most = channels - kind.lanes if self.texels else 2**31
        if not isinstance(channel, int | np.ndarray) or np.any((np.asarray(channel) < 0) | (channel > most)):
            raise Wrong(f"image {array} has no channel {channel}")
        key = id(row), id(column), array
        if key not in self.pixels:
            width, height = (self.lanes.known[axis][:, None] for axis in (1, 3))
            rows, columns = Place.values_of(row, 1), Place.values_of(column, 0)
            beyond = (rows < 0) | (rows >= height)
            found = beyond, (rows * width + columns) * channels, columns * channels, row, column
            self.pixels = {**dict([*self.pixels.items()][-3:]), key: found}
        beyond, first, across, *_ = self.pixels[key]
        self._wrong(beyond, f"image {array} is read beyond its ends")  # other lanes may be active now
        size = self.lanes.known[1][:, None] * channels
        shapes: list[Words] = []
        for k in range(kind.lanes):
            at = across + (channel + k)
            self._wrong((at < 0) | (at >= size), f"image {array} is read beyond its ends")
            shapes.append(hashed(f"image {array.removeprefix(IMAGE)}", first + (channel + k)))
        ends = self.spans.get(array.removeprefix(IMAGE))
        size = (1, 1) if kind.lanes == 1 else (kind.lanes, 1, 1)
        span = ends and (np.full(size, ends[0]), np.full(size, ends[1]))
        return Term(shapes[0] if kind.lanes == 1 else np.stack(shapes), span=span)

    # ---- the result ----------------------------------------------------------------------------------------

    def _result(self, index: Sequence[Any], value: Any) -> None:
        """Check numbers that are written against those of the claim."""
        if not isinstance(value, Term) or value.known.ndim != 2:
            raise Wrong("it writes a result that is no number")
        row, column, channel = index
        shape = self.lanes.count, self.turns.count
        x, y, width, height = (a[:, None] for a in (self.lanes.x, self.lanes.y, *self.lanes.known[1::2]))
        rows, columns = (
            np.broadcast_to(Place.values_of(each, axis), shape) for axis, each in ((1, row), (0, column))
        )
        channels = np.broadcast_to(self._plain(channel), (1, self.turns.count))[0]
        active = np.broadcast_to(True if self.mask is None else self.mask, shape)
        outside = (columns >= width) | (rows >= height) | (rows < 0) | (columns < 0)
        if (outside & active).any():
            raise Wrong("it writes a result beyond the picture")
        across, down = columns - x, rows - y
        beside = across % self.claim.stride != 0
        across = across // self.claim.stride
        first, own = active.argmax(axis=0), np.arange(self.turns.count)
        across_one, down_one = across[first, own], down[first, own]
        claim, there = self.claim, active.any(axis=0)
        bad = beside | (across != across_one) | (down != down_one)
        bad |= (across < 0) | (across >= claim.pixels) | (down < 0) | (down >= claim.rows)
        if (bad & active).any() or (there & ((channels < 0) | (channels >= self.written.shape[2]))).any():
            raise Wrong("it writes a result that is not its own")
        term = self.folded(value)
        found = np.broadcast_to(term.known, (1, self.turns.count))[0]
        slot = np.zeros(self.turns.count, int) if self.turns.slot is None else self.turns.slot
        at = tuple(a[there] for a in (slot, down_one * claim.pixels + across_one, channels))
        if len({*zip(*(each.tolist() for each in at), strict=True)}) < len(at[0]):
            raise Race
        if (self.written[at] & active[:, there].T).any():
            raise Wrong("a channel of the result is written twice")
        if not np.array_equal(self.outputs[at], found[there]):
            missing = claim.missing()
            why = f": {missing} are never made" if missing else ", though all its sums are made"
            raise Wrong(f"output {channels[there][0]} is not the program's{why}")
        self.written[at] |= active[:, there].T

    def ended(self) -> None:
        """Refuse a text that leaves a pixel out."""
        claim, lanes = self.claim, self.lanes
        down, across = np.divmod(np.arange(self.written.shape[1]), claim.pixels)
        there = lanes.x + claim.stride * across[:, None] < lanes.known[1]
        expected = there & (lanes.y + down[:, None] < lanes.known[3])
        if not (self.written | ~expected[None, :, None]).all():
            raise Wrong("it leaves a pixel without a result")


def _repeated(value: Any, count: int) -> Any:
    """Return a value of each turn for each of so many turns inside it."""
    if isinstance(value, np.ndarray) and value.ndim and value.shape[-1] > 1:
        return np.repeat(value, count, axis=-1)
    if isinstance(value, Term | Place | Slice):
        return value.each(lambda a: _repeated(a, count), lambda a: _repeated(a, count))
    return value
