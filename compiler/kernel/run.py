"""Runs a kernel in NumPy: all work items at once, with a mask of those that are active.

1. A value of one lane is an array (items,), or one number where it is the same for all items; a vector is an
   array (lanes, items). Branches and loops whose bounds depend on the item only change the mask.
2. Floats belong to a domain [memory.py]: float32 rounded after every operation gives the bits of the C source
   compiled without contraction.
3. Every access is checked [memory.py]: an index beyond its array, a value that is read before it is written,
   two items of a group that use one element without a barrier between, a pixel written twice or never.
   Integers are exact in 64 bits while expressions compute, and must fit when they are stored.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..core.ops import OPS
from . import kernel as tree
from .interface import IMAGE, RESULT, UNSIGNED, WEIGHTS
from .interface import Array as Declared
from .memory import STORED, Domain, Items, Memory, Part, computed
from .verify import STEPS, KernelError, verify
from .walker import Walker

Values = Any
"""A number for all items, an array (items,) or (lanes, items)."""


def run(
    kernel: tree.Kernel,
    images: Mapping[str, NDArray[Any]],
    weights: NDArray[Any],
    domain: Domain | None = None,
) -> NDArray[Any]:
    """Return the result (H, W, C) for images (H, W, channels) by name, or raise a KernelError."""
    height, width = next(iter(images.values())).shape[:2]
    arrays = {WEIGHTS: weights, **{f"{IMAGE}{key}": image for key, image in images.items()}}
    return run_on(kernel, arrays, {"width": width, "height": height}, domain)[RESULT]


def run_on(
    kernel: tree.Kernel,
    arrays: Mapping[str, NDArray[Any]],
    integers: Mapping[str, int],
    domain: Domain | None = None,
) -> dict[str, NDArray[Any]]:
    """Return the arrays that a kernel writes, by name, for those that it reads and for its integers."""
    verify(kernel)
    with np.errstate(all="ignore"):
        runner = Runner(kernel, arrays, integers, domain or Domain())
        runner.body(kernel.body)
    width, results = integers.get("width", 1), runner.results
    found = {a.name: results[a.name].image(bool(a.planes), width) for a in kernel.interface.written}
    return found | {key: memory.left() for key, memory in runner.both.items()}


class Runner(Walker):
    """One run: the items, what they name, and the memory that they see."""

    def __init__(
        self,
        kernel: tree.Kernel,
        arrays: Mapping[str, NDArray[Any]],
        integers: Mapping[str, int],
        domain: Domain,
    ) -> None:
        self.kernel, self.domain = kernel, domain
        self.functions = {each.name: each for each in kernel.functions}
        self.tables = {key: computed(np.asarray(table)) for key, table in kernel.tables}
        self.constants = {each.name: tree.integer(kernel, each.value) for each in kernel.constants}
        self.numbers: dict[int, Values] = {}
        self.items, places = self._items(integers.get("width", 1), integers.get(kernel.interface.rows, 1))
        self.names: dict[str, Values] = {**self.constants, **places}
        for key, number in integers.items():
            self.names[key] = np.uint32(number) if key in UNSIGNED else number
        self.memory: dict[str, Memory | Part] = {}
        self.both = {each.name: self._updated(each, arrays, integers) for each in kernel.interface.both}
        for key, array in arrays.items():
            self.memory[key] = self._weights(array) if key == WEIGHTS else self._read(key, array)
        self.memory |= self.both
        self.results: dict[str, Memory] = {}
        for each in kernel.interface.written:
            shape = [size if isinstance(size, int) else integers[size] for size in each.shape]
            self.results[each.name] = Memory.of(each.name, np.zeros(shape, domain.dtype), "result")
        self.memory |= self.results
        methods = (key for key in dir(self) if key.startswith("_value_"))
        self.evaluators = {key.removeprefix("_value_"): getattr(self, key) for key in methods}
        if kernel.batch is not None:
            self.names |= dict(zip(tree.BATCH, (0, self.value(kernel.batch)), strict=True))

    def _items(self, width: int, height: int) -> tuple[Items, dict[str, Values]]:
        """Return the work items, and names of their places; only groups reach beyond the image."""
        across, down = (tree.integer(self.kernel, each) for each in self.kernel.step)
        columns, rows = self.kernel.group or (1, 1)
        groups = -(-width // (across * columns)), -(-height // (down * rows))
        row, column = (each.ravel() for each in np.mgrid[: groups[1] * rows, : groups[0] * columns])
        local_x, local_y = column % columns, row % rows
        x = column // columns * (columns * across) + local_x
        y = row // rows * (rows * down) + local_y
        places: dict[str, Values] = dict(zip(self.kernel.place, (x, y), strict=True))
        if self.kernel.group:
            places |= {"local_x": local_x, "local_y": local_y, "item": local_y * columns + local_x}
        return Items(x, y, row // rows * groups[0] + column // columns), places

    def _read(self, key: str, array: NDArray[Any]) -> Memory:
        """Return the memory of an array that is only read."""
        declared = self.kernel.interface.named(key)
        kind = tree.Type(declared.dtype, declared.lanes) if declared else tree.FLOAT
        return Memory.of(key, self._lifted(array, kind), "read", kind)

    def _lifted(self, array: NDArray[Any], kind: tree.Type) -> NDArray[Any]:
        """Return values of a kind as they are stored."""
        return self.domain.lift(array) if kind.dtype == "float32" else np.array(array, STORED[kind.dtype])

    def _updated(
        self, declared: Declared, arrays: Mapping[str, NDArray[Any]], integers: Mapping[str, int]
    ) -> Memory:
        """Return the memory of an array that is read and written; nothing is written if none is given."""
        kind, given = tree.Type(declared.dtype, declared.lanes), arrays.get(declared.name)
        if given is None:
            given = np.zeros([each if isinstance(each, int) else integers[each] for each in declared.shape])
            given = np.repeat(given, kind.lanes)
        memory = Memory.of(declared.name, self._lifted(given, kind).flatten(), "device", kind)
        memory.written = np.full(memory.data.shape, declared.name in arrays)
        return memory

    def _weights(self, weights: NDArray[Any]) -> Memory:
        """Return the memory of the weights, which may be words bit by bit."""
        flat, lanes = np.ascontiguousarray(weights).ravel(), self.kernel.weights.lanes
        data = self.domain.lift(flat.view(np.float32))[:, None]
        memory = Memory(WEIGHTS, data, tree.FLOAT.of(lanes), (len(flat) // lanes,), "read")
        memory.words = flat.view(np.int32)[:, None]
        return memory

    # ---- statements --------------------------------------------------------------------------------------

    def _under(self, mask: NDArray[np.bool_], body: tree.Body) -> NDArray[np.bool_]:
        """Run statements for some of the active items; return those that no break has stopped."""
        before = self.items.mask
        if mask.any():
            self.items.only(mask)
            self.body(body)
            mask = self.items.mask
            self.items.only(before)
        return mask

    def _run_array(self, statement: tree.Array) -> None:
        """Make new memory, of which nothing is written."""
        kind = statement.type
        columns = {"item": self.items.count, "group": self.items.groups, "device": 1}[statement.space]
        sizes = tuple(each if isinstance(each, int) else self.value(each) for each in statement.sizes)
        dtype = self.domain.dtype if kind.dtype == "float32" else STORED[kind.dtype]
        data = np.zeros((int(np.prod(sizes)) * kind.lanes, columns), dtype)
        self.names.pop(statement.name, None)
        made = Memory(statement.name, data, kind, sizes, statement.space)
        self.memory[statement.name] = made
        if statement.value is not None:
            made.write(self.items, 0, kind, self.value(statement.value))

    def _run_store(self, statement: tree.Store) -> None:
        """Write an element, or add to it."""
        if statement.value.type.lanes > 1 and statement.array in self.results:
            self._spread(statement)
            return
        kind, value = statement.value.type, self.value(statement.value)
        memory, place = self._place(statement.array, statement.index, kind)
        if statement.add:
            read = memory.read(self.items, place, kind)
            value = (
                self.domain.apply(tree.Expr("add", (), kind), [read, value])
                if kind.dtype == "float32"
                else read + value
            )
        memory.write(self.items, place, kind, value)

    def _spread(self, statement: tree.Store) -> None:
        """Write the lanes of a value to pixels side by side, up to the end of a row."""
        mask, index, axis = self.items.mask, statement.index, 1 if statement.array.startswith(IMAGE) else 2
        for lane in range(statement.value.type.lanes):
            there, value = index[axis] + lane, statement.value.lane(lane)
            inside = mask & (self.value(there) < self.results[statement.array].sizes[axis])
            store = tree.Store(statement.array, (*index[:axis], there, *index[axis + 1 :]), value)
            self._under(inside, (store,))

    def _run_for(self, statement: tree.For) -> None:
        """Run a loop: at once for all items where its bounds are theirs, else while any is in it."""
        ends = (statement.start, statement.count, statement.step)
        start, count, step = map(self.value, ends)
        if not np.all(np.asarray(step) > 0):
            raise KernelError(f"the loop over {statement.name} has a step that is not positive")
        breaks = statement.until or any(isinstance(each, tree.Break) for each in statement.body)
        if not breaks and all(isinstance(each, int) for each in (start, count, step)):
            for turn in range(start, count, step):
                self.names[statement.name] = turn
                self.body(statement.body)
            return
        before, turn = self.items.mask, start
        mask = before
        while True:
            self.names[statement.name] = turn
            mask = mask & (turn < count)
            if statement.until is not None and mask.any():
                self.items.only(mask)
                mask = mask & self.value(statement.until)
                self.items.only(before)
            if not mask.any():
                return
            mask = self._under(mask, statement.body)
            turn = turn + step

    def _run_break(self, statement: tree.Break) -> None:
        """Leave the other items in the loop."""
        self.items.only(self.items.mask & ~np.asarray(self.value(statement.condition)))

    def _run_if(self, statement: tree.If) -> None:
        """Run each branch for the items that take it."""
        condition = np.asarray(self.value(statement.condition))
        mask = self.items.mask
        self._under(mask & condition, statement.body)
        self._under(mask & ~condition, statement.otherwise)

    def _run_barrier(self, statement: tree.Statement) -> None:
        """Let all items of each group wait for each other."""
        active = np.bincount(self.items.group[self.items.mask], minlength=self.items.groups)
        size = self.items.count // self.items.groups
        if ((active > 0) & (active < size)).any():
            raise KernelError(
                f"a barrier is reached by {active[active > 0].min()} of {size} items of a group"
            )
        for memory in self.memory.values():
            memory.settle(active > 0)

    def _run_launch(self, statement: tree.Launch) -> None:
        """Run a grid of items; for memory of the device they are one group, and the end is a barrier."""
        outer, (across, down) = self.items, [*map(self.value, statement.counts), 1][:2]
        row, column = (each.ravel() for each in np.mgrid[:down, :across])
        self.items = Items(column, row, np.zeros(len(row), np.int64))
        self.names |= dict(zip(statement.place, (column, row), strict=False))
        self.body(statement.body)
        for memory in self.memory.values():
            memory.settle(np.ones(1, np.bool_))
        self.items = outer

    def _run_call(self, statement: tree.Call) -> None:
        """Run a function on views."""
        function = self.functions[statement.function]
        names: dict[str, Values] = {}
        memory: dict[str, Memory | Part] = {}
        for (array, kind), view, step in zip(function.takes, statement.views, STEPS, strict=False):
            names[step] = self.value(view.step)
            memory[array] = Part(*self._place(view.array, view.index, kind))
        self._inside(function, names, memory)

    # ---- values ------------------------------------------------------------------------------------------

    def _operation(self, value: tree.Expr, args: list[Values]) -> Values:
        """Return an operation on values."""
        if value.type.dtype == "float32" or any(each.type.dtype == "float32" for each in value.args):
            return self.domain.apply(value, args)
        if value.op in ("divide", "remainder"):
            return self._divided(value.op, *args)
        if value.op in tree.INTEGERS and all(isinstance(each, int) for each in args):
            return tree.INTEGERS[value.op](*args)
        definition = OPS[value.op].definition
        if value.op == "convert" or definition is None:
            return self.domain.apply(value, args)
        return definition(*args)

    def _divided(self, what: str, a: Values, b: Values) -> Values:
        """Return a quotient or remainder of indices, which are not negative."""
        wrong = (np.asarray(a) < 0) | (np.asarray(b) <= 0)
        if np.any(wrong):
            self.items.refuse(wrong, f"{what} of a negative index, or by 0")
            b = np.where(np.asarray(b) == 0, 1, b)
        return a // b if what == "divide" else a % b

    def _value_const(self, value: tree.Expr) -> Values:
        """Return a constant."""
        if value.type.dtype == "int32":
            return int(value.value)
        kind, key = value.type.dtype, id(value)
        if key not in self.numbers and kind == "float32":
            self.numbers[key] = self.domain.lift(np.float32(value.value))
        elif key not in self.numbers:
            self.numbers[key] = computed(np.asarray(value.value, STORED[kind]))
        return self.numbers[key]

    def _value_load(self, value: tree.Expr) -> Values:
        """Return an element of an array."""
        memory, place = self._place(value.value, value.args, value.type)
        return memory.read(self.items, place, value.type)

    def _place(self, array: str, index: Sequence[tree.Expr], kind: tree.Type) -> tuple[Memory, Values]:
        """Return the memory of an array, and the component where an access begins."""
        return self.memory[array].place(self.items, [self.value(each) for each in index], kind)

    def _value_take(self, value: tree.Expr) -> Values:
        """Return an entry of a table."""
        table, index = self.tables[value.value], self.value(value.args[0])
        return table[self.items.checked(value.value, index, len(table))]

    def _value_any(self, value: tree.Expr) -> Values:
        """Return whether a condition holds in any lane."""
        mask = np.asarray(self.value(value.args[0]))
        return mask.any(axis=0) if mask.ndim == 2 else mask

    def _value_lanes(self, value: tree.Expr) -> Values:
        """Return the number of each lane."""
        return np.arange(value.type.lanes, dtype=np.uint32)[:, None]

    def _value_component(self, value: tree.Expr) -> Values:
        """Return one component of a vector."""
        vector = self.value(value.args[0])
        return vector[value.value] if np.ndim(vector) == 2 else vector

    def _value_stack(self, value: tree.Expr) -> Values:
        """Return a vector of single values."""
        lanes = np.broadcast_arrays(*(np.atleast_1d(self.value(each)) for each in value.args))
        return np.stack(lanes)

    def _value_clamp(self, value: tree.Expr) -> Values:
        """Return an index within limits."""
        index, low, high = map(self.value, value.args)
        if value.type.lanes > 1:
            index = index + np.arange(value.type.lanes)[:, None]
        if isinstance(index, int) and isinstance(low, int) and isinstance(high, int):
            return min(max(index, low), high)
        return np.where(index < low, low, np.where(index > high, high, index))

    def _value_bits(self, value: tree.Expr) -> Values:
        """Return the bits of words as floats."""
        return self.domain.cast(value, [self.value(value.args[0])])

    def _value_pack4(self, value: tree.Expr) -> Values:
        """Return the bytes of four floats as a word, the first one the lowest."""
        as_word = [tree.apply("convert", each, value="int32") for each in value.args]
        whole = [self.domain.apply(each, [self.value(each.args[0])]) for each in as_word]
        word = sum((np.asarray(each) & 255) << (8 * k) for k, each in enumerate(whole))
        return computed(np.asarray(word).astype(np.uint32).view(np.int32))

    def _value_dot4(self, value: tree.Expr) -> Values:
        """Return products of the bytes of words, which have a sign, with four bytes or those of a word."""
        words, four = map(self.value, value.args)
        factors = four if value.args[1].type.lanes == 4 else [signed_byte(four, k) for k in range(4)]
        return sum(signed_byte(words, k) * factors[k] for k in range(4))


def signed_byte(word: Values, k: int) -> Values:
    """Return byte `k` of a word, as it is with its sign."""
    return ((np.asarray(word) >> (8 * k)) & 255 ^ 128) - 128
