"""A program in a separate process that answers lines: a line on its input, a line back on its output.

1. It has its own process group: an interrupt is for whoever asks, and what the program starts ends with
   it: its input is closed, and what has not ended then is killed [`LineProcess.end`].
2. A program that does not read, or that prints errors without end, must not stop whoever asks: a thread
   writes, another one keeps the last errors, and one reads the output that is left in the end.
"""

from __future__ import annotations

import json
import math
import os
import select
import signal
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from queue import SimpleQueue
from threading import Thread
from time import monotonic
from typing import IO, Any

from ..refimpl.errors import ExecutorUnavailable

LONGEST_LINE = 2**24
"""Most bytes of a line: what is longer is not an answer."""

KEPT_ERRORS = 2_000
"""Bytes of a program's errors that are kept: the last ones."""

CLOSING_S = 20.0
"""Seconds in which a program ends by itself once its input has ended."""

LATE_S = 2.0
"""Seconds in which the last words of a program that has ended are read."""


class LineProcess:
    """A running program; `ended` is the error when it has gone, before the last line of its own errors.

    Answers begin with the `mark`; other lines are passed over.
    """

    def __init__(
        self,
        command: Sequence[str],
        ended: str = "",
        mark: str = "",
        environment: Mapping[str, str] | None = None,
    ) -> None:
        """Start it; raises OSError or ValueError where that fails."""
        pipe, self._ended, self._mark = subprocess.PIPE, ended, mark.encode()
        self._process = subprocess.Popen(
            command, stdin=pipe, stdout=pipe, stderr=pipe, start_new_session=True, env=environment
        )
        assert self._process.stdin and self._process.stdout and self._process.stderr  # noqa: PT018
        self._in, self._out, self._err = self._process.stdin, self._process.stdout, self._process.stderr
        self._unsent, self._unread, self._errors = SimpleQueue[bytes | None](), bytearray(), bytearray()
        self._helpers: list[Thread] = []
        self._help(self._write)
        self._help(self._read, self._err, self._errors)

    def _help(self, work: Callable[..., None], *arguments: Any) -> None:
        """Do something in a thread."""
        self._helpers.append(Thread(target=work, args=arguments, daemon=True))
        self._helpers[-1].start()

    def _write(self) -> None:
        """Write what is to be sent, and close the input in the end."""
        with suppress(OSError), self._in:  # of a program that has ended
            while (line := self._unsent.get()) is not None:
                self._in.write(line)
                self._in.flush()

    def _read(self, pipe: IO[bytes], kept: bytearray) -> None:
        """Read what comes until there is no more, and keep the last bytes."""
        with pipe:
            while part := os.read(pipe.fileno(), 1 << 16):
                kept += part
                del kept[:-KEPT_ERRORS]

    @property
    def status(self) -> int | None:
        """Return the exit status, None as long as it runs."""
        return self._process.poll()

    def tell(self, question: Mapping[str, Any]) -> None:
        """Send a question as a line of JSON."""
        self._unsent.put(json.dumps(question).encode() + b"\n")

    def line(self, limit_s: float = math.inf) -> bytes:
        """Return the next line that is not blank, b"" at the end; TimeoutError if none comes."""
        deadline, line, at_end, ready = monotonic() + limit_s, b"", False, select.poll()
        ready.register(self._out, select.POLLIN)
        while not (line.strip() or at_end):
            while b"\n" not in self._unread and len(self._unread) < LONGEST_LINE and not at_end:
                left = deadline - monotonic()
                if left <= 0.0 or not ready.poll(1e3 * left if left < math.inf else None):
                    raise TimeoutError
                part = os.read(self._out.fileno(), 1 << 16)
                self._unread += part
                at_end = not part
            first, _, self._unread[:] = self._unread.partition(b"\n")
            line = bytes(first)
        return line.strip()

    def answer(self) -> dict[str, Any]:
        """Return the next answer; ExecutorUnavailable says that the program has ended."""
        while line := self.line():
            if line.startswith(self._mark):
                answer: dict[str, Any] = json.loads(line.removeprefix(self._mark))
                return answer
        errors = self.end(LATE_S).splitlines()[-1:]
        raise ExecutorUnavailable(": ".join([self._ended, *(line.strip() for line in errors)]))

    def ask(self, question: Mapping[str, Any]) -> dict[str, Any]:
        """Return the answer to a question."""
        self.tell(question)
        return self.answer()

    def end(self, patience_s: float = CLOSING_S) -> str:
        """End it after so many seconds, where it does not by itself, and return the end of its errors."""
        if self._helpers:  # once: later, the number of its group may be another's
            self._unsent.put(None)
            self._help(self._read, self._out, bytearray())
            with suppress(subprocess.TimeoutExpired):
                # An error is on its way: nobody waits.
                self._process.wait(patience_s if sys.exc_info()[0] is None else 0.0)
            with suppress(ProcessLookupError, PermissionError):
                os.killpg(self._process.pid, signal.SIGKILL)
            self._process.wait()
        while self._helpers:
            self._helpers.pop().join(LATE_S)
        return self._errors.decode(errors="replace").strip()
