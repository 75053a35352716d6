"""Mutants of the second implementation: each breaks one clause, and the vectors must say which.

`python examples/c99/mutants.py` prints a line a mutant, and how many of them were caught. It takes a minute
of one core. With words, only those whose clause is one, or whose name holds one.

1. A mutant is wamnet.c with one piece of its text replaced, as mutants.txt says [`Mutant`], [`read`]; it is
   compiled and asked like any program [`outcome`].
2. It is caught if a case fails. The blame is the clause that `wamnet conformance` says to look at first: that
   of the first failure of the most elementary kind that fails. It must be the clause that the mutant breaks.
3. Only the kinds are asked that could notice; of some mutants, everything.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from wamnet.spec.conformance import run, vectors
from wamnet.spec.conformance.case import Case
from wamnet.spec.conformance.protocol import Session
from wamnet.spec.conformance.report import first_blamed

SOURCE = Path(__file__).with_name("wamnet.c")
"""What is mutated."""

TABLE = Path(__file__).with_name("mutants.txt")
"""How."""

TIMEOUT_S = 30.0
"""Longest time for an answer."""

EVERYTHING = "everything"
"""Word for all cases."""


class Mutant(NamedTuple):
    """One change: the clause that it breaks, what it is, who is asked, a text and what replaces it."""

    clause: str
    name: str
    asked: tuple[str, ...]
    old: str
    new: str


class Outcome(NamedTuple):
    """What came of a mutant: how many cases failed, the clause that is blamed, and the case."""

    failed: int
    clause: str
    case: str


def read(table: str) -> list[Mutant]:
    """Return the mutants of a table: each paragraph is one, except for the first."""
    found = []
    for paragraph in table.strip().split("\n\n")[1:]:
        title, ask, *lines = paragraph.split("\n")
        clause, _, name = title.partition(": ")
        words = tuple(ask.split()[1:])
        old, new = ("\n".join(line[1:] for line in lines if line[0] == sign) for sign in "-+")
        found.append(Mutant(clause, name, () if words == (EVERYTHING,) else words, old, new))
    return found


def mutated(mutant: Mutant, text: str) -> str:
    """Return the program with the change; its text must occur once."""
    count = text.count(mutant.old)
    if count != 1 or mutant.old == mutant.new:
        raise ValueError(f"{mutant.name}: its text appears {count} times, or stays as it is")
    return text.replace(mutant.old, mutant.new)


def outcome(mutant: Mutant, cases: Mapping[str, Sequence[Case]], folder: Path, compiler: str) -> Outcome:
    """Compile a mutant and ask it."""
    source, program = folder / "mutant.c", folder / "mutant"
    source.write_text(mutated(mutant, SOURCE.read_text()))
    subprocess.run([compiler, "-std=c99", "-O0", "-w", source, "-o", program, "-lm"], check=True)
    with Session([str(program)], TIMEOUT_S) as session:
        found = list(run.run(session, run.chosen(cases, mutant.asked), "ieee"))
    first = first_blamed(found)
    failed = sum(verdict.failed for verdict in found)
    return Outcome(failed, first.clause if first else "", first.id if first else "")


def main(arguments: Sequence[str] | None = None) -> int:
    """Ask all mutants, print what came of each, and return the exit status."""
    parser = argparse.ArgumentParser(description="Ask the mutants of wamnet.c.")
    parser.add_argument("words", nargs="*", help="only mutants whose clause is one, or whose name holds one")
    parser.add_argument("--cc", default="cc", help="the C compiler")
    options = parser.parse_args(arguments)
    mutants = [
        m
        for m in read(TABLE.read_text())
        if not options.words or any(word == m.clause or word in m.name for word in options.words)
    ]
    cases = run.read_vectors(vectors.FOLDER)
    caught = right = 0
    with tempfile.TemporaryDirectory() as folder:
        for mutant in mutants:
            failed, clause, case = outcome(mutant, cases, Path(folder), options.cc)
            caught += failed > 0
            right += clause == mutant.clause
            told = f"caught by {failed} cases, first {case}" if failed else "survives"
            told += "" if clause == mutant.clause or not failed else f", and {clause} is blamed"
            print(f"{mutant.clause:7} {mutant.name}: {told}", flush=True)
    print(f"{caught} of {len(mutants)} mutants caught, {right} of them blamed on the clause that they break")
    return 0 if caught == right == len(mutants) else 1


if __name__ == "__main__":
    sys.exit(main())
