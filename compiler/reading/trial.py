"""Runs a kernel of tiles on terms: run.py with other values, and turns of a loop at once where they may be.

1. A float is a `Term` [terms.py]; an index is Python's integer, an array (1, turns), or a `Place` where it
   depends on coordinates; a truth is Python's, or one for each lane and turn.
2. A loop over known turns is run for all of them at once. Where these have to do with each other [cells.py],
   what was written is undone, and they are run one after another.
3. Launches compute a few tiles, of an odd number that no source can know: an index is that of its own tile
   only if it is written with the number of tiles.
"""

from __future__ import annotations

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
    Store,
    Type,
    name,
    walk,
)
from ..kernel.run import Runner
from ..kernel.sizes import integer
from ..kernel.verify import STEPS
from .cells import Cells, Device, Race, Slice, Tile, Turns
from .claim import Claim
from .field import P, Words, hashed
from .lanes import Unread, Wrong
from .places import COMPARES, Place, chosen, corner, integers
from .terms import Term, constant, expression, operate, select, stacked

MOST = 2**20
"""Most numbers of all arrays: no kernel comes near."""

TOGETHER = 64
"""Turns of loops are run at once while there are fewer of them than this."""

LONGEST = 2**12
"""Most turns of a loop."""

TRIES = 3
"""How often turns of a loop that have to do with each other are run at once."""


class Trial(Runner):
    """One run of a kernel for a claim about tiles."""

    def __init__(self, kernel: Kernel, claim: Claim, texels: bool) -> None:
        lanes = claim.lanes
        self.kernel, self.claim, self.texels, self.lanes = kernel, claim, texels, lanes
        self.functions = {each.name: each for each in kernel.functions}
        self.constants = {each.name: integer(kernel, each.value) for each in kernel.constants}
        self.dual, self.fold = bool(kernel.launches), claim.fold
        self.turns = Turns(1)
        self.mask: NDArray[np.bool_] | None = None
        self.numbers: dict[int, Any] = {}
        self.memory: dict[str, Any] = {}
        self.size: dict[int, int] = {}
        self.apart: Counter[tuple[int, int]] = Counter()
        self.pixels: dict[tuple[int, int, str], Any] = {}
        self.masks: list[NDArray[np.bool_]] = [np.ones(lanes.count, bool)]
        x, width, y, height = (Place.of(lanes, axis) for axis in range(4))
        self.names: dict[str, Any] = {**self.constants, "width": width, "height": height}
        self.start = x, y
        if not kernel.launches:
            self.names |= dict(zip(kernel.place, self.start, strict=True))
        self.images = {f"{IMAGE}{key}": int(n) for key, n in claim.images}
        self.weights = claim.weights
        self.outputs = claim.expected
        slots, pixels, channels = self.outputs.shape
        self.written = np.zeros((slots, pixels, channels, lanes.count), bool)
        self.evaluators = self._evaluators()
        self.keys = np.array(sorted(claim.first), dtype=np.uint64)
        of = 2**36 + secrets.randbelow(2**36)
        self.tile_count = of * self.fold.slots
        self.tiles = secrets.randbelow(of) + of * np.arange(self.fold.slots)
        if kernel.launches:
            self.names[BATCH[1]] = Tile(np.array([[self.tile_count]]))

    def _evaluators(self) -> dict[str, Any]:
        """Return the methods that evaluate expressions: of no other operations than these."""
        return {key: getattr(self, f"_value_{key}") for key in EVALUATED}

    # ---- lanes and turns -----------------------------------------------------------------------------------

    @property
    def active(self) -> NDArray[np.bool_] | None:
        """The turns (turns,) that are active in any lane; None for all."""
        if self.mask is None:
            return None
        found: NDArray[np.bool_] = np.broadcast_to(self.mask.any(axis=0), (self.turns.count,))
        return None if found.all() else found

    def _wrong(self, bad: Any, what: str) -> None:
        """Refuse what is wrong in a lane and turn that are active."""
        found = bad is not False and (bad is True or bad.any())
        if found and (self.mask is None or np.logical_and(bad, self.mask).any()):
            raise Wrong(what)

    def _number(self) -> int:
        """Return the number of the lanes that are active, the same in all turns."""
        if self.mask is None or self.mask.shape[0] == 1:
            return 0
        lanes: NDArray[np.bool_] = np.asarray(self.mask.any(axis=1))
        if self.mask.shape[1] > 1 and not np.array_equal(
            self.mask & lanes[:, None], lanes[:, None] & self.mask.any(axis=0)
        ):
            raise Unread("numbers that some lanes write in some turns")
        for number, each in enumerate(self.masks):
            if np.array_equal(each, lanes):
                return number
        self.masks.append(lanes)
        return len(self.masks) - 1

    def _readable(self, numbers: NDArray[np.int32]) -> NDArray[np.bool_]:
        """Return whether what these lanes have written is there for those that are active."""
        good = np.ones(numbers.shape, bool)
        for number in np.unique(numbers[numbers > 0]):
            active = self.masks[0] if self.mask is None else self.mask.any(axis=1)
            good &= (numbers != number) | bool((~active | self.masks[number]).all())
        return good

    def _folded(self, term: Term) -> Term:
        """Return a number of all lanes together."""
        if term.shape is None or term.shape.shape[-2] == 1:
            return term
        slot = self.turns.slot
        return Term(self.fold.of(term.shape, 0 if slot is None else slot)[..., None, :])

    def _only(self, mask: NDArray[np.bool_], body: Body) -> None:
        """Run statements for some lanes and turns."""
        outer = self.mask
        self.mask = mask if outer is None else mask & outer
        if self.mask.any():
            self.body(body)
        self.mask = outer

    # ---- statements ----------------------------------------------------------------------------------------

    def _run_array(self, statement: Array) -> None:
        """Make new memory, of which nothing is written."""
        kind = statement.type
        if kind.dtype != "float32" or statement.space == "group":
            raise Unread(f"an array {statement.name} of {kind.dtype} in tiles")
        if statement.space == "device":
            self._device(statement)
            return
        sizes = tuple(integer(self.kernel, each) for each in statement.sizes)
        count = int(np.prod(sizes, dtype=object)) * kind.lanes
        self.size[id(statement)] = count
        if not 0 < count <= MOST or sum(self.size.values()) > MOST:
            raise Wrong(f"{statement.name} is an array of {count} numbers: at most {MOST} in all")
        self.names.pop(statement.name, None)
        self.memory[statement.name] = Slice(Cells(statement.name, count, self.turns.count), 0, kind, sizes)
        if statement.value is not None:
            self._put(statement.name, (), kind, self.value(statement.value))

    def _run_store(self, statement: Store) -> None:
        """Write an element, or add to it."""
        value, kind = statement.value, statement.value.type
        index = [self.value(each) for each in statement.index]
        if statement.add:
            away = value.op == "negative"
            number = self.value(value.args[0] if away else value)
            read = self._load(statement.array, index, kind)
            self._put(
                statement.array, index, kind, self._of_floats("subtract" if away else "add", read, number)
            )
        else:
            self._put(statement.array, index, kind, self.value(value))

    def _put(self, array: str, index: Sequence[Any], kind: Type, value: Any) -> None:
        if array == RESULT:
            self._result(index, value)
            return
        if not isinstance(value, Term) or kind.dtype != "float32":
            raise Unread(f"anything but floats in {array}")
        cells, place = self._place_of(array, index, kind)
        cells.store(place, kind.lanes, self._folded(value), self.turns, self.active, self._number())

    def _place_of(self, array: str, index: Sequence[Any], kind: Type) -> tuple[Cells, Any]:
        """Return an array's memory, and the place of an element."""
        memory = self.memory.get(array)
        if isinstance(memory, Device):
            if kind.lanes != memory.width or len(index) != 1:
                raise Wrong(f"{array} holds other elements")
            return memory.cells, memory.place(index[0], self.active)
        if not isinstance(memory, Slice):
            raise Wrong(f"{array} is not an array of tiles")
        element: Any = 0
        sizes = memory.sizes
        if len(index) == len(sizes) and (kind.lanes == memory.kind.lanes or len(sizes) > 1):
            if kind.lanes != memory.kind.lanes:
                raise Unread(f"numbers of vectors of {array}")
            for each, size in zip(index, sizes, strict=True):
                each = self._plain(each)
                if size is not None:
                    self._wrong((each < 0) | (each >= size), f"{array} has no such element")
                element = element * (size or 0) + each
        elif len(index) == 1 and len(sizes) == 1 and kind.lanes == 1:
            element = self._plain(index[0])
        else:
            raise Wrong(f"{array} has {len(sizes)} indices")
        return memory.cells, memory.first + element * kind.lanes

    def _plain(self, index: Any) -> Any:
        """Return an index that no coordinate goes into."""
        if isinstance(index, Place | Tile):
            raise Wrong("an array has an index that differs between lanes, or tiles")
        return index

    def _run_for(self, statement: For) -> None:
        """Run a loop: all turns at once, or one after another, each for the lanes that are in it."""
        start, count, step = map(self.value, (statement.start, statement.count, statement.step))
        if not all(type(each) is int for each in (start, count, step)) or step < 1:
            raise Unread(f"the loop over {statement.name} has other ends than integers")
        turns = range(start, count, step)
        if len(turns) > LONGEST:
            raise Wrong(f"a loop runs more than {LONGEST} times")
        together = self.turns.count < TOGETHER and len(turns) > 1 and statement.until is None
        key = id(statement), self.turns.count
        if together and self.apart[key] < TRIES and self._at_once(statement, turns):
            return
        outer = self.mask
        for turn in turns:
            self.names[statement.name] = turn
            if statement.until is not None:
                going = self._truth(self.value(statement.until))
                if going is False:
                    break
                if going is not True:
                    self.mask = going if self.mask is None else self.mask & going
                    if not self.mask.any():
                        break
            self.body(statement.body)
        self.mask = outer

    def _at_once(self, loop: For, turns: range) -> bool:
        """Run all turns of a loop at once, if they have nothing to do with each other."""
        outer, names, memory, mask, size = self.turns, self.names, self.memory, self.mask, dict(self.size)
        count, written = len(turns), self.written.copy() if _writes(loop) else None
        slot = None if outer.slot is None else np.repeat(outer.slot, count)
        self.turns = Turns(outer.count * count, slot)
        self.turns.undoes, self.turns.ordered = True, outer.count == 1
        self.names = {key: _repeated(value, count) for key, value in names.items()}
        self.names[loop.name] = np.tile(np.array(turns, dtype=np.int64), outer.count)[None]
        self.mask = _repeated(mask, count)
        self.memory = {key: _repeated(each, count) for key, each in memory.items()}
        try:
            self.body(loop.body)
            self.turns.end(outer)
            return True
        except (Race, Wrong, Unread):  # the last two may be of turns that need the one before
            self.turns.restore()
            self.apart[id(loop), outer.count] += 1
            self.size = size
            if written is not None:
                self.written = written
            return False
        finally:
            self.turns, self.names, self.memory, self.mask = outer, names, memory, mask

    def _run_if(self, statement: If) -> None:
        """Run each branch for the lanes and turns that take it."""
        found = self._truth(self.value(statement.condition))
        if isinstance(found, bool):
            self.body(statement.body if found else statement.otherwise)
            return
        self._only(found, statement.body)
        self._only(~found, statement.otherwise)

    def _truth(self, value: Any) -> Any:
        if isinstance(value, bool) or (isinstance(value, np.ndarray) and value.dtype == bool):
            return value
        raise Wrong("it branches on a number of the image, or on an integer")

    def _run_barrier(self, statement: Any) -> None:
        """Refuse."""
        raise Unread("a barrier, or a loop that ends in its body, in tiles")

    _run_break = _run_barrier

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
        self.memory[statement.name] = Device(statement.name, lanes, count, self.tiles, self.tile_count)

    def _run_launch(self, statement: Launch) -> None:
        """Run the items of a launch for the tiles that are computed; the end is a barrier."""
        across, down = statement.counts
        count, slots, lines = self.tile_count, self.fold.slots, integer(self.kernel, down)
        items = self.value(across)
        if not isinstance(items, Tile) or items.values.item() not in (count, count // slots):
            raise Unread("a launch of other items than tiles, or than groups of tiles")
        tiles = self.tiles if items.values == count else self.tiles[:1]
        outer = self.turns, self.names
        self.turns = Turns(lines * len(tiles), np.tile(np.arange(len(tiles)), lines))
        column, row = statement.place
        own = {column: Tile(np.tile(tiles, lines)[None]), row: np.repeat(np.arange(lines), len(tiles))[None]}
        self.names = {**self.names, **own}
        body = statement.body
        first = corner(column)
        if body[: len(first)] == first and self.constants.get("OUT") == self.claim.rows:
            body = body[len(first) :]
            self.names |= dict(zip(("tile_x", "tile_y"), self.start, strict=True))
        try:
            self.body(body)
        except Race as error:
            raise Wrong("items of a launch read and write one element") from error
        self.turns, self.names = outer

    # ---- integers ------------------------------------------------------------------------------------------

    def _operation(self, value: Expr, args: list[Any]) -> Any:
        """Return an operation on values."""
        if any(isinstance(each, Term) for each in args):
            if value.type.dtype not in ("float32", "bool"):
                raise Unread(f"{value.op} of floats in tiles")
            return self._of_floats(value.op, *args)
        if len(args) != 2:
            raise Unread(f"{value.op} of integers")
        return self._of_integers(value.op, *args)

    def _of_integers(self, what: str, a: Any, b: Any) -> Any:
        """Return what an operation makes of two integers, none beyond 32 bits."""
        if isinstance(a, Tile) or isinstance(b, Tile):
            return Tile.operated(what, a, b, self.tile_count, self.fold.slots)
        if isinstance(a, Place) or isinstance(b, Place):
            made = Place.compared if what in COMPARES else Place.operated
            return made(self.lanes, what, a, b, self.mask)
        return integers(what, a, b, self._wrong)

    def _value_const(self, value: Expr) -> Any:
        """Return a constant."""
        if value.type.dtype in ("int32", "bool"):
            return value.value
        if value.type.dtype != "float32":
            raise Unread(f"a constant of type {value.type.dtype} in tiles")
        if id(value) not in self.numbers:
            self.numbers[id(value)] = constant(value.value)
        return self.numbers[id(value)]

    def _value_clamp(self, value: Expr) -> Any:
        """Return an integer within two others, the first of which is not above the second."""
        given, low, high = map(self.value, value.args)
        if any(isinstance(each, Term) for each in (given, low, high)):
            given, low, high = map(self._float, (given, low, high))
            return self._of_floats("minimum", self._of_floats("maximum", given, low), high)
        order = self._of_integers("less_equal", low, high)
        self._wrong(
            not order if isinstance(order, bool) else ~order, "a value between two others in no order"
        )
        return self._of_integers("minimum", self._of_integers("maximum", given, low), high)

    def _value_select(self, value: Expr) -> Any:
        """Return one of two values, for each lane and turn."""
        where, a, b = map(self.value, value.args)
        if isinstance(where, Term):
            return select(self._folded(where), *(self._folded(self._float(each)) for each in (a, b)))
        where = self._truth(where)
        if isinstance(where, bool):
            return a if where else b
        if isinstance(a, Term) and isinstance(b, Term):
            if a.shape is None or b.shape is None or not (a.sums is b.sums is None):
                raise Unread("a choice of sums on their way")
            if where.shape[0] > 1 and a.shape.shape[-2] == b.shape.shape[-2] == 1:
                raise Unread("a choice, by lanes, of numbers of all lanes")
            return Term(np.where(where, a.shape, b.shape))
        if isinstance(a, Term) or isinstance(b, Term):
            raise Wrong("it mixes coordinates, or truths, and numbers of the image")
        return chosen(self.lanes, where, a, b)

    def _value_logical_and(self, value: Expr) -> Any:
        """Return whether both hold; the second is not asked where the first does not."""
        return self._logical(value, True)

    def _value_logical_or(self, value: Expr) -> Any:
        """Return whether one holds."""
        return self._logical(value, False)

    def _logical(self, value: Expr, both: bool) -> Any:
        a = self._truth(self.value(value.args[0]))
        if isinstance(a, bool) and a is not both:
            return a
        b = self._truth(self.value(value.args[1]))
        if isinstance(a, bool):
            return b
        return np.logical_and(a, b) if both else np.logical_or(a, b)

    def _value_logical_not(self, value: Expr) -> Any:
        """Return whether something does not hold."""
        found = self._truth(self.value(value.args[0]))
        return not found if isinstance(found, bool) else ~found

    # ---- floats --------------------------------------------------------------------------------------------

    def _float(self, value: Any) -> Term:
        if not isinstance(value, Term):
            raise Wrong("it mixes coordinates, or truths, and numbers of the image")
        return value

    def _of_floats(self, what: str, *args: Any) -> Term:
        """Return what an operation makes of floats."""
        terms = [self._folded(self._float(each)) for each in args]
        if what in ("add", "subtract", "multiply"):
            a, b = terms
            found = operate(what, a, b, self.dual)
            return self._found(found) if what == "add" and found.sums is not None else found
        if what in ("convert", "bits", "pack4", "dot4"):
            raise Unread(f"{what} of floats in tiles")
        if what in COMPARES:
            if not what.startswith("less"):
                terms, what = terms[::-1], what.replace("greater", "less")
            return Term(expression(what, *terms))
        return Term(expression(what, *terms, commutes=what in ("minimum", "maximum")))

    def _found(self, term: Term) -> Term:
        """Return a sum, where it is one of the program as the number that this is."""
        assert term.sums is not None
        value = term.sums % P
        word = value[0] << np.uint64(32) | value[1]
        at = np.minimum(np.searchsorted(self.keys, word), len(self.keys) - 1)
        good = self.keys[at] == word
        if not good.any():
            return term
        for first in np.unique(self.keys[at[good]][:: max(1, good.sum() // 8)]).tolist():
            self.claim.found.add(self.claim.first[first])
        return Term(np.where(good, hashed("found", *value), term.known))

    def _value_load(self, value: Expr) -> Any:
        """Return an element of an array."""
        return self._load(value.value, [self.value(each) for each in value.args], value.type)

    def _load(self, array: str, index: Sequence[Any], kind: Type) -> Any:
        if kind.dtype != "float32":
            raise Unread(f"{array} as {kind.dtype}")
        if array in self.images:
            return self._pixel(array, index, kind)
        if array == RESULT:
            raise Wrong("the result is read")
        if array == WEIGHTS:
            return self._of_weights(index, kind)
        cells, place = self._place_of(array, index, kind)
        return cells.load(place, kind.lanes, self.turns, self.active, self._readable)

    def _of_weights(self, index: Sequence[Any], kind: Type) -> Term:
        """Return numbers of the file: of spectra no sums are made."""
        (place,) = map(self._plain, index)
        place = np.asarray(place * (1 if self.kernel.weights.lanes == 1 else kind.lanes))
        if place.ndim and place.shape[0] != 1:
            raise Wrong("the weights have an index that differs between lanes")
        numbers, spectra = self.weights.numbers, self.weights.spectra
        bad = (place < 0) | (place > self.weights.size - kind.lanes)
        self._wrong(bad, f"the weights are read at {np.max(place)}: there are {self.weights.size}")
        place = np.where(bad, 0, place).reshape(1, -1)
        at = place + np.arange(kind.lanes)[:, None]
        shape: Words = numbers.known[0][at]
        draw = numbers.value[:, 0][:, at]
        inside = (at >= spectra.start) & (at < spectra.stop)
        if inside.any() and not inside.all():
            raise Wrong("numbers of spectra and others in one vector, or loop")
        own = None if inside.any() else draw if kind.lanes == 1 else draw[:, :, None]
        return Term(shape if kind.lanes == 1 else shape[:, None], draw=own)

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
            rows, columns = (Place.values_of(each) for each in (row, column))
            beyond = (rows < 0) | (rows >= height)
            found = beyond, (rows * width + columns) * channels, columns * channels, row, column
            self.pixels = {**dict([*self.pixels.items()][-3:]), key: found}
        beyond, first, across, *_ = self.pixels[key]
        self._wrong(beyond, f"image {array} is read beyond its ends")  # other lanes may be active now
        size = self.lanes.known[1][:, None] * channels
        shapes = []
        for k in range(kind.lanes):
            at = across + (channel + k)
            self._wrong((at < 0) | (at >= size), f"image {array} is read beyond its ends")
            shapes.append(hashed(f"image {array.removeprefix(IMAGE)}", first + (channel + k)))
        return Term(shapes[0]) if kind.lanes == 1 else Term(np.stack(shapes))

    def _value_component(self, value: Expr) -> Any:
        """Return one number of a vector."""
        given = self.value(value.args[0])
        return given.part(value.value) if isinstance(given, Term) and given.known.ndim == 3 else given

    def _value_stack(self, value: Expr) -> Any:
        """Return a vector of numbers."""
        key = id(value)
        if key in self.numbers:
            return self.numbers[key]
        found = stacked([self._float(self.value(each)) for each in value.args])
        if all(each.op == "const" for each in value.args):
            if self.dual and any(each.value for each in value.args):  # a column of weights
                found = Term(found.shape, draw=found.value)
            self.numbers[key] = found
        return found

    # ---- the result ----------------------------------------------------------------------------------------

    def _result(self, index: Sequence[Any], value: Any) -> None:
        """Check numbers that are written against those of the claim."""
        if not isinstance(value, Term) or value.known.ndim != 2:
            raise Wrong("it writes a result that is no number")
        row, column, channel = index
        shape = self.lanes.count, self.turns.count
        x, y, width, height = (a[:, None] for a in (self.lanes.x, self.lanes.y, *self.lanes.known[1::2]))
        rows, columns = (np.broadcast_to(Place.values_of(each), shape) for each in (row, column))
        channels = np.broadcast_to(self._plain(channel), (1, self.turns.count))[0]
        active = np.broadcast_to(True if self.mask is None else self.mask, shape)
        outside = (columns >= width) | (rows >= height) | (rows < 0) | (columns < 0)
        if (outside & active).any():
            raise Wrong("it writes a result beyond the picture")
        across, down = columns - x, rows - y
        first, own = active.argmax(axis=0), np.arange(self.turns.count)
        across_one, down_one = across[first, own], down[first, own]
        claim, there = self.claim, active.any(axis=0)
        bad = (across != across_one) | (down != down_one)
        bad |= (across < 0) | (across >= claim.pixels) | (down < 0) | (down >= claim.rows)
        if (bad & active).any() or (there & ((channels < 0) | (channels >= self.written.shape[2]))).any():
            raise Wrong("it writes a result that is not its own")
        term = self._folded(value)
        found = np.broadcast_to(term.known, (1, self.turns.count))[0]
        slot = np.zeros(self.turns.count, int) if self.turns.slot is None else self.turns.slot
        at = tuple(a[there] for a in (slot, down_one * claim.pixels + across_one, channels))
        if not np.array_equal(self.outputs[at], found[there]):
            missing = claim.missing()
            why = f": {missing} are never made" if missing else ", though all its sums are made"
            raise Wrong(f"output {channels[there][0]} is not the program's{why}")
        self.written[at] |= active[:, there].T

    def complete(self) -> None:
        """Refuse a text that leaves a pixel out."""
        claim, lanes = self.claim, self.lanes
        down, across = np.divmod(np.arange(self.written.shape[1]), claim.pixels)
        due = (lanes.x + across[:, None] < lanes.known[1]) & (lanes.y + down[:, None] < lanes.known[3])
        if not (self.written | ~due[None, :, None]).all():
            raise Wrong("it leaves a pixel without a result")


EVALUATED = (
    "const", "name", "load", "component", "splat", "stack", "clamp", "select", "call", "logical_and",
    "logical_or", "logical_not",
)  # fmt: skip
"""Expressions that are not operations on their operands' values."""


def _repeated(value: Any, count: int) -> Any:
    """Return a value of each turn for each of so many turns inside it."""
    if isinstance(value, np.ndarray) and value.ndim and value.shape[-1] > 1:
        return np.repeat(value, count, axis=-1)
    if isinstance(value, Term | Place | Slice | Tile):
        return value.each(lambda a: _repeated(a, count), lambda a: _repeated(a, count))
    return value


def _writes(loop: For) -> bool:
    """Return whether a loop writes the result."""
    return any(isinstance(each, Store) and each.array == RESULT for each in walk(loop.body))
