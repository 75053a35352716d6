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
from ...compiler.kernel.interface import BATCH, BLOCK, WEIGHTS, Interface
from ...compiler.languages.glsl_buffers import GROUP
from ..devices.executor import Executor
from ..devices.kernel import Memory, batches, plane_shape, words


@dataclass(frozen=True)
class Launch:
    """One call: integers, buffers by number, threads (x, y).

    Threads start in whole groups (x, y), so there may be more than requested. `blocks` are the uniform blocks
    among the buffers.
    """

    integers: NDArray[np.uint32]
    buffers: Mapping[int, Any]
    threads: tuple[int, int]
    group: tuple[int, int] = GROUP
    blocks: Sequence[int] = ()

    @property
    def groups(self) -> tuple[int, int]:
        """Return the numbers of groups that hold all threads."""
        (width, height), (columns, rows) = self.threads, self.group
        return -(-width // columns), -(-height // rows)


class BufferRunner(Executor):
    """Runs kernels of one target; a subclass builds one [`_build`] and launches it [`_launch`].

    What several launches hand on is kept for the next picture of the same size.
    """

    def __init__(self) -> None:
        super().__init__()
        self._handed_on: dict[str, Memory] = {}

    @abstractmethod
    def _build(self, kernel: Artifact, group: tuple[int, int] | None) -> Any:
        """Return a kernel, built; `group`: the threads (x, y) that wait for each other, if any do."""

    @abstractmethod
    def _launch(self, built: Any, launch: Launch) -> None:
        """Start a kernel."""

    def _prepare(self, kernel: Artifact) -> tuple[Any, ...]:
        """Return a kernel's launches, built, one or several."""
        group = kernel.manifest.get("schedule", {}).get("group")
        waiting = None if group is None else (int(group[0]), int(group[1]))
        return tuple(self._build(each, waiting) for each in kernel.launches or [kernel])

    def _weights(self, kernel: Artifact) -> Memory:
        """Return the weights in whole vectors of four."""
        beyond = -kernel.weights.size % 4 or 4 * (not kernel.weights.size)
        return self._store(WEIGHTS, np.pad(kernel.weights, (0, beyond)))

    def _start(
        self, kernel: Artifact, prepared: Any, arrays: Mapping[str, Memory], integers: Mapping[str, int]
    ) -> None:
        taken, picked = kernel.interface, kernel.manifest.get("schedule", {})
        if "launches" in picked:
            self._batches(kernel, prepared, arrays, integers)
            return
        threads = (-(-integers["width"] // picked.get("pixels", 1)), integers[taken.rows])
        group = tuple(picked.get("group", GROUP))
        self._launch(prepared[0], self._of(taken, arrays, integers, threads, group))

    def _of(
        self,
        taken: Interface,
        held: Mapping[str, Any],
        integers: Mapping[str, int],
        threads: tuple[int, int],
        group: tuple[int, int],
    ) -> Launch:
        """Return a call with all arrays and integers that a kernel takes."""
        numbers = taken.numbers()
        buffers = {number: held[name].held for name, number in numbers.items()}
        blocks = [numbers[array.name] for array in taken.arrays if array.home == BLOCK]
        return Launch(words(taken, integers), buffers, threads, group, blocks)

    def _batches(
        self, kernel: Artifact, prepared: Any, held: Mapping[str, Any], integers: Mapping[str, int]
    ) -> None:
        """Start several launches for one batch of tiles after another."""
        taken, picked = kernel.interface, kernel.manifest["schedule"]
        count, firsts = batches(picked, (integers["height"], integers["width"]))
        shapes = {a.name: (*plane_shape(a.shape, {BATCH[1]: count}), a.lanes) for a in taken.both}
        if shapes != {name: memory.shape for name, memory in self._handed_on.items()}:
            while self._handed_on:
                self._release(self._handed_on.popitem()[1])
            for name, shape in shapes.items():
                self._handed_on[name] = self._memory(name, shape)
        for first in firsts:
            given = {**integers, **dict(zip(BATCH, (first, count), strict=True))}
            for built, launch in zip(prepared, picked["launches"], strict=True):
                threads = count // launch["tiles"], launch["lines"]
                self._launch(
                    built, self._of(taken, {**held, **self._handed_on}, given, threads, (picked["items"], 1))
                )
