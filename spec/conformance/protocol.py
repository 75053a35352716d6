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

import json
import os
import selectors
import signal
import subprocess
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from time import monotonic
from typing import IO, Any

from ...refimpl.errors import InputError
from ...refimpl.reading import parse_json

PROTOCOL = 1
"""Version of the protocol."""

LONGEST_LINE = 2**24
"""Most bytes of an answer: what is longer is not an answer."""

PATIENCE_S = 2.0
"""Time in which a program ends by itself once its input has ended, in seconds."""

KEPT_ERRORS = 2_000
"""Characters of a program's standard error that a verdict shows: the last ones."""


class NoAnswerError(Exception):
    """The program gave no answer; `verdict` says in one word why: crash, timeout or garbage."""

    def __init__(self, verdict: str, text: str) -> None:
        super().__init__(text)
        self.verdict = verdict


class Session:
    """A program under test; a context manager that ends it."""

    def __init__(self, command: Sequence[str], timeout_s: float) -> None:
        self.command, self.timeout_s = list(command), timeout_s
        self._process: subprocess.Popen[bytes] | None = None

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
        process = self._start()
        self._unsent += json.dumps(request).encode() + b"\n"
        if process.stdin not in self._pipes.get_map():
            self._pipes.register(process.stdin, selectors.EVENT_WRITE)  # type: ignore[arg-type]
        deadline, line = monotonic() + self.timeout_s, bytearray()
        while not line.strip():
            while b"\n" not in self._unread and len(self._unread) < LONGEST_LINE:
                if process.stdout not in self._pipes.get_map():
                    break
                if monotonic() > deadline or not self._exchanged(deadline - monotonic()):
                    self._end(at_once=True)
                    raise NoAnswerError("timeout", f"no answer within {self.timeout_s:g} s")
            if not self._unread:
                raise NoAnswerError("crash", self._last_words())
            line, _, self._unread[:] = self._unread.partition(b"\n")
        return self._parsed(bytes(line))

    def _parsed(self, line: bytes) -> Mapping[str, Any]:
        """Return a line as a JSON object."""
        answer = None
        with suppress(InputError):
            answer = parse_json(line, "answer", "see spec/conformance.md")
        if not isinstance(answer, dict):
            self._end(at_once=True)
            raise NoAnswerError("garbage", f"the line is not a JSON object: {line[:80]!r}")
        return answer

    def _start(self) -> subprocess.Popen[bytes]:
        """Return the running program, started again if it has ended."""
        if self._process is not None and self._process.poll() is None:
            return self._process
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
        assert process.stdin is not None
        os.set_blocking(process.stdin.fileno(), False)
        self._process, self._pipes = process, selectors.DefaultSelector()
        self._unsent, self._unread, self._errors = b"", bytearray(), bytearray()
        for stream, kept in ((process.stdout, self._unread), (process.stderr, self._errors)):
            assert stream is not None
            self._pipes.register(stream, selectors.EVENT_READ, kept)
        return process

    def _exchanged(self, limit_s: float) -> bool:
        """Write and read what the pipes take and hold; tell whether any did in time.

        A program that does not read, or that prints errors without end, must not stop the runner.
        """
        ready = self._pipes.select(max(limit_s, 0.0))
        for key, mask in ready:
            if mask & selectors.EVENT_WRITE:
                # A program that has ended is noticed by the end of its output.
                with suppress(BlockingIOError):
                    self._unsent = self._unsent[_written(key.fd, self._unsent) :]
                is_done = not self._unsent
            else:
                part = os.read(key.fd, 1 << 16)
                key.data.extend(part)
                is_done = not part
            if is_done:
                self._pipes.unregister(key.fileobj)
        del self._errors[:-KEPT_ERRORS]
        return bool(ready)

    def _last_words(self) -> str:
        """End the program and return its exit status and the end of its standard error."""
        process = self._process
        assert process is not None
        self._end()
        text = self._errors.decode(errors="replace").strip()
        return f"it ended with status {process.returncode}" + (f"; it said: {text}" if text else "")

    def _end(self, at_once: bool = False) -> None:
        """Close the program's input, and stop it if it does not end by itself soon; or `at_once`."""
        process, self._process = self._process, None
        if process is None:
            return
        # An answer may be there before all of the request is read.
        if not at_once and self._served(lambda: not self._unsent):
            self._close(process.stdin)
            self._served(lambda: process.poll() is not None)
        with suppress(ProcessLookupError, PermissionError):
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()
        self._unsent = b""
        # What it has said before.
        self._served(lambda: not self._exchanged(0.0))
        for pipe in (process.stdin, process.stdout, process.stderr):
            self._close(pipe)
        self._pipes.close()

    def _served(self, is_done: Callable[[], bool]) -> bool:
        """Serve the pipes until something is done, but not for long; tell whether it is."""
        end = monotonic() + PATIENCE_S
        while not (done := is_done()) and monotonic() < end:
            self._exchanged(PATIENCE_S / 100)
            self._unread.clear()
        return done

    def _close(self, pipe: IO[bytes] | None) -> None:
        """Close a pipe, which is served no more."""
        assert pipe is not None
        if not pipe.closed and pipe in self._pipes.get_map():
            self._pipes.unregister(pipe)
        pipe.close()

    def __enter__(self) -> Session:
        return self

    def __exit__(self, *_: object) -> None:
        self._end()


def _written(handle: int, content: bytes) -> int:
    """Return how many bytes a pipe has taken: all where nobody reads them any more."""
    try:
        return os.write(handle, content)
    except BrokenPipeError:
        return len(content)
