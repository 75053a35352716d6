"""What a document shows of `same_bits.py`: its printed rows, one line a compiler or device.

Rows of the same way, on the same device and with the same options, are one: their schedules are joined, and
the shares of floats that differ are a range [`summary`].
"""

from __future__ import annotations

from collections import defaultdict

from .records import Records
from .tables import markdown

RECORD = "same-bits"
"""The record's name."""

HEADS = ("compiler or device", "version", "options", "schedules", "equal", "floats that differ")
"""Of the table."""


def summary(records: Records) -> str:
    """Return the table of all ways: where integers are equal, and the share of floats that are not."""
    ways: dict[tuple[str, str, str], list[dict[str, str]]] = defaultdict(list)
    for record in records[RECORD].records():
        row = record["values"]
        ways[(row["compiler or device"], row["found"], row["options"])].append(row)
    return markdown(HEADS, [[*way, *joined(rows)] for way, rows in ways.items()])


def joined(rows: list[dict[str, str]]) -> list[str]:
    """Return the cells of a way: schedules, how many of its pictures are equal, the range of the shares."""
    schedules = ", ".join(row["schedule"] for row in rows)
    done = [row for row in rows if row["SHA-256"] != "-"]
    equal = f"{sum(row['equal'] == 'yes' for row in done)} of {len(done)}" if done else "-"
    shares = sorted({row["floats that differ"] for row in done}, key=_size)
    return [schedules, equal, " to ".join(dict.fromkeys((shares[0], shares[-1]))) if shares else "-"]


def _size(share: str) -> float:
    """Return a share as a number; what was refused comes last."""
    return float(share.rstrip("%")) if share.endswith("%") else float("inf")
