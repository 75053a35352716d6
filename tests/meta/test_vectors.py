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

CODE = re.compile(r"`(?:refimpl|compiler|kernels|spec|cli|models|experiments)/[\w/]+\.py: *([\w., ]+)`")
"""The names of code that a clause is about."""


VECTORS = re.compile(r"; vectors: ((?:`[\w.]+`(?:, *)?)+)\)")
"""The kinds of vectors that test a clause, at the end of the names of its code."""


def words_of_tests() -> set[str]:
    """Return every word of every test: names of functions, and numbers of clauses."""
    texts = [path.read_text() for path in (ROOT / "tests").rglob("*.py") if path != Path(__file__)]
    return set(re.findall(r"\b[A-Z]{2,5}-\d+[a-z]?\b|\w+", "\n".join(texts)))


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
    lists = ((clause.number, " ".join(VECTORS.findall(clause.text))) for clause in house.clauses())
    by_text = {(number, kind) for number, kinds in lists for kind in re.findall(r"[\w.]+", kinds)}
    by_vectors = said_by_vectors(house.root / "spec/vectors")
    wrong = [f"{clause} does not name `{kind}`" for clause, kind in sorted(by_vectors - by_text)]
    wrong += [f"no vector of `{kind}` names {clause}" for clause, kind in sorted(by_text - by_vectors)]
    house.refuse(
        wrong, "A clause names its vectors, as (`refimpl/rng.py: random_block`; vectors: `random.block`)."
    )


def test_every_clause_has_a_proof(house):
    proven = {clause for clause, _ in said_by_vectors(house.root / "spec/vectors")} | words_of_tests()
    wrong = []
    for clause in house.clauses():
        names = {name.strip() for found in CODE.findall(clause.text) for name in found.split(",")}
        if not proven & {clause.number, *(name.rpartition(".")[2] for name in names)}:
            wrong.append(clause.number)
    house.refuse(
        wrong,
        "A clause is tested: by a vector, or by a test that names it or its code. Write one, or name the "
        "clause in the docstring of the test that holds it.",
    )
