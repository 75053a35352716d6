"""What a text must compute: a certificate's program, run on the numbers of field.py.

An affine map is known by the value of its sum. Where the certificate's bound rests on partial sums
[spec/profiles.md, PRO-6b], each of these is known as well, and a number of its own replaces it: a text that
does not add up these parts finds no sum of the whole. A sum that has been found is a number of the program
from there on [`Claim.added`]; all other operations must be those of the program, in its order.
"""

from __future__ import annotations

import base64
import re
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..proof.evidence import INTEGERS, NODE, places
from ..proof.sine_checker import sine
from . import words
from .field import (
    Number,
    P,
    Words,
    choice,
    difference,
    drawn,
    expression,
    hashed,
    leaf,
    literal,
    product,
    total,
)
from .lanes import Lanes, Unread
from .memory import Weights
from .spectra import Tiles
from .terms import Fold

COMMUTE = ("minimum", "maximum", "bitwise_and", "bitwise_xor", "bitwise_or")
"""Operations whose operands may be exchanged, sums and products apart."""

OPERATIONS: dict[str, Callable[[Number, Number], Number]] = {
    "multiply": product, "add": total, "subtract": difference,
    **{name: partial(expression, name, commutes=True) for name in COMMUTE},
    **{name: partial(expression, name) for name in ("right_shift", "left_shift")},
}  # fmt: skip
"""Operations of a program's text, in addition to affine maps, sines, constants and conversions."""


class Traced(np.lib.mixins.NDArrayOperatorsMixin):
    """A number that the reference's sine is called with."""

    def __init__(self, number: Number) -> None:
        self.number = number

    def __array_ufunc__(self, ufunc: Any, method: str, *given: Any) -> Any:
        a = [one.number if isinstance(one, Traced) else literal(float(one), "float32") for one in given]
        name = ufunc.__name__
        if name in OPERATIONS:
            return Traced(OPERATIONS[name](*a))
        if name == "less_equal":
            found = expression(name, *a, kind="bool")
            return Traced(Number(found.given, found.shape, "bool", compared=(a[0], a[1])))
        return Traced(expression(name, *a))

    def __array_function__(self, function: Any, types: Any, given: Any, named: Any) -> Any:
        return Traced(choice(*(one.number for one in given)))


class Claim:
    """The program of a certificate, for each of the `pixels` of every lane; `outputs` has what these are.

    A lane's pixels are `stride` columns apart; of `tiles` they are those of `rows` rows too, all at once, in
    `slots` [terms.py]: `expected` has the shapes (slots, pixels, channels) of what these are.
    """

    def __init__(
        self,
        held: Any,
        manifest: Any,
        raw: Any,
        lanes: Lanes,
        pixels: int,
        stride: int = 1,
        tiles: Tiles | None = None,
        slots: int = 1,
    ) -> None:
        self.text, self.lanes, self.pixels, self.stride = str(held["program"]), lanes, pixels, stride
        self.parameters, self.tiles, self.rows = held["parameters"], tiles, tiles.rows if tiles else 1
        self.exact = held["schema"] == INTEGERS
        self.sine = self._sine(held)
        self.stated = words.stated(held)
        self.ranges = words.Ranges(held, self.stated)
        self.weights: Any = words.Stored(raw) if self.stated else self._memory(raw)
        self.tables: list[tuple[str, str]] = []
        self.first: dict[int, int] = {}
        self.found: set[int] = set()
        self.images = re.findall(r"(?m)^  image (\w+): (\d+) ", self.text)
        (self.window,) = re.findall(r"(?m)^  window (\d+)x(\d+), border (\w+)$", self.text)
        self.centre = int(manifest["window"]["centre"])
        self.together, self.outputs = 1, []
        if tiles:
            self.fold = Fold((lanes.x < lanes.known[1]) & (lanes.y < lanes.known[3]), slots)
            self.together = pixels * self.rows * slots
            self.expected = self._pixel(0).known.reshape(slots, pixels * self.rows, -1)
        else:
            self.outputs = [self._pixel(p * stride) for p in range(pixels)]

    def _sine(self, held: Any) -> Any:
        """Return the sine that the certificate promises, as the spec defines it."""
        promise = (held.get("sine") or {}).get("text", "")
        degree = re.fullmatch(r"emitted, odd polynomial of degree (\d+)", promise)
        return partial(sine, degree=int(degree[1])) if degree else None

    # ---- inputs --------------------------------------------------------------------------------------------

    def _memory(self, raw: NDArray[np.float32]) -> Weights:
        return Weights(self._weights(raw), self.tiles.range if self.tiles else range(0))

    def _weights(self, raw: NDArray[np.float32]) -> Number:
        """Return all weights (2, 1, n) of the file: those of the program as unknowns, others as they are."""
        shape = hashed("weight", np.arange(len(raw)))
        value = drawn(shape)
        owned = np.zeros(len(raw), dtype=bool)
        for name, place in self.parameters.items():
            if "base64" in place:
                if self.tiles is None:
                    raise Unread("weights that the file does not hold")
                continue
            owned[places(name, place, len(raw)).ravel()] = True
        if self.tiles:
            owned[self.tiles.owned.ravel()] = True
            owned[self.tiles.bias if self.tiles.bias is not None else []] = True
        for number in np.unique(raw[~owned]):
            same = ~owned & (raw == number)
            value[:, same] = literal(float(number), "float32").value
        return Number(value[:, None], shape[None], weight=True)

    def parameter(self, name: str) -> Number:
        """Return a parameter's numbers, (2, 1, outputs * inputs) or (2, 1, outputs)."""
        if self.stated:
            array = self.stated[name]
            return words.integers(array.ravel(), "float32", True) if array.ndim > 1 else words.floats(array)
        if "base64" in self.parameters[name]:
            if self.tiles is None:
                raise Unread("weights that the file does not hold")
            return words.floats(np.frombuffer(base64.b64decode(self.parameters[name]["base64"]), "<f4"))
        numbers = self.weights.numbers
        at = places(name, self.parameters[name], numbers.value.shape[-1]).ravel()
        return Number(numbers.value[:, :, at], numbers.known[:, at], weight=True)

    def _input(self, at: int) -> Number:
        """Return the window (2, 1, n) of a pixel of each lane: tap by tap, all images' channels.

        It is added up over lanes: nothing but sums reads it.
        """
        return Number(np.stack([tap.term for tap in self._taps(at)], axis=-1))

    def _taps(self, at: int) -> Iterator[Number]:
        """Yield the numbers of a pixel's window in every lane."""
        lanes, nothing = self.lanes, literal(0.0, "float32")
        _, width, _, height = lanes.known
        for dy in range(int(self.window[0])):
            for dx in range(int(self.window[1])):
                column, row = lanes.x + at + dx - self.centre, lanes.y + dy - self.centre
                pixel = np.clip(row, 0, height - 1) * width + np.clip(column, 0, width - 1)
                inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
                for name, channels in self.images:
                    for c in range(int(channels)):
                        number = leaf(hashed(f"image {name}", pixel * int(channels) + c))
                        if self.window[2] == "zero":
                            value = np.where(inside, number.value, nothing.value)
                            number = Number(value, np.where(inside, number.known, nothing.known))
                        yield number

    # ---- the program ---------------------------------------------------------------------------------------

    def _pixel(self, pixel: int) -> Number:
        """Return the outputs of a pixel of each lane, and make a table of its sums."""
        values: dict[str, Any] = {}
        for m in filter(None, map(NODE.fullmatch, self.text.splitlines())):
            number, op, named = m[1], m[2], dict(p.split("=") for p in (m[4] or "").split(", ") if p)
            given = [values[i] for i in re.findall(r"%(\d+)", m[3])]
            kind = m[0].rpartition(" : ")[2].partition("[")[0]
            if op == "input":
                values[number] = None if self.tiles else self._input(pixel)  # which only spectra read
            elif op == "affine":
                self.ranges.note(re.findall(r"%(\d+)", m[3])[0], given[0])
                values[number] = self._affine(number, given[0], named, is_window=values["0"] is given[0])
            elif op == "constant":
                values[number] = literal(float(named["value"]), kind)
            elif op == "parameter":
                values[number] = self._each(self.parameter(named["name"]))
            elif op == "convert":
                values[number] = (
                    expression("convert", given[0], kind=kind) if given[0].kind != kind else given[0]
                )
            elif op == "sin" and self.sine:
                values[number] = self.sine(Traced(given[0])).number
            elif op in OPERATIONS:
                values[number] = OPERATIONS[op](*given)
            else:
                raise Unread(f"operation {op} of %{number}")
        (output,) = re.findall(r"(?m)^  output \w+ = %(\d+)$", self.text)
        found: Number = values[output]
        return found

    def _affine(self, node: str, given: Number, named: Any, is_window: bool) -> Number:
        """Return W x + b, and note its value and those of its parts."""
        if is_window and self.tiles:
            return self._from_spectra(node, "bias" in named)
        weight = self.parameter(named["weight"])
        outputs = self.parameters[named["weight"]]["shape"][0]
        matrix = weight.value[:, 0].reshape(2, outputs, -1)
        whole: Any = np.zeros((2, 1, 1), dtype=np.uint64)
        parts = self._parts(matrix.shape[2]) if is_window and not self.exact else []
        terms = (given.term % P).reshape(2, -1, matrix.shape[2])
        for name, part in parts if len(parts) > 1 else []:
            own = dot(terms[..., part], matrix[..., part])
            self._note(own, "part", f"the sum of %{node} over {name}")
            whole = (whole + renamed(own)) % P
        if len(parts) < 2:
            whole = dot(terms, matrix)
        if "bias" in named:
            whole = (whole + self.parameter(named["bias"]).term) % P
        whole = whole.reshape(2, -1, self.together * outputs)
        self._note(whole, "sum", f"the sums of %{node}")
        return self._number(whole)

    def _each(self, number: Number) -> Number:
        """Return a number of every pixel (2, 1, n) as those of all that are computed at once."""
        if self.together == 1:
            return number
        return Number(np.tile(number.value, self.together), np.tile(number.known, self.together), weight=True)

    def _from_spectra(self, node: str, biased: bool) -> Number:
        """Return the sums of the window with their bias, all pixels': those before it are known by shape."""
        assert self.tiles is not None
        if biased != (self.tiles.bias is not None) or len(re.findall(r"= affine %0\b", self.text)) != 1:
            raise Unread("spectra of a layer that is not the only one to read the window, or of another bias")
        channels = self.tiles.channels(self.lanes, self.fold, self.images, self.centre, self.window[2])
        found = leaf(self.tiles.sums(channels))
        if not biased:
            return found
        at = self.tiles.bias
        numbers = self.weights.numbers
        bias = Number(numbers.value[:, :, at], numbers.known[:, at], weight=True)
        whole = (found.term + np.tile(bias.term, self.together)) % P
        self._note(whole, "sum", f"the sums of %{node}")
        return self._number(whole)

    def _number(self, value: Words) -> Number:
        """Return the number of the program that a sum is, in all lanes: it is known by the sum's value."""
        return Number(None, hashed("found", *value))

    def _parts(self, n: int) -> list[tuple[str, NDArray[np.intp]]]:
        """Return the partial sums of a window: of each image and row of taps."""
        counts = [int(channels) for _, channels in self.images]
        owner = np.tile(np.repeat(np.arange(len(counts)), counts), n // sum(counts))
        rows = int(self.window[0])
        row = np.repeat(np.arange(rows), n // rows)
        return [
            (f"image {name}, row {y}", np.flatnonzero((owner == i) & (row == y)))
            for i, (name, _) in enumerate(self.images)
            for y in range(rows)
        ]

    def _note(self, value: Words, kind: str, name: str) -> None:
        """Keep sums (2, 1, n), to be found by their pairs of numbers."""
        for word in _word(value).tolist():
            self.first.setdefault(word, len(self.tables))
        self.tables.append((kind, name))

    # ---- what a text has found -----------------------------------------------------------------------------

    def added(self, number: Number) -> Number:
        """Return a sum of a text: a number of the program, or a part, if it is one; else as it is."""
        if number.shape is not None:
            return number
        value = number.value % P
        words = _word(value)
        hits = [self.first.get(word) for word in words.ravel().tolist()]
        if not any(hit is not None for hit in hits):
            return number
        good = np.array([hit is not None for hit in hits]).reshape(words.shape)
        table = next(hit for hit in hits if hit is not None)
        self.found.add(table)
        if self.tables[table][0] == "part":
            return Number(np.where(good, renamed(value), value))
        return Number(None, np.where(good, self._number(value).known, hashed("sum", *value)))

    def missing(self) -> str | None:
        """Return the first sum of the program that a text has not made."""
        return next((name for k, (_, name) in enumerate(self.tables) if k not in self.found), None)


def _word(value: Words) -> Words:
    """Return both numbers of sums (2, 1, ...) as one."""
    word: Words = value[0, 0] << np.uint64(32) | value[1, 0]
    return word


def renamed(value: Words) -> Words:
    """Return the number that stands for a part in the sums that it goes into."""
    return drawn(hashed("part", *value))


def dot(given: Words, matrix: Words) -> Words:
    """Return the sums (2, lanes, m) of products of (2, lanes, n) and (2, m, n) in the field.

    Halves of 16 bits: their products, added up, stay below 2^53.
    """

    def halves(a: Words) -> list[Any]:
        return [(a & np.uint64(0xFFFF)).astype(np.float64), (a >> np.uint64(16)).astype(np.float64)]

    (a0, a1), (b0, b1) = halves(given), halves(matrix.transpose(0, 2, 1))
    sums = [(a0 @ b0), (a0 @ b1 + a1 @ b0), (a1 @ b1)]
    low, middle, high = (s.astype(np.uint64) % P for s in sums)
    shift = np.uint64(16)
    found: Words = (low + (middle << shift) % P + ((high << shift) % P << shift) % P) % P
    return found
