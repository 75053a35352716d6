"""What a text must compute: a certificate's program, run on the numbers of field.py.

An affine map is known by the value of its sum. Where the certificate's bound rests on partial sums
[spec/profiles.md, PRO-6b], each of these is known as well, and a number of its own replaces it: a text that
does not add up these parts finds no sum of the whole. A sum that has been found is a number of the program
from there on [`Trial`]; all other operations must be those of the program, in its order.
"""

from __future__ import annotations

import re
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..proof.evidence import INTEGERS, inputs_of, nodes_of, parameters_of, places
from ..proof.sine_checker import sine
from .field import P, Words, drawn, hashed, literal
from .integers import Ranges, Stored, filled
from .lanes import Lanes, Unread
from .spectra import Tiles, patches
from .terms import COMMUTE, Fold, Term, applied, constant, expression, known_floats, known_integers, select

OPERATIONS = ("multiply", "add", "subtract", *COMMUTE, "right_shift", "left_shift")
"""Operations of a program's text, in addition to affine maps, sines, constants and conversions."""


class Traced(np.lib.mixins.NDArrayOperatorsMixin):
    """A number that the reference's sine is called with."""

    def __init__(self, number: Term) -> None:
        self.number = number

    def __array_ufunc__(self, ufunc: Any, method: str, *given: Any) -> Any:
        terms = [one.number if isinstance(one, Traced) else constant(float(one)) for one in given]
        return Traced(applied(ufunc.__name__, *terms))

    def __array_function__(self, function: Any, types: Any, given: Any, named: Any) -> Any:
        return Traced(select(*(one.number for one in given)))


class Claim:
    """The program of a certificate, for all pixels of every lane at once.

    A lane has `pixels` columns, `stride` apart, of `rows` rows, in `slots` [terms.py]: `expected` has the
    shapes (slots, pixels, channels) of what these are. Sums of `tiles` come from spectra.
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
        self.exact, self.count = held["schema"] == INTEGERS, len(raw)
        promise = (held.get("sine") or {}).get("text", "")
        degree = re.fullmatch(r"emitted, odd polynomial of degree (\d+)", promise)
        self.sine = partial(sine, degree=int(degree[1])) if degree else None
        self.arrays, inside = parameters_of(held, raw), ["base64" in p for p in self.parameters.values()]
        self.stated = self.exact and all(inside)
        if any(inside) and self.count and not (tiles or self.stated):
            raise Unread("weights that the file does not hold")
        self.ranges = Ranges(held, self.arrays if self.exact else {}, self.stated)
        self.spectra = tiles.range if tiles else range(0)
        self.weights: Any = Stored(raw) if self.stated else self._weights(raw)
        self.tables: list[tuple[str, str]] = []
        self.first: dict[int, int] = {}
        self.found: set[int] = set()
        self.made: set[int] = set()
        self.window, images = inputs_of(self.text)
        self.images = [(name, channels) for name, channels, *_ in images]
        # Those of the second kernel of a first layer of low rank are one (KER-15).
        self.groups = [("horizontal", sum(n for _, n in self.images))] if "factored" in held else self.images
        self.centre = int(manifest["window"]["centre"])
        own = (lanes.x < lanes.known[1]) & (lanes.y < lanes.known[3])
        self.fold = Fold(own | (lanes.inside is not None), slots)  # all items of a group compute sums
        self.together = pixels * self.rows * slots
        outputs = self._outputs().known.reshape(slots, pixels * self.rows, -1)
        self.expected = outputs[..., :-1] if self.exact else outputs

    # ---- inputs --------------------------------------------------------------------------------------------

    def _weights(self, raw: NDArray[np.float32]) -> Term:
        """Return all weights (1, n + 1) of the file, and 0: the program's as unknowns, others as they are."""
        raw = np.append(raw, np.float32(0))
        shape = hashed("weight", np.arange(len(raw)))
        value = drawn(shape)
        owned = np.zeros(len(raw), dtype=bool)
        for name, place in self.parameters.items():
            if "base64" not in place:
                owned[places(name, place, self.count).ravel()] = True
        if self.tiles:
            owned[self.tiles.owned.ravel()] = True
            owned[self.tiles.bias if self.tiles.bias is not None else []] = True
        value[:, ~owned] = drawn(literal(raw[~owned], "float32"))
        if self.exact:
            shape[~owned] = literal(raw[~owned], "float32")
        return Term(shape[None], draw=value[:, None])

    def _stored(self, at: NDArray[np.intp]) -> Term:
        """Return numbers (1, n) of the file."""
        return self.weights.each(lambda a: a[:, at], lambda a: a[:, :, at])  # type: ignore[no-any-return]

    def parameter(self, name: str) -> Term:
        """Return a parameter's numbers, (1, outputs * inputs) or (1, outputs); of integers `filled`."""
        if self.stated:
            array = filled(self.text, name, self.arrays[name])
            flat = array.ravel()[None]
            return known_integers(flat, "float32") if array.ndim > 1 else known_floats(flat)
        place = self.parameters[name]
        if "base64" in place:
            return known_floats(self.arrays[name].reshape(1, -1))
        at = places(name, place, self.count)
        if self.exact:
            at = filled(self.text, name, at.reshape(place["shape"]), self.count)
        return self._stored(at.ravel())

    def _input(self) -> Term:
        """Return the windows (1, pixels * n) of all pixels, folded: tap by tap, all images' channels."""
        # A window along one axis has one tap along the other.
        rows, columns = (np.arange(size) - self.centre * (size > 1) for size in self.window[:2])
        every = columns + self.stride * np.arange(self.pixels)[:, None]
        across = np.unique(every)
        read = patches(self.lanes, self.fold, self.images, (across, rows), self.window[2])
        taps = np.stack(list(read), axis=-1)[0][:, np.searchsorted(across, every)]
        return Term(taps.transpose(1, 0, 2, 3).reshape(1, -1))

    # ---- the program ---------------------------------------------------------------------------------------

    def _outputs(self) -> Term:
        """Return the outputs of all pixels, and make a table of their sums."""
        values: dict[str, Any] = {}
        for m in nodes_of(self.text):
            number, op, named = m[1], m[2], dict(p.split("=") for p in (m[4] or "").split(", ") if p)
            given = [values[i] for i in re.findall(r"%(\d+)", m[3])]
            kind = m[0].rpartition(" : ")[2].partition("[")[0]
            if op == "input":
                values[number] = None if self.tiles else self._input()  # which only spectra read
            elif op == "affine":
                self.ranges.note(re.findall(r"%(\d+)", m[3])[0], given[0])
                values[number] = self._affine(number, given[0], named, is_window=values["0"] is given[0])
            elif op == "constant":
                values[number] = constant(float(named["value"]), kind)
            elif op == "parameter":
                values[number] = self.parameter(named["name"]).each(
                    *[lambda a: np.tile(a, self.together)] * 2
                )
            elif op == "convert":
                same = given[0].kind == kind
                values[number] = given[0] if same else Term(expression("convert", given[0]), kind=kind)
            elif op == "sin" and self.sine:
                values[number] = self.sine(Traced(given[0])).number
            elif op in OPERATIONS:
                values[number] = applied(op, *given)
            else:
                raise Unread(f"operation {op} of %{number}")
            if kind == "int32" or (op == "convert" and kind != "float32"):
                self.made.update(values[number].known.ravel().tolist())
        (output,) = re.findall(r"(?m)^  output \w+ = %(\d+)$", self.text)
        found: Term = values[output]
        return found

    def _affine(self, node: str, given: Term, named: Any, is_window: bool) -> Term:
        """Return W x + b, and note its value and those of its parts."""
        if is_window and self.tiles:
            return self._from_spectra(node, "bias" in named)
        weight = self.parameter(named["weight"])
        outputs = self.parameters[named["weight"]]["shape"][0] + self.exact
        matrix = weight.term[:, 0].reshape(2, outputs, -1)
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
        return self._summed(node, whole)

    def _from_spectra(self, node: str, biased: bool) -> Term:
        """Return the sums of the window with their bias, all pixels': those before it are known by shape."""
        assert self.tiles is not None
        if biased != (self.tiles.bias is not None) or len(re.findall(r"= affine %0\b", self.text)) != 1:
            raise Unread("spectra of a layer that is not the only one to read the window, or of another bias")
        channels = self.tiles.channels(self.lanes, self.fold, self.images, self.centre, self.window[2])
        found = Term(self.tiles.sums(channels))
        if self.tiles.bias is None:
            return found
        bias = self._stored(self.tiles.bias)
        return self._summed(node, (found.term + np.tile(bias.term, self.together)) % P)

    def _summed(self, node: str, value: Words) -> Term:
        """Note the sums (2, pixels, n), or (2, 1, pixels * n), of a map; return the numbers that they are."""
        value = value.reshape(2, 1, -1)
        self._note(value, "sum", f"the sums of %{node}")
        return Term(np.where(value.any(axis=0), hashed("found", *value), hashed("sum", 0, 0)))

    def _parts(self, n: int) -> list[tuple[str, NDArray[np.intp]]]:
        """Return the partial sums of a window: of each image and row of taps."""
        counts = [channels for _, channels in self.groups]
        owner = np.tile(np.repeat(np.arange(len(counts)), counts), n // sum(counts))
        rows = self.window[0]
        row = np.repeat(np.arange(rows), n // rows)
        return [
            (f"image {name}, row {y}", np.flatnonzero((owner == i) & (row == y)))
            for i, (name, _) in enumerate(self.groups)
            for y in range(rows)
        ]

    def _note(self, value: Words, kind: str, name: str) -> None:
        """Keep sums of all pixels, to be found by their pairs of numbers; one of nothing is not found."""
        table = len(self.tables) * self.together
        words = word_of(value.reshape(2, self.together, -1))
        for pixel, line in enumerate(words.tolist()):
            for word in filter(None, line):
                self.first.setdefault(word, table + pixel)
        self.tables.append((kind, name))

    def missing(self) -> str | None:
        """Return the first sum of the program that a text has not made."""
        each = (name for _, name in self.tables for _ in range(self.together))
        return next((name for k, name in enumerate(each) if k not in self.found), None)


def word_of(value: Words) -> Words:
    """Return both numbers of sums (2, ...) as one."""
    word: Words = value[0] << np.uint64(32) | value[1]
    return word


def renamed(value: Words) -> Words:
    """Return the number that stands for a part in the sums that it goes into."""
    return np.where(value.any(axis=0), drawn(hashed("part", *value)), np.uint64(0))


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
