"""How a program is asked: one JSON request a line on its input, one JSON answer a line on its output.

1. The first request is `{"protocol": 1, "kind": "hello"}`; the answer names the program and the kinds that it
   knows: `{"program": "mine 1.0", "kinds": ["random.block", ...]}`.
2. Then a request a case: `{"id": ..., "kind": ..., "profile": ..., "input": {...}}`. The answer repeats the
   id and has `output`, or `refused` with a reason for an input that it will not take, or `unsupported`.
3. Images travel as files: an input `{"file": PATH, "shape": [...]}` is raw little-endian float32.
4. The end of the input means: end. A program that crashes, hangs or prints something else gets a verdict for
   the case that it was asked, and is started again for the next [`Session.ask`].
"""

from __future__ import annotations

import io
import json
import os
import queue
import signal
import subprocess
import threading
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from types import TracebackType
from typing import Any

from ...refimpl.errors import InputError
from ...refimpl.reading import parse_json

PROTOCOL = 1
"""Version of the protocol."""

LONGEST_LINE = 2**24
"""Most bytes of an answer: what is longer is not an answer."""

LINES_AHEAD = 4
"""Most lines that are kept before they are read: an endless output must not fill the memory."""

PATIENCE_S = 2.0
"""Time in which a program ends by itself once its input has ended, in seconds."""

WRITER = "writer"
"""Name of threads that write."""

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
    lines: queue.Queue[bytes | None] = field(default_factory=lambda: queue.Queue(LINES_AHEAD))
    errors: list[bytes] = field(default_factory=list)
    threads: list[threading.Thread] = field(default_factory=list)
    ended: threading.Event = field(default_factory=threading.Event)


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
            self._end(at_once=True)
            found = repr(answer.get("id"))[:80]
            raise NoAnswerError("garbage", f"the answer is to {found}, not to {request['id']!r}")
        return answer

    def _request(self, request: Mapping[str, Any]) -> Mapping[str, Any]:
        """Write a line and read one."""
        child = self._start()
        # A program that does not read must not stop the runner.
        self._thread(child, _write, json.dumps(request).encode() + b"\n")
        try:
            line = child.lines.get(timeout=self.timeout_s)
        except queue.Empty:
            self._end(at_once=True)
            raise NoAnswerError("timeout", f"no answer within {self.timeout_s:g} s") from None
        if line is None:
            raise NoAnswerError("crash", self._last_words())
        return self._parsed(line)

    def _parsed(self, line: bytes) -> Mapping[str, Any]:
        """Return a line as a JSON object."""
        answer = None
        with suppress(InputError):
            answer = parse_json(line, "answer", "see spec/conformance.md")
        if not isinstance(answer, dict):
            self._end(at_once=True)
            raise NoAnswerError("garbage", f"the line is not a JSON object: {line[:80]!r}")
        return answer

    def _start(self) -> _Child:
        """Return the running program, started again if it has ended."""
        if self._child is not None and self._child.process.poll() is None:
            return self._child
        self._end()
        pipe = subprocess.PIPE
        try:
            # A group of its own: what the program starts ends with it.
            process = subprocess.Popen(
                self.command, bufsize=0, stdin=pipe, stdout=pipe, stderr=pipe, start_new_session=True
            )
        except (OSError, ValueError) as error:
            reason = getattr(error, "strerror", None) or str(error)
            raise NoAnswerError("crash", f"{self.command[0]} cannot be started: {reason}") from None
        self._child = _Child(process)
        for target in (_read_lines, _read_errors):
            self._thread(self._child, target)
        return self._child

    @staticmethod
    def _thread(child: _Child, target: Callable[..., None], *arguments: Any) -> None:
        """Start a thread that serves a program; those that are done are forgotten."""
        name = WRITER if target is _write else None
        thread = threading.Thread(target=target, args=(child, *arguments), name=name, daemon=True)
        child.threads[:] = [known for known in child.threads if known.is_alive()] + [thread]
        thread.start()

    def _last_words(self) -> str:
        """End the program and return its exit status and the end of its standard error."""
        child = self._child
        assert child is not None
        self._end()
        text = b"".join(child.errors).decode(errors="replace").strip()[-KEPT_ERRORS:]
        return f"it ended with status {child.process.returncode}" + (f"; it said: {text}" if text else "")

    def _end(self, at_once: bool = False) -> None:
        """Close the program's input, and stop it if it does not end by itself soon; or `at_once`."""
        child, self._child = self._child, None
        if child is None:
            return
        process, patience_s = child.process, 0.0 if at_once else PATIENCE_S
        assert process.stdin is not None
        if _written(child, patience_s):
            process.stdin.close()
        else:
            patience_s = 0.0
        with suppress(subprocess.TimeoutExpired):
            process.wait(timeout=patience_s)
        with suppress(ProcessLookupError, PermissionError):
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()
        child.ended.set()
        for thread in child.threads:
            thread.join(timeout=PATIENCE_S)
        process.stdin.close()

    def __enter__(self) -> Session:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._end()


def _write(child: _Child, line: bytes) -> None:
    """Write a request; a program that has ended is noticed by the end of its output."""
    assert child.process.stdin is not None
    with suppress(OSError, ValueError):
        while line:
            line = line[child.process.stdin.write(line) :]


def _written(child: _Child, patience_s: float) -> bool:
    """Wait until all lines are written, and return whether they are: an answer may be there before."""
    writers = [thread for thread in child.threads if thread.name == WRITER]
    for thread in writers:
        thread.join(patience_s / len(writers))
    return not any(thread.is_alive() for thread in writers)


def _read_lines(child: _Child) -> None:
    """Put the lines of a program into its queue as they come."""
    assert child.process.stdout is not None
    with io.BufferedReader(child.process.stdout) as stream:  # type: ignore[type-var]
        while not child.ended.is_set() and (line := stream.readline(LONGEST_LINE)):
            if line.strip():
                _put(child, line)
    _put(child, None)


def _put(child: _Child, line: bytes | None) -> None:
    """Put a line into the queue, and wait for room unless the program was ended."""
    while not child.ended.is_set():
        with suppress(queue.Full):
            child.lines.put(line, timeout=0.1)
            return


def _read_errors(child: _Child) -> None:
    """Keep the end of what a program says on standard error."""
    assert child.process.stderr is not None
    with child.process.stderr as stream:
        while part := stream.read(4096):
            child.errors[:] = [b"".join([*child.errors, part])[-KEPT_ERRORS:]]
