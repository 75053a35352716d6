"""Promise the same bits on every target: small weights become 0, what cannot keep the promise is refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..grain import sizes
from ..ir import LEAST, Program


def pin(program: Program) -> Program:
    """Return the program as an exact one; its sines are still single operations."""
    parameters = {
        name: np.where(np.abs(array) < LEAST, array.dtype.type(0), array)
        for name, array in program.parameters.items()
    }
    pinned = replace(program, parameters=parameters, exact=True)
    sizes(pinned)
    return pinned
