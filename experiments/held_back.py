"""Plant faults that are kept back in the program in JavaScript, one at a time, and ask the vectors.

    python experiments/held_back.py -o out/held-back
    python experiments/held_back.py -o out/held-back transport.mjs LTR-9

1. examples/javascript/faults.json has a hundred mistakes of a programmer, written from the text and the
   program before the vectors were asked about them. No vector is made for one of them before it has been
   counted.
2. Each is made in a copy of the program, which is asked all cases, the most elementary kind first, until one
   fails: the clause of that case is the one that `wamnet conformance` says to look at first.
3. Words choose faults by their file or clause. Outcomes are kept in the folder, and a fault that has one is
   not asked again.
4. It prints tables of faults by file, of those that no case catches, and of those that blame another chapter.
   It ends with status 1 if a smaller share is caught than `--least-caught`.
"""

from __future__ import annotations

import argparse
import functools
import json
import shutil
import sys
import tempfile
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import NamedTuple

from lab import trial, trial_c
from lab.blame import CLAUSE
from lab.command import begin
from lab.tables import markdown
from lab.trial import Outcome

from wamnet.refimpl.errors import ExecutorUnavailable
from wamnet.spec.conformance import vectors
from wamnet.spec.conformance.case import Case
from wamnet.spec.conformance.protocol import Session

PROGRAM = trial.ROOT / "examples/javascript"
"""The program that is changed."""

LEAST_CAUGHT = 0.95
"""Share of the faults that are not equal that cases should catch."""

LIMIT_S = 20.0
"""Longest time for an answer: many times what the slowest case takes."""


class Fault(NamedTuple):
    """A mistake: in a file a text, which is there once, becomes another, and breaks a clause.

    `says` is the mistake in words. The first run missed some: `equal` is the reason why no input that the
    spec allows shows the fault, `shown_by` an input that does, with the right answer."""

    file: str
    old: str
    new: str
    clause: str
    says: str
    equal: str = ""
    shown_by: str = ""

    @property
    def name(self) -> str:
        """Return what an outcome is kept under."""
        return f"{self.file}: {self.old} -> {self.new}"


def faults(path: Path = PROGRAM / "faults.json") -> list[Fault]:
    """Return the faults of a file."""
    return [Fault(**entry) for entry in json.loads(path.read_text(encoding="utf-8"))]


def program(folder: Path, fault: Fault | None = None) -> list[str]:
    """Copy the program to a folder, with a fault in it; return its command."""
    node = shutil.which("node")
    if node is None:
        raise ExecutorUnavailable("node is not there: apt-get install nodejs")
    for path in PROGRAM.glob("*.mjs"):
        shutil.copy(path, folder)
    if fault is not None:
        path = folder / fault.file
        text = path.read_text(encoding="utf-8")
        assert text.count(fault.old) == 1, f"{fault.name}: it must be there once"
        path.write_text(text.replace(fault.old, fault.new), encoding="utf-8")
    return [node, str(folder / "program.mjs")]


def tried(fault: Fault | None, cases: Sequence[tuple[str, Case]]) -> Outcome:
    """Ask a program with a fault until a case fails."""
    with tempfile.TemporaryDirectory() as place, Session(program(Path(place), fault), LIMIT_S) as session:
        return Outcome(len(cases), *(trial_c.asked(session, cases) or ()))


def asked(some: Sequence[Fault], kept: dict[str, Outcome], path: Path, options: argparse.Namespace) -> None:
    """Ask faults that have no outcome yet, and add theirs to the file."""
    waiting = [fault for fault in some if fault.name not in kept]
    if not waiting:
        return
    cases = trial.in_order(options.vectors)
    with path.open("a", encoding="utf-8") as file, ThreadPoolExecutor(options.jobs) as pool:
        outcomes = pool.map(functools.partial(tried, cases=cases), waiting)
        for number, (fault, outcome) in enumerate(zip(waiting, outcomes, strict=True), 1):
            kept[fault.name] = outcome
            file.write(json.dumps([fault.name, *outcome]) + "\n")
            file.flush()
            came = f"{outcome.verdict} {outcome.case}" if outcome.verdict else "not caught"
            print(
                f"{number} of {len(waiting)}: {fault.file} {fault.clause}: {came}",
                file=sys.stderr,
                flush=True,
            )


def read(path: Path) -> dict[str, Outcome]:
    """Return the outcomes in a file."""
    if not path.exists():
        return {}
    rows = (json.loads(line) for line in path.read_text(encoding="utf-8").splitlines())
    return {name: Outcome(*rest) for name, *rest in rows}


@functools.cache
def chapters() -> Mapping[str, str]:
    """Return the file of each clause."""
    found = {}
    for path in (trial.ROOT / "spec").glob("*.md"):
        found.update(dict.fromkeys(CLAUSE.findall(path.read_text(encoding="utf-8")), path.stem))
    return found


def near(one: str, other: str) -> bool:
    """Tell whether two clauses are of one chapter: their letters or their file are the same."""
    of = chapters()
    return one.partition("-")[0] == other.partition("-")[0] or (one in of and of[one] == of.get(other))


HEADS = ("file", "faults", "caught", "equal", "missed", "caught, %", "clause, %", "chapter, %")
"""Columns of the first table. Shares are of the faults that are not equal; blame is that of wrong answers."""


def table(some: Iterable[Fault], kept: Mapping[str, Outcome]) -> str:
    """Return a table of what came of faults, with the sum of all in the last row."""
    rows: dict[str, list[Fault]] = {}
    for fault in some:
        rows.setdefault(fault.file, []).append(fault)
    every = [fault for part in rows.values() for fault in part]
    return markdown(HEADS, [[name, *_row(part, kept)] for name, part in [*rows.items(), ("all", every)]])


def _row(some: Sequence[Fault], kept: Mapping[str, Outcome]) -> list[str]:
    """Return the cells of a row."""
    caught = [fault for fault in some if kept[fault.name].verdict]
    equal = sum(bool(fault.equal) for fault in some)
    wrong = [fault for fault in caught if kept[fault.name].verdict == "fail"]
    right = sum(kept[fault.name].clause == fault.clause for fault in wrong)
    close = sum(near(kept[fault.name].clause, fault.clause) for fault in wrong)
    fair = len(some) - equal
    shares = (len(caught), fair), (right, len(wrong)), (close, len(wrong))
    numbers = map(str, (len(some), len(caught), equal, fair - len(caught)))
    return [*numbers, *(f"{100 * part / whole:.1f}" if whole else "" for part, whole in shares)]


def left(some: Iterable[Fault], kept: Mapping[str, Outcome]) -> str:
    """Return a table of the faults that no case catches."""
    survivors = [fault for fault in some if not kept[fault.name].verdict]
    rows = [
        [f.file, f.clause, f.says, f"equal: {f.equal}" if f.equal else f"missed: {f.shown_by}"]
        for f in survivors
    ]
    return markdown(("file", "clause", "not caught", "why"), rows)


def elsewhere(some: Iterable[Fault], kept: Mapping[str, Outcome]) -> str:
    """Return a table of the faults whose first failure blames another chapter."""
    wrong = [(fault, kept[fault.name]) for fault in some if kept[fault.name].verdict == "fail"]
    rows = [[f.file, f.clause, f.says, o.clause, o.case] for f, o in wrong if not near(o.clause, f.clause)]
    return markdown(("file", "clause", "blamed elsewhere", "blamed", "first case"), rows)


def main(arguments: Sequence[str] | None = None) -> int:
    """Ask faults and print what came of them; return 1 where too few are caught."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("words", nargs="*", help="only faults of these files and clauses")
    parser.add_argument("-o", "--output", type=Path, required=True, help="folder of outcomes")
    parser.add_argument("--faults", type=Path, default=PROGRAM / "faults.json", help="list of faults")
    parser.add_argument("--vectors", type=Path, default=vectors.FOLDER, help="folder of vectors")
    parser.add_argument("--least-caught", type=float, default=LEAST_CAUGHT, help="share to be caught")
    parser.add_argument("--jobs", type=int, default=2, help="programs that are asked at once")
    options = parser.parse_args(arguments)
    options.output.mkdir(parents=True, exist_ok=True)
    path = options.output / "outcomes.jsonl"
    every, kept = faults(options.faults), read(path)
    some = [f for f in every if not options.words or {f.file, f.clause} & set(options.words)]
    asked(some, kept, path, options)
    excused = [f.name for f in some if f.equal and kept[f.name].verdict]
    assert not excused, f"caught, and said to be equal: {excused}"
    for made in (table, left, elsewhere):
        print(made(some, kept))
    fair = [fault for fault in some if not fault.equal]
    return int(sum(bool(kept[f.name].verdict) for f in fair) < options.least_caught * len(fair))


if __name__ == "__main__":
    begin(lambda arguments: sys.exit(main(arguments)))
