"""Show one mutant of the reference: its line, which cases of the suite see it, and which clause is blamed.

    python experiments/mutant.py "sphere.py:*:discriminant > 0.0 -> (discriminant >= 0.0)"
    python experiments/mutant.py "sphere.py:*:b < 0.0 -> (b <= 0.0)" -k intersection

The name is as `mutants.py` writes it, or its end, or a part; * is any text, so that no line needs a number.
What names several mutants is refused with a list, and so is what names none. `-k` chooses cases as `wamnet
conformance` does; without it all are asked, except pictures that are judged by chance.
"""

import re
from collections.abc import Iterator, Sequence

import mutants
from lab import mutation, trial
from lab.blame import Clauses
from lab.command import described
from lab.mutation import Mutant

from wamnet.refimpl.errors import InputError
from wamnet.spec.conformance import run
from wamnet.spec.conformance.case import Case

MOST_LISTED = 20
"""Mutants that a refusal lists at most."""

Asked = Sequence[tuple[str, Case]]
"""Kinds and cases, the most elementary kind first."""

Failures = Sequence[list[str] | None]
"""Of each case: its id, the clause that is blamed, the output, verdict and text; None where it passed."""


def named(name: str) -> Mutant:
    """Return the one mutant with a name, or refuse it."""
    pattern = ".*" + re.escape(name).replace(r"\*", ".*")
    every = mutants.chosen((), None, 0)
    found = [mutant for mutant in every if re.fullmatch(pattern, mutant.name)]
    found = found or [mutant for mutant in every if re.match(pattern, mutant.name)]
    if len(found) == 1:
        return found[0]
    rule = f"must be the name of one mutant, not of {len(found)}"
    some = "; ".join(mutant.name for mutant in found[:MOST_LISTED])
    raise InputError("mutant", name, rule, some or "the name of a module lists some of its mutants")


def cases(words: Sequence[str]) -> Asked:
    """Return the cases that words choose, the most elementary kind first."""
    every = trial.in_order()
    wanted = run.chosen({kind: [c for k, c in every if k == kind] for kind, _ in every}, words)
    ids = {case.id for some in wanted.values() for case in some}
    return [(k, c) for k, c in every if c.id in ids and (words or k not in trial.STATISTICAL)]


def changed(mutant: Mutant, source: str) -> Iterator[str]:
    """Yield the lines before the change, with -, and after it, with +."""
    pairs = zip(source.splitlines(), mutation.mutated(mutant, source).splitlines(), strict=True)
    for old, new in pairs:
        if old != new:
            yield from (f"- {old.strip()}", f"+ {new.strip()}")


def told(mutant: Mutant, source: str, asked: Asked, failures: Failures, whole: bool) -> Iterator[str]:
    """Yield the lines of a report; only the `whole` suite can miss a mutant, not some of its cases."""
    yield f"{mutant.module}:{mutant.line}, governed by {', '.join(sorted(Clauses().broken(mutant)))}"
    yield from changed(mutant, source)
    seen = [(kind, failed) for (kind, _), failed in zip(asked, failures, strict=True) if failed]
    yield f"{len(seen)} of {len(asked)} cases see it{':' if seen else ''}"
    if not seen:
        reason = mutants.reason_of(mutant, mutants.reasons())
        missed = "missed: a case, or a reason, is still to be written"
        others = "other cases may see it: ask without -k"
        yield f"{reason.sort}: {reason.words}" if reason else missed if whole else others
        return
    for kind in dict.fromkeys(kind for kind, _ in seen):
        blamed = [failed[1] for found, failed in seen if found == kind]
        count = sum(found == kind for found, _ in asked)
        yield f"  {kind}: {len(blamed)} of {count} cases, blamed on {', '.join(sorted(set(blamed)))}"
    name, clause, output, verdict, text = seen[0][1]
    note = next(case.note for _, case in asked if case.id == name)
    yield f"look first at {clause}: {name}{note and f' ({note})'}"
    yield f"{': '.join(part for part in (output, text or verdict) if part)}"


def main(arguments: Sequence[str] | None = None) -> None:
    """Show a mutant."""
    parser = described(__doc__)
    parser.add_argument("name", help="name of a mutant, or a part of it; * is any text")
    parser.add_argument("-k", dest="words", action="append", default=[], help="only such cases")
    options = parser.parse_args(arguments)
    try:
        mutant = named(options.name)
        asked = cases(options.words)
        if not asked:
            raise InputError("-k", " ".join(options.words), "no case fits", "for example -k adam")
    except InputError as error:
        parser.error(str(error))
    source = mutants.texts(c99=False)[mutant.module]
    failures = trial.failures(mutant, source, asked)
    print("\n".join(told(mutant, source, asked, failures, not options.words)))


if __name__ == "__main__":
    main()
