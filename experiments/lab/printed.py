"""What a program prints as Markdown tables, kept as records: for programs that print and keep no JSON.

1. Each row of a table is a record: its first cell that is not empty is the configuration, its cells are
   values under their headings, as they were printed [`records_of`]. Rows of the same name have a number.
2. The tables come back as they were printed [`table`]; a number in a cell is read by
   [`results.number`].
"""

import re
from collections import Counter
from collections.abc import Callable, Collection, Iterator, Mapping
from typing import Any

from .results import Results
from .tables import markdown

RULE = re.compile(r"\|?(?: *:?-{3,}:? *\|)+(?: *:?-{3,}:? *)?")
"""The line below a table's headings."""


def tables(text: str) -> Iterator[list[list[str]]]:
    """Yield the cells of each table of a text, its headings first."""
    lines = [line.strip() for line in text.splitlines()]
    for at, line in enumerate(lines):
        if at and RULE.fullmatch(line) and lines[at - 1].startswith("|"):
            rows = [cells(lines[at - 1])]
            for row in lines[at + 1 :]:
                if not row.startswith("|"):
                    break
                rows.append(cells(row))
            yield rows


def cells(line: str) -> list[str]:
    """Return the cells of a row."""
    return [cell.strip() for cell in re.split(r"(?<!\\)\|", line.strip().strip("|"))]


def records_of(text: str) -> list[dict[str, Any]]:
    """Return the rows of all tables of a text as records."""
    found: list[dict[str, Any]] = []
    seen: Counter[str] = Counter()
    for number, (heads, *rows) in enumerate(tables(text), 1):
        for row in rows:
            name = next((cell for cell in row if cell), "").replace("/", ",").strip("`*")
            seen[name] += 1
            kept = name if seen[name] == 1 else f"{name} #{seen[name]}"
            values = dict(zip(_different(heads), row, strict=False))
            found.append({"configuration": kept, "seed": 0, "values": {"table": number, **values}})
    return found


def _different(heads: list[str]) -> list[str]:
    """Return headings that differ: an empty one stays, another of the same name has its number."""
    seen: Counter[str] = Counter()
    made = []
    for head in heads:
        seen[head] += 1
        made.append(head if seen[head] == 1 else f"{head} #{seen[head]}")
    return made


def table(
    results: Results,
    number: int | None = None,
    without: Collection[str] = (),
    shows: Callable[[Mapping[str, Any]], bool] = lambda row: True,
) -> str:
    """Return one of the printed tables as Markdown, counted from 1, or all as one if headings agree.

    `without`: headings of columns that are left out. `shows` tells whether a row is shown.
    """
    rows = [record["values"] for record in results.records() if number in (None, record["values"]["table"])]
    rows = [row for row in rows if list(row) == list(rows[0]) and shows(row)]
    hidden = {"table", *without}
    shown = [{head: cell for head, cell in row.items() if head not in hidden} for row in rows]
    heads = [re.sub(r" #\d+$", "", head) for head in shown[0]] if shown else []
    return markdown(heads, [list(row.values()) for row in shown])
