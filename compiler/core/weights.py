"""The weights of a kernel: all parameters but tables, one after another in one array of float32.

Matrices are stored input-major, (D_in, D_out) in C order: the inner loops of a kernel run over the neurons
that one input feeds, and so walk through memory.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .ir import Program


@dataclass(frozen=True)
class Slot:
    """Where a parameter is: `shape` as it is stored, `offset` in floats."""

    name: str
    shape: tuple[int, ...]
    offset: int


def weights(program: Program) -> Mapping[str, NDArray[Any]]:
    """Return the parameters that are weights; the others are tables, which are in the source."""
    found = tables(program)
    return {name: array for name, array in program.parameters.items() if name not in found}


def tables(program: Program) -> Mapping[str, NDArray[Any]]:
    """Return the parameters that look-ups read, in the order in which the program holds them."""
    read = {node.get(key) for node in program.nodes for key in ("table", "first", "skip")}
    return {name: array for name, array in program.parameters.items() if name in read}


def layout(program: Program) -> Mapping[str, Slot]:
    """Return the slot of each weight, in the order in which the program holds them."""
    slots: dict[str, Slot] = {}
    offset = 0
    for name, array in weights(program).items():
        slots[name] = Slot(name, array.shape[::-1], offset)
        offset += array.size
    return slots


def pack(program: Program) -> NDArray[np.float32]:
    """Return the weights (count,) as `layout` places them."""
    pieces = [np.ravel(array.T) for array in weights(program).values()]
    return np.concatenate(pieces, dtype=np.float32) if pieces else np.zeros(0, np.float32)
