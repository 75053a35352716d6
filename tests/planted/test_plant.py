"""Planted faults are well formed, and the tests that reach them are found."""

import ast
import json
import os
import subprocess
import sys
from pathlib import Path

import plant
import pytest

SOURCE = """\
LEAST = 1
def least(values):
    if values:
        return min(
            values, default=LEAST,
        )
    return LEAST
"""


def test_faults_are_complete_and_leave_python():
    every = plant.faults()
    assert len({fault["id"] for fault in every}) == len(every)
    for fault in every:
        assert set(fault) == {"id", "file", "old", "new", "kind", "wrong"}
        assert all(fault.values()), fault["id"]
        assert fault["old"] != fault["new"], fault["id"]
        if (plant.ROOT / fault["file"]).exists():
            ast.parse(plant.planted(fault, plant.source_of(fault)))


@pytest.mark.parametrize(
    ("old", "new", "lines"),
    [
        ("LEAST = 1", "LEAST = 0", set()),
        ("if values", "if not values", {3}),
        ("values, default", "values, key=abs, default", {4, 5, 6}),
        ("        )\n    return LEAST", "        )\n    return 0", {7}),
    ],
)
def test_a_fault_is_reached_by_the_statements_that_it_changes(old, new, lines):
    assert plant.lines({"old": old, "new": new}, SOURCE) == lines


def test_what_is_not_there_once_is_not_planted():
    assert plant.planted({"old": "LEAST", "new": "MOST"}, SOURCE) == ""


@pytest.mark.needs("programs")
def test_a_program_notes_the_faults_that_it_reaches(tmp_path):
    (tmp_path / "some").mkdir()
    (tmp_path / "some/made.py").write_text(SOURCE)
    files = {"some/made.py": [{"4": ["first"], "7": ["last"]}, ["outside"]]}
    watch = {"root": f"{tmp_path}/", "files": files, "folders": ["some/"]}
    (tmp_path / "watch.json").write_text(json.dumps(watch))
    told = {"PLANT_WATCH": tmp_path / "watch.json", "PLANT_OUT": tmp_path / "rows", "PLANT_TEST": "t"}
    path = os.pathsep.join([str(Path(plant.__file__).parent), str(tmp_path / "some")])
    environment = os.environ | {"PYTHONPATH": path} | {key: str(value) for key, value in told.items()}
    program = "import reach, made; made.least([2])"
    subprocess.run([sys.executable, "-c", program], env=environment, check=True)
    rows = [json.loads(line) for line in (tmp_path / "rows").read_text().splitlines()]
    assert sorted(rows) == [["t", name, "hit"] for name in ("first", "outside", "some/")]
