"""How a program is asked: one JSON request a line on its standard input, one JSON answer a line on its output.

1. The first request is `{"protocol": 1, "kind": "hello"}`; the answer names the program and the kinds that it
   knows: `{"program": "mine 1.0", "kinds": ["random.block", ...]}`.
2. Then a request a case: `{"id": ..., "kind": ..., "profile": ..., "input": {...}}`. The answer repeats the id
   and has `output`, or `refused` with a reason for an input that it will not take, or `unsupported`.
3. Images travel as files: an input `{"file": PATH, "shape": [...]}` is raw little-endian float32.
4. The end of the input means: end. A program that crashes, hangs or prints something else gets a verdict for
   the case that it was asked, and is started again for the next [`Session.ask`].
"""

from __future__ import annotations

import json
import queue
import subprocess
import threading
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import TracebackType
from typing import Any

PROTOCOL = 1
"""Version of the protocol."""

LONGEST_LINE = 2**26
"""Most bytes of an answer: what is longer is no answer."""

KEPT_ERRORS = 2_000
"""Characters of a program's standard error that a verdict shows: the last ones."""


class NoAnswerError(Exception):
    """The program gave no answer; `verdict` says in one word why: crash, timeout or garbage."""

    def __init__(self, verdict: str, text: str) -> None:
        super().__init__(text)
        self.verdict = verdict


@dataclass
class _Child:
    """A running program with the lines that it prints, as they come; None is their end."""

    process: subprocess.Popen[bytes]
    lines: queue.Queue[bytes | None]
    errors: list[bytes]


class Session:
    """A program under test; a context manager that ends it."""

    def __init__(self, command: Sequence[str], timeout_s: float) -> None:
        self.command, self.timeout_s = list(command), timeout_s
        self._child: _Child | None = None

    def hello(self) -> Mapping[str, Any]:
        """Return what the program says of itself."""
        answer = self._request({"protocol": PROTOCOL, "kind": "hello"})
        kinds = answer.get("kinds")
        if not isinstance(kinds, list) or not all(isinstance(kind, str) for kind in kinds):
            raise NoAnswerError("garbage", "the answer to hello has no list of kinds")
        return answer

    def ask(self, request: Mapping[str, Any]) -> Mapping[str, Any]:
        """Return the answer to a request, or raise [`NoAnswerError`]."""
        answer = self._request(request)
        if answer.get("id") != request["id"]:
            self._end()
            raise NoAnswerError("garbage", f"the answer is to {answer.get('id')!r}, not to {request['id']!r}")
        return answer

    def _request(self, request: Mapping[str, Any]) -> Mapping[str, Any]:
        """Write a line and read one."""
        child = self._start()
        try:
            assert child.process.stdin is not None
            child.process.stdin.write(json.dumps(request).encode() + b"\n")
            child.process.stdin.flush()
            line = child.lines.get(timeout=self.timeout_s)
        except queue.Empty:
            self._end()
            raise NoAnswerError("timeout", f"no answer within {self.timeout_s:g} s") from None
        except OSError:
            line = None
        if line is None:
            raise NoAnswerError("crash", self._last_words())
        return self._parsed(line)

    def _parsed(self, line: bytes) -> Mapping[str, Any]:
        """Return a line as a JSON object."""
        try:
            answer = json.loads(line)
        except (ValueError, RecursionError):
            answer = None
        if not isinstance(answer, dict):
            self._end()
            raise NoAnswerError("garbage", f"the line is no JSON object: {line[:80]!r}")
        return answer

    def _start(self) -> _Child:
        """Return the running program, started anew if it has ended."""
        if self._child is not None and self._child.process.poll() is None:
            return self._child
        self._end()
        pipe = subprocess.PIPE
        try:
            process = subprocess.Popen(self.command, stdin=pipe, stdout=pipe, stderr=pipe)
        except OSError as error:
            raise NoAnswerError("crash", f"{self.command[0]} cannot be started: {error.strerror}") from None
        self._child = _Child(process, queue.Queue(), [])
        for target in (_read_lines, _read_errors):
            threading.Thread(target=target, args=(self._child,), daemon=True).start()
        return self._child

    def _last_words(self) -> str:
        """End the program and return its exit status and the end of its standard error."""
        child = self._child
        assert child is not None
        self._end()
        text = b"".join(child.errors).decode(errors="replace").strip()[-KEPT_ERRORS:]
        return f"it ended with status {child.process.returncode}" + (f"; it said: {text}" if text else "")

    def _end(self) -> None:
        """Close the program's input, and stop it if it does not end by itself."""
        child, self._child = self._child, None
        if child is None:
            return
        assert child.process.stdin is not None
        try:
            child.process.stdin.close()
        except OSError:
            pass
        try:
            child.process.wait(timeout=2.0)
        except subprocess.TimeoutExpired:
            child.process.kill()
            child.process.wait()

    def __enter__(self) -> Session:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._end()


def _read_lines(child: _Child) -> None:
    """Put the lines of a program into its queue as they come."""
    assert child.process.stdout is not None
    with child.process.stdout as stream:
        while line := stream.readline(LONGEST_LINE):
            if line.strip():
                child.lines.put(line)
    child.lines.put(None)


def _read_errors(child: _Child) -> None:
    """Keep the end of what a program says on standard error."""
    assert child.process.stderr is not None
    with child.process.stderr as stream:
        while part := stream.read1(4096):  # type: ignore[attr-defined]
            child.errors[:] = [b"".join([*child.errors, part])[-KEPT_ERRORS:]]
