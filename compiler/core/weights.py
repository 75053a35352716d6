"""The weights of a kernel: all parameters but tables, in an order that is a schedule's [schedules.py]."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

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
