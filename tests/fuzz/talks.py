"""What comes through a pipe or a socket: requests to `wamnet view`, and answers of programs under test."""

import io
import json
import re
import socket
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from xml.etree import ElementTree

from targets import VECTORS, Target

from wamnet.cli.commands.view import HOST, handler_of
from wamnet.refimpl.errors import InputError
from wamnet.refimpl.reading import parse_json
from wamnet.spec.conformance import report
from wamnet.spec.conformance.case import Case, load
from wamnet.spec.conformance.numbers import to_json
from wamnet.spec.conformance.protocol import NoAnswerError, Session
from wamnet.spec.conformance.run import SCHEMA, judge

PAGE = b"<!doctype html><title>the page</title>"
"""What only somebody who names this machine may read."""

SMALL_BYTES = 20_000
"""Longest file of vectors of which a case is taken."""

PORT = 8080
"""Port of the server that is asked."""

REQUESTS = (
    b"GET / HTTP/1.1\r\nHost: 127.0.0.1:8080\r\nUser-Agent: x\r\nAccept: */*\r\n\r\n",
    b"HEAD / HTTP/1.0\r\nHost: localhost:8080\r\nConnection: keep-alive\r\n\r\n",
    b"GET /x?y#z HTTP/1.1\r\nHost: evil.example:8080\r\nContent-Length: 3\r\n\r\nabc",
    b"POST / HTTP/1.1\r\nHost: [::1]:8080\r\nExpect: 100-continue\r\nContent-Length: 9\r\n\r\n",
)
"""Requests of all kinds."""

STATUSES = (100, 200, 400, 404, 414, 421, 431, 501, 505)
"""What an answer may say."""

NAMED = re.compile(rb"(?i)[\r\n]Host[ \t]*:\s*(127\.0\.0\.1|localhost|\[::1\]):8080\s*(?:[\r\n]|\Z)")
"""A request that names this machine; headers end at either sign."""


def talks() -> list[Target]:
    """Return the requests and, for some kinds of vectors, the answers."""
    cases = _cases()
    answers = [_answer(case) for case in cases.values()]
    return [
        Target("request to view", "bytes", REQUESTS, _request),
        Target("answer of a program", "json", answers, partial(_answered, cases)),
    ]


def _cases() -> dict[str, Case]:
    """Return a case of each kind that is small, by its id."""
    found = {}
    for path in sorted(VECTORS.glob("*.json")):
        if path.name != SCHEMA and path.stat().st_size < SMALL_BYTES:
            case = next(case for case in load(path)[1] if case.expected)
            found[case.id] = case
    return found


def _answer(case: Case) -> bytes:
    """Return a right answer."""
    outputs = {name: output.value for name, output in (case.expected or {}).items()}
    return json.dumps({"id": case.id, "output": to_json(outputs)}).encode()


def _request(content: bytes, _folder: Path) -> None:
    """Send a request; the answer has a known status, and the page only for who names this machine."""
    ours, theirs = socket.socketpair()
    with ours, theirs:
        ours.settimeout(5.0)
        theirs.settimeout(5.0)
        ours.sendall(content[:50_000])
        ours.shutdown(socket.SHUT_WR)
        server: Any = SimpleNamespace(server_address=(HOST, PORT))
        handler_of(PAGE)(theirs, (HOST, 1), server)
        theirs.shutdown(socket.SHUT_RDWR)
        answer = io.BytesIO()
        while part := ours.recv(65_536):
            answer.write(part)
    said = answer.getvalue()
    for status in re.findall(rb"(?m)^HTTP/1\.[01] (\d+) ", said):
        assert int(status) in STATUSES, f"status {status!r}"
    assert PAGE not in said or NAMED.search(content), "the page goes to a client that names another host"


def _answered(cases: Mapping[str, Case], content: bytes, _folder: Path) -> None:
    """Judge an answer to the case that it names, or to all; what came of it can be reported."""
    with Session(["nothing"], 1.0) as session:
        try:
            answer = session._parsed(content)
        except NoAnswerError as error:
            raise InputError("answer", error.verdict, str(error), "see spec/conformance.md") from None
    judged = [judge(name.partition("/")[0], case, answer) for name, case in cases.items()]
    ElementTree.fromstring(report.to_junit("x", judged, "again"))
    parse_json(report.to_json("x", "ieee", judged, "again"), "report", "fix it")
    report.track_text(None, judged)
