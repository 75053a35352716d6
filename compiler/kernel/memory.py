"""The values and the memory of a kernel that runs in NumPy [run.py], and the checks of every access.

Floats are float32, or other things that add up: a domain sees each operation that reads or makes one, so that
it may count roundings, or compute in a prime field. Indices, integers and booleans are the same in every
domain. Memory is an array (components, columns) with a column for each item, for each group, or for all.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from ..core.ops import OPS
from .kernel import FLOAT, Expr, Type
from .verify import KernelError

STORED: dict[str, DTypeLike] = {
    "int32": np.int32, "uint32": np.uint32, "bool": np.bool_, "uint8": np.uint8, "int8": np.int8,
}  # fmt: skip
"""How NumPy stores a value of each kind but floats."""


class Domain:
    """Float32, rounded after every operation by the definitions of core/ops.py; nothing is fused."""

    dtype: DTypeLike = np.float32

    def lift(self, values: Any) -> NDArray[Any]:
        """Return float32 values as elements of the domain."""
        return np.asarray(values, np.float32)

    def apply(self, operation: Expr, args: list[Any]) -> Any:
        """Return the result of an operation; its arguments and itself may be vectors (lanes, items)."""
        definition = OPS[operation.op].definition
        assert definition, operation.op
        if operation.op != "convert":
            return definition(*args)
        value = definition(args[0], dtype=self.dtype) if _is_float(operation) else args[0]
        return converted(value, operation)

    def cast(self, operation: Expr, args: list[Any]) -> Any:
        """Return the same bits as a value of another kind."""
        kinds = {**STORED, "float32": self.dtype}
        source = np.asarray(args[0]).astype(kinds[operation.args[0].type.dtype])
        return computed(np.ascontiguousarray(source).view(kinds[operation.type.dtype]).reshape(source.shape))


def _is_float(value: Expr) -> bool:
    """Return whether an expression is a float, or several."""
    return value.type.dtype == "float32"


def converted(value: Any, operation: Expr) -> Any:
    """Return a value as one of the kind that a conversion names."""
    return value if _is_float(operation) else computed(np.asarray(value).astype(STORED[operation.type.dtype]))


def computed(value: NDArray[Any]) -> Any:
    """Return stored values as expressions compute with them: signed integers exactly, in 64 bits."""
    return value.astype(np.int64) if value.dtype.kind in "iu" and value.dtype != np.uint32 else value


NOBODY, SEVERAL = -1, -2
"""Instead of the number of an item that has used an element since the last barrier."""


def spread(place: Any, count: int) -> Any:
    """Return the places of so many elements from one on, or those of a row that are known one by one."""
    return place if np.ndim(place) == 2 else place + np.arange(count)[:, None]


class Items:
    """The work items: first pixels, groups, and which of them are active."""

    def __init__(self, x: NDArray[np.int64], y: NDArray[np.int64], group: NDArray[np.int64]) -> None:
        self.x, self.y, self.group = x, y, group
        self.count, self.groups = len(x), int(group.max()) + 1
        self.all = np.arange(self.count)
        self.only(np.ones(self.count, np.bool_))

    def only(self, mask: NDArray[np.bool_]) -> None:
        """Let these items be the active ones."""
        self.mask = mask
        self.full = bool(mask.all())

    def refuse(self, wrong: Any, what: str) -> None:
        """Raise where an active item is at fault, with the first one's pixel."""
        where: Any = np.logical_and(wrong, self.mask)
        where = where.any(axis=0) if where.ndim == 2 else where
        if where.any():
            first = int(np.argmax(where))
            raise KernelError(f"{what}, in the item of pixel ({self.x[first]}, {self.y[first]})")

    def checked(self, array: str, index: Any, size: int) -> Any:
        """Return an index below `size`; that of an item that is not active may be anything, and becomes 0."""
        if isinstance(index, int):
            if not 0 <= index < size:
                self.refuse(True, f"index {index} is beyond {array}, which has {size}")
                return 0
            return index
        wrong = (index < 0) | (index >= size)
        if not np.any(wrong):
            return index
        where = wrong & self.mask
        number = np.broadcast_to(index, where.shape).ravel()[np.argmax(where)]
        self.refuse(wrong, f"index {number} is beyond {array}, which has {size}")
        return np.where(wrong, 0, index)


class Memory:
    """One array; `space`: `item`, `group`, `device`, `read` (weights, images) or `result`.

    `words`: the same bits as integers, where weights are read as both.
    """

    def __init__(self, name: str, data: NDArray[Any], kind: Type, sizes: tuple[int, ...], space: str) -> None:
        self.name, self.data, self.kind, self.sizes, self.space = name, data, kind, sizes, space
        self.words: NDArray[np.int32] | None = None
        self.written = None if space == "read" else np.zeros(data.shape, np.bool_)
        if space in ("group", "device", "result"):
            self.writer = np.full(data.shape, NOBODY, np.int64)
            self.reader = np.full(data.shape, NOBODY, np.int64)

    @classmethod
    def of(cls, name: str, values: NDArray[Any], space: str, kind: Type = FLOAT) -> Memory:
        """Return the memory of an array that a kernel is given; one of vectors has one index."""
        sizes = values.shape if kind.lanes == 1 else (values.size // kind.lanes,)
        return cls(name, values.reshape(-1, 1), kind, sizes, space)

    def columns(self, items: Items) -> Any:
        """Return the column of each item."""
        return {"item": items.all, "group": items.group}.get(self.space, 0)

    # ---- places ------------------------------------------------------------------------------------------

    def place(self, items: Items, index: Sequence[Any], kind: Type) -> tuple[Memory, Any]:
        """Return this memory and the component where an access begins: for each item, or for all."""
        lanes = kind.lanes
        if len(index) == len(self.sizes) and lanes == self.kind.lanes:
            return self, self._element(items, index, self.sizes) * lanes
        if len(self.sizes) == 3 and len(index) == 2:  # an image's row and a position in it, or a pixel
            height, width, channels = self.sizes
            sizes = (height, width) if lanes > 1 else (height, width * channels)
            return self, self._element(items, index, sizes) * (channels if lanes > 1 else 1)
        if len(index) == 3:  # elements of a row of a plane
            column = index[-1] if np.ndim(index[-1]) == 2 else spread(index[-1], lanes)
            return self, self._element(items, (*index[:-1], column), self.sizes)
        if self.kind.lanes == 1:  # elements side by side, from any one on
            return self, self._element(items, index, (len(self.data) - lanes + 1,))
        return self, self._element(items, index, (len(self.data) // lanes,)) * lanes

    def _element(self, items: Items, index: Sequence[Any], sizes: Sequence[int]) -> Any:
        """Return the number of an element, in the order of C."""
        element: Any = 0
        for each, size in zip(index, sizes, strict=True):
            element = element * size + items.checked(self.name, each, size)
        return element

    # ---- accesses ----------------------------------------------------------------------------------------

    def read(self, items: Items, place: Any, kind: Type) -> Any:
        """Return what is there: (items,), (lanes, items), or one number that all items read."""
        count, columns = kind.lanes, self.columns(items)
        data = self.words if self.words is not None and kind.dtype == "int32" else self.data
        if self.space in ("group", "device"):
            self._reads(items, place, count)
        if isinstance(place, int):
            rows = slice(place, place + count)
            there = data[rows] if self.space == "item" else data[rows][:, columns]
            written = self.written if self.written is None else self.written[rows]
            written = written[:, columns] if self.space == "group" and written is not None else written
        else:
            each = spread(place, count)
            there = data[each, columns]
            written = self.written if self.written is None else self.written[each, columns]
        if written is not None and not written.all():
            items.refuse(~written, f"{self.name} is read before it is written")
        value = there if kind.dtype in ("float32", "bool", "uint32") else computed(there)
        if kind.lanes == 1:
            return value[0].copy()
        return value.copy() if value.ndim == 2 else value[:, None]

    def write(self, items: Items, place: Any, kind: Type, value: Any) -> None:
        """Write a value for the active items."""
        self._check_range(items, kind, value)
        value = np.broadcast_to(value, (kind.lanes, items.count))
        count = kind.lanes
        if isinstance(place, int) and self.space == "item" and self.written is not None:
            rows = slice(place, place + count)
            np.copyto(self.data[rows], value, where=items.mask, casting="unsafe")
            self.written[rows] |= items.mask
            return
        if self.space in ("group", "device", "result"):
            self._writes(items, place, count)
        each, columns, _ = self._used(items, place, count)
        self.data[each, columns] = value[:, items.mask]
        assert self.written is not None, "what is only read is not written"
        self.written[each, columns] = True

    def _check_range(self, items: Items, kind: Type, value: Any) -> None:
        """Refuse an integer that its kind cannot hold."""
        if kind.dtype in ("int32", "uint8", "int8"):
            limits = np.iinfo(STORED[kind.dtype])
            wrong = (np.asarray(value) < limits.min) | (np.asarray(value) > limits.max)
            if np.any(wrong):
                items.refuse(wrong, f"{self.name} is set to an integer that {kind.dtype} does not hold")

    # ---- items of a group --------------------------------------------------------------------------------

    def _used(self, items: Items, place: Any, count: int) -> tuple[Any, Any, Any]:
        """Return the components, columns and numbers of the active items of an access."""
        active = np.flatnonzero(items.mask)
        each = np.broadcast_to(spread(place, count), (count, items.count))[:, active]
        columns = np.broadcast_to(self.columns(items), (items.count,))[active]
        return each, columns, np.broadcast_to(active, each.shape)

    def _reads(self, items: Items, place: Any, count: int) -> None:
        """Note who reads; refuse what another item has written since the last barrier."""
        each, columns, who = self._used(items, place, count)
        writer, reader = self.writer[each, columns], self.reader[each, columns]
        if ((writer != NOBODY) & (writer != who)).any():
            raise KernelError(f"an item reads {self.name} where another wrote, without a barrier between")
        self.reader[each, columns] = np.where((reader == NOBODY) | (reader == who), who, SEVERAL)
        together = (self.reader[each, columns] != who) & (self.reader[each, columns] != SEVERAL)
        self.reader[each[together], np.broadcast_to(columns, each.shape)[together]] = SEVERAL

    def _writes(self, items: Items, place: Any, count: int) -> None:
        """Note who writes; refuse what another item has read or written since the last barrier."""
        each, columns, who = self._used(items, place, count)
        writer, reader = self.writer[each, columns], self.reader[each, columns]
        self.writer[each, columns] = who
        if self.space == "result":
            if ((writer != NOBODY) | (self.writer[each, columns] != who)).any():
                raise KernelError("a channel of the result is written twice")
            return
        if ((writer != NOBODY) & (writer != who)).any() or (self.writer[each, columns] != who).any():
            raise KernelError(f"two items write one element of {self.name} without a barrier between")
        if ((reader != NOBODY) & (reader != who)).any():
            raise KernelError(f"an item writes {self.name} where another read, without a barrier between")

    def settle(self, groups: NDArray[np.bool_]) -> None:
        """Forget who has used what: the items of these groups have waited for each other."""
        if self.space in ("group", "device"):
            self.writer[:, groups] = NOBODY
            self.reader[:, groups] = NOBODY

    def image(self, planes: bool, width: int) -> NDArray[Any]:
        """Return the result (H, W, C), or planes (C, H, W) of it; all of the image must be written."""
        assert self.written is not None, "a result is written"
        written, data = self.written.reshape(self.sizes), self.data.reshape(self.sizes)
        if planes:  # whose rows may be longer
            written, data = np.moveaxis(written[..., :width], 0, -1), data[..., :width]
        if not written.all():
            row, column, channel = np.unravel_index(int(np.argmin(written)), written.shape)
            raise KernelError(f"channel {channel} of pixel ({column}, {row}) of the result is never written")
        return data

    def left(self) -> NDArray[Any]:
        """Return the elements, one after another; floats that nothing has written are NaN."""
        assert self.written is not None, "what is read and written notes what is written"
        return np.where(self.written, self.data, np.nan if self.data.dtype.kind == "f" else 0)[:, 0]


class Part:
    """Elements of an array that a function sees, from a component on."""

    def __init__(self, memory: Memory, first: Any) -> None:
        self.memory, self.first = memory, first

    def place(self, items: Items, index: Sequence[Any], kind: Type) -> tuple[Memory, Any]:
        """Return the memory and the component where an access begins."""
        place = self.first + index[0] * kind.lanes
        return self.memory, items.checked(self.memory.name, place, len(self.memory.data) - kind.lanes + 1)

    def settle(self, groups: NDArray[np.bool_]) -> None:
        """Forget nothing: a function on views has no barrier."""
