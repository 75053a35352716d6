"""House rules about the spec: text, code and numbers hold on to each other, so that no link can rot.

1. A clause has a number of its own and names code that exists [`test_clauses_name_code`].
2. A module of refimpl has a chapter, and every public function and class of refimpl and compiler a clause
   [`test_public_code_has_a_clause`].
3. Vectors and their clauses: tests/meta/test_vectors.py. Examples: tests/meta/test_spec_examples.py.
"""

import ast
import re
from pathlib import Path

CODE = re.compile(r"`((?:refimpl|compiler|kernels|spec|cli|models|experiments)/[\w/]+\.py): *([\w., ]+)`")
"""Code is named by path and names: `refimpl/rng.py: pcg4d`; several names are separated by commas."""

BROKEN = re.compile(r"`((?:refimpl|compiler|kernels|spec|cli|models|experiments)/[\w/]+\.py:)[^`\n]*\n[^`]*`")
"""Names of code over two lines, which nobody would see."""

REFERENCE = re.compile(r"\b([A-Z]{2,5}-\d+[a-z]?)\b")
"""A mention of a clause, in the spec or in the code."""

NO_CLAUSES = {"AVX", "SHA", "UTF"}
"""What the spec writes in the same way: AVX-512, SHA-256, UTF-8."""

NO_CHAPTER = {"__init__", "errors"}
"""Modules of refimpl without a chapter: the first holds nothing, the second only the form of messages."""


def defined_names(house, path: str) -> set[str]:
    """Return what a module defines: functions, classes, `Class.member` and constants."""
    tree = ast.parse((house.root / path).read_text())
    names = set()
    for node in tree.body:
        names |= set(names_of(node))
        if isinstance(node, ast.ClassDef):
            names |= {f"{node.name}.{name}" for member in node.body for name in names_of(member)}
    return names


def names_of(node: ast.stmt) -> list[str]:
    if isinstance(node, ast.FunctionDef | ast.ClassDef):
        return [node.name]
    targets = (
        node.targets
        if isinstance(node, ast.Assign)
        else [node.target]
        if isinstance(node, ast.AnnAssign)
        else []
    )
    return [target.id for target in targets if isinstance(target, ast.Name)]


def test_clause_numbers_are_unique(house):
    seen: dict[str, str] = {}
    wrong = []
    for clause in house.clauses():
        if clause.number in seen:
            wrong.append(f"{clause.where}: {clause.number} is also at {seen[clause.number]}")
        seen[clause.number] = clause.where
    house.refuse(wrong, "A clause's number is used once: give the later one the next free number.")


def test_clauses_name_code(house):
    wrong = [f"{c.where}: {c.number}" for c in house.clauses() if not CODE.search(c.text)]
    house.refuse(
        wrong, "A clause names the code that it governs: add (`refimpl/rng.py: pcg4d`), or remove the clause."
    )


def test_names_of_code_stand_on_one_line(house):
    wrong = [
        f"spec/{path.name}: {found}"
        for path in sorted((house.root / "spec").glob("*.md"))
        for found in BROKEN.findall(path.read_text())
    ]
    house.refuse(
        wrong, "Code is named on one line, so that links find it: join `path: names` that is broken."
    )


def test_named_code_exists(house):
    wrong = []
    for chapter in sorted((house.root / "spec").glob("*.md")):
        for path, names in CODE.findall(chapter.read_text()):
            if not (house.root / path).exists():
                wrong.append(f"spec/{chapter.name}: {path} does not exist")
                continue
            missing = {n.strip() for n in names.split(",")} - defined_names(house, path)
            wrong += [f"spec/{chapter.name}: {path} has no {name}" for name in sorted(missing)]
    house.refuse(wrong, "Code that the spec names exists: correct the name in the spec.")


def public_names(tree: ast.Module) -> list[str]:
    """Return the public functions and classes of a module, without a second definition of a name."""
    found = [n.name for n in tree.body if isinstance(n, ast.FunctionDef | ast.ClassDef)]
    return [name for name in dict.fromkeys(found) if not name.startswith("_")]


def named_by_clauses(house) -> dict[str, set[str]]:
    """Return what clauses name of each module; `Class.member` names its class."""
    named: dict[str, set[str]] = {}
    for clause in house.clauses():
        for path, names in CODE.findall(clause.text):
            each = {name.strip() for name in names.split(",")}
            named.setdefault(path, set()).update(each | {name.partition(".")[0] for name in each})
    return named


def test_public_code_has_a_clause(house):
    named = named_by_clauses(house)
    wrong = [
        f"{source.path}: {name}"
        for source in house.python("refimpl", "models", "compiler")
        for name in public_names(source.tree)
        if name not in named.get(source.path, set())
    ]
    house.refuse(
        wrong,
        "A public function or class of refimpl, models and compiler is named by a clause: add it to the "
        "clause that it serves, as (`refimpl/rng.py: pcg4d`), or begin its name with _.",
    )


def test_mentioned_clauses_exist(house):
    known = {c.number for c in house.clauses()}
    prefixes = {number.partition("-")[0] for number in known}
    wrong = []
    for path in [*sorted((house.root / "spec").glob("*.md")), *(house.root / s.path for s in house.python())]:
        unknown = set(REFERENCE.findall(path.read_text())) - known
        of_spec = path.suffix == ".md"  # In code the pattern may stand for something else.
        dangling = sorted(
            n
            for n in unknown
            if (prefix := n.partition("-")[0]) in prefixes or (of_spec and prefix not in NO_CLAUSES)
        )
        wrong += [f"{path.relative_to(house.root)}: {number}" for number in dangling]
    house.refuse(wrong, "A clause that is mentioned exists: correct the number.")


def test_every_reference_module_has_a_chapter(house):
    stems = {Path(source.path).stem for source in house.python("refimpl")} - NO_CHAPTER
    wrong = [f"refimpl/{stem}.py" for stem in sorted(stems) if not (house.root / f"spec/{stem}.md").exists()]
    house.refuse(wrong, "A module of refimpl has a chapter of the same stem in spec/: write it.")


def test_the_index_lists_every_chapter(house):
    index = (house.root / "spec/README.md").read_text()
    chapters = sorted(path.name for path in (house.root / "spec").glob("*.md") if path.name != "README.md")
    wrong = [f"spec/{name}" for name in chapters if f"]({name})" not in index]
    house.refuse(wrong, "spec/README.md lists every chapter: add a line with a link.")
