"""Change the reference, or the C program, in one place at a time, and ask the vectors whether they notice.

    python experiments/mutants.py -o out/mutants
    python experiments/mutants.py -o out/mutants --count 400 --seed 1
    python experiments/mutants.py -o out/mutants refimpl/rng.py transport.py:2
    python experiments/mutants.py -o out/mutants --c99 --count 600

Words choose mutants whose name holds one, or whose change, which has a function in place of the line;
`--count` draws some by a seed. Outcomes are kept in the folder, and a mutant that has one is not asked again.
It prints tables of mutants by module and by sort, then every survivor without a reason in
records/survivors.txt.
"""

import argparse
import json
import random
import re
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import chain
from pathlib import Path
from typing import NamedTuple

from lab import mutation, mutation_c, trial, trial_c
from lab.blame import Clauses
from lab.command import described
from lab.mutation import Mutant
from lab.tables import markdown
from lab.trial import Outcome

REASONS = trial.ROOT / "experiments/records/survivors.txt"
"""Survivors that no vector can tell from the reference: `change | number | sort | words` ([`Reason`])."""

C99 = "examples/c99/wamnet.c"
"""The C program."""

MOST_MISSED = 0.03
"""Largest share of mutants that may survive without a reason."""

EVERY = 50
"""Mutants after which progress is reported."""


def texts(c99: bool) -> dict[str, str]:
    """Return the texts that are changed, by path."""
    return {
        path: (trial.ROOT / path).read_text(encoding="utf-8") for path in ([C99] if c99 else trial.paths())
    }


def chosen(words: Sequence[str], count: int | None, seed: int, c99: bool = False) -> list[Mutant]:
    """Return the mutants whose name or change holds a word, all without words; some, drawn by a seed."""
    make = mutation_c.mutants if c99 else mutation.mutants
    every = [m for path, text in texts(c99).items() for m in make(path, text)]
    found = [m for m in every if not words or any(word in m.name or word in m.change for word in words)]
    if count is None or count >= len(found):
        return found
    # Fewer are a part of more: a run that is cut short is a draw too.
    random.Random(seed).shuffle(found)
    return found[:count]


def of_reference(some: Sequence[Mutant]) -> Iterator[Outcome | None]:
    """Yield what comes of mutants of the reference."""
    cases, sources = trial.in_order(), texts(c99=False)
    reached = trial.reach(cases)
    yield from (trial.trial(mutant, sources[mutant.module], cases, reached) for mutant in some)


def of_c99(some: Sequence[Mutant]) -> Iterator[Outcome | None]:
    """Yield what comes of mutants of the C program."""
    cases, (source,) = trial.in_order(), texts(c99=True).values()
    with tempfile.TemporaryDirectory() as place:
        lines = trial_c.reach(source, cases, Path(place))
        yield from (trial_c.trial(mutant, source, cases, lines, Path(place)) for mutant in some)


def asked(some: Sequence[Mutant], kept: dict[str, Outcome], path: Path, options: argparse.Namespace) -> None:
    """Ask mutants that have no outcome yet, and add theirs to the file."""
    waiting = [m for m in some if m.name not in kept]
    if not waiting:
        return
    began = time.monotonic()
    outcomes = (of_c99 if options.c99 else of_reference)(waiting)
    with path.open("a", encoding="utf-8") as file:
        for number, (mutant, outcome) in enumerate(zip(waiting, outcomes, strict=True)):
            # What does not compile counts as not reached.
            kept[mutant.name] = outcome or Outcome(0)
            file.write(json.dumps([mutant.name, *kept[mutant.name]]) + "\n")
            file.flush()
            if number % EVERY == 0:
                seconds = time.monotonic() - began
                print(f"{number} of {len(waiting)}, {seconds:.0f} s", file=sys.stderr, flush=True)


def read(path: Path) -> dict[str, Outcome]:
    """Return the outcomes in a file."""
    if not path.exists():
        return {}
    rows = (json.loads(line) for line in path.read_text(encoding="utf-8").splitlines())
    return {name: Outcome(*rest) for name, *rest in rows}


class Reason(NamedTuple):
    """Why no vector can tell some mutants.

    `changes` fits all of their [`Mutant.change`], * is any text; `number` is how many of all mutants it fits,
    which a test asks: one more, and somebody must look at it. `sort` is one of [`SORTS`].
    """

    changes: re.Pattern[str]
    number: int
    sort: str
    words: str


SORTS = {
    "equal": "the same for all inputs, or beneath every bound",
    "unasked": "no kind asks for what it changes",
}
"""Sorts of reasons."""


def reasons(path: Path = REASONS) -> list[Reason]:
    """Return the reasons in a file."""
    found = []
    for line in path.read_text(encoding="utf-8").splitlines():
        if line.strip() and not line.startswith("#"):
            # A change may hold the sign between columns.
            change, number, sort, words = (part.strip() for part in line.rsplit(" | ", 3))
            assert sort in SORTS, f"{line}: a reason is one of {', '.join(SORTS)}"
            pattern = re.compile(re.escape(change).replace(r"\*", ".*"))
            found.append(Reason(pattern, int(number), sort, words))
    return found


def reason_of(mutant: Mutant, known: Sequence[Reason]) -> Reason | None:
    """Return the first reason that fits a mutant."""
    return next((reason for reason in known if reason.changes.fullmatch(mutant.change)), None)


def excuse(mutant: Mutant, known: Sequence[Reason]) -> str:
    """Return the sort of the reason that a mutant has, or nothing."""
    found = reason_of(mutant, known)
    return found.sort if found else ""


def faults(some: Sequence[Mutant], known: Sequence[Reason]) -> list[str]:
    """Return what is wrong: reasons that fit more or fewer mutants than they say, or one of another."""
    fits = [[m.change for m in some if reason.changes.fullmatch(m.change)] for reason in known]
    wrong = [
        f"{reason.changes.pattern} fits {len(found)} mutants, not {reason.number}: look at {found[:3]}"
        for reason, found in zip(known, fits, strict=True)
        if len(found) != reason.number
    ]
    several = [change for change, count in Counter(chain(*fits)).items() if count > 1]
    return wrong + [f"{change} has more than one reason" for change in several]


HEADS = ("mutants", "reached", "caught", "equal", "unasked", "missed", "caught, %", "clause, %", "chapter, %")
"""Columns: how many there are, run at all, differ in an answer, have a reason of each sort, and have none.
Shares are of those without a reason; blame is that of wrong answers."""


def table(first: str, rows: Mapping[str, Sequence[Mutant]], kept: Mapping[str, Outcome]) -> str:
    """Return a table of what came of mutants, with the sum of all in the last row."""
    known, clauses = reasons(), Clauses()
    every = [mutant for part in rows.values() for mutant in part]
    lines = [[name, *_row(some, kept, known, clauses)] for name, some in [*rows.items(), ("all", every)]]
    return markdown((first, *HEADS), lines)


def _row(
    some: Sequence[Mutant], kept: Mapping[str, Outcome], known: Sequence[Reason], clauses: Clauses
) -> list[str]:
    """Return the cells of a row."""
    reached = [m for m in some if kept[m.name].asked]
    caught = [m for m in reached if kept[m.name].verdict]
    sorts = Counter(excuse(m, known) for m in reached if not kept[m.name].verdict)
    numbers = (len(some), len(reached), len(caught), *(sorts[sort] for sort in SORTS), sorts[""])
    wrong = [m for m in caught if kept[m.name].verdict == "fail"]
    right = sum(kept[m.name].clause in clauses.broken(m) for m in wrong)
    near = sum(clauses.near(m, kept[m.name].clause) for m in wrong)
    shares = (len(caught), len(caught) + sorts[""]), (right, len(wrong)), (near, len(wrong))
    return [*map(str, numbers), *(f"{100 * part / whole:.1f}" if whole else "" for part, whole in shares)]


def main(arguments: Sequence[str] | None = None) -> int:
    """Ask mutants and print what came of them; return 1 where too many survive without a reason.

    The share is that of mutants that are run and have no reason, of which all would be caught at best.
    """
    parser = described(__doc__)
    parser.add_argument("words", nargs="*", help="only mutants whose name holds one")
    parser.add_argument("-o", "--output", type=Path, required=True, help="folder of outcomes")
    parser.add_argument("--count", type=int, help="how many, drawn at random; all without it")
    parser.add_argument("--seed", type=int, default=0, help="seed of the draw")
    parser.add_argument("--c99", action="store_true", help="change the C program, not the reference")
    options = parser.parse_args(arguments)
    options.output.mkdir(parents=True, exist_ok=True)
    path = options.output / ("c99.jsonl" if options.c99 else "reference.jsonl")
    some, kept = chosen(options.words, options.count, options.seed, options.c99), read(path)
    asked(some, kept, path, options)
    some.sort(key=lambda m: (m.module, m.start))
    print(table("chapter" if options.c99 else "module", _grouped(some, _place), kept))
    print(table("change", _grouped(some, lambda m: m.operator), kept))
    known = reasons()
    fair = [m for m in some if kept[m.name].asked and not excuse(m, known)]
    left = [m for m in fair if not kept[m.name].verdict]
    print("\n".join(f"missed: {m.change} (line {m.line})" for m in left))
    return 1 if len(left) > MOST_MISSED * len(fair) else 0


def _place(mutant: Mutant) -> str:
    """Return the module of a mutant, or the chapter of its first clause in the C program."""
    return mutant.function.partition("-")[0] if mutant.module == C99 else mutant.module


def _grouped(some: Sequence[Mutant], key: Callable[[Mutant], str]) -> dict[str, list[Mutant]]:
    """Return mutants by a word of theirs."""
    found: dict[str, list[Mutant]] = {}
    for mutant in some:
        found.setdefault(key(mutant), []).append(mutant)
    return found


if __name__ == "__main__":
    sys.exit(main())
