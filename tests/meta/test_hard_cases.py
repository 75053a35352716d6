"""House rule about the catalogue of hard cases: each clause names its tests, each test has its clause."""

import ast
import re

CHAPTER = "spec/hard_cases.md"
"""The catalogue."""

TEST = re.compile(r"`(test_\w+)`")
"""A test is named as `test_many_turns`."""


def test_catalogue_and_tests_agree(house):
    text = (house.root / CHAPTER).read_text()
    bodies = re.split(r"^\*\*(HRD-\d+)\*\*", text, flags=re.MULTILINE)[1:]
    named = {number: set(TEST.findall(body)) for number, body in zip(bodies[::2], bodies[1::2], strict=True)}
    there = {
        node.name
        for path in (house.root / "tests/hard").glob("test_*.py")
        for node in ast.parse(path.read_text()).body
        if isinstance(node, ast.FunctionDef) and node.name.startswith("test_")
    }
    wrong = [f"{number} names no test" for number, tests in named.items() if not tests]
    every = set().union(*named.values())
    wrong += [f"{name} is named and does not exist" for name in sorted(every - there)]
    wrong += [f"{name} has no clause" for name in sorted(there - every)]
    house.refuse(wrong, f"Each clause of {CHAPTER} names tests of tests/hard, each of them has a clause.")
