"""Runs a kernel that was parsed on the numbers of field.py, in all lanes at once: run.py with other values.

1. A float, and an integer that is computed from the picture, is a `Number`; an index is Python's integer, or
   a `Place` where lanes differ [lanes.py]; a truth is Python's, or one for each lane.
2. What names, blocks and functions are has run.py; arrays, images, weights and the result are memory.py's.
3. Reading what was not written, reading or writing beyond an array or an image, and branching on a number of
   the picture raise `Wrong`, what this machine has no rule for `Unread`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from ..kernel.kernel import (
    INTEGERS,
    Array,
    Call,
    Expr,
    For,
    If,
    Kernel,
    Statement,
    Store,
    Type,
    parts,
    walk,
)
from ..kernel.run import Runner
from ..kernel.sizes import integer
from ..kernel.verify import STEPS
from . import words
from .field import (
    Number,
    Span,
    blended,
    choice,
    difference,
    expression,
    literal,
    part_of,
    product,
    stacked,
    total,
)
from .groups import Group
from .lanes import Lanes, Mask, Place, Unread, Wrong, chosen, clamped, plus, times
from .memory import Image, Memory, Result, Slice
from .places import COMPARES

BITS = ("bitwise_and", "bitwise_or", "bitwise_xor", "right_shift", "left_shift")
"""Operations on bits."""

MOST_TURNS = 2**16
"""Most turns of a loop: no kernel comes near, and one that does not end is refused."""

MOST_NUMBERS = 2**20
"""Most numbers of all arrays: no kernel comes near, and more would not fit the stack of a thread."""


class Machine(Runner):
    """One run of a kernel.

    `memory` has its images, weights and result; `added` says what a sum of the kernel is to its claim;
    `texels`: a channel beyond a pixel's own is not that of the next pixel, but wrong.
    """

    def __init__(
        self,
        kernel: Kernel,
        lanes: Lanes,
        memory: Mapping[str, Any],
        added: Callable[[Number], Number],
        group: Group | None = None,
        span_of: Callable[[Number, Mask], Span | None] | None = None,
        texels: bool = False,
    ) -> None:
        self.kernel, self.lanes, self.added = kernel, lanes, added
        self.group, self.span_of, self.texels = group, span_of, texels
        self.functions = {each.name: each for each in kernel.functions}
        self.constants = {each.name: integer(kernel, each.value) for each in kernel.constants}
        self.memory: dict[str, Any] = dict(memory)
        self.numbers: dict[Any, Any] = {}
        self.size: dict[int, int] = {}
        self.fixed: dict[int, bool] = {}
        x, width, y, height = (lanes.place(axis) for axis in range(4))
        self.names: dict[str, Any] = {**self.constants, "width": width, "height": height}
        if group and lanes.inside is not None and kernel.group:
            local_x, local_y = map(lanes.constant, lanes.inside)
            x, y = x.plus(local_x), y.plus(local_y)
            item = local_y.times(kernel.group[0]).plus(local_x)
            self.names |= {"local_x": local_x, "local_y": local_y, "item": item}
        self.names |= dict(zip(kernel.place, (x, y), strict=True))
        self.evaluators = self._evaluators()

    @property
    def running(self) -> Mask:
        """The lanes (lanes,) in which a statement has an effect now."""
        return self.lanes.running

    @property
    def mask(self) -> Mask | None:
        """The lanes of a branch; None for all."""
        return self.lanes.mask

    @mask.setter
    def mask(self, lanes: Mask | None) -> None:
        self.lanes.mask = lanes

    def written(self, value: Any, name: str) -> Any:
        """Return a value that every running lane has written."""
        if value is None or (
            isinstance(value, Number) and value.held is not None and (~value.held & self.running).any()
        ):
            raise Wrong(f"{name} is read before it is written")
        return value

    # ---- statements ----------------------------------------------------------------------------------------

    def _run_array(self, statement: Array) -> None:
        """Make new memory, of which nothing is written."""
        name, kind = statement.name, statement.type
        sizes = tuple(integer(self.kernel, each) for each in statement.sizes)
        count = int(np.prod(sizes)) * kind.lanes
        self.size[id(statement)] = count
        if not 0 < count <= MOST_NUMBERS or sum(self.size.values()) > MOST_NUMBERS:
            raise Wrong(f"{name} is an array of {count} numbers: at most {MOST_NUMBERS} in all")
        if statement.space == "item":
            memory: Any = Memory(name, count, self.mask, kind.dtype)
        elif self.group is None:
            raise Unread("memory that a group shares, without groups")
        else:
            memory = self.group.share(name, count, kind.dtype)
        self.names.pop(name, None)
        self.memory[name] = Slice(memory, 0, kind, sizes)
        if statement.value is not None:
            self._store(name, (), kind, self.value(statement.value))

    def _run_store(self, statement: Store) -> None:
        """Write an element, or add to it."""
        value, kind = statement.value, statement.value.type
        index = [self.value(each) for each in statement.index]
        if statement.add:
            away = value.op == "negative"
            number = self.value(value.args[0] if away else value)
            read = self._load(statement.array, index, kind)
            self._store(
                statement.array, index, kind, self.operate("subtract" if away else "add", read, number)
            )
        else:
            self._store(statement.array, index, kind, self.value(value))

    def _store(self, array: str, index: Sequence[Any], kind: Type, value: Any) -> None:
        """Write a value, an integer as a number of a kind."""
        memory = self.memory[array]
        if type(value) is int and not (isinstance(memory, Slice) and memory.is_index):
            value = literal(value, kind.dtype)
        if isinstance(memory, Result):
            row, column, channel = index
            rows = plus(row, self.lanes.constant(0)).values
            outside = ((rows < 0) | (rows >= self.names["height"].values)) & self.running
            if type(channel) is not int or not 0 <= channel < memory.channels or outside.any():
                raise Wrong("it writes a result that is not its own")
            at = times(plus(times(row, self.names["width"]), column), memory.channels)
            memory.store(self._whole(plus(at, channel)), 1, value, self)
        elif isinstance(memory, Slice):
            memory.memory.store(memory.place(index, kind), kind.lanes, value, self)
        else:
            raise Wrong(f"{array} is written")

    def _run_for(self, statement: For) -> None:
        """Run a loop: in each turn the lanes that are in it."""
        turn, count, step = map(self.value, (statement.start, statement.count, statement.step))
        if type(step) is not int or step < 1:
            raise Wrong(f"the loop over {statement.name} has a step that is not positive")
        if id(statement) not in self.fixed:
            self.fixed[id(statement)] = not _changes_its_end(statement)
        if not self.fixed[id(statement)]:
            raise Unread(f"a loop over {statement.name} that changes its own end")
        outer = self.mask
        for _ in range(MOST_TURNS):
            self.names[statement.name] = turn
            more = self._whole_compared("less", turn, count)
            if more is not False and statement.until is not None:
                more = self._both(more, self._where(more, statement.until))
            if isinstance(more, bool):
                if not more:
                    break
            else:
                self.mask = more if self.mask is None else self.mask & more
                if not self.running.any():
                    break
            self.body(statement.body)
            turn = self._whole(plus(turn, step))
        else:
            raise Wrong(f"a loop runs more than {MOST_TURNS} times")
        self.mask = outer

    def _where(self, lanes: Any, value: Expr) -> Any:
        """Return a truth, of which only some lanes' counts."""
        outer = self.mask
        if not isinstance(lanes, bool):
            self.mask = lanes if outer is None else outer & lanes
        found = self._truth(self.value(value))
        self.mask = outer
        return found

    def _run_if(self, statement: If) -> None:
        """Run a branch, or each for the lanes that take it."""
        found = self._truth(self.value(statement.condition))
        if isinstance(found, bool):
            self.body(statement.body if found else statement.otherwise)
            return
        outer = self.mask
        for part, branch in ((found, statement.body), (~found, statement.otherwise)):
            self.mask = part if outer is None else outer & part
            if self.running.any():
                self.body(branch)
        self.mask = outer

    def _truth(self, value: Any) -> Any:
        if isinstance(value, (bool, np.ndarray)):
            return value
        raise Wrong("it branches on a number of the image, or on an integer")

    def _run_barrier(self, statement: Statement) -> None:
        """Let all items of a group wait for each other."""
        if self.group is None:
            raise Unread("a barrier without groups")
        self.group.wait(self)

    def _run_call(self, statement: Call) -> None:
        """Run a function on views."""
        function = self.functions[statement.function]
        names: dict[str, Any] = {}
        memory: dict[str, Any] = {}
        for (array, kind), view, step in zip(function.takes, statement.views, STEPS, strict=False):
            names[step] = self.value(view.step)
            whole = self.memory[view.array]
            if not isinstance(whole, Slice):
                raise Unread(f"a view of {view.array}")
            place = whole.place([self.value(each) for each in view.index], kind)
            memory[array] = Slice(whole.memory, place, kind, (None,))
        self._inside(function, names, memory)

    # ---- integers ------------------------------------------------------------------------------------------

    def _whole(self, value: Any) -> Any:
        """Return an integer: `Wrong` for one that may not fit 32 bits."""
        if type(value) is int:
            if not -(2**31) <= value < 2**31:
                raise Wrong(f"{value} is no integer of 32 bits")
        elif isinstance(value, Place):
            if (np.abs(value.values) > self.lanes.most)[self.running].any():
                raise Wrong("an integer is larger than an index of an image")
            if (np.abs(value.form) > self.lanes.channels).any():
                raise Wrong("a coordinate is multiplied by more than the channels of an image")
        return value

    def _whole_compared(self, what: str, a: Any, b: Any) -> Any:
        """Return a comparison of two integers."""
        if isinstance(a, Place):
            return COMPARES[what](a.against(b), 0)
        if isinstance(b, Place):
            return COMPARES[what](-b.against(a), 0)
        return COMPARES[what](a, b)

    def _of_ints(self, what: str, a: int, b: int) -> int:
        """Return what arithmetic makes of two integers that all lanes share."""
        if (b <= 0 or a < 0) and what in ("divide", "remainder"):
            raise Wrong("it divides a negative integer, or by one")
        found = INTEGERS[what](a, b)
        return found if -(2**31) <= found < 2**31 else self._whole(found)

    def _of_integers(self, what: str, a: Any, b: Any) -> Any:
        """Return what an operation makes of two integers."""
        if what in COMPARES:
            return self._whole_compared(what, a, b)
        if type(a) is int and type(b) is int and what in INTEGERS:
            return self._of_ints(what, a, b)
        if what in ("add", "subtract"):
            return self._whole(plus(a, b, 1 if what == "add" else -1))
        if what == "multiply":
            return self._whole(times(a, b))
        if what in ("minimum", "maximum"):
            return clamped(a, b, -1 if what == "minimum" else 1)
        if what not in ("divide", "remainder") or type(b) is not int:
            raise Unread(f"{what} of coordinates")
        if a.form.any():
            raise Unread(f"{what} of coordinates")
        if b <= 0 or (a.values < 0)[self.running].any():
            raise Wrong("it divides a negative integer, or by one")
        return self.lanes.constant(a.values // b if what == "divide" else a.values % b)

    # ---- operations ----------------------------------------------------------------------------------------

    def operate(self, what: str, *args: Any) -> Any:
        """Return what an operation makes of values."""
        if len(args) == 2:
            kinds = type(args[0]), type(args[1])
            if kinds == (Number, Number):
                return self._of_two(what, *args)
            if kinds == (int, int) and what in INTEGERS:
                return self._of_ints(what, *args)
        if not any(isinstance(each, Number) for each in args):
            if len(args) != 2 or not all(type(each) in (int, Place) for each in args):
                raise Unread(f"{what} of other values than integers and numbers")
            return self._of_integers(what, *args)
        if not all(type(each) in (int, Number) for each in args):
            raise Wrong("it mixes coordinates, or truths, and numbers of the image")
        kind = next(each.kind for each in args if isinstance(each, Number))
        given = [literal(each, kind) if type(each) is int else each for each in args]
        if len(given) == 1:
            (number,) = given
            if what == "negative" and number.literal is not None:
                return literal(-number.literal, number.kind)
            return expression(what, number)
        return self._of_two(what, *given)

    def _of_two(self, what: str, a: Number, b: Number) -> Number:
        """Return what an operation makes of two numbers."""
        if what == "multiply" and not (a.span and b.span):
            return product(a, b)
        shift = what.endswith("shift")
        if shift and (b.literal is None or not 0 <= b.literal < 32):
            raise Unread("a shift by anything but a constant below 32")
        if (exact := words.operate(what, a, b)) is not None:
            return exact
        if what in ("add", "subtract", "multiply"):
            if what == "add":
                return self.added(total(a, b))
            return difference(a, b) if what == "subtract" else product(a, b)
        if what in BITS:
            moved = words.moved(what, a, b)
            return expression(what, a, b, commutes=not shift) if moved is None else moved
        if what in ("minimum", "maximum"):
            return expression(what, a, b, commutes=True)
        if what in COMPARES:
            a, b = (a, b) if what.startswith("less") else (b, a)
            name = what.replace("greater", "less")
            found = expression(name, a, b, kind="bool")
            return Number(found.value, found.shape, "bool", compared=(a, b) if name == "less" else None)
        return expression(what, a, b)

    def _operation(self, value: Expr, args: list[Any]) -> Any:
        """Return an operation on values."""
        return self.operate(value.op, *args)

    def _value_const(self, value: Expr) -> Any:
        """Return a constant."""
        if value.type.dtype in ("int32", "bool"):
            return value.value
        key = value.type.dtype, value.value
        if key not in self.numbers:
            self.numbers[key] = literal(value.value, value.type.dtype)
        return self.numbers[key]

    def _value_load(self, value: Expr) -> Any:
        """Return an element of an array."""
        return self._load(value.value, [self.value(each) for each in value.args], value.type)

    def _load(self, array: str, index: Sequence[Any], kind: Type) -> Any:
        memory = self.memory[array]
        if isinstance(memory, Slice):
            return memory.memory.load(memory.place(index, kind), kind.lanes, self)
        if isinstance(memory, Result):
            raise Wrong("the result is read")
        if isinstance(memory, Image):
            return memory.pixel(index, kind, self)
        if isinstance(memory, words.Stored):
            memory = memory.seen_as(kind.dtype)
        elif kind.dtype != "float32":
            raise Unread(f"weights as {kind.dtype}")
        own = self.kernel.weights.lanes
        return memory.load(index[0] if own == 1 else times(index[0], kind.lanes), kind.lanes, self)

    def _value_component(self, value: Expr) -> Any:
        """Return one number of a vector."""
        return part_of(self.value(value.args[0]), value.value)

    def _value_stack(self, value: Expr) -> Any:
        """Return a vector of numbers."""
        parts = [self.value(each) for each in value.args]
        return stacked([literal(p, value.type.dtype) if type(p) is int else p for p in parts])

    def _value_clamp(self, value: Expr) -> Any:
        """Return a value within two others; of integers the first is not above the second."""
        given, low, high = map(self.value, value.args)
        whole = not isinstance(low, Number) and not isinstance(high, Number)
        if whole and not np.all(self._whole_compared("less_equal", low, high) | ~self.running):
            raise Wrong("a value between two others in no order")
        return self.operate("minimum", self.operate("maximum", given, low), high)

    def _value_select(self, value: Expr) -> Any:
        """Return one of two values, or of each lane one."""
        where = self.value(value.args[0])
        a, b = map(self.value, value.args[1:])
        kind = value.type.dtype
        if isinstance(a, Number) or isinstance(b, Number):
            a, b = (literal(each, kind) if type(each) is int else each for each in (a, b))
        if isinstance(where, Number):
            return choice(where, a, b)
        where = self._truth(where)
        if isinstance(where, bool):
            return a if where else b
        return blended(a, b, where) if isinstance(a, Number) else chosen(self.lanes, where, a, b)

    def _value_logical_and(self, value: Expr) -> Any:
        """Return whether both hold."""
        return self._logical(value, False)

    def _value_logical_or(self, value: Expr) -> Any:
        """Return whether one holds."""
        return self._logical(value, True)

    def _logical(self, value: Expr, ends: bool) -> Any:
        """Return the truth of two; the first one alone where that decides."""
        a = self._truth(self.value(value.args[0]))
        if isinstance(a, bool):
            return a if a is ends else self._truth(self.value(value.args[1]))
        b = self._truth(self.value(value.args[1]))
        return a | b if ends else a & b

    @staticmethod
    def _both(a: Any, b: Any) -> Any:
        """Return whether two truths hold."""
        return a and b if isinstance(a, bool) and isinstance(b, bool) else np.logical_and(a, b)

    def _value_logical_not(self, value: Expr) -> Any:
        """Return whether something does not hold."""
        found = self._truth(self.value(value.args[0]))
        return not found if isinstance(found, bool) else ~found

    def _value_convert(self, value: Expr) -> Any:
        """Return a value as one of another kind."""
        given, kind = self.value(value.args[0]), value.type.dtype
        if isinstance(given, Number):
            return self.cast(given, kind)
        if kind == "int32":
            return int(given) if type(given) is bool else given
        limits = words.LIMITS.get(kind, (-words.EXACT, words.EXACT))
        if type(given) is not int or not limits[0] <= given <= limits[1]:
            raise Unread(f"a coordinate, or {given!r}, as {kind}")
        return literal(given, kind)

    def cast(self, value: Number, kind: str) -> Number:
        """Return a number as one of another kind: `Wrong` for a constant that it does not hold."""
        limits = words.LIMITS.get(kind)
        whole = int(value.literal) if value.literal is not None and value.kind == "float32" else 0
        if limits and not limits[0] <= whole <= limits[1]:
            raise Wrong(f"{value.literal} as {kind}")
        if value.kind != kind and (other := words.cast(value, kind, self)) is not None:
            return other
        if kind not in ("float32", "int32", "uint32") or value.kind == kind:
            return value
        return (
            expression("convert", value, kind=kind) if value.literal is None else literal(value.literal, kind)
        )

    def _value_bits(self, value: Expr) -> Any:
        """Return the bits of words that are known as floats."""
        numbers = words.known(self.value(value.args[0]))
        if numbers is None:
            raise Unread("bits of the picture as floats")
        return words.floats(np.asarray(numbers).astype("<i4").view("<f4"))

    def _value_pack4(self, value: Expr) -> Any:
        """Return the bytes of four floats as a word, the first one the lowest."""
        four = [self.cast(self.value(each), "int32") for each in value.args]
        return words.packed(four)

    def _value_dot4(self, value: Expr) -> Any:
        """Return products of the bytes of words, which have a sign, with four bytes or those of a word."""
        weights, four = map(self.value, value.args)
        bytes_ = value.args[1].type.lanes == 4
        given = [part_of(four, k) for k in range(4)] if bytes_ else words.bytes_of(four, signed=True)
        return words.dots(words.bytes_of(weights, signed=True), given)


def _changes_its_end(loop: For) -> bool:
    """Return whether a loop's body names or writes what its count or its step reads in every turn."""
    read = {
        part.value for end in (loop.count, loop.step) for part in parts(end) if part.op in ("name", "load")
    }
    written: set[Any] = {loop.name}
    for statement in walk(loop.body):
        written.add(getattr(statement, "name", getattr(statement, "array", None)))
        written |= {view.array for view in getattr(statement, "views", ())}
    return bool(read & written)
