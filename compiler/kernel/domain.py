"""What a kernel's floats are while it runs in NumPy [run.py]: float32 values, or other things that add up.

Indices, integers and booleans are the same in every domain. A domain sees each operation that reads or
makes a float, so that it may count roundings, or compute in a prime field.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from ..core.ops import OPS
from .kernel import Expr

STORED: dict[str, DTypeLike] = {
    "int32": np.int32, "uint32": np.uint32, "bool": np.bool_, "uint8": np.uint8, "int8": np.int8,
}  # fmt: skip
"""How NumPy stores a value of each kind but floats."""


class Domain:
    """Float32, rounded after every operation by the definitions of core/ops.py; nothing is fused."""

    dtype: DTypeLike = np.float32

    def lift(self, values: Any) -> NDArray[Any]:
        """Return float32 values as elements of the domain."""
        return np.asarray(values, np.float32)

    def apply(self, operation: Expr, args: list[Any]) -> Any:
        """Return the result of an operation; its arguments and itself may be vectors (lanes, items)."""
        definition = OPS[operation.op].definition
        if operation.op == "convert":
            return (
                converted(definition(args[0], dtype=self.dtype), operation)
                if _is_float(operation)
                else (converted(args[0], operation))
            )
        return definition(*args)

    def cast(self, operation: Expr, args: list[Any]) -> Any:
        """Return the same bits as a value of another kind."""
        kinds = {**STORED, "float32": self.dtype}
        source = np.asarray(args[0]).astype(kinds[operation.args[0].type.dtype])
        return computed(np.ascontiguousarray(source).view(kinds[operation.type.dtype]).reshape(source.shape))


def _is_float(value: Expr) -> bool:
    """Return whether an expression is a float, or several."""
    return value.type.dtype == "float32"


def converted(value: Any, operation: Expr) -> Any:
    """Return a value as one of the kind that a conversion names."""
    return value if _is_float(operation) else computed(np.asarray(value).astype(STORED[operation.type.dtype]))


def computed(value: NDArray[Any]) -> Any:
    """Return stored values as expressions compute with them: signed integers exactly, in 64 bits."""
    return value.astype(np.int64) if value.dtype.kind in "iu" and value.dtype != np.uint32 else value
