"""Who uses what a module makes as it is imported: the lines that name it, and those that name its users.

A constant is read where no tracer sees it, so that text decides: a line that names it uses it. What is made
of it as modules are imported is used by those who name that [`Users.lines`].
"""

import ast
import re
from collections.abc import Iterator, Mapping

from .mutation import Mutant

Place = tuple[str, int]
"""A module and a line."""


class Users:
    """The lines of modules that use names."""

    def __init__(self, sources: Mapping[str, str]) -> None:
        self.trees = {path: ast.parse(text) for path, text in sources.items()}
        self.by_word: dict[str, set[Place]] = {}
        for path, text in sources.items():
            for number, line in enumerate(text.splitlines(), 1):
                for word in re.findall(r"[A-Za-z_]\w*", line):
                    self.by_word.setdefault(word, set()).add((path, number))

    def lines(self, mutant: Mutant) -> set[Place]:
        """Return the lines that use what the statement of a mutant makes."""
        top = self._top(mutant.module, mutant.line)
        if isinstance(top, ast.ClassDef):
            # Fields and their defaults are used by those who make the class: its module's functions at least.
            last = self.trees[mutant.module].body[-1].end_lineno or 0
            own = {(mutant.module, line) for line in range(1, last + 1)}
            return own | self._users({top.name})
        return self._users(set(_names(top)))

    def _users(self, names: set[str]) -> set[Place]:
        """Return the lines that name something, or what is made of it outside of functions."""
        found: set[Place] = set()
        seen: set[str] = set()
        while names - seen:
            new = names - seen
            seen |= new
            places = set().union(*(self.by_word.get(name, set()) for name in new))
            found |= places
            tops = (self._top(path, line) for path, line in places)
            names = set().union(*(_names(top) for top in tops if isinstance(top, ast.Assign | ast.AnnAssign)))
        return found.union(*(self._of_field(path, line) for path, line in found))

    def _of_field(self, path: str, line: int) -> set[Place]:
        """Return the lines of a class where a line is a field of it: who makes one uses the default."""
        top = self._top(path, line)
        if not isinstance(top, ast.ClassDef):
            return set()
        is_field = any(isinstance(n, ast.AnnAssign) and n.lineno <= line <= _last(n) for n in top.body)
        return {(path, own) for own in range(top.lineno, _last(top) + 1)} if is_field else set()

    def _top(self, module: str, line: int) -> ast.stmt | None:
        """Return the statement of a module, outside of all others, that has a line."""
        body = self.trees[module].body
        return next((node for node in body if _first(node) <= line <= _last(node)), None)


def _last(node: ast.stmt) -> int:
    """Return the last line of a statement."""
    return node.end_lineno or node.lineno


def _first(node: ast.stmt) -> int:
    """Return the first line of a statement, its decorators among them."""
    decorators = getattr(node, "decorator_list", [])
    return min([node.lineno, *(decorator.lineno for decorator in decorators)])


def _names(node: ast.stmt | None) -> Iterator[str]:
    """Yield the names that a statement of a module makes."""
    if isinstance(node, ast.FunctionDef | ast.ClassDef):
        yield node.name
    targets = node.targets if isinstance(node, ast.Assign) else [getattr(node, "target", None)]
    for target in targets:
        yield from (part.id for part in ast.walk(target) if isinstance(part, ast.Name)) if target else ()
