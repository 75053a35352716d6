"""Formulas as MathML, made when the site is built: browsers draw it, no script and no font is fetched.

1. `$...$` and `$$...$$` in Markdown become elements of class arithmatex (pymdownx.arithmatex, generic).
2. Their TeX becomes MathML [`rendered`]; TeX that the converter does not know stops the build.
"""

from __future__ import annotations

import re
from html import unescape

from latex2mathml.converter import convert
from mkdocs.exceptions import PluginError

FORMULA = re.compile(r'<(span|div) class="arithmatex">\\([(\[])(.*?)\\[)\]]</\1>', re.DOTALL)
"""A formula in a page's HTML: within a line, or on lines of its own."""


def rendered(html: str, where: str) -> str:
    """Return a page's HTML with its formulas as MathML."""

    def formula(match: re.Match[str]) -> str:
        tex, block = unescape(match[3]).strip(), match[2] == "["
        try:
            mathml = convert(tex, display="block" if block else "inline")
        except Exception as error:  # noqa: BLE001 - the converter documents no errors of its own
            raise PluginError(f"{where}: formula {tex!r} cannot be set: {error!r}") from None
        unknown = re.search(r"\\[A-Za-z]+", mathml)
        if unknown:
            raise PluginError(f"{where}: formula {tex!r} has the unknown command {unknown[0]}")
        return f'<div class="formula" tabindex="0">{mathml}</div>' if block else mathml

    return FORMULA.sub(formula, html)
