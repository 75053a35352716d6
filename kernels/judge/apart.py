"""An executor in a process of its own: a kernel that ends the process, or never ends, is a result too.

1. The process opens the executor and waits for kernels [orphans.py: `Worker`].
2. A run has an [`Outcome`]: the picture, or why the executor refuses the kernel, or how it failed
   [`attempt`].
3. A process that ends on its own, or does not answer in time, has failed; the next run starts another one
   [`Apart.run`].
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from operator import attrgetter, methodcaller
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...compiler.artifact import Artifact
from ...refimpl.errors import ExecutorUnavailable, WamnetError
from ..devices.executor import Executor
from ..devices.kernel import Closing, Images
from ..devices.registry import WAYS, open_executor
from ..orphans import Worker, WorkerEnded

LIMIT_S = 300.0
"""Seconds after which a kernel, its compilation included, counts as one that never ends."""


@dataclass(frozen=True)
class Outcome:
    """A picture (H, W, C), or why the executor refuses the kernel, or how it failed."""

    image: NDArray[np.float32] | None = None
    refusal: str = ""
    failure: str = ""


def attempt(executor: Executor, artifact: Artifact, images: Images) -> Outcome:
    """Run a kernel; an error in the house's words is a refusal, any other a failure."""
    try:
        return Outcome(executor.run(artifact, images))
    except WamnetError as error:
        return Outcome(refusal=_line(str(error)))
    except Exception as error:  # noqa: BLE001 - whatever it is, it is the result
        return Outcome(failure=_line(f"{type(error).__name__}: {error}"))


class Apart(Closing):
    """An executor in a process of its own, which tells failures in place of raising them.

    `way` is its name in registry.WAYS; raises ExecutorUnavailable where it is missing.
    """

    def __init__(self, way: str) -> None:
        self.way, self.limit_s = way, LIMIT_S
        self.target, _ = WAYS[way]
        self._worker: Worker | None = None
        opened = self._asked(attrgetter("device"))
        if isinstance(opened, Outcome):
            self.close()
            raise ExecutorUnavailable(f"{way}: {opened.failure}")
        self.device = str(opened)

    def picked(self, size: tuple[int, int]) -> str:
        """Return the name of the schedule that the executor picks for a size (height, width)."""
        found = self._asked(methodcaller("schedule_for", size))
        return found if isinstance(found, str) else "plain"

    def run(self, artifact: Artifact, images: Images) -> Outcome:
        """Run a kernel on images (H, W, C)."""
        found = self._asked(attempt, artifact, dict(images))
        assert isinstance(found, Outcome)
        return found

    def _asked(self, function: Callable[..., Any], *arguments: object) -> Any:
        """Return a function of the executor, in a process that starts if the last one has ended."""
        if self._worker is None:
            self._worker = Worker()
        try:
            return self._worker.call(self.limit_s, _of_executor, self.way, function, *arguments)
        except WorkerEnded as error:
            self._worker = None
            return Outcome(failure=str(error))

    def close(self) -> None:
        """End the process."""
        if self._worker is not None:
            self._worker.close()
            self._worker = None


@lru_cache(1)
def _opened(way: str) -> Executor:
    """Return the executor of a process."""
    name, options = WAYS[way]
    return open_executor(name, **options)


def _of_executor(way: str, function: Callable[..., Any], *arguments: object) -> Any:
    """Return what a function returns of a process's executor, or why that is missing."""
    try:
        executor = _opened(way)
    except Exception as error:  # noqa: BLE001 - whatever it is, the executor is missing
        return Outcome(failure=_line(str(error)))
    return function(executor, *arguments)


def _line(text: str) -> str:
    """Return a text on one line."""
    return " ".join(text.split())
