"""What a kernel may write for given images: the reference's picture, and how far each number may be from it.

1. The reference is the program in float64, with the weights that the artifact's profile has [`analysed`] and
   the images as they are; the bound is that of the artifact's schedule at these images: a-posteriori.
2. Both are computed for a block of rows at a time: all windows of a picture fill the memory [`expected`].
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..refimpl.errors import CompileError
from . import bounds, schedules
from .artifact import Artifact
from .compile import analysed, schedule_named, sine_contract
from .emit import kernel_gather
from .interpret import interpret
from .ir import Program

BLOCK_NUMBERS = 2**20
"""Numbers in the windows of one block of rows: a bound holds some copies of them, 8 MiB each."""


@dataclass(frozen=True)
class Expected:
    """The reference's picture (H, W, C) in float64, and the most that a kernel may be off (H, W, C)."""

    value: NDArray[np.float64]
    bound: NDArray[np.float64]


def expected(program: Program, artifact: Artifact, images: Mapping[str, NDArray[np.float32]]) -> Expected:
    """Return what the artifact of a program may write for images (H, W, C); without a promise, any number."""
    if artifact.before is not None:
        raise CompileError("a kernel of two passes is compared by factor.at_images; compile without a rank")
    common = analysed(program, artifact.profile)
    contract = sine_contract(artifact.profile, artifact.target)
    schedule = schedule_named(artifact.target, artifact.manifest["schedule"]["name"])
    height, width = next(iter(images.values())).shape[:2]
    rows = max(1, BLOCK_NUMBERS // (width * kernel_gather(program).n_inputs))
    values, errors = [], []
    for top in range(0, height, rows):
        block = slice(top, min(top + rows, height))
        windows = schedules.windows(kernel_gather(program), images, block)
        (value,) = interpret(replace(common, exact=False), {"window": windows}, np.float64).values()
        enclosed = schedule.enclosures(common, contract, images, block)
        (error,) = bounds.output_errors(common, enclosed).values()
        values.append(_per_pixel(value, windows.shape[:2]))
        errors.append(np.broadcast_to(_per_pixel(error, windows.shape[:2]), values[-1].shape))
    return Expected(np.concatenate(values), np.concatenate(errors))


def _per_pixel(array: Any, size: tuple[int, ...]) -> NDArray[np.float64]:
    """Return (H, W, C) of an array that may lack the last axis, or all but it (constants)."""
    if np.ndim(array) < len(size):
        array = np.broadcast_to(np.atleast_1d(array), (*size, np.size(array)))
    found: NDArray[np.float64] = np.reshape(array, (*size, -1))
    return found
