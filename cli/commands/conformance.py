"""`wamnet conformance`: hold any program, or the project's own executors, to the vectors of the spec."""

import shlex
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import typer

from ...compiler.core.profiles import profile_named
from ...kernels.devices.registry import EXECUTORS
from ...kernels.export.targets import RUNNERS
from ...refimpl.errors import NO_VALUE, InputError, choice
from ...spec.conformance import report, run
from ...spec.conformance import vectors as all_vectors
from ...spec.conformance.case import FOLDER, Case
from ...spec.conformance.protocol import Session
from ...spec.conformance.report import about, counts, first_blamed
from ...spec.conformance.run import PASS, UNSUPPORTED, Verdict
from ..common.request import given
from ..common.terminal import STATUS_WRONG, progress, say, table
from ..files.outputs import check_output, write_text

SHOWN_FAILURES = 10
"""Failures that are printed in full; the reports hold all."""


@dataclass(frozen=True)
class Tested:
    """The program under test, and what it is asked."""

    program: str | None = None
    executor: str | None = None
    profile: str = "ieee"
    words: list[str] | None = None
    vectors: Path | None = None
    track: Path | None = None
    timeout: float = 60.0

    @property
    def again(self) -> str:
        """Return the command that asks again; a case's id is to be added."""
        asked = given(self, "program", "executor", "profile", "vectors", "timeout")
        words = [
            f"{word:g}" if isinstance(word, float) else str(word) for pair in asked.items() for word in pair
        ]
        return shlex.join(["wamnet", "conformance", *words, "-k"])


def conformance(
    *,
    tested: Tested,
    as_json: Path | None = None,
    junit: Path | None = None,
    write: Path | None = None,
) -> None:
    """Test a program against the spec's vectors and their error bounds."""
    if write is not None:
        if given(tested, "program", "executor"):
            rule = "it makes vectors and asks nobody"
            raise InputError("--write", str(write), rule, "leave --program and --executor out")
        say(f"wrote {all_vectors.write(write)} files to {write}")
        return
    profile, track, words = tested.profile, tested.track, tested.words or ()
    profile_named(profile)
    command = _command(tested.program, tested.executor)
    for path in filter(None, (track, as_json, junit)):
        check_output(path)
    cases = run.chosen(run.read_vectors(tested.vectors or FOLDER), words)
    if not cases:
        rule = "no case has such an id, clause or flag"
        raise InputError("-k", " ".join(words), rule, "for example -k random, -k RNG-3 or -k random.block/0")
    before = None if track is None else report.read_track(track)
    total = sum(map(len, cases.values()))
    with Session(command, tested.timeout) as session, progress("testing", total, "cases") as advance:
        verdicts = list(run.run(session, cases, profile, advance))
    name = tested.program or f"executor {tested.executor}"
    if as_json is not None:
        write_text(as_json, report.to_json(name, profile, verdicts, tested.again))
    if junit is not None:
        write_text(junit, report.to_junit(name, verdicts, tested.again))
    _print_counts(f"Conformance of {name}, profile {profile}", verdicts)
    failed = [verdict for verdict in verdicts if verdict.failed]
    if track is not None and before is not None:
        changed = report.changes(before, verdicts)
        failed = [change.verdict for change in changed if change.worse]
        for change in changed:
            say(str(change))
        say(f"{len(changed)} verdicts changed since {track} was written, {len(failed)} for the worse")
    _print_failures(failed, cases, tested.again)
    if track is not None and (before is None or not failed):
        write_text(track, report.track_text(before, verdicts))
    if failed:
        raise typer.Exit(STATUS_WRONG)


def _command(program: str | None, executor: str | None) -> list[str]:
    """Return the command of the program under test."""
    if (program is None) == (executor is None):
        rule = "one of them is needed" if program is None else "exclude each other"
        raise InputError("--program and --executor", NO_VALUE, rule, "for example --executor numpy")
    if program is not None:
        try:
            command = shlex.split(program)
        except ValueError as error:
            raise InputError(
                "--program", program, f"is not a command: {error}", "close quotation marks"
            ) from None
        if not command:
            raise InputError("--program", program, "is not a command", "name a program")
        return command
    if executor not in ("reference", *EXECUTORS, *RUNNERS):
        known = dict.fromkeys(("reference", *EXECUTORS, *RUNNERS))
        raise InputError("--executor", executor, "unknown", choice(str(executor), known))
    return [sys.executable, "-m", "wamnet.spec.conformance.program", "--executor", str(executor)]


def _print_counts(title: str, verdicts: Sequence[Verdict]) -> None:
    """Print a table with a line a kind."""
    rows = []
    for known in counts(verdicts):
        passed, unsupported = known.found.get(PASS, 0), known.found.get(UNSUPPORTED, 0)
        others = {word: n for word, n in known.found.items() if word not in (PASS, UNSUPPORTED)}
        text = ", ".join(f"{n} {word}" for word, n in others.items()) or "0"
        ratio = f"{known.ratio:.2f}" if passed else "-"
        rows.append((known.kind, str(known.cases), str(passed), text, str(unsupported), ratio))
    header = ("kind", "cases", "pass", "failed", "unsupported", "error / bound")
    table(title, header, rows)
    failed = sum(verdict.failed for verdict in verdicts)
    passed = sum(verdict.verdict == PASS for verdict in verdicts)
    rest = len(verdicts) - passed - failed
    say(f"{passed} of {len(verdicts)} cases passed, {failed} failed, {rest} unsupported")


def _print_failures(failed: Sequence[Verdict], cases: Mapping[str, Sequence[Case]], again: str) -> None:
    """Print the first failures in full."""
    first = first_blamed(failed)
    if first is not None and len(failed) > 1:
        say(f"look first at {first.clause}: {first.id} fails, and others depend on it")
    by_id = {case.id: case for some in cases.values() for case in some}
    for verdict in failed[:SHOWN_FAILURES]:
        for line in about(verdict, by_id[verdict.id], f"{again} {verdict.id}"):
            say(line)
    if len(failed) > SHOWN_FAILURES:
        say(f"... and {len(failed) - SHOWN_FAILURES} more; --json or --junit report all")
