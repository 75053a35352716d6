"""The interpreters of the IR as an executor: all windows of a block of rows at once, in float32.

A network's program is interpreted, which leaves its products to NumPy; kernels of all other roles are run as
they are (compiler/kernel/run.py).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...compiler.artifact import Artifact
from ...compiler.core.interpret import interpret
from ...compiler.kernel.interface import DENOISE, IMAGE, READ, RESULT
from ...compiler.kernel.run import run_on
from ...compiler.schedules.common import kernel_gather
from ...refimpl.network.window import all_windows, pad
from .executor import Executor
from .kernel import Memory

BLOCK_NUMBERS = 2**22
"""Numbers in the windows of one block of rows: 16 MiB in float32, for images of any height."""


class NumpyExecutor(Executor):
    """Runs the program itself; there is nothing to build."""

    name = "numpy"
    interprets = True

    def __init__(self) -> None:
        super().__init__()
        self.device = f"NumPy {np.__version__}"

    def _prepare(self, kernel: Artifact) -> Any:
        """Do nothing: programs are interpreted."""

    def _start(
        self, kernel: Artifact, prepared: Any, arrays: Mapping[str, Memory], integers: Mapping[str, int]
    ) -> None:
        held = {name: memory.held for name, memory in arrays.items()}
        if kernel.role == DENOISE:
            images = [held[f"{IMAGE}{image.name}"] for image in kernel.images]
            _denoised(kernel, np.concatenate(images, axis=-1), held[RESULT])
            return
        taken = {a.name: held[a.name] for a in kernel.interface.arrays if a.access == READ}
        for name, content in run_on(kernel.kernel, taken, integers).items():
            held[name][:] = content


def _denoised(artifact: Artifact, image: NDArray[np.float32], result: NDArray[np.float32]) -> None:
    """Fill the output (H, W, C) of one kernel for its images, joined."""
    gather = kernel_gather(artifact.programs)
    height, width, _ = image.shape
    padded = pad(image, gather.window, gather.axes)
    rows = max(1, BLOCK_NUMBERS // (width * gather.n_inputs))
    for top in range(0, height, rows):
        bottom = min(top + rows, height)
        # These rows and the margin around them are all that their pixels see.
        strip = padded[top : bottom + gather.rows - 1]
        windows = all_windows(strip, gather.window, gather.axes)
        (value,) = interpret(artifact.programs, {"window": windows}).values()
        result[top:bottom] = np.reshape(value, (bottom - top, width, -1)) if np.ndim(value) > 1 else value
