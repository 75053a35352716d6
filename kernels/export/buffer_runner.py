"""What runners of kernels on numbered buffers share: sizes 0, what is read 1, what is written 2, images 3.

A language without numbers takes the same buffers in that order [host_runner.py].
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...compiler.artifact import Artifact
from ...compiler.languages.glsl_buffers import GROUP
from ...compiler.languages.interface import BLOCK, IMAGE, RESULT, SUMS, WEIGHTS, Interface
from ...compiler.scenes.encode_kernel import EncodeArtifact
from ...compiler.scenes.path_kernel import PathArtifact
from ...compiler.schedules.emit import output_channels
from ..devices.executor import Executor, Part, in_order
from ..devices.images import Images

Kernel = Artifact | PathArtifact | EncodeArtifact
"""A kernel of any role."""


@dataclass(frozen=True)
class Launch:
    """One call: `sizes` as 32-bit integers, buffers by binding, those that come back, threads (x, y).

    Threads start in whole groups (x, y), so there may be more than requested. `blocks` are the uniform blocks
    among the buffers.
    """

    sizes: Sequence[int]
    buffers: Mapping[int, NDArray[np.float32]]
    back: Sequence[int]
    threads: tuple[int, int]
    group: tuple[int, int] = GROUP
    blocks: Sequence[int] = ()

    @property
    def groups(self) -> tuple[int, int]:
        """Return the numbers of groups that hold all threads."""
        (width, height), (columns, rows) = self.threads, self.group
        return -(-width // columns), -(-height // rows)


class BufferRunner(Executor):
    """Runs denoisers, paths and encodings of one target; a subclass runs one kernel [`_launch`]."""

    @abstractmethod
    def _prepare(self, kernel: Kernel, group: tuple[int, int] | None) -> Any:
        """Return a kernel, built; `group`: the threads (x, y) that wait for each other, if any do."""

    @abstractmethod
    def _launch(self, prepared: Any, launch: Launch) -> list[NDArray[np.float32]]:
        """Run a kernel, and return the buffers that come back, flat."""

    def _kernel(self, kernel: Kernel) -> Any:
        """Return a built kernel; again costs nothing."""
        if not hasattr(self, "_kernels"):
            self._kernels: dict[str, Any] = {}
        if kernel.digest not in self._kernels:
            group = kernel.manifest.get("schedule", {}).get("group")
            shared = None if group is None else (int(group[0]), int(group[1]))
            self._kernels[kernel.digest] = self._prepare(kernel, shared)
        return self._kernels[kernel.digest]

    def build(self, artifact: Artifact, size: tuple[int, int] = (1, 1)) -> None:
        """Build the kernels."""
        for kernel in artifact.kernels:
            self._kernel(kernel)

    def _run(self, artifact: Artifact, images: Images) -> NDArray[np.float32]:
        found = list(images.values())
        for kernel in artifact.kernels:
            height, width, _ = found[0].shape
            shape = (height, width, output_channels(kernel.program))
            weights = np.pad(kernel.weights, (0, -kernel.weights.size % 4 or 4 * (not kernel.weights.size)))
            given = {RESULT: np.zeros(shape, np.float32), WEIGHTS: weights}
            read = (image.name for image in kernel.interface.images)
            given |= dict(zip(read, found, strict=True))
            numbers, buffers = _numbered(kernel.interface, given)
            picked = kernel.manifest["schedule"]
            threads, group = (-(-width // picked["pixels"]), height), picked.get("group", GROUP)
            blocks = [numbers[array.name] for array in kernel.interface.arrays if array.home == BLOCK]
            launch = Launch((width, height), buffers, (numbers[RESULT],), threads, tuple(group), blocks)
            found = [self._launch(self._kernel(kernel), launch)[0].reshape(shape)]
        return found[0]

    def build_path(self, kernel: PathArtifact) -> None:
        """Build the kernel."""
        self._kernel(kernel)

    def _trace(self, kernel: PathArtifact, part: Part) -> NDArray[np.float32]:
        shape = (len(kernel.planes), part.rows, part.width)
        sizes = [int(n) for n in in_order(kernel.interface, part.integers)]
        places, buffers = _numbered(kernel.interface, {SUMS: np.zeros(shape, np.float32)})
        launch = Launch(sizes, buffers, (places[SUMS],), (part.width, part.rows))
        return self._launch(self._kernel(kernel), launch)[0].reshape(shape)

    def _encode(self, kernel: EncodeArtifact, sums: NDArray[np.float32], samples: int) -> Images:
        _, height, width = sums.shape
        images = {i.name: np.zeros((height, width, i.channels), np.float32) for i in kernel.images}
        written = {f"{IMAGE}{name}": image for name, image in images.items()}
        numbers, buffers = _numbered(kernel.interface, {SUMS: sums, **written})
        places = [numbers[name] for name in written]
        given = {"width": width, "height": height, "sample_count": samples}
        sizes = [int(n) for n in in_order(kernel.interface, given)]
        launch = Launch(sizes, buffers, places, (width, height))
        found = self._launch(self._kernel(kernel), launch)
        return {
            name: flat.reshape(image.shape) for (name, image), flat in zip(images.items(), found, strict=True)
        }


def _numbered(
    interface: Interface, given: Mapping[str, NDArray[np.float32]]
) -> tuple[Mapping[str, int], dict[int, NDArray[np.float32]]]:
    """Return the number of each array of a kernel, and by number the given arrays that it binds."""
    numbers = interface.numbers()
    return numbers, {numbers[name]: data for name, data in given.items() if name in numbers}
