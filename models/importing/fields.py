"""Linear functions of values on pixels: what convolutions, matrices, sums and scales make of an image.

1. A field has, at each pixel, C channels; each is a constant and a sum of multiples of channels of other
   values at this pixel and around it [`Field`]. Values are numbered: images, and what activations return.
2. Linear operators on fields are products and sums of matrices, in float64 [`convolved`, `added`, `joined`].
3. `layout` says what the axes of the operator's tensor are, so that Transpose and Reshape move labels only.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

Place = tuple[int, int, int]
"""A value's number, and the rows and columns from the pixel to where it is read."""

BATCH, POINTS, CHANNEL, ROWS, COLUMNS = "NPCHW"
"""Labels: a batch of several images, rows of values (N, D), channels, rows and columns. An axis has the label
of each axis of an input that is merged in it, in row-major order: "HW" is all pixels, "" is one element."""

PLACE_NUMBERS = 2**5
"""What a place takes in memory beside its matrix, in numbers of float64."""


@dataclass(frozen=True)
class Field:
    """constant (C,) + the sum over places of terms[place] (C, C of the value) times the value there.

    All of it is to be multiplied by `scale`, which a sine keeps as a separate factor. A single channel has
    no label. The field has `grown` rows and columns more than the image. `edges`: so many rows above, columns
    left, rows below and columns right differ from the graph's. `integer`: the graph computes it in integers.
    """

    constant: Array
    terms: Mapping[Place, Array]
    layout: tuple[str, ...]
    grown: tuple[int, int] = (0, 0)
    scale: float = 1.0
    edges: tuple[int, ...] = (0, 0, 0, 0)
    integer: bool = False

    @property
    def channels(self) -> int:
        """Return the number of channels."""
        return len(self.constant)

    @property
    def shown(self) -> str:
        """Return the axes as a message shows them."""
        return ", ".join({"": "1", POINTS: "N"}.get(labels, labels) for labels in self.layout)

    @property
    def numbers(self) -> int:
        """Return what the field takes in memory, in numbers of float64."""
        return self.channels + sum(term.size + PLACE_NUMBERS for term in self.terms.values())

    def has_channels(self, axis: int) -> bool:
        """Return whether an axis is that of the channels: of a single one, any axis of one element."""
        return self.layout[axis] == ("" if self.channels == 1 else CHANNEL)

    def labelled(self, axis: int) -> Field:
        """Return the field with its channels on an axis: their number has changed."""
        label = "" if self.channels == 1 else CHANNEL
        return replace(self, layout=(*self.layout[:axis], label, *self.layout[axis + 1 :]))

    def mapped(self, matrix: Array, constant: Any = 0.0) -> Field:
        """Return matrix (D, C) times this field, plus a constant (D,)."""
        x = self.folded()
        terms = {place: matrix @ term for place, term in x.terms.items()}
        return replace(x, constant=matrix @ x.constant + constant, terms=terms)

    def scaled(self, factors: Any, constant: Any = 0.0) -> Field:
        """Return the field times one factor, or one for each channel (C,), plus a constant."""
        column = np.reshape(factors, (-1, 1))
        terms = {place: column * term for place, term in self.terms.items()}
        return replace(self, constant=factors * self.constant + constant, terms=terms)

    def folded(self) -> Field:
        """Return the same function without a scale."""
        return self if self.scale == 1.0 else replace(self.scaled(self.scale), scale=1.0)

    def moved(self, rows: int, columns: int, grown: tuple[int, int]) -> Field:
        """Return the field read so many rows and columns further on, grown by that much more."""
        terms = {(value, dy + rows, dx + columns): term for (value, dy, dx), term in self.terms.items()}
        size = (self.grown[0] + grown[0], self.grown[1] + grown[1])
        return replace(self, terms=terms, grown=size)

    def picked(self, channels: Any) -> Field:
        """Return some channels."""
        terms = {place: term[channels] for place, term in self.terms.items()}
        return replace(self, constant=self.constant[channels], terms=terms)


def identity(value: int, channels: int, like: Field) -> Field:
    """Return the field that is a value itself, on the pixels of another field."""
    return replace(like, constant=np.zeros(channels), terms={(value, 0, 0): np.eye(channels)}, scale=1.0)


def added(a: Field, b: Field) -> Field:
    """Return the sum of two fields of one size."""
    a, b = a.folded(), b.folded()
    terms = dict(a.terms)
    for place, term in b.terms.items():
        terms[place] = terms[place] + term if place in terms else term
    return replace(a, constant=a.constant + b.constant, terms=terms, edges=_worst((a, b)))


def _worst(fields: Sequence[Field]) -> tuple[int, ...]:
    """Return the most rows and columns at each side that differ in any field."""
    return tuple(map(max, zip(*(field.edges for field in fields), strict=True)))


def joined(fields: Sequence[Field]) -> Field:
    """Return the channels of fields of one size, those of the first one first."""
    fields = [field.folded() for field in fields]
    total, start = sum(field.channels for field in fields), 0
    terms: dict[Place, Array] = {}
    for field in fields:
        for place, term in field.terms.items():
            if place not in terms:
                terms[place] = np.zeros((total, term.shape[1]))
            terms[place][start : start + field.channels] = term
        start += field.channels
    constant = np.concatenate([field.constant for field in fields])
    return replace(fields[0], constant=constant, terms=terms, edges=_worst(fields))


def convolved(x: Field, weight: Array, bias: Array, step: tuple[int, int]) -> Field:
    """Return the convolution with weight (D, C, K, L) of a field, whose size shrinks by the window's.

    `step`: the dilation.
    """
    x = x.folded()
    terms: dict[Place, Array] = {}
    rows, columns = weight.shape[2:]
    for i in range(rows):
        for j in range(columns):
            for (value, dy, dx), term in x.terms.items():
                place = (value, dy + i * step[0], dx + j * step[1])
                part = weight[:, :, i, j] @ term
                terms[place] = terms[place] + part if place in terms else part
    constant = weight.sum(axis=(2, 3)) @ x.constant + bias
    grown = (x.grown[0] - (rows - 1) * step[0], x.grown[1] - (columns - 1) * step[1])
    return replace(x, constant=constant, terms=terms, grown=grown)
