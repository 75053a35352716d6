"""OpenCL C 1.2 for path kernels: several paths in a work item on CPUs, in vectors; one on GPUs.

`min` and `max` are single instructions where `fmin` and `fmax`, which must treat NaN, are three. A boolean
in a vector is an integer with all bits set, or none.

Vectors use operators in place of `min`, `max` and `fabs`, with the same values, and clang's builtins for
others [`OpenCL.vector_operations`]: PoCL's library may be compiled for another processor than the kernel,
LLVM then inlines none of its functions, and each call saves all vector registers. With the functions the
mini cubes took twice the time.
"""

from __future__ import annotations

from ..kernel.instructions import BUILTINS
from .opencl import OpenCL

LANES = (1, 4, 8, 16)
"""Numbers of paths that a work item follows at once."""


class OpenCLPath(OpenCL):
    """The dialect's table for one path in a work item."""

    operations = {
        **OpenCL.operations,
        "minimum": "min({0}, {1})",
        "maximum": "max({0}, {1})",
    }


class OpenCLVectorPath(OpenCLPath):
    """The dialect's table for 4, 8 or 16 paths in a work item."""

    splatted = "({type})({value})"

    def __init__(self, lanes: int) -> None:
        kinds = {"float32": "float", "int32": "int", "uint32": "uint", "bool": "int"}
        self.lanes = lanes
        self.types = {kind: f"{name}{lanes}" for kind, name in kinds.items()}
        self.operations = {
            **{name: text for name, text in OpenCL.operations.items() if "." not in name},
            **OpenCL.vector_operations,
        }
        self.helpers = dict.fromkeys(("floor", "convert"), BUILTINS)


def of_lanes(lanes: int) -> OpenCLPath:
    """Return the dialect for a number of paths in a work item."""
    return OpenCLPath() if lanes == 1 else OpenCLVectorPath(lanes)
