"""The repository as data for the house rules: its files, their syntax trees, and one way to refuse.

A rule is one test. It lists its violations as `path:line: what` and hands them to `refuse` with one sentence
that states the rule and the fix.
"""

import ast
import gc
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

import pytest
from quick import DISTRIBUTIONS

ROOT = Path(__file__).resolve().parents[2]
"""The repository's root folder."""

PARTS = ("refimpl", "models", "compiler", "kernels", "spec", "cli", "wamnet")
"""The folders that make up the package, in the order of imports: each may import those before it."""

FOREIGN = {"out", "build", "dist", "__pycache__", "node_modules"}
"""Folders that hold no source; so do hidden ones (but .ci and .github) and virtual environments."""


CLAUSE = re.compile(r"^\*\*([A-Z0-9]+-\d+[a-z]?)\*\*", re.MULTILINE)
"""A clause opens a paragraph with its number, as **RNG-1**."""


class Clause(NamedTuple):
    """A numbered paragraph of the spec: where it is, and the text up to the next clause or heading."""

    where: str
    number: str
    text: str


@dataclass(frozen=True)
class Source:
    """One Python file: its path relative to the root, its text and its syntax tree."""

    path: str
    text: str

    @property
    def part(self) -> str:
        """Return the folder of its distribution, or its folder at the root."""
        others = (folder for folder in DISTRIBUTIONS if self.path.startswith(f"{folder}/"))
        return next(others, self.path.partition("/")[0])

    @property
    def package(self) -> list[str]:
        """Return the package that relative imports start from, as a list of names."""
        folder = self.part if self.part in DISTRIBUTIONS else "wamnet"
        inside = self.path.removeprefix(f"{folder}/").split("/")[:-1]
        return [DISTRIBUTIONS.get(folder, "wamnet"), *inside]

    @cached_property
    def lines(self) -> list[str]:
        return self.text.splitlines()

    @cached_property
    def tree(self) -> ast.Module:
        return ast.parse(self.text, self.path)

    @cached_property
    def nodes(self) -> list[ast.AST]:
        return list(ast.walk(self.tree))

    @cached_property
    def functions(self) -> list[ast.FunctionDef | ast.AsyncFunctionDef]:
        """Return every function and method, nested ones included."""
        return [node for node in self.nodes if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)]

    def at(self, node: ast.AST, what: str) -> str:
        return f"{self.path}:{getattr(node, 'lineno', 1)}: {what}"


@dataclass(frozen=True)
class House:
    """The repository: `house.python("refimpl")` gives sources, `house.files()` every path."""

    root: Path
    distributions: Mapping[str, str] = field(default_factory=lambda: DISTRIBUTIONS)
    _read: dict[Path, Source] = field(default_factory=dict, compare=False)

    def files(self) -> Iterator[Path]:
        """Yield every file that belongs to the project, in a fixed order."""
        yield from _files(self.root)

    def python(self, *folders: str) -> list[Source]:
        """Return the Python files under the named folders; without a name, all."""
        paths = [p for p in self.files() if p.suffix == ".py"]
        for path in paths:
            if path not in self._read:
                self._read[path] = Source(path.relative_to(self.root).as_posix(), path.read_text())
        return [s for s in map(self._read.__getitem__, paths) if not folders or s.part in folders]

    def clauses(self) -> Iterator[Clause]:
        """Yield the clauses of the spec; the glossary has none."""
        for path in sorted((self.root / "spec").glob("*.md")):
            text = path.read_text()
            _, *rest = CLAUSE.split(text)
            lines = [text.count("\n", 0, match.start()) + 1 for match in CLAUSE.finditer(text)]
            for line, number, body in zip(lines, rest[::2], rest[1::2], strict=True):
                yield Clause(f"spec/{path.name}:{line}", number, body)

    def parts(self) -> list[Source]:
        """Return the Python files of the package."""
        return self.python(*PARTS)

    def installed(self) -> list[Source]:
        """Return the Python files of the package and of the other distributions."""
        return self.python(*PARTS, *self.distributions)

    @staticmethod
    def refuse(violations: Iterable[str], rule: str) -> None:
        """Fail with the rule in one sentence and a line for each violation; pass when there are none."""
        if found := list(violations):
            pytest.fail("\n  ".join([f"{rule} ({len(found)} violations)", *found]), pytrace=False)


def _files(folder: Path) -> Iterator[Path]:
    for path in sorted(folder.iterdir()):
        hidden = path.name.startswith(".") and path.name not in {".ci", ".github"}
        if path.is_file():
            if path.name != ".git":  # in a worktree of git it is a file that names the other folder
                yield path
        elif not (
            hidden or path.name in FOREIGN or path.suffix == ".egg-info" or (path / "pyvenv.cfg").exists()
        ):
            yield from _files(path)


@pytest.fixture(scope="module")
def house() -> Iterator[House]:
    """Give the repository; what one file of rules has read and parsed is let go before the next one.

    Meanwhile no garbage is looked for: of a million nodes of syntax trees none is, and that takes seconds.
    """
    gc.disable()
    yield House(ROOT)
    gc.enable()
