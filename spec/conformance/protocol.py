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

from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import Any

from ...models.lines import LineProcess
from ...refimpl.errors import InputError
from ...refimpl.reading import parse_json

PROTOCOL = 1
"""Version of the protocol."""

PATIENCE_S = 2.0
"""Time in which a program ends by itself once its input has ended, in seconds."""


class NoAnswerError(Exception):
    """The program gave no answer; `verdict` says in one word why: crash, timeout or garbage."""

    def __init__(self, verdict: str, text: str) -> None:
        super().__init__(text)
        self.verdict = verdict


class Session:
    """A program under test; a context manager that ends it."""

    def __init__(self, command: Sequence[str], timeout_s: float) -> None:
        self.command, self.timeout_s = list(command), timeout_s
        self._process: LineProcess | None = None

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
            self._end(0.0)
            found = repr(answer.get("id"))[:80]
            raise NoAnswerError("garbage", f"the answer is to {found}, not to {request['id']!r}")
        return answer

    def _request(self, request: Mapping[str, Any]) -> Mapping[str, Any]:
        """Write a line and read one."""
        process = self._started()
        process.tell(request)
        try:
            line = process.line(self.timeout_s)
        except TimeoutError:
            self._end(0.0)
            raise NoAnswerError("timeout", f"no answer within {self.timeout_s:g} s") from None
        if not line:
            said = self._end()
            text = f"it ended with status {process.status}" + (f"; it said: {said}" if said else "")
            raise NoAnswerError("crash", text)
        return self._parsed(line)

    def _parsed(self, line: bytes) -> Mapping[str, Any]:
        """Return a line as a JSON object."""
        answer = None
        with suppress(InputError):
            answer = parse_json(line, "answer", "see spec/conformance.md")
        if not isinstance(answer, dict):
            self._end(0.0)
            raise NoAnswerError("garbage", f"the line is not a JSON object: {line[:80]!r}")
        return answer

    def _started(self) -> LineProcess:
        """Return the running program, started again if it has ended."""
        if self._process is None or self._process.status is not None:
            self._end()
            try:
                self._process = LineProcess(self.command)
            except (OSError, ValueError) as error:
                reason = getattr(error, "strerror", None) or str(error)
                raise NoAnswerError("crash", f"{self.command[0]} cannot be started: {reason}") from None
        return self._process

    def _end(self, patience_s: float = PATIENCE_S) -> str:
        """End the program, and return the end of its standard error."""
        process, self._process = self._process, None
        return process.end(patience_s) if process else ""

    def __enter__(self) -> Session:
        return self

    def __exit__(self, *_: object) -> None:
        self._end()
