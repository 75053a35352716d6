"""What has to be trusted of a certificate that holds: both checkers, and all that they import."""

from __future__ import annotations

import ast
from pathlib import Path

CHECKERS = ("compiler/proof/checker.py", "compiler/reading/check.py")
"""The check of a proof, and that of a source."""

ROOM = Path(__file__).parents[2]
"""The folder of the project's packages."""


def trusted_files() -> list[Path]:
    """Return the files that have to be trusted: those that the checkers import, at the top of a file."""
    found, waiting = set[Path](), [ROOM / name for name in CHECKERS]
    while waiting:
        if (path := waiting.pop()) in found:
            continue
        found.add(path)
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            if isinstance(node, ast.ImportFrom) and node.level:
                package = path.parents[node.level - 1].joinpath(*(node.module or "").split("."))
                modules = [package.with_suffix(".py"), *(package / f"{each.name}.py" for each in node.names)]
                waiting += filter(Path.is_file, modules)
    return sorted(found)


def trusted_lines() -> int:
    """Return how many lines these have, comments counted."""
    return sum(len(path.read_text(encoding="utf-8").splitlines()) for path in trusted_files())
