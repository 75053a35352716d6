"""Workers that end with the process that started them, however that ended.

A parent that is killed by SIGKILL can end nobody, and a worker that waits for work would wait for ever. The
system closes what the parent held open: a thread of the worker waits for that [`end_with_parent`]. Signals do
not meet workers that are not known yet [`starting_workers`].

A [`Worker`] calls functions in a separate process: that it ends, or never answers, is an answer too.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from multiprocessing import resource_tracker
from multiprocessing.connection import wait
from typing import Any

from ..models.writing import signals_wait


def end_with_parent() -> None:
    """Let this process, which multiprocessing has started, end as soon as its parent has ended."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        threading.Thread(target=_end_after, args=(parent.sentinel,), daemon=True).start()


def _end_after(sentinel: int) -> None:
    """Wait for the end of the parent, and end this process at once, whatever its other threads do."""
    wait([sentinel])
    os._exit(1)


@contextmanager
def starting_workers() -> Iterator[None]:
    """Let SIGINT and SIGTERM wait while workers start: they are known by then, and their parent ends them.

    Threads and processes inherit the mask of signals, so that every worker, also one instead of a lost one,
    has SIGINT blocked: Ctrl-C in the terminal does not reach it. SIGTERM must not wait in them, and is only
    noted here. Python's tracker of shared resources unblocks SIGINT in the thread that starts it: it is
    started before.
    """
    resource_tracker.ensure_running()
    with signals_wait():
        before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            yield
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)


class WorkerEnded(Exception):
    """How a worker ended, or that it did not answer in time and was ended."""


class Worker:
    """A process that calls functions of modules, with what can be pickled; one that raises ends it."""

    def __init__(self) -> None:
        context = multiprocessing.get_context("spawn")
        self._pipe, other = context.Pipe()
        self._process = context.Process(target=_serve, args=(other,), daemon=True)
        self._process.start()
        other.close()

    def call(self, limit_s: float, function: Callable[..., Any], *arguments: object) -> Any:
        """Return what a function returns in the process, or raise WorkerEnded."""
        try:
            self._pipe.send((function, arguments))
            if self._pipe.poll(limit_s):
                return self._pipe.recv()
            reason = f"no answer in {limit_s:g} s"
        except (EOFError, OSError):
            self._process.join()
            code = self._process.exitcode or 0
            how = f"signal {signal.Signals(-code).name}" if code < 0 else f"exit status {code}"
            reason = f"its process ended with {how}"
        self.close()
        raise WorkerEnded(reason)

    def close(self) -> None:
        """End the process."""
        self._process.kill()
        self._process.join()
        self._pipe.close()


def _serve(pipe: Any) -> None:
    """Call functions until the other end is closed."""
    end_with_parent()
    # Ctrl-C reaches all processes of a terminal: the parent ends this one.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    while True:
        try:
            function, arguments = pipe.recv()
        except EOFError:
            # Drivers' own clean-up at the end of a process has nothing to say any more.
            os._exit(0)
        try:
            pipe.send(function(*arguments))
        except Exception:  # noqa: BLE001 - the caller sees how the process ended
            os._exit(1)
