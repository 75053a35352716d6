"""Mutants of the C program before the judge: each compiled, and asked what reaches its line.

1. The program is built once with gcc's counters of lines, and each kind asked, so that a mutant is asked
   only the kinds that reach its line [`reach`].
2. A mutant is compiled without optimisation; one that does not compile is left out. It is asked until a case
   fails, the most elementary kind first [`trial`].
"""

import gzip
import json
import subprocess
from collections.abc import Mapping, Sequence
from pathlib import Path

from wamnet.spec.conformance import run
from wamnet.spec.conformance.case import Case
from wamnet.spec.conformance.protocol import Session

from .mutation import Mutant, mutated
from .trial import Outcome

LIMIT_S = 10.0
"""Longest time for an answer."""

BUILD = ("gcc", "-std=c99", "-O0", "-w")
"""How a mutant is compiled."""


def build(source: str, folder: Path, *options: str) -> str | None:
    """Compile a program and return its path, or None where it does not compile."""
    path, made = folder / "program.c", folder / "program"
    path.write_text(source, encoding="utf-8")
    done = subprocess.run(
        [*BUILD, *options, path, "-o", made, "-lm"], capture_output=True, check=False, cwd=folder
    )
    return str(made) if done.returncode == 0 else None


def reach(source: str, cases: Sequence[tuple[str, Case]], folder: Path) -> Mapping[int, frozenset[str]]:
    """Return the kinds that reach each line."""
    made = build(source, folder, "--coverage")
    assert made is not None, "the program must compile"
    found: dict[int, set[str]] = {}
    for kind in dict.fromkeys(kind for kind, _ in cases):
        for old in folder.glob("*.gcda"):
            old.unlink()
        with Session([made], LIMIT_S) as session:
            failed = asked(session, [(k, case) for k, case in cases if k == kind])
        assert failed is None, f"{failed} fails without a change"
        for line in _reached(folder):
            found.setdefault(line, set()).add(kind)
    return {line: frozenset(kinds) for line, kinds in found.items()}


def _reached(folder: Path) -> list[int]:
    """Return the lines that ran, as gcov tells them."""
    counts = next(iter(folder.glob("*.gcda")))
    subprocess.run(["gcov", "--json-format", counts.name], capture_output=True, check=True, cwd=folder)
    with gzip.open(next(iter(folder.glob("*.gcov.json.gz"))), "rt") as file:
        data = json.load(file)
    return [line["line_number"] for line in data["files"][0]["lines"] if line["count"]]


def asked(session: Session, cases: Sequence[tuple[str, Case]]) -> list[str] | None:
    """Return case, clause, output, verdict and text of the first failure, or None."""
    for kind, case in cases:
        verdict = run._asked(session, kind, case, "ieee")
        if verdict.failed:
            return [verdict.id, verdict.clause, verdict.stage, verdict.verdict, verdict.text[:120]]
    return None


def trial(
    mutant: Mutant,
    source: str,
    cases: Sequence[tuple[str, Case]],
    lines: Mapping[int, frozenset[str]],
    folder: Path,
) -> Outcome | None:
    """Ask a mutant; None where it does not compile."""
    kinds = lines.get(mutant.line, frozenset())
    wanted = [(kind, case) for kind, case in cases if kind in kinds]
    if not wanted:
        return Outcome(0)
    made = build(mutated(mutant, source), folder)
    if made is None:
        return None
    with Session([made], LIMIT_S) as session:
        failed = asked(session, wanted)
    return Outcome(len(wanted), *(failed or ("", "", "", "", "")))
