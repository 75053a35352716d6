"""The interpreter of the IR as an executor: all windows of a block of rows at once, in float32."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..compiler.artifact import Artifact
from ..compiler.emit import output_channels
from ..compiler.interpret import interpret
from ..refimpl import dataset
from .executor import Executor, Images, gather_of

BLOCK_NUMBERS = 2**22
"""Numbers in the windows of one block of rows: 16 MiB in float32, for images of any height."""


class NumpyExecutor(Executor):
    """Runs the program itself; there is nothing to build."""

    name = "numpy"

    def __init__(self) -> None:
        self.device = f"NumPy {np.__version__}"

    def build(self, artifact: Artifact, size: tuple[int, int] = (1, 1)) -> None:
        """Do nothing: the program is interpreted."""

    def _run(self, artifact: Artifact, images: Images) -> NDArray[np.float32]:
        gather = gather_of(artifact)
        image = np.concatenate(list(images.values()), axis=-1)
        height, width, _ = image.shape
        padded = dataset.pad(image, gather.window)
        rows = max(1, BLOCK_NUMBERS // (width * gather.n_inputs))
        result = np.empty((height, width, output_channels(artifact.program)), np.float32)
        for top in range(0, height, rows):
            bottom = min(top + rows, height)
            # These rows and the margin around them are all that their pixels see.
            windows = dataset.all_windows(padded[top : bottom + gather.window.size - 1], gather.window)
            (value,) = interpret(artifact.program, {"window": windows}).values()
            result[top:bottom] = np.reshape(value, (bottom - top, width, -1)) if np.ndim(value) > 1 else value
        return result
