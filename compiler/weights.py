"""The weights of a kernel: all parameters one after another in one array of float32.

Matrices are stored input-major, (D_in, D_out) in C order: the inner loops of a kernel run over the neurons
that one input feeds, and so walk through memory.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .ir import Program


@dataclass(frozen=True)
class Slot:
    """Where a parameter lies: `shape` as it is stored, `offset` in floats."""

    name: str
    shape: tuple[int, ...]
    offset: int


def layout(program: Program) -> Mapping[str, Slot]:
    """Return the slot of each parameter, in the order in which the program holds them."""
    slots: dict[str, Slot] = {}
    offset = 0
    for name, array in program.parameters.items():
        slots[name] = Slot(name, array.shape[::-1], offset)
        offset += array.size
    return slots


def pack(program: Program) -> NDArray[np.float32]:
    """Return the parameters (count,) as `layout` places them."""
    pieces = [np.ravel(array.T) for array in program.parameters.values()]
    return np.concatenate(pieces, dtype=np.float32) if pieces else np.zeros(0, np.float32)
