"""An executor in a process of its own: a kernel that ends the process, or never ends, is a result too.

1. The process opens the executor and waits for kernels [`_serve`]; what it is sent and sends back is pickled.
2. A run has an [`Outcome`]: the picture, or why the executor refuses the kernel, or how it failed
   [`attempt`].
3. A process that ends on its own, or does not answer in time, has failed; the next run starts another one
   [`Apart.run`].
"""

from __future__ import annotations

import multiprocessing
import os
import signal
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from ...compiler.artifact import Artifact
from ...refimpl.errors import ExecutorUnavailable, WamnetError
from ..devices.executor import Executor
from ..devices.images import Images
from ..devices.registry import WAYS, open_executor
from ..orphans import end_with_parent

LIMIT_S = 300.0
"""Seconds after which a kernel, its compilation included, counts as one that never ends."""


@dataclass(frozen=True)
class Outcome:
    """A picture (H, W, C), or why the executor refuses the kernel, or how it failed."""

    image: NDArray[np.float32] | None = None
    refusal: str = ""
    failure: str = ""


class Runner(Protocol):
    """An executor that tells failures in place of raising them; `way` is its name in registry.WAYS."""

    way: str
    target: str
    device: str

    def picked(self, size: tuple[int, int]) -> str:
        """Return the name of the schedule that the executor picks for a size (height, width)."""

    def run(self, artifact: Artifact, images: Images) -> Outcome:
        """Run a kernel on images (H, W, C)."""


def attempt(executor: Executor, artifact: Artifact, images: Images) -> Outcome:
    """Run a kernel; an error in the house's words is a refusal, any other a failure."""
    try:
        return Outcome(executor.run(artifact, images))
    except WamnetError as error:
        return Outcome(refusal=_line(str(error)))
    except Exception as error:  # noqa: BLE001 - whatever it is, it is the result
        return Outcome(failure=_line(f"{type(error).__name__}: {error}"))


class Apart:
    """An executor in a process of its own, as a runner; raises ExecutorUnavailable where it is missing."""

    def __init__(self, way: str, limit_s: float = LIMIT_S) -> None:
        self.way, self.limit_s = way, limit_s
        self.target, self._options = WAYS[way]
        self._process: Any = None
        self._start()

    def _start(self) -> None:
        """Start the process and wait for its device."""
        context = multiprocessing.get_context("spawn")
        self._pipe, other = context.Pipe()
        self._process = context.Process(
            target=_serve, args=(other, self.target, dict(self._options)), daemon=True
        )
        self._process.start()
        other.close()
        opened = self._answer()
        if isinstance(opened, Outcome):
            self.close()
            raise ExecutorUnavailable(f"{self.way}: {opened.refusal or opened.failure}")
        self.device = str(opened)

    def picked(self, size: tuple[int, int]) -> str:
        """Return the name of the schedule that the executor picks for a size (height, width)."""
        found = self._asked(size)
        return found if isinstance(found, str) else "plain"

    def run(self, artifact: Artifact, images: Images) -> Outcome:
        """Run a kernel on images (H, W, C)."""
        found = self._asked((artifact, dict(images)))
        assert isinstance(found, Outcome)
        return found

    def _asked(self, request: Any) -> Any:
        """Return the answer to a request, of a process that is started if the last one has ended."""
        try:
            if self._process is None:
                self._start()
            self._pipe.send(request)
        except ExecutorUnavailable as error:
            return Outcome(failure=str(error))
        except OSError:
            return self._ended()
        return self._answer()

    def _answer(self) -> Any:
        """Return what the process sends, or how it ended."""
        try:
            if self._pipe.poll(self.limit_s):
                return self._pipe.recv()
        except (EOFError, OSError):
            return self._ended()
        self.close()
        return Outcome(failure=f"no answer in {self.limit_s:g} s")

    def _ended(self) -> Outcome:
        """Return how the process ended."""
        self._process.join()
        code = self._process.exitcode
        self.close()
        how = f"signal {signal.Signals(-code).name}" if code < 0 else f"exit status {code}"
        return Outcome(failure=f"its process ended with {how}")

    def close(self) -> None:
        """End the process."""
        if self._process is not None:
            self._process.kill()
            self._process.join()
            self._pipe.close()
            self._process = None

    def __enter__(self) -> Apart:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _serve(pipe: Any, name: str, options: Mapping[str, str]) -> None:
    """Open an executor, say its device, and answer requests until the other end is closed."""
    end_with_parent()
    # Ctrl-C reaches all processes of a terminal: the parent ends this one.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        executor = open_executor(name, **options)
    except Exception as error:  # noqa: BLE001 - whatever it is, the executor is missing
        pipe.send(Outcome(refusal=_line(str(error))))
        return
    pipe.send(executor.device)
    while True:
        try:
            request = pipe.recv()
        except EOFError:
            # Drivers' own clean-up at the end of a process has nothing to say any more.
            os._exit(0)
        if isinstance(request[0], Artifact):
            pipe.send(attempt(executor, *request))
        else:
            pipe.send(executor.schedule_for(request))


def _line(text: str) -> str:
    """Return a text on one line."""
    return " ".join(text.split())
