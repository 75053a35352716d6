"""The teacher's tables of a class: two of CSV, one page of HTML.

1. grades.csv has a line a student and a column a lab: checks passed of all, empty where there is no file
   [`grades`]. findings.csv has a line for each check that is not passed [`findings`].
2. index.html has both, with the findings below the table; it loads nothing and runs no script [`page`].

Names and messages come from students. They have no control characters [frame.py, grading.py]; a cell of CSV
that a spreadsheet would take for a formula gets a quote before it, and HTML is escaped.
"""

from __future__ import annotations

import csv
import html
import io
from collections.abc import Iterable, Sequence

from .grading import Result, Student
from .labs import Lab

FORMULA = ("=", "+", "-", "@", "\t", "\r")
"""What a formula of a spreadsheet begins with."""

STYLE = """
body { font: 15px/1.4 sans-serif; margin: 2em; color: #222; background: #fff }
table { border-collapse: collapse } th, td { border: 1px solid #bbb; padding: 3px 8px; text-align: left }
td.right { background: #d8efd8 } td.part { background: #f7edc8 } td.none { background: #f3d6d6 }
dl { margin-left: 1em } dt { font-weight: bold; margin-top: .6em }
"""
"""The page's style: green, yellow, red, and the numbers say the same."""


def _cell(text: str) -> str:
    """Return a text as a cell of CSV that is not a formula."""
    return f"'{text}" if text.startswith(FORMULA) else text


def _csv(rows: Iterable[Sequence[str]]) -> str:
    """Return rows as CSV."""
    written = io.StringIO()
    csv.writer(written, lineterminator="\n").writerows([_cell(cell) for cell in row] for row in rows)
    return written.getvalue()


def _count(result: Result | None) -> str:
    """Return "3/8", or "" where a lab is not there."""
    return "" if result is None else f"{result.passed}/{len(result.checks)}"


def grades(students: Sequence[Student], labs: Sequence[Lab]) -> str:
    """Return the table of grades as CSV."""
    header = ["student", *(lab.name for lab in labs), "labs complete"]
    rows = [[s.name, *(_count(s.of(lab)) for lab in labs), str(s.complete)] for s in students]
    return _csv([header, *rows])


def findings(students: Sequence[Student]) -> str:
    """Return what is wrong, one check a line, as CSV."""
    rows = [["student", "lab", "check", "clause", "what", "expected", "found", "likely"]]
    for student in students:
        for result in student.results:
            for name, wrong in result.checks:
                if wrong is not None:
                    rows.append([student.name, result.lab.name, name, *wrong.args])
    return _csv(rows)


def page(students: Sequence[Student], labs: Sequence[Lab]) -> str:
    """Return the page for the teacher."""
    head = "".join(f"<th>{html.escape(lab.target)}</th>" for lab in labs)
    rows = "".join(_row(student, number, labs) for number, student in enumerate(students))
    details = "".join(_details(student, number) for number, student in enumerate(students))
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head><meta charset="utf-8"><title>The class</title>'
        f"<style>{STYLE}</style></head>\n<body>\n<h1>The class</h1>\n"
        f"<table>\n<tr><th>student</th>{head}<th>labs complete</th></tr>\n{rows}</table>\n{details}"
        "</body>\n</html>\n"
    )


def _row(student: Student, number: int, labs: Sequence[Lab]) -> str:
    """Return a student's row."""
    cells = []
    for lab in labs:
        result = student.of(lab)
        kind = "none" if result is None or not result.passed else "right" if result.right else "part"
        cells.append(f'<td class="{kind}">{_count(result)}</td>')
    name = f'<a href="#s{number}">{html.escape(student.name)}</a>'
    return f"<tr><td>{name}</td>{''.join(cells)}<td>{student.complete}</td></tr>\n"


def _details(student: Student, number: int) -> str:
    """Return a student's findings."""
    parts = [f'<h2 id="s{number}">{html.escape(student.name)}</h2>\n']
    if not student.results:
        parts.append("<p>There is no file of a lab.</p>\n")
    for result in student.results:
        parts.append(f"<h3>{result.lab.name}: {_count(result)}</h3>\n<dl>\n")
        for name, wrong in result.checks:
            if wrong is not None:
                parts.append(f"<dt>{html.escape(name)}</dt><dd>{html.escape(str(wrong))}</dd>\n")
        parts.append("</dl>\n")
    return "".join(parts)
