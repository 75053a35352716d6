"""How large a kernel is: the bytes of an item's arrays, and the bytes that a group shares."""

from __future__ import annotations

from collections.abc import Mapping

from .kernel import BATCH, BYTES, Array, Expr, Kernel, const, expr, substituted, walk
from .kernel import integer as integer


def of_tile(kernel: Kernel, count: Expr | int, tiles: int = 1) -> int:
    """Return an integer that the kernel's constants determine, and the number of tiles of a batch."""
    return integer(kernel, substituted(expr(count), {BATCH[1]: const(tiles)}))


def handed_on(kernel: Kernel) -> Mapping[str, int]:
    """Return the numbers of a tile that launches hand on, by array."""
    arrays = [s for s in kernel.body if isinstance(s, Array) and s.space == "device"]
    return {s.name: s.type.lanes * of_tile(kernel, s.sizes[0]) for s in arrays}


def bytes_of(kernel: Kernel, array: Array) -> int:
    """Return the bytes of an array."""
    count = BYTES[array.type.dtype] * array.type.lanes
    for size in array.sizes:
        count *= integer(kernel, size)
    return count


def item_bytes(kernel: Kernel) -> int:
    """Return the bytes of an item's arrays in memory; those in registers, and single values, do not count."""
    arrays = [s for s in walk(kernel.body) if isinstance(s, Array) and s.space == "item"]
    held = [s for s in arrays if not s.register and (s.sizes or s.type.lanes > 1)]
    return sum(bytes_of(kernel, s) for s in held)


def shared_bytes(kernel: Kernel) -> int:
    """Return the bytes that a group shares."""
    return sum(bytes_of(kernel, s) for s in walk(kernel.body) if isinstance(s, Array) and s.space == "group")
