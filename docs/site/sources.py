"""Pages that show the source of a file, with an anchor at each line and at each definition.

1. What a file defines, and on which line: functions, classes, `Class.member`, constants [`definitions`].
2. Its text in colours, each line with its number and the anchors of what begins there [`page`].
"""

from __future__ import annotations

import ast
from collections.abc import Iterator, Mapping
from html import escape

from pygments import highlight
from pygments.formatters import HtmlFormatter
from pygments.lexers import PythonLexer


def definitions(text: str) -> Mapping[str, int]:
    """Return the line, from 1, on which each name of a Python file is defined."""
    found: dict[str, int] = {}
    for node in ast.parse(text).body:
        for name, line in _named(node):
            found.setdefault(name, line)
        if isinstance(node, ast.ClassDef):
            for member in node.body:
                for name, line in _named(member):
                    found.setdefault(f"{node.name}.{name}", line)
    return found


def _named(node: ast.stmt) -> Iterator[tuple[str, int]]:
    """Yield what a statement defines."""
    if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
        yield node.name, min([node.lineno, *(decorator.lineno for decorator in node.decorator_list)])
    targets = node.targets if isinstance(node, ast.Assign) else [getattr(node, "target", None)]
    for target in targets:
        if isinstance(target, ast.Name):
            yield target.id, node.lineno


def coloured(text: str) -> list[str]:
    """Return the lines of a Python text as HTML."""
    html = highlight(text, PythonLexer(stripnl=False, ensurenl=False), HtmlFormatter(nowrap=True))
    return html.rstrip("\n").split("\n")


def page(text: str) -> str:
    """Return the HTML of a file's source."""
    names: dict[int, list[str]] = {}
    for name, line in definitions(text).items():
        names.setdefault(line, []).append(name)
    rows = []
    for number, line in enumerate(coloured(text.rstrip("\n")), 1):
        anchors = "".join(f'<span id="{escape(name)}"></span>' for name in names.get(number, ()))
        number_link = f'<a href="#L{number}" class="number">{number}</a>'
        rows.append(f'{anchors}<span id="L{number}" class="row">{number_link}{line}\n</span>')
    return f'<div class="highlight source" tabindex="0"><pre><code>{"".join(rows)}</code></pre></div>'
