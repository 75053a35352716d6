"""The folder that a student begins with: skeletons, a Makefile, a README and a file for pytest.

Nothing of it is an answer. `make lab3`, `wamnet course check 3` and `pytest -k lab03` say the same.
"""

from __future__ import annotations

from pathlib import Path

from .labs import LABS

MAKEFILE = """# make check grades all labs, make lab3 one; WAMNET= is the command.
WAMNET ?= wamnet
LABS = {labs}

.PHONY: check $(LABS)
check:
	@$(WAMNET) course check all .

$(LABS):
	@$(WAMNET) course check $@ .
"""
"""The Makefile; {labs} are the targets."""

README = """# The course

Each file is a lab: its task is at the top, and `raise NotImplementedError` is where your lines go. Add
`import numpy as np` where you need it. Ask the grader as often as you like:

    make lab1
    make check

or `wamnet course check 1`, or `pytest -k lab01` (for which pytest has to be installed). A message has the
clause of the spec, what was looked at, what was expected, what was found, and the likeliest mistake. The
clauses are in the spec; pages with hints for each lab are in the course's part of the site, `docs/course`.

| make | file | lab | clauses | minutes |
|---|---|---|---|---|
{rows}

Statistical checks reject a right answer with a chance of 1 %, always or never: their random numbers are
fixed. The labs need NumPy only. Licence of these skeletons: Apache-2.0, as wamnet has it.
"""
"""The README; {rows} are the labs."""

TESTS = '''"""Plain pytest grades the labs of this folder: one test a check."""

import functools
from pathlib import Path

import pytest

from wamnet_course.grading import grade
from wamnet_course.labs import LABS

FOLDER = Path(__file__).parent
CASES = [(lab, check.name) for lab in LABS if (FOLDER / lab.file).is_file() for check in lab.checks]


@functools.cache
def graded(lab):
    return dict(grade(lab, FOLDER, trusted=True).checks)


@pytest.mark.parametrize(("lab", "name"), CASES, ids=[f"{lab.name}-{name}" for lab, name in CASES])
def test_lab(lab, name):
    if wrong := graded(lab)[name]:
        pytest.fail(str(wrong), pytrace=False)
'''
"""The file for pytest."""


def begin(folder: Path) -> list[str]:
    """Write all files to a new, empty folder; return their names."""
    rows = "\n".join(
        f"| {lab.target} | {lab.file} | {lab.title} | {lab.clauses} | {lab.minutes} |" for lab in LABS
    )
    files = {lab.file: lab.skeleton for lab in LABS}
    files["Makefile"] = MAKEFILE.format(labs=" ".join(lab.target for lab in LABS))
    files["README.md"] = README.format(rows=rows)
    files["test_labs.py"] = TESTS
    for name, text in files.items():
        (folder / name).write_text(text, encoding="utf-8")
    return list(files)
