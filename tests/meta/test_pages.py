"""House rules about pages: the first ones are short, and each of the site says what it is good for."""

import re

import pytest

LONGEST = {"README.md": 120, "CONTRIBUTING.md": 100}
"""The most lines of what everyone reads first: a few screens."""

WITHOUT_PROMISE = ("docs/index", "docs/reference", "docs/results", "docs/speed", "docs/support")
"""Beginnings of the names of pages that lead to others, or are looked up."""

PROMISE = re.compile(r"\*You will (?:learn|have)\b[^*]*\*")
"""What a reader can do afterwards, and how long it takes, in italics."""

TIME = re.compile(r"\b(?:minutes?|hours?)\b")
"""A time in words."""


@pytest.mark.parametrize("name", LONGEST)
def test_what_everyone_reads_first_is_short(house, name):
    lines = len((house.root / name).read_text(encoding="utf-8").splitlines())
    assert lines <= LONGEST[name], (
        f"{name} has {lines} lines of {LONGEST[name]}: move some to a page of docs/"
    )


def test_each_page_says_what_it_is_good_for_and_how_long_it_takes(house):
    wrong = []
    for path in sorted((house.root / "docs").rglob("*.md")):
        name = path.relative_to(house.root).as_posix()
        promise = PROMISE.search(path.read_text(encoding="utf-8"))
        if not name.startswith(WITHOUT_PROMISE) and not (promise and TIME.search(promise[0])):
            wrong.append(name)
    house.refuse(
        wrong, "A page begins with what its reader will learn and how long it takes: *You will learn to ...*"
    )
