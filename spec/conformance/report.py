"""Reports of verdicts: counts, one text a failure, JSON, JUnit, and what changed since the last time.

1. [`counts`] counts verdicts by kind; [`about`] describes one failure in full, [`first_blamed`] finds the
   one to fix first.
2. [`to_json`] and [`to_junit`] are for other programs.
3. A track is a file of the last verdicts: [`changes`] are the cases that differ from it, and those that are
   [`worse`] are failures; known ones are not. It is replaced unless something is worse.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from ...refimpl.reading import parse_json, read_file, refusing
from .case import VERSION, Case
from .run import FAIL, PASS, UNSUPPORTED, VERDICTS, Verdict

TRACK = "wamnet-conformance-track"
"""Value of the key `format` of a track."""

SHOWN_CHARACTERS = 300
"""Most characters of a case's input that are shown."""

XML_CONTROL = {code: "?" for code in (*range(32), 0xFFFE, 0xFFFF) if chr(code) not in "\t\n\r"}
"""Characters that XML cannot hold; a program's words may."""


@dataclass(frozen=True)
class Kinds:
    """Counts of verdicts of one kind by verdict, and the largest error / bound of what passed."""

    kind: str
    cases: int
    found: Mapping[str, int]
    ratio: float


def counts(verdicts: Sequence[Verdict]) -> list[Kinds]:
    """Return the counts of all kinds, in order."""
    by_kind: dict[str, list[Verdict]] = {}
    for verdict in verdicts:
        by_kind.setdefault(verdict.kind, []).append(verdict)
    found = []
    for kind, some in by_kind.items():
        count = Counter(v.verdict for v in some)
        ratio = max((v.ratio for v in some if v.verdict == PASS), default=0.0)
        found.append(Kinds(kind, len(some), {n: count[n] for n in VERDICTS if count[n]}, ratio))
    return found


ELEMENTARY: Sequence[str] = json.loads(
    (Path(__file__).parent / "kinds/order.json").read_text(encoding="utf-8")
)
"""How kinds begin, those that others are made of first: what fails there makes the others fail."""


def first_blamed(verdicts: Sequence[Verdict]) -> Verdict | None:
    """Return the failure to look at first: of the most elementary kind that fails, the first case."""

    def rank(verdict: Verdict) -> int:
        known = [i for i, start in enumerate(ELEMENTARY) if verdict.kind.startswith(start)]
        return min(known, default=len(ELEMENTARY))

    failed = [verdict for verdict in verdicts if verdict.failed]
    return min(failed, key=rank, default=None)


def about(verdict: Verdict, case: Case, again: str) -> list[str]:
    """Return the lines that tell a failure: what, where, input, expected and found, and how to repeat it."""
    note = f": {case.note}" if case.note else ""
    lines = [f"{verdict.verdict.upper()} {verdict.id}, clause {verdict.clause}{note}"]
    where = f"{verdict.stage}: " if verdict.stage else ""
    lines.append(f"  {where}{verdict.text}")
    if verdict.expected or verdict.got:
        lines.append(f"  expected {verdict.expected}, got {verdict.got}")
    text = json.dumps(dict(case.inputs))
    lines.append(f"  input {text if len(text) <= SHOWN_CHARACTERS else text[:SHOWN_CHARACTERS] + '...'}")
    if case.expected is not None and verdict.stage:
        output = case.expected.get(verdict.stage.partition("[")[0])
        lines += [f"  bound: {output.source}"] if output is not None else []
    return [*lines, f"  again: {again}"]


def to_json(program: str, profile: str, verdicts: Sequence[Verdict], again: str) -> str:
    """Return a report as JSON; `again` is the command that asks a single case, without its id."""
    first = first_blamed(verdicts)
    data = {
        "format": "wamnet-conformance-report",
        "version": VERSION,
        "program": program,
        "profile": profile,
        "kinds": {k.kind: {"cases": k.cases, **k.found} for k in counts(verdicts)},
        "look_first_at": first.id if first is not None else None,
        "verdicts": [
            {**verdict.to_json(), **({"again": f"{again} {verdict.id}"} if verdict.failed else {})}
            for verdict in verdicts
        ],
    }
    return json.dumps(data, indent=1) + "\n"


def to_junit(program: str, verdicts: Sequence[Verdict], again: str) -> str:
    """Return a report in the form of JUnit: a suite a kind, `skipped` for what is not supported.

    The text of a failure is the command that repeats it."""
    root = ElementTree.Element("testsuites", name=_xml(program))
    for known in counts(verdicts):
        some = [v for v in verdicts if v.kind == known.kind]
        failures, skipped = known.found.get(FAIL, 0), known.found.get(UNSUPPORTED, 0)
        errors = sum(v.failed for v in some) - failures
        numbers = {"tests": known.cases, "failures": failures, "errors": errors, "skipped": skipped}
        attributes = {"name": known.kind, **{name: str(number) for name, number in numbers.items()}}
        suite = ElementTree.SubElement(root, "testsuite", attributes)
        for v in some:
            element = ElementTree.SubElement(suite, "testcase", classname=v.kind, name=v.id)
            if v.verdict != PASS:
                word = {FAIL: "failure", UNSUPPORTED: "skipped"}.get(v.verdict, "error")
                text = f"{v.clause}: {v.stage} {v.text} expected {v.expected} got {v.got}"
                told = ElementTree.SubElement(element, word, type=v.verdict, message=_xml(text))
                told.text = _xml(f"{again} {v.id}") if v.failed else None
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ElementTree.tostring(root, encoding="unicode") + "\n"


def _xml(text: str) -> str:
    """Return a text without what XML cannot hold."""
    return text.encode("utf-8", "replace").decode().translate(XML_CONTROL)


# ---- tracks -----------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Change:
    """A case whose verdict differs from the last one, which is empty for a new case."""

    verdict: Verdict
    before: str

    @property
    def worse(self) -> bool:
        """Tell whether it fails now and did not before."""
        return self.verdict.failed and self.before in (PASS, UNSUPPORTED, "")

    def __str__(self) -> str:
        return f"{self.verdict.id}: {self.before or 'new'} -> {self.verdict.verdict}"


def read_track(path: Path) -> dict[str, str] | None:
    """Return the last verdicts by id, or nothing where there is no file yet."""
    if not path.exists():
        return None
    way_out = "name a new file, or one that --track wrote"
    with refusing("--track", str(path), "it cannot be read", way_out):
        data: Any = parse_json(read_file(path, "--track", way_out), f"--track {path}", way_out)
        if data["format"] != TRACK:
            raise ValueError(f"its format is not {TRACK!r}")
        return {str(name): str(verdict) for name, verdict in data["verdicts"].items()}


def changes(before: Mapping[str, str], verdicts: Sequence[Verdict]) -> list[Change]:
    """Return the cases whose verdicts differ from the last ones."""
    return [Change(v, before.get(v.id, "")) for v in verdicts if before.get(v.id, "") != v.verdict]


def track_text(before: Mapping[str, str] | None, verdicts: Sequence[Verdict]) -> str:
    """Return the track's new text; cases that were not asked now keep their verdict."""
    found = {**(before or {}), **{v.id: v.verdict for v in verdicts}}
    return json.dumps({"format": TRACK, "version": VERSION, "verdicts": found}, indent=1) + "\n"
