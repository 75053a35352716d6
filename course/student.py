"""The student's process as the grader has it: start it, call its functions, end it.

1. The process runs in the sandbox, or only with its own limits where the code is trusted [`started`].
2. A function of the student is an attribute [`Functions`]: calling it sends the arguments and returns data,
   or raises what the function raised. Functions among the arguments are called back.
3. A process that ends, sends what is no answer, or takes too long raises `Ended`, which no check
   catches [`Functions.request`, `deadline`].
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from .frame import Ended, Wrong
from .sandbox import FOLDER, MEGABYTE, Limits, bubblewrap
from .wire import MOST_BYTES, BadMessage, Channel, Expression, names_of, packed, read

LARGEST_FILE = MEGABYTE
"""Bytes of the largest Python file that is sent: a lab has some kilobytes."""

MOST_FILES = 100
"""Python files of a student that are sent."""

MOST_CALLBACKS = 100_000
"""Callbacks from a student's functions: the most of a lab are 4000."""

KEPT = ("PATH", "PYTHONPATH", "VIRTUAL_ENV", "LD_LIBRARY_PATH")
"""Environment variables that a student's process has."""


class Functions:
    """A student's functions as attributes."""

    def __init__(self, channel: Channel) -> None:
        self._channel = channel
        self._callbacks: list[Callable[..., Any]] = []
        self._left = MOST_CALLBACKS

    def __getattr__(self, name: str) -> Callable[..., Any]:
        return lambda *args: self.request(Expression(f"student.{name}"), *args)

    def request(self, function: Callable[..., Any], *args: Any) -> Any:
        """Return what a function gives there; arguments and result are copies."""
        wrong: Wrong | None = None
        message: tuple[Any, ...] = (function, args)
        while True:
            try:
                self._channel.send(packed(message, self._callbacks))
                kind, answer = read(self._channel.receive(MOST_BYTES))
                if kind == "call":
                    callback, *values = self._callback(*answer)
            except (EOFError, BrokenPipeError):
                raise Ended from None
            except BadMessage as error:
                raise Ended(f"something else than an answer: {error}") from None
            if kind == "value":
                break
            if kind == "raised":
                raise wrong or answer
            try:
                message = ("value", callback(*values))
            except Exception as error:  # noqa: BLE001
                # What the grader's function finds wrong counts, whatever the student's makes of it.
                wrong = wrong or (error if isinstance(error, Wrong) else None)
                message = ("raised", names_of(error), str(error))
        if wrong:
            raise wrong
        return answer

    def _callback(self, index: Any, *values: Any) -> tuple[Any, ...]:
        """Return the function that a student's function calls, and its arguments."""
        self._left -= 1
        if self._left < 0:
            raise BadMessage(f"more than {MOST_CALLBACKS} calls of the functions that it gets")
        if type(index) is not int or not 0 <= index < len(self._callbacks):
            raise BadMessage(f"a call of function {index}")
        return self._callbacks[index], *values


def sources(folder: Path) -> dict[str, bytes]:
    """Return a student's Python files (plain ones, not links) by name."""
    files = [path for path in sorted(folder.glob("*.py")) if path.is_file() and not path.is_symlink()]
    return {
        path.name: path.read_bytes() for path in files[:MOST_FILES] if path.stat().st_size <= LARGEST_FILE
    }


@contextmanager
def started(folder: Path, limits: Limits, trusted: bool, shows: bool) -> Iterator[tuple[Functions, Any]]:
    """Give a new process, with the student's functions before anything is loaded; it ends with the block."""
    command = [sys.executable, "-m", "wamnet_course.judged"]
    command += [str(folder.resolve()) if trusted else FOLDER, *map(str, limits)]
    quiet = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "PYTHONDONTWRITEBYTECODE"), "1")
    home = {} if trusted else {"HOME": FOLDER, "TMPDIR": FOLDER}
    process = subprocess.Popen(
        command if trusted else [*bubblewrap(), *command],
        cwd="/",
        env={**{name: os.environ[name] for name in KEPT if name in os.environ}, **quiet, **home},
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=1 if shows else subprocess.DEVNULL,
        start_new_session=True,
    )
    assert process.stdin is not None
    assert process.stdout is not None
    try:
        yield Functions(Channel(process.stdout, process.stdin)), process
    finally:
        process.kill()
        process.wait()
        for pipe in (process.stdin, process.stdout):
            with suppress(BrokenPipeError):
                pipe.close()


@contextmanager
def deadline(seconds: int) -> Iterator[None]:
    """Raise `Ended` in the main thread when the block takes longer than these seconds of wall-clock time."""

    def stop(*_: Any) -> None:
        raise Ended(f"no end within {seconds} s")

    before = signal.signal(signal.SIGALRM, stop)
    signal.alarm(seconds)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)
