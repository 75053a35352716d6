"""From the spec's pages to pages that are linked: clauses get anchors, and what is named becomes a link.

The spec is plain Markdown that reads well anywhere; links that can be derived are not written into it:

1. `**RNG-1**` at the start of a paragraph becomes an anchor, `#rng-1` [`anchored`].
2. A clause that is mentioned, RNG-1, links to its anchor; so does a chapter, `spec/rng.md` or rng.md.
3. Code that is named, `refimpl/rng.py: pcg4d`, links to its line on a page with the source.

Steps 2 and 3 work on the page's HTML, between its tags [`linked`]: nothing inside of links, headings or
listings is touched.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Mapping
from html import unescape

CLAUSE = re.compile(r"^\*\*([A-Z0-9]+-\d+[a-z]?)\*\*", re.MULTILINE)
"""A clause opens a paragraph with its number."""

CODE = re.compile(r"((?:[\w.-]+/)+[\w-]+\.py)(?:: *([\w., ]+))?")
"""Code is named by its path and, perhaps, by names."""

MENTION = re.compile(r"\b([A-Z]{2,5}-\d+[a-z]?)\b|(?:\bspec/)?\b(\w+)\.md\b")
"""A clause, or a chapter, that a text names."""

TAG = re.compile(r"(<[^>]*>)")
"""A tag of HTML."""

CLOSED = {"a", "pre", "h1", "h2", "h3", "h4", "svg", "math"}
"""Elements inside which nothing becomes a link."""


def clauses(text: str) -> list[str]:
    """Return the numbers of a chapter's clauses, in order."""
    return CLAUSE.findall(text)


def anchored(text: str) -> str:
    """Return a chapter's Markdown with anchors where its clauses begin."""

    def anchor(match: re.Match[str]) -> str:
        name = match[1].lower()
        return f'<a class="clause" id="{name}" href="#{name}" title="Link to this clause">{match[1]}</a>'

    return CLAUSE.sub(anchor, text)


def named_files(text: str) -> set[str]:
    """Return the paths of Python files that a text names."""
    return {path for path, _ in CODE.findall(text)}


def linked(
    html: str,
    places: Mapping[str, str],
    sources: Mapping[str, Collection[str]],
    link: Callable[[str], str],
) -> str:
    """Return a page's HTML with links to what it names.

    `places`: clauses ("RNG-1") and chapters ("rng") to site addresses; `sources`: the names that each source
    page has an anchor for; `link` makes a site address relative to the page.
    """
    found, open_elements, in_code = [], 0, False
    for piece in TAG.split(html):
        if piece.startswith("<"):
            name = piece.strip("</>").split(maxsplit=1)[0].rstrip("/") if len(piece) > 2 else ""
            if name in CLOSED:
                open_elements += -1 if piece.startswith("</") else 1
            if name == "code":
                in_code = not piece.startswith("</")
        elif not open_elements:
            piece = _code(piece, sources, link) if in_code else _mentions(piece, places, link)
        found.append(piece)
    return "".join(found)


def _mentions(text: str, places: Mapping[str, str], link: Callable[[str], str]) -> str:
    """Return a text with links to the clauses and chapters that it names."""

    def replaced(match: re.Match[str]) -> str:
        place = places.get(match[1] or match[2])
        return f'<a href="{link(place)}">{match[0]}</a>' if place else match[0]

    return MENTION.sub(replaced, text)


def _code(text: str, sources: Mapping[str, Collection[str]], link: Callable[[str], str]) -> str:
    """Return the text of a `code` element with links to the source that it names."""

    def replaced(match: re.Match[str]) -> str:
        path, names = match[1], match[2]
        if path not in sources:
            return match[0]
        page = link(source_page(path))
        start = f'<a href="{page}">{path}</a>'
        if not names:
            return start
        each = [
            f'<a href="{page}#{name}">{name}</a>' if name in sources[path] else name
            for name in (name.strip() for name in names.split(","))
        ]
        return f"{start}: {', '.join(each)}"

    return CODE.sub(replaced, unescape(text)) if "&" not in text else text


def source_page(path: str) -> str:
    """Return the site's address of the page that shows a file's source."""
    return f"source/{path.removesuffix('.py')}.html"
