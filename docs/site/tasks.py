"""The task of a lab as its page shows it: what the skeleton leaves to write, read from the skeleton itself.

A function or method whose body raises NotImplementedError is a task. Its signature and the first sentence of
its docstring are shown, so that a page cannot say something else than the file that a student has.
"""

from __future__ import annotations

import ast
import textwrap
from collections.abc import Iterator
from pathlib import Path

SKELETONS = Path(__file__).resolve().parents[2] / "course/skeletons"
"""The files that `wamnet course start` writes."""

WIDTH = 88
"""Columns of a page's code."""


def functions(tree: ast.Module) -> Iterator[ast.FunctionDef]:
    """Yield what is to be written, in the file's order."""
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef) and "NotImplementedError" in ast.unparse(node.body[-1]):
            yield node


def shown(node: ast.FunctionDef) -> str:
    """Return a signature without types, and the first sentence of its docstring below it."""
    names = [argument.arg for argument in node.args.args]
    names += [f"*{node.args.vararg.arg}"] if node.args.vararg else []
    names += [f"**{node.args.kwarg.arg}"] if node.args.kwarg else []
    sentence = " ".join((ast.get_docstring(node) or "").split("\n\n")[0].split())
    signature = textwrap.fill(f"{node.name}({', '.join(names)})", WIDTH, subsequent_indent=" " * 8)
    return f"{signature}\n{textwrap.indent(textwrap.fill(sentence, WIDTH - 4), '    ')}"


def task(lab: int) -> None:
    """Print what lab number `lab` leaves to write."""
    (path,) = SKELETONS.glob(f"lab{lab:02d}_*.py")
    tree = ast.parse(path.read_text(encoding="utf-8"))
    print("\n\n".join(shown(node) for node in functions(tree)))
