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
        if package != PACKAGE:
            return None
        file = Path(__file__).parents[1] / "commands" / f"{stem}.py"
        return spec_from_file_location(name, file, loader=cls(name, str(file)))

    def get_code(self, fullname: str) -> CodeType:
        """Return the code of the statements that are needed."""
        stem, kept = Path(self.path).stem, list[ast.stmt]()
        calls = [lines["call"] for lines in table().values() if "call" in lines]
        needed = {name.partition(".")[2] for name in (*calls, *table()) if name.startswith(f"{stem}.")}
        # What is named is above what names it.
        for node in reversed(ast.parse(self.get_data(self.path)).body):
            if _is_needed(node, needed):
                needed |= _names(node, ast.Load)
                kept.insert(0, node)
        code: CodeType = compile(ast.fix_missing_locations(ast.Module(kept, [])), self.path, "exec")
        return code


def _is_needed(node: ast.stmt, needed: set[str]) -> bool:
    """Tell whether a statement defines what is needed, and cut it down to that."""
    match node:
        case ast.ImportFrom(module="__future__"):
            return True
        case ast.ImportFrom() | ast.Import():
            node.names = [each for each in node.names if (each.asname or each.name) in needed]
            return bool(node.names)
        case ast.FunctionDef():  # called where `--help` is the value of an option [main.py]
            node.body = ast.parse("raise NotImplementedError").body
            return node.name in needed
        case ast.ClassDef():
            node.body = [*(each for each in node.body if isinstance(each, ast.AnnAssign)), ast.Pass()]
            return node.name in needed
    return bool(needed & _names(node, ast.Store))


def _names(node: ast.stmt, use: type[ast.expr_context]) -> set[str]:
    """Return the names that a statement reads, or sets."""
    return {each.id for each in ast.walk(node) if isinstance(each, ast.Name) and isinstance(each.ctx, use)}


def package() -> str:
    """Return the name of the package, which can be imported from then on."""
    if PACKAGE not in sys.modules:
        sys.modules[PACKAGE] = ModuleType(PACKAGE)
        sys.modules[PACKAGE].__path__ = []
        sys.meta_path.insert(0, Signatures)
    return PACKAGE
