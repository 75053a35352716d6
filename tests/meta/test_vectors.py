"""House rules about vectors: they and the clauses name each other, and no clause is without a proof.

1. A clause says which kinds of vectors test it, `vectors: `random.block``, and these vectors name it
   [`test_clauses_and_vectors_name_each_other`]. So a clause that goes, or a kind, is missed.
2. A clause has a proof: a vector names it, or a test, by its number or by a name of its code
   [`test_every_clause_has_a_proof`].
"""

import json
import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]

CLAUSE = re.compile(r"^\*\*([A-Z0-9]+-\d+[a-z]?)\*\*", re.MULTILINE)
"""A clause opens a paragraph with its number."""

CODE = re.compile(r"`(?:refimpl|compiler|kernels|spec|cli|models|experiments)/[\w/]+\.py: *([\w., ]+)`")
"""The names of code that a clause is about."""


VECTORS = re.compile(r"; vectors: ((?:`[\w.]+`(?:, *)?)+)\)")
"""The kinds of vectors that test a clause, at the end of the names of its code."""


def texts(folder: Path) -> dict[str, str]:
    """Return the text of each clause."""
    found = {}
    for path in sorted(folder.glob("*.md")):
        text = path.read_text()
        starts = list(CLAUSE.finditer(text))
        for match, after in zip(starts, [*starts[1:], None], strict=False):
            found[match[1]] = text[match.end() : after.start() if after else len(text)]
    return found


def clauses(folder: Path) -> dict[str, set[str]]:
    """Return the names of code of each clause."""
    return {
        clause: {name.strip() for names in CODE.findall(body) for name in names.split(",")}
        for clause, body in texts(folder).items()
    }


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
    house.refuse(wrong, "A clause that a vector names exists: correct the kind, and write the vectors again.")


def said_by_clauses(folder: Path) -> set[tuple[str, str]]:
    """Return (clause, kind) for the kinds of vectors that clauses name."""
    found = ((clause, VECTORS.findall(body)) for clause, body in texts(folder).items())
    return {(clause, kind) for clause, lists in found for kind in re.findall(r"[\w.]+", " ".join(lists))}


def said_by_vectors(folder: Path) -> set[tuple[str, str]]:
    """Return (clause, kind) for the clauses that vectors name."""
    loaded = [(path.stem, json.loads(path.read_text())) for path in sorted(folder.glob("*.json"))]
    parts = (
        (part, kind)
        for kind, data in loaded
        for case in data.get("cases", ())
        for part in (case, *case.get("expected", {}).values())
    )
    return {(part["clause"], kind) for part, kind in parts if "clause" in part}


def test_clauses_and_vectors_name_each_other(house):
    by_text, by_vectors = (said_by_clauses(house.root / "spec"), said_by_vectors(house.root / "spec/vectors"))
    wrong = [f"{clause} does not name `{kind}`" for clause, kind in sorted(by_vectors - by_text)]
    wrong += [f"no vector of `{kind}` names {clause}" for clause, kind in sorted(by_text - by_vectors)]
    house.refuse(
        wrong, "A clause names its vectors, as (`refimpl/rng.py: random_block`; vectors: `random.block`)."
    )


def test_every_clause_has_a_proof(house):
    known, vectors = clauses(house.root / "spec"), named_by_vectors(house.root / "spec/vectors")
    house.refuse(
        without_proof(known, vectors, words_of_tests()),
        "A clause is tested: by a vector, or by a test that names it or its code. Write one, or name the "
        "clause in the docstring of the test that holds it.",
    )
