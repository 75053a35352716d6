"""A program in a process of its own that answers questions: a line of JSON in, a line of JSON back.

1. Answers begin with a mark, so that other lines of the program are passed over [`LineProcess.ask`].
2. It is in a process group of its own: an interrupt is for the one who asks, who then closes this.
3. It is closed by closing its input, and killed where it does not end then, or where an error is on its way
   [`LineProcess.close`].
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from contextlib import suppress
from typing import Any

from ...refimpl.errors import ExecutorUnavailable

CLOSING_S = 20.0
"""Seconds in which the process has to end before it is ended."""


class LineProcess:
    """A running program; `ended` is what is said when it has gone, before the last line of its errors."""

    def __init__(self, command: Sequence[str], ended: str, mark: str = "") -> None:
        """Start it."""
        self._ended, self._mark = ended, mark
        self._said = tempfile.TemporaryFile("w+", encoding="utf-8", errors="replace")  # noqa: SIM115
        self._process = subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._said,
            text=True,
            start_new_session=True,
        )

    def ask(self, question: dict[str, Any]) -> dict[str, Any]:
        """Return the answer to a question; ExecutorUnavailable says that the program has ended."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        with suppress(BrokenPipeError):
            self._process.stdin.write(json.dumps(question) + "\n")
            self._process.stdin.flush()
            for line in self._process.stdout:
                if line.startswith(self._mark):
                    found: dict[str, Any] = json.loads(line.removeprefix(self._mark))
                    return found
        raise ExecutorUnavailable(f"{self._ended}{self._last_words()}")

    def _last_words(self) -> str:
        """Return the last line that it printed as an error, if there is one."""
        self._said.seek(0)
        lines = self._said.read().strip().splitlines()
        return f": {lines[-1].strip()}" if lines else ""

    def close(self) -> None:
        """End the process."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        if not self._process.stdin.closed:
            with suppress(BrokenPipeError):
                self._process.stdin.close()
        if sys.exc_info()[0] is not None:
            self._process.kill()
        try:
            self._process.wait(CLOSING_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._process.stdout.close()
        self._said.close()
