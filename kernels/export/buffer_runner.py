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
from ...compiler.kernel.interface import BLOCK, WEIGHTS, Interface
from ...compiler.languages.glsl_buffers import GROUP
from ..devices.executor import Executor
from ..devices.kernel import Kernel, Memory, words


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


@dataclass(frozen=True)
class Prepared:
    """A built kernel, what it takes, its weights, and its schedule's facts."""

    built: Any
    interface: Interface
    weights: Memory | None
    schedule: Mapping[str, Any]


class BufferRunner(Executor):
    """Runs kernels of one target; a subclass builds one [`_build`] and launches it [`_launch`]."""

    @abstractmethod
    def _build(self, kernel: Kernel, group: tuple[int, int] | None) -> Any:
        """Return a kernel, built; `group`: the threads (x, y) that wait for each other, if any do."""

    @abstractmethod
    def _launch(self, built: Any, launch: Launch) -> None:
        """Start a kernel."""

    def _prepare(self, kernel: Kernel) -> Prepared:
        schedule, weights = {}, None
        if isinstance(kernel, Artifact):
            schedule = kernel.manifest["schedule"]
            whole = -kernel.weights.size % 4 or 4 * (not kernel.weights.size)
            weights = self._store(WEIGHTS, np.pad(kernel.weights, (0, whole)))
        group = schedule.get("group")
        waiting = None if group is None else (int(group[0]), int(group[1]))
        return Prepared(self._build(kernel, waiting), kernel.interface, weights, schedule)

    def _discard(self, prepared: Prepared) -> None:
        if prepared.weights is not None:
            self._release(prepared.weights)

    def _start(
        self, kernel: Kernel, prepared: Prepared, arrays: Mapping[str, Memory], integers: Mapping[str, int]
    ) -> None:
        taken, picked = prepared.interface, prepared.schedule
        held = {**arrays, WEIGHTS: prepared.weights} if prepared.weights else arrays
        numbers = taken.numbers()
        threads = (-(-integers["width"] // picked.get("pixels", 1)), integers[taken.rows])
        launch = Launch(
            words(taken, integers),
            {number: held[name].held for name, number in numbers.items()},
            threads,
            tuple(picked.get("group", GROUP)),
            [numbers[array.name] for array in taken.arrays if array.home == BLOCK],
        )
        self._launch(prepared.built, launch)
