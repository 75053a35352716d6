"""Pages of labs: each has its sections in their order, a figure, the task of its skeleton, and sources."""

import re
from pathlib import Path

import pytest
import tasks

COURSE = Path(__file__).resolve().parents[2] / "docs/course"
"""The course's pages."""

LABS = sorted(COURSE.glob("lab*.md"))
"""Pages of the twelve labs."""

SECTIONS = [
    "The idea",
    "A worked example",
    "Your task",
    "Hints",
    "What the grader asks",
    "What a professional would do next",
]
"""Sections of each, in their order."""

SOURCE = re.compile(r"\b(?:19|20)\d\d\b|Khronos Group|documentation")
"""What a line that names a source has: a year, or whose text it is where that changes."""


def test_there_are_twelve():
    assert [int(path.name[3:5]) for path in LABS] == list(range(1, 13))


@pytest.mark.parametrize("path", LABS, ids=lambda path: path.stem)
def test_a_page_teaches_before_it_asks(path):
    text = path.read_text()
    assert re.findall(r"^## (.*)$", text, re.M) == SECTIONS
    parts = dict(zip(SECTIONS, re.split(r"^## .*$", text, flags=re.M)[1:], strict=True))
    assert "$" in text.partition("## Your task")[0] or "`" in parts["The idea"]
    example, asked = parts["A worked example"], parts["Your task"]
    assert "print(" in example
    assert "show(" in example
    assert f"```python cell\ntask({int(path.name[3:5])})\n```" in asked
    assert f"wamnet course check {int(path.name[3:5])}" in asked
    assert parts["Hints"].count("<details") >= 3
    items = [" ".join(item.split()) for item in parts[SECTIONS[-1]].partition("\nNext:")[0].split("\n* ")[1:]]
    assert sum(bool(SOURCE.search(item)) for item in items) >= 2, items


@pytest.mark.parametrize("lab", range(1, 13))
def test_a_task_is_what_the_skeleton_leaves_out(lab, capsys):
    """Each function that a student writes, once, with a sentence; the solution's names are among them."""
    tasks.task(lab)
    printed = capsys.readouterr().out
    (path,) = tasks.SKELETONS.glob(f"lab{lab:02d}_*.py")
    wanted = re.findall(r"NotImplementedError\(\"(\w+)\"\)", path.read_text())
    assert re.findall(r"^(\w+)\(", printed, re.M) == [
        *(name for name in wanted if not name.startswith("__")),
        *(name for name in wanted if name.startswith("__")),
    ]
    assert all(len(line) <= tasks.WIDTH for line in printed.splitlines())
