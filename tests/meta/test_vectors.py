"""House rules about vectors: clauses that they name exist, and a report of clauses that nothing proves.

The report is `golden/clauses_without_proof.txt` of the tests: a clause that no vector names, and no test
either, by its number or by a name of its code. It can only change where a commit shows it.
"""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]

CLAUSE = re.compile(r"^\*\*([A-Z0-9]+-\d+[a-z]?)\*\*", re.MULTILINE)
"""A clause opens a paragraph with its number."""

CODE = re.compile(r"`(?:refimpl|compiler|kernels|cli)/[\w/]+\.py: *([\w., ]+)`")
"""The names of code that a clause is about."""


def clauses(folder: Path) -> dict[str, set[str]]:
    """Return the names of code of each clause."""
    found = {}
    for path in sorted(folder.glob("*.md")):
        text = path.read_text()
        starts = list(CLAUSE.finditer(text))
        for match, after in zip(starts, [*starts[1:], None], strict=False):
            body = text[match.end() : after.start() if after else len(text)]
            found[match[1]] = {name.strip() for names in CODE.findall(body) for name in names.split(",")}
    return found


def named_by_vectors(folder: Path) -> dict[str, list[str]]:
    """Return the ids of cases by the clause that they name."""
    found: dict[str, list[str]] = {}
    for path in sorted(folder.glob("*.json")):
        for case in json.loads(path.read_text()).get("cases", ()):
            for part in (case, *case.get("expected", {}).values()):
                if "clause" in part:
                    found.setdefault(part["clause"], []).append(case["id"])
    return found


def words_of_tests() -> set[str]:
    """Return every word of every test: names of functions, and numbers of clauses."""
    texts = [path.read_text() for path in (ROOT / "tests").rglob("*.py") if path != Path(__file__)]
    return set(re.findall(r"\b[A-Z]{2,5}-\d+[a-z]?\b|\w+", "\n".join(texts)))


def without_proof(known: dict[str, set[str]], vectors: dict[str, list[str]], words: set[str]) -> list[str]:
    """Return the clauses that no vector names, and no test either, by number or by a name of its code."""
    return [
        clause
        for clause, names in known.items()
        if clause not in vectors
        and clause not in words
        and not any(name.rpartition(".")[2] in words for name in names)
    ]


def test_clauses_that_vectors_name_exist(house):
    known = clauses(house.root / "spec")
    found = named_by_vectors(house.root / "spec/vectors")
    wrong = [
        f"{ids[0]} and {len(ids) - 1} more: {clause}" for clause, ids in found.items() if clause not in known
    ]
    house.refuse(wrong, "A clause that a vector names exists: correct the kind, and write the vectors anew.")


def test_report_of_clauses_without_proof(house, golden):
    known, vectors = clauses(house.root / "spec"), named_by_vectors(house.root / "spec/vectors")
    missing = without_proof(known, vectors, words_of_tests())
    golden("clauses_without_proof.txt", "".join(f"{clause}\n" for clause in missing))


@pytest.mark.parametrize(
    ("names", "vectors", "words", "missing"),
    [
        ({"pcg4d"}, {}, set(), ["RNG-2"]),
        ({"pcg4d"}, {"RNG-2": ["a/0"]}, set(), []),
        ({"pcg4d"}, {}, {"pcg4d"}, []),
        ({"Model.check"}, {}, {"check"}, []),
        ({"pcg4d"}, {}, {"RNG-2"}, []),
    ],
)
def test_the_rule_knows_a_proof(names, vectors, words, missing):
    assert without_proof({"RNG-2": names}, vectors, words) == missing
