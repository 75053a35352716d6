"""Which clauses a piece of the reference is governed by, and whether a blamed clause is one of them.

1. A clause of the spec names code: `path: names` [`named`].
2. A mutant breaks the clauses that name its function, its class or its constant. Where no clause does, it
   breaks those that name its callers, and so on up [`Clauses.broken`].
3. Blame is right if the blamed clause is among them, and near if it names anything of the module or is of the
   chapter of one of them.
"""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

from .mutation import Mutant
from .trial import ROOT, paths

CLAUSE = re.compile(r"^\*\*([A-Z0-9]+-\d+[a-z]?)\*\*", re.MULTILINE)
"""How a clause begins."""

Place = tuple[str, str]
"""A module and a name in it."""

CODE = re.compile(r"`((?:refimpl|models|compiler)/[\w/]+\.py): *([\w., ]+)`")
"""How it names code."""


def named(folder: Path = ROOT / "spec") -> Iterator[tuple[str, str, str]]:
    """Yield clause, module and name of all that clauses name."""
    for path in sorted(folder.glob("*.md")):
        text = path.read_text(encoding="utf-8")
        starts = list(CLAUSE.finditer(text))
        for start, after in zip(starts, [*starts[1:], None], strict=bool(starts)) if starts else ():
            body = text[start.end() : after.start() if after else len(text)]
            for module, names in CODE.findall(body):
                yield from ((start[1], module, name.strip()) for name in names.split(","))


class Clauses:
    """The clauses of all code that is named."""

    def __init__(self) -> None:
        self.of: dict[tuple[str, str], set[str]] = {}
        self.modules: dict[str, set[str]] = {}
        for clause, module, name in named():
            self.of.setdefault((module, name), set()).add(clause)
            self.modules.setdefault(module, set()).add(clause)
        texts = {path: (ROOT / path).read_text(encoding="utf-8") for path in paths()}
        self._trees = {path: ast.parse(text) for path, text in texts.items()}
        self._users = {path: list(_used(tree)) for path, tree in self._trees.items()}
        self._imported = {path: set(_imported(tree)) for path, tree in self._trees.items()}

    def near(self, mutant: Mutant, clause: str) -> bool:
        """Tell whether a clause names anything of a mutant's module, or is of a chapter that it breaks."""
        if mutant.module.endswith(".c"):
            return clause.partition("-")[0] in {known.partition("-")[0] for known in mutant.function.split()}
        chapters = {broken.partition("-")[0] for broken in self.broken(mutant)}
        return clause in self.modules.get(mutant.module, ()) or clause.partition("-")[0] in chapters

    def broken(self, mutant: Mutant) -> set[str]:
        """Return the clauses that a mutant breaks."""
        if mutant.module.endswith(".c"):
            return set(mutant.function.split())
        waiting = {(mutant.module, name) for name in self._names(mutant, self._trees[mutant.module])}
        seen: set[Place] = set()
        while waiting:
            found = set().union(*(self.of.get(place, set()) for place in waiting))
            if found:
                return found
            seen |= waiting
            waiting = set().union(*(self._callers(*place) for place in waiting)) - seen
        return self.modules.get(mutant.module, set())

    def _callers(self, module: str, name: str) -> set[Place]:
        """Return what uses a module's name, in that module or in one that imports it."""
        plain, stem = name.rpartition(".")[2], Path(module).stem
        found = set()
        for path, used in self._users.items():
            if path == module or stem in self._imported[path] or plain in self._imported[path]:
                found |= {(path, user) for user, names in used if plain in names}
        return found

    @staticmethod
    def _names(mutant: Mutant, tree: ast.Module) -> set[str]:
        """Return the names of the function, class or constant that a mutant is in."""
        if mutant.function:
            return {mutant.function, mutant.function.partition(".")[0]}
        for node in tree.body:
            if node.lineno <= mutant.line <= (node.end_lineno or 0):
                if isinstance(node, ast.FunctionDef | ast.ClassDef):
                    return {node.name}
                return {part.id for part in ast.walk(node) if isinstance(part, ast.Name)}
        return set()


def _imported(tree: ast.Module) -> Iterator[str]:
    """Yield the names that a module imports, and the last words of the modules that it imports them from."""
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom):
            yield (node.module or "").rpartition(".")[2]
            yield from (alias.name for alias in node.names)


def _used(tree: ast.Module) -> Iterator[tuple[str, set[str]]]:
    """Yield the functions and classes of a module with the names that they use."""
    for node in tree.body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            names = {part.id for part in ast.walk(node) if isinstance(part, ast.Name)}
            names |= {part.attr for part in ast.walk(node) if isinstance(part, ast.Attribute)}
            yield node.name, names
