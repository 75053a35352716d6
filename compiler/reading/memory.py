"""What a text reads and writes: its arrays, the images, the weights and the result."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ..kernel.kernel import INT, Type
from .field import Number, Span, blended, hashed, leaf, part_of, repeated, stacked, wide
from .lanes import Mask, Place, Unread, Wrong, chosen, plus, times

if TYPE_CHECKING:
    from .claim import Claim
    from .machine import Machine


@dataclass(frozen=True)
class Slice:
    """An array of a kernel: elements of a `kind` in a memory, from a place on; a view has sizes (None,)."""

    memory: Any
    first: Any
    kind: Type
    sizes: tuple[int | None, ...]

    @property
    def is_index(self) -> bool:
        """Whether it is a variable that may hold an index."""
        return self.sizes == () and self.kind == INT

    def place(self, index: Sequence[Any], kind: Type) -> Any:
        """Return the place of a number, or vector, of a kind: within each size where that is known."""
        if len(index) == len(self.sizes) and (kind.lanes == self.kind.lanes or self.kind.lanes == 1):
            sizes, lanes = self.sizes, self.kind.lanes
        else:
            sizes, lanes = (None,), kind.lanes
        if len(index) != len(sizes):
            raise Wrong(f"{len(index)} indices of an array of {len(sizes)}")
        at: Any = 0
        for each, size in zip(index, sizes, strict=True):
            if size is not None and type(each) is int and not 0 <= each < size:
                raise Wrong(f"element {each} of an array of {size}")
            at = plus(times(at, size or 1), each)
        return plus(self.first, times(at, lanes))


class Memory:
    """An array of a text: what was written, by offset; a vector is several numbers.

    `vectors` are those at multiples of their width `unit` that have been written as a whole. `mask`:
    the lanes that declare it; no other lane sees it. `kind`: of its numbers, nothing where that is not known.
    """

    def __init__(self, name: str, size: int, mask: Mask | None = None, kind: str = "") -> None:
        self.name, self.size, self.mask, self.kind, self.unit = name, size, mask, kind, 0
        self.cells: dict[int, tuple[Any, int | None]] = {}
        self.vectors: dict[int, Number] = {}

    def _checked(self, offset: Any, width: int) -> int:
        if not isinstance(offset, int):
            raise Wrong(f"{self.name} has an index that differs between lanes")
        if not 0 <= offset <= self.size - width:
            raise Wrong(f"{self.name} has no number {offset}: it has {self.size}")
        return offset

    def load(self, offset: Any, width: int, machine: Machine) -> Any:
        """Return `width` numbers that have been written."""
        offset = self._checked(offset, width)
        if self.unit:
            k = offset % self.unit
            vector = self.vectors.get(offset - k)
            if vector is not None and (width == 1 or (k == 0 and width == self.unit)):
                return machine.written(part_of(vector, k) if width == 1 else vector, self.name)
            whole = [self.vectors.get(at) for at in range(offset, offset + width, self.unit)]
            if k == 0 and width % self.unit == 0 and all(whole):
                return stacked([machine.written(vector, self.name) for vector in whole])
            self._split(offset, width)
        cells = [self.cells.get(offset + k, (None, None)) for k in range(width)]
        parts = [machine.written(part_of(*cell), self.name) for cell in cells]
        return parts[0] if width == 1 else stacked(parts)

    def store(self, offset: Any, width: int, value: Any, machine: Machine) -> None:
        """Write `width` numbers, in the lanes that run."""
        offset, mask = self._checked(offset, width), machine.mask
        if mask is self.mask:
            mask = None
        if isinstance(value, (int, Place)) and self.size == 1:
            self._store_index(value, mask, machine)
            return
        if not isinstance(value, Number):
            raise Unread(f"anything but numbers in {self.name}")
        if wide(value) not in (1, width):
            raise Wrong(f"{self.name} is given {wide(value)} numbers for {width}")
        if width > 1 and mask is None and offset % width == 0 and self.unit in (0, width):
            self.unit = width
            self.vectors[offset] = value if wide(value) == width else repeated(value, width)
            return
        if self.unit:
            self._split(offset, width)
        for k in range(width):
            new: tuple[Any, int | None] = (value, k if width > 1 else None)
            if mask is not None:
                old = self.cells.get(offset + k, (None, None))
                new = (blended(part_of(*new), part_of(*old), mask), None)
            self.cells[offset + k] = new

    def _store_index(self, value: Any, mask: Mask | None, machine: Machine) -> None:
        """Write an integer of a variable."""
        old, _ = self.cells.get(0, (None, None))
        if mask is not None:
            if isinstance(old, Number) or old is None:
                raise Wrong(f"{self.name} is written in some lanes only")
            value = chosen(machine.lanes, mask, value, old)
        self.cells[0] = (value, None)

    def _split(self, offset: int, width: int) -> None:
        """Keep the vectors of these places as numbers."""
        for at in range(offset - offset % self.unit, offset + width, self.unit):
            vector = self.vectors.pop(at, None)
            if vector is not None:
                self.cells |= {at + k: (vector, k) for k in range(self.unit)}


class Image:
    """An image: every number of it is an unknown of the claim."""

    def __init__(self, name: str, channels: int, size: tuple[Place, Place], span: Span | None = None) -> None:
        self.name, self.channels, self.size, self.lanes, self.span = name, channels, size, size[0].lanes, span

    def pixel(self, index: Sequence[Any], kind: Type, machine: Machine) -> Number:
        """Return numbers of it: of a row, a column, and a channel or what lies behind."""
        row, column, *behind = index
        channel = behind[0] if behind else 0
        most = self.channels - kind.lanes if machine.texels else 2**31
        if type(channel) is not int or not 0 <= channel <= most:
            raise Wrong(f"image {self.name} has no channel {channel}")
        at = plus(times(column, self.channels), channel)
        width, height = self.size
        self._within(row, height.values, 1, machine)
        self._within(at, width.values * self.channels, kind.lanes, machine)
        offset = plus(times(row, times(width, self.channels)), at)
        parts = [self._one(plus(offset, k)) for k in range(kind.lanes)]
        return parts[0] if len(parts) == 1 else stacked(parts)

    def _within(self, index: Any, size: Any, lanes: int, machine: Machine) -> None:
        """Refuse an index beyond a size."""
        values = index.values if isinstance(index, Place) else np.full(self.lanes.count, index)
        if (((values < 0) | (values > size - lanes)) & machine.running).any():
            raise Wrong(f"image {self.name} is read beyond its ends")

    def _one(self, offset: Any) -> Number:
        values = offset.values if isinstance(offset, Place) else np.full(self.lanes.count, offset)
        return leaf(hashed(f"image {self.name}", values), span=self.span)


class Weights:
    """The weights. Of `spectra` no sums are made."""

    def __init__(self, numbers: Number, spectra: range = range(0)) -> None:
        self.numbers, self.spectra, self.size = numbers, spectra, int(numbers.value.shape[2])

    def load(self, offset: Any, width: int, machine: Machine) -> Number:
        """Return numbers of the file."""
        if not isinstance(offset, int) or not 0 <= offset <= self.size - width:
            raise Wrong(f"the weights are read at {offset}: there are {self.size}")
        part = slice(offset, offset + width) if width > 1 else offset
        return Number(self.numbers.value[..., part], self.numbers.known[..., part], weight=True)


class Result:
    """The picture that a text writes: its own pixels, with what the claim says, and all of them."""

    def __init__(self, claim: Claim, channels: int) -> None:
        self.claim, self.channels = claim, channels
        self.written = np.zeros((len(claim.outputs), channels, claim.lanes.count), dtype=bool)

    def store(self, offset: Any, width: int, value: Any, machine: Machine) -> None:
        """Check numbers that are written."""
        for k in range(width):
            self._one(plus(offset, k), part_of(value, k if width > 1 else None), machine)

    def _one(self, offset: Any, value: Any, machine: Machine) -> None:
        lanes, stride = self.claim.lanes, self.claim.stride
        x, width, y, height = lanes.x, lanes.known[1], lanes.y, lanes.known[3]
        running = machine.running
        if not running.any():
            return
        values = offset.values if isinstance(offset, Place) else np.full(len(x), offset)
        found = set((values - (y * width + x) * self.channels)[running].tolist())
        column, channel = divmod(found.pop(), self.channels)
        pixel = column // stride
        if found or column % stride or not 0 <= pixel < self.claim.pixels:
            raise Wrong("it writes a result that is not its own")
        if ((x + column >= width) | (y >= height))[running].any():
            raise Wrong("it writes a result beyond the picture")
        self.hold(pixel, channel, value, running)

    def hold(self, pixel: int, channel: int, value: Any, running: Any) -> None:
        """Check the number of one channel of one pixel, in the lanes that run."""
        wanted = self.claim.outputs[pixel].known[..., channel]
        known = value.known if isinstance(value, Number) else np.zeros(1, dtype=np.uint64)
        found, due = (np.broadcast_to(one, running.shape)[running] for one in (known, wanted))
        if not np.array_equal(found, due):
            missing = self.claim.missing()
            why = f": {missing} are never made" if missing else ", though all its sums are made"
            raise Wrong(f"output {channel} is not the program's{why}")
        self.written[pixel, channel] |= running

    def complete(self) -> None:
        """Refuse a text that leaves a pixel out."""
        lanes, stride = self.claim.lanes, self.claim.stride
        x, width, y, height = lanes.x, lanes.known[1], lanes.y, lanes.known[3]
        for pixel, written in enumerate(self.written):
            if not written[:, (x + pixel * stride < width) & (y < height)].all():
                raise Wrong("it leaves a pixel without a result")
