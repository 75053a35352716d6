"""What a text reads and writes: its arrays, the images, the weights and the result."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from .field import FOLDED, Number, Span, blended, folded, hashed, leaf, part_of, repeated, stacked, wide
from .lanes import Mask, Place, Unread, Wrong, plus, times
from .tokens import Type

if TYPE_CHECKING:
    from .claim import Claim
    from .machine import Machine


@dataclass(frozen=True)
class Every:
    """The index of a loop whose `turns` are run at once [together.py]."""

    turns: int


OWN = Type("")
"""The type of an address that no source declares."""


@dataclass(slots=True)
class Pointer:
    """A place of `width` numbers in a memory; `sizes` of an array, (None,) of a pointer, () of a variable.

    `of`: the type that it is declared with, of no kind where it has none.
    """

    memory: Any
    offset: Any
    width: int = 1
    sizes: tuple[int | None, ...] = (None,)
    of: Type = OWN

    def at(self, index: Any) -> Pointer:
        """Return the place of an element, within the array's own size where that is known."""
        if isinstance(index, Every):
            return Pointer(self.memory, self.offset, self.width * index.turns, (), self.of)
        if isinstance(index, int) and self.sizes[0] is not None and not 0 <= index < self.sizes[0]:
            raise Wrong(f"element {index} of an array of {self.sizes[0]}")
        step = self.width
        for size in self.sizes[1:]:
            step *= size or 1
        offset = plus(self.offset, times(index, step))
        return Pointer(self.memory, offset, self.width, self.sizes[1:], self.of)

    def moved(self, index: Any, machine: Machine) -> Pointer:
        """Return the place of an element, or of the end, as a pointer; `Wrong` outside the array."""
        offset = plus(self.offset, times(index, self.width))
        own = self.sizes[0]
        at, end = (offset, getattr(self.memory, "size", None)) if own is None else (index, own)
        beyond = (at.values < 0)[machine.running].any() if isinstance(at, Place) else at < 0
        if beyond or (isinstance(at, int) and isinstance(end, int) and at > end):
            raise Wrong("an address outside its array")
        return Pointer(self.memory, offset, self.width, of=self.of)

    def declared(self, type_: Type) -> Pointer:
        """Return it as a pointer, or a reference, of a type, to which nothing is converted without a cast."""
        own = self.of
        if own.kind and (
            (own.kind, self.width, own.space) != (type_.kind, type_.width, type_.space)
            or own.fixed > type_.fixed
            or len(self.sizes) > 1
        ):
            raise Unread(f"an address of {own.fixed * 'const '}{own.kind} as one of {type_.kind}")
        return replace(self, of=type_)

    def load(self, machine: Machine) -> Any:
        """Return what is there."""
        return self.memory.load(self.offset, self.width, machine)

    def store(self, value: Any, machine: Machine) -> None:
        """Write a number, or a vector."""
        if self.of.fixed:
            raise Wrong("it writes what is const")
        self.memory.store(self.offset, self.width, value, machine)


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
        if not isinstance(value, Number):
            raise Unread(f"anything but numbers in {self.name}")
        offset, mask = self._checked(offset, width), machine.mask
        if mask is self.mask:
            mask = None
        if wide(value) not in (1, width):
            raise Wrong(f"{self.name} is given {wide(value)} numbers for {width}")
        number = isinstance(value, Number)
        if FOLDED and number:
            value, mask = self._folded(value, mask), None
        if number and width > 1 and mask is None and offset % width == 0 and self.unit in (0, width):
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

    def _split(self, offset: int, width: int) -> None:
        """Keep the vectors of these places as numbers."""
        for at in range(offset - offset % self.unit, offset + width, self.unit):
            vector = self.vectors.pop(at, None)
            if vector is not None:
                self.cells |= {at + k: (vector, k) for k in range(self.unit)}

    @staticmethod
    def _folded(value: Number, mask: Mask | None) -> Number:
        """Return a number of all lanes as one; where some lanes only write it, others must not read it."""
        if value.shape is not None and len(value.shape) > 1:
            value = leaf(folded(value.shape)[None], value.kind, held=value.held)
        if mask is None:
            return value
        return replace(value, held=mask if value.held is None else mask & value.held)


class Image:
    """An image: every number of it is an unknown of the claim."""

    kind = "float32"

    def __init__(self, name: str, channels: int, size: tuple[Place, Place], span: Span | None = None) -> None:
        self.name, self.channels, self.size, self.lanes, self.span = name, channels, size, size[0].lanes, span

    def load(self, offset: Any, width: int, machine: Machine) -> Number:
        """Return numbers of it, each within the picture."""
        parts = [self._one(plus(offset, k), machine) for k in range(width)]
        return parts[0] if width == 1 else stacked(parts)

    def _one(self, offset: Any, machine: Machine) -> Number:
        values = offset.values if isinstance(offset, Place) else np.full(self.lanes.count, offset)
        count = self.size[0].values * self.size[1].values * self.channels
        if (((values < 0) | (values >= count)) & machine.running).any():
            raise Wrong(f"image {self.name} is read beyond its ends")
        return leaf(hashed(f"image {self.name}", values), span=self.span)

    def store(self, *given: Any) -> None:
        """Refuse."""
        raise Wrong(f"image {self.name} is written")


@dataclass(frozen=True)
class Texel:
    """A pixel of a texture, whose channels are read one by one."""

    image: Image
    column: Any
    row: Any

    def component(self, c: int, machine: Machine) -> Number:
        """Return a channel; the pixel must be within the image."""
        if type(c) is not int or not 0 <= c < self.image.channels:
            raise Wrong(f"image {self.image.name} has no channel {c}")
        for at, size in zip((self.column, self.row), self.image.size, strict=True):
            values = at.values if isinstance(at, Place) else np.full(size.lanes.count, at)
            if (((values < 0) | (values >= size.values)) & machine.running).any():
                raise Wrong(f"image {self.image.name} is read beyond its ends")
        place = times(plus(times(self.row, self.image.size[0]), self.column), self.image.channels)
        return self.image.load(plus(place, c), 1, machine)


class Weights:
    """The weights, as a buffer; a texture of them has rows of `TEXELS`. Of `spectra` no sums are made."""

    TEXELS, kind = 1024, "float32"

    def __init__(self, numbers: Number, spectra: range = range(0)) -> None:
        self.numbers, self.spectra, self.size = numbers, spectra, int(numbers.value.shape[2])

    def load(self, offset: Any, width: int, machine: Machine) -> Number:
        """Return numbers of the file."""
        if not isinstance(offset, int) or not 0 <= offset <= self.size - width:
            raise Wrong(f"the weights are read at {offset}: there are {self.size}")
        part = slice(offset, offset + width) if width > 1 else offset
        weight = offset + width <= self.spectra.start or offset >= self.spectra.stop
        return Number(self.numbers.value[..., part], self.numbers.known[..., part], weight=weight)

    def store(self, *given: Any) -> None:
        """Refuse."""
        raise Wrong("the weights are written")


class Result:
    """The picture that a text writes: its own pixels, with what the claim says, and all of them."""

    kind = "float32"

    def __init__(self, claim: Claim, channels: int) -> None:
        self.claim, self.channels = claim, channels
        self.written = np.zeros((len(claim.outputs), channels, claim.lanes.count), dtype=bool)

    def store(self, offset: Any, width: int, value: Any, machine: Machine) -> None:
        """Check numbers that are written."""
        for k in range(width):
            self._one(plus(offset, k), part_of(value, k if width > 1 else None), machine)

    def load(self, *given: Any) -> None:
        """Refuse."""
        raise Wrong("the result is read")

    def _one(self, offset: Any, value: Any, machine: Machine) -> None:
        lanes, stride = self.claim.lanes, self.claim.stride
        x, width, y, height = lanes.x, lanes.known[1], lanes.y, lanes.known[3]
        running = machine.running
        if not running.any():
            return
        values = offset.values if isinstance(offset, Place) else np.full(len(x), offset)
        at, row = values - (y * width + x) * self.channels, 0
        if self.claim.rows > 1:  # a row's columns are below the width, or written beyond the picture
            rows, at = np.divmod(at, width * self.channels)
            row = int(rows[running][0])
            at = np.where(rows == row, at, -1)
        found = set(at[running].tolist())
        column, channel = divmod(found.pop(), self.channels)
        pixel = column // stride
        if found or column % stride or not (0 <= pixel < self.claim.pixels and 0 <= row < self.claim.rows):
            raise Wrong("it writes a result that is not its own")
        if ((x + column >= width) | (y + row >= height))[running].any():
            raise Wrong("it writes a result beyond the picture")
        pixel += row * self.claim.pixels
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
            row, column = divmod(pixel, self.claim.pixels)
            if not written[:, (x + column * stride < width) & (y + row < height)].all():
                raise Wrong("it leaves a pixel without a result")
