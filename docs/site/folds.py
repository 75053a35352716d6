"""Long pages of the spec, folded where a reader looks for one part.

1. The formats of the vectors: each kind under its heading, which stays visible with its anchor [`by_kind`].
2. The table of all decisions: a fold for each chapter, with the number of its rows [`by_chapter`].
"""

from __future__ import annotations

import re
from itertools import groupby

KIND = re.compile(r"(<h2 [^>]*>.*?</h2>)(.*?)(?=<h2 |\Z)", re.DOTALL)
"""A heading of the vectors' page, and what is below it."""

TABLE = re.compile(r"<table>\s*(<thead>.*?</thead>)\s*<tbody>(.*?)</tbody>\s*</table>", re.DOTALL)
"""A table, its head and its rows."""

ROW = re.compile(r"<tr>.*?</tr>", re.DOTALL)
"""A row of a table."""

CHAPTER = re.compile(r'href="(?:[^"#]*/)?([\w-]+)\.(?:html|md)')
"""The chapter that a row links to."""

DECISIONS = '<h2 id="all-decisions"'
"""The heading above the table of all decisions."""


def folded(html: str, uri: str) -> str:
    """Return the HTML of a page with its long parts folded."""
    if uri == "spec/vectors/README.md":
        return by_kind(html)
    return by_chapter(html) if uri == "spec/departures.md" else html


def by_kind(html: str) -> str:
    """Fold each section under its heading."""
    return KIND.sub(r"<details><summary>\1</summary>\2</details>", html)


def by_chapter(html: str) -> str:
    """Fold the rows of each chapter in the table of all decisions."""
    before, heading, after = html.partition(DECISIONS)

    def chapter(row: str) -> str:
        found = CHAPTER.search(row)
        return found[1] if found else ""

    def table(match: re.Match[str]) -> str:
        groups = [(name, list(rows)) for name, rows in groupby(ROW.findall(match[2]), chapter)]
        return "\n".join(
            f"<details><summary>{name} ({len(rows)})</summary>"
            f"<table>{match[1]}<tbody>{''.join(rows)}</tbody></table></details>"
            for name, rows in groups
        )

    return before + heading + TABLE.sub(table, after, count=1)
