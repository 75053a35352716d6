"""Modules of commands for a help text, or a shell that completes a line: what signatures need, and no more.

1. A module of `commands` is read as one of a package of its own [`Signatures.find_spec`].
2. Of its statements those are kept that the functions and data classes of `options.ini` need: functions
   without bodies, classes with their fields, and what these name [`Signatures.get_code`]. No command needs
   NumPy for that.
"""

from __future__ import annotations

import ast
import sys
from importlib.machinery import ModuleSpec, SourceFileLoader
from importlib.util import spec_from_file_location
from pathlib import Path
from types import CodeType, ModuleType
from typing import Any

from .request import table

PACKAGE = f"{__package__.rpartition('.')[0]}.signatures"
"""The package of these modules; it is as deep as `commands`, so that relative imports mean the same."""


class Signatures(SourceFileLoader):
    """The finder and loader of these modules."""

    @classmethod
    def find_spec(cls, name: str, _path: Any = None, _target: Any = None) -> ModuleSpec | None:
        """Return how a module of the package is loaded."""
        package, _, stem = name.rpartition(".")
        file = Path(__file__).parents[1] / "commands" / f"{stem}.py"
        return (
            spec_from_file_location(name, file, loader=cls(name, str(file))) if package == PACKAGE else None
        )

    def get_code(self, fullname: str) -> CodeType:
        """Return the code of the statements that are needed."""
        tree, stem, kept = ast.parse(self.get_data(self.path)), Path(self.path).stem, list[ast.stmt]()
        calls = [lines["call"] for lines in table().values() if "call" in lines]
        needed = {name.partition(".")[2] for name in (*calls, *table()) if name.startswith(f"{stem}.")}
        # What is named is above what names it.
        for node in reversed(tree.body):
            if isinstance(node, ast.ImportFrom | ast.Import):
                future = isinstance(node, ast.ImportFrom) and node.module == "__future__"
                node.names = [each for each in node.names if future or (each.asname or each.name) in needed]
                is_needed = bool(node.names)
            elif isinstance(node, ast.FunctionDef | ast.ClassDef):
                fields = [each for each in node.body if isinstance(each, ast.AnnAssign)]
                is_class, is_needed = isinstance(node, ast.ClassDef), node.name in needed
                node.body = [*fields, ast.Pass()] if is_class else ast.parse("raise NotImplementedError").body
            else:
                targets = getattr(node, "targets", [getattr(node, "target", ast.Pass())])
                is_needed = bool(needed & _names(ast.Store, *targets))
            if is_needed:
                needed |= _names(ast.Load, node)
                kept.insert(0, node)
        code: CodeType = compile(ast.fix_missing_locations(ast.Module(kept, [])), self.path, "exec")
        return code


def _names(use: type[ast.expr_context], *nodes: ast.AST) -> set[str]:
    """Return the names that some statements read, or set."""
    found = (each for node in nodes for each in ast.walk(node) if isinstance(each, ast.Name))
    return {each.id for each in found if isinstance(each.ctx, use)}


def package() -> str:
    """Return the name of the package, which can be imported from then on."""
    if PACKAGE not in sys.modules:
        sys.modules[PACKAGE] = ModuleType(PACKAGE)
        sys.modules[PACKAGE].__path__ = []
        sys.meta_path.insert(0, Signatures)
    return PACKAGE
