"""The layout of a training kernel's numbers: whole vectors of 16, so that a processor reads them at once.

1. A matrix is stored input-major, (D_in, D_out), as denoisers store it (weights.py); its rows are filled up
   with zeros to whole vectors. A vector is a matrix of one row [`Slot`].
2. All trained parameters follow one another; moments and sums are laid out alike [`slots`]. A matrix whose
   factors are trained is among them: it has no moments, and the factors' sums are made from its sums.
   Transposed matrices are kept beside them in an order of their own [`transposed_slots`].
3. Zeros that fill up stay zeros: sums write zeros there, and Adam leaves what has no gradient (ADM-4).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..core.ir import Program
from ..core.passes.gradient import TRANSPOSED
from .step import SQUARES, Step

LANES = 16
"""Numbers in a vector: the longest vectors that OpenCL has, one AVX-512 register, two of AVX2."""


@dataclass(frozen=True)
class Slot:
    """`rows` of `width` numbers, each in whole vectors, from vector `offset` on."""

    name: str
    rows: int
    width: int
    offset: int

    @property
    def vectors(self) -> int:
        """Return the vectors of a row."""
        return vectors_for(self.width)

    @property
    def end(self) -> int:
        """Return the vector after the last."""
        return self.offset + self.rows * self.vectors


def vectors_for(width: int) -> int:
    """Return how many vectors hold `width` numbers."""
    return -(-width // LANES)


def slots(step: Step) -> Mapping[str, Slot]:
    """Return the slots of the parameters with derivatives, then of factors, then of the squared errors."""
    found = _placed(step.program, step.trained)
    end = max(slot.end for slot in found.values())
    if step.split is not None:
        split, (vertical, horizontal) = step.split, step.split.factors
        n_out, n_in = step.program.parameters[split.parameter].shape
        found[vertical] = Slot(vertical, split.size * split.rank, n_out, end)
        found[horizontal] = Slot(horizontal, n_in // split.size, split.rank, found[vertical].end)
        end = found[horizontal].end
    width = step.program.nodes[dict(step.program.outputs)[SQUARES]].type.shape[0]
    return {**found, SQUARES: Slot(SQUARES, 1, width, end)}


def transposed_slots(step: Step) -> Mapping[str, Slot]:
    """Return the slots of the transposed matrices."""
    return _placed(step.program, [name for name in step.program.parameters if name.endswith(TRANSPOSED)])


def _placed(program: Program, names: Iterable[str]) -> dict[str, Slot]:
    """Return slots for parameters, one after another."""
    found: dict[str, Slot] = {}
    offset = 0
    for name in names:
        width, *inputs = program.parameters[name].shape
        found[name] = Slot(name, inputs[0] if inputs else 1, width, offset)
        offset = found[name].end
    return found


def pack(places: Mapping[str, Slot], arrays: Mapping[str, NDArray[Any]]) -> NDArray[np.float32]:
    """Return arrays (D_out, D_in) or (D_out,), by name, as their slots lay them out."""
    vectors = np.zeros((max((places[name].end for name in arrays), default=0), LANES), np.float32)
    for name, array in arrays.items():
        _rows(vectors, places[name])[:] = array.T
    return vectors.reshape(-1)


def unpack(places: Mapping[str, Slot], numbers: NDArray[np.float32]) -> dict[str, NDArray[np.float32]]:
    """Return the arrays that lie in `numbers`, by name; a matrix of one row and a vector look alike."""
    vectors = numbers.reshape(-1, LANES)
    return {name: np.array(_rows(vectors, slot).T, order="C") for name, slot in places.items()}


def _rows(vectors: NDArray[np.float32], slot: Slot) -> NDArray[np.float32]:
    """Return the numbers of a slot without what fills up, (rows, width), as a view."""
    padded = vectors[slot.offset : slot.end].reshape(slot.rows, slot.vectors * LANES)
    return padded[:, : slot.width]
