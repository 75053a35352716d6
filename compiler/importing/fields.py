"""Linear functions of values on pixels: what convolutions, matrices, sums and scales make of a picture.

1. A field has, at each pixel, C channels; each is a constant and a sum of multiples of channels of other
   values at this pixel and around it [`Field`]. Values are numbered: images, and what activations return.
2. Linear operators on fields are products and sums of matrices, in float64 [`convolved`, `added`].
3. `layout` says what the axes of the operator's tensor are; transposes change nothing else.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

Place = tuple[int, int, int]
"""A value's number, and the rows and columns from the pixel to where it is read."""

CHANNEL, ROWS, COLUMNS = "C", "H", "W"
"""Labels of axes; all others have one element, or pixels of which no operator reads neighbours."""


@dataclass(frozen=True)
class Field:
    """constant (C,) + the sum over places of terms[place] (C, C of the value) times the value there.

    All of it is to be multiplied by `scale`, which a sine keeps as a factor of its own. The field has
    `grown` rows and columns more than the picture. `loose`: which pixels are neighbours is not known.
    """

    constant: Array
    terms: Mapping[Place, Array]
    layout: tuple[str, ...]
    grown: tuple[int, int] = (0, 0)
    scale: float = 1.0
    loose: bool = False

    @property
    def channels(self) -> int:
        """Return the number of channels."""
        return len(self.constant)

    @property
    def axis(self) -> int:
        """Return the axis of the channels."""
        return self.layout.index(CHANNEL)

    def mapped(self, matrix: Array, constant: Any = 0.0) -> Field:
        """Return matrix (D, C) times this field, plus a constant (D,)."""
        held = self.folded()
        terms = {place: matrix @ term for place, term in held.terms.items()}
        return replace(held, constant=matrix @ held.constant + constant, terms=terms)

    def folded(self) -> Field:
        """Return the same function without a scale."""
        if self.scale == 1.0:
            return self
        terms = {place: self.scale * term for place, term in self.terms.items()}
        return replace(self, constant=self.scale * self.constant, terms=terms, scale=1.0)

    def moved(self, rows: int, columns: int, grown: tuple[int, int]) -> Field:
        """Return the field read so many rows and columns further on, grown by that much more."""
        terms = {(value, dy + rows, dx + columns): term for (value, dy, dx), term in self.terms.items()}
        size = (self.grown[0] + grown[0], self.grown[1] + grown[1])
        return replace(self, terms=terms, grown=size)

    def picked(self, channels: Any) -> Field:
        """Return some channels."""
        terms = {place: term[channels] for place, term in self.terms.items()}
        return replace(self, constant=self.constant[channels], terms=terms)


def identity(value: int, channels: int, like: Field | None = None, layout: tuple[str, ...] = ()) -> Field:
    """Return the field that is a value itself, on the pixels of another field."""
    found = Field(np.zeros(channels), {(value, 0, 0): np.eye(channels)}, layout)
    if like is None:
        return found
    return replace(found, layout=like.layout, grown=like.grown, loose=like.loose)


def added(a: Field, b: Field) -> Field:
    """Return the sum of two fields of one size."""
    a, b = a.folded(), b.folded()
    terms = dict(a.terms)
    for place, term in b.terms.items():
        terms[place] = terms[place] + term if place in terms else term
    return replace(a, constant=a.constant + b.constant, terms=terms, loose=a.loose or b.loose)


def convolved(x: Field, weight: Array, bias: Array, before: tuple[int, int], step: tuple[int, int]) -> Field:
    """Return the convolution with weight (D, C, K, L) of a field that has `before` margins above and left.

    `step`: the dilation. The size is that of the field less the window's, without any margin.
    """
    x = x.folded()
    terms: dict[Place, Array] = {}
    rows, columns = weight.shape[2:]
    for i in range(rows):
        for j in range(columns):
            for (value, dy, dx), term in x.terms.items():
                place = (value, dy + i * step[0] - before[0], dx + j * step[1] - before[1])
                part = weight[:, :, i, j] @ term
                terms[place] = terms[place] + part if place in terms else part
    grown = (x.grown[0] - (rows - 1) * step[0], x.grown[1] - (columns - 1) * step[1])
    constant = weight.sum(axis=(2, 3)) @ x.constant + bias
    return replace(x, constant=constant, terms=terms, grown=grown)
