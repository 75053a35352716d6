"""`wamnet course`: what it writes and prints, its exit status, refusals; pytest and make in its folder."""

import subprocess
import sys
from pathlib import Path

import pytest

from wamnet_course.labs import LABS

pytestmark = pytest.mark.needs("programs")

SOLUTIONS = Path(__file__).parents[1] / "course/solutions"


@pytest.fixture
def started(wamnet, tmp_path):
    """Begin the course, and return its folder."""
    outcome = wamnet("course", "start", "mine")
    assert outcome.status == 0
    assert outcome.out.startswith("wrote 18 files to mine; read mine/README.md")
    return tmp_path / "mine"


def test_a_folder_has_skeletons_and_no_answers(started):
    assert {path.name for path in started.iterdir()} == {
        *(lab.file for lab in LABS),
        *("Makefile", "README.md", "test_labs.py"),
    }
    for lab in LABS:
        text = (started / lab.file).read_text()
        assert "raise NotImplementedError" in text
        assert text != (SOLUTIONS / lab.file).read_text()
        assert f"| {lab.target} | {lab.file} | {lab.title} |" in (started / "README.md").read_text()


def test_a_folder_that_holds_something_is_refused(started, refused):
    (started / "lab01_sphere.py").write_text("mine")
    told = refused("course", "start", "mine")
    assert "output folder 'mine': is not empty (name another folder)" in told  # it has no option -o
    assert (started / "lab01_sphere.py").read_text() == "mine"


def test_a_check_in_another_folder_says_where_answers_are_named(started, wamnet):
    outcome = wamnet("course", "check", "1")
    assert outcome.status == 1
    assert "it is in another folder, which is named after the lab" in outcome.out


def test_a_check_says_clause_expected_found_and_likely(started, wamnet):
    text = (SOLUTIONS / "lab02_camera.py").read_text()
    (started / "lab02_camera.py").write_text(text.replace("height - 2 * (y + v)", "2 * (y + v) - height"))
    outcome = wamnet("course", "check", "camera", "mine")
    assert outcome.status == 1
    assert outcome.out.splitlines() == [
        "lab02_camera: 4 of 8 checks, not yet",
        "  the top edge, clause CAM-2",
        "    the top edge at a depth of 1",
        "    expected: [0, 1, -1]",
        "    found:    [0, -1, -1]",
        "    likely:   up and down are exchanged: row 0 is at the top",
    ]
    every = wamnet("course", "check", "2", "mine", "--every")
    assert every.out.count("expected:") >= 2


def test_a_right_answer_ends_with_status_0(started, wamnet):
    (started / "lab08_adam.py").write_text((SOLUTIONS / "lab08_adam.py").read_text())
    outcome = wamnet("course", "check", "lab8", "mine")
    assert (outcome.status, outcome.out) == (0, "lab08_adam: 6 of 6 checks, passed\n")


def test_a_class_is_graded(wamnet, tmp_path):
    for name, text in (("ada", (SOLUTIONS / "lab08_adam.py").read_text()), ("bob", "import sys; sys.exit()")):
        (tmp_path / "class" / name).mkdir(parents=True)
        (tmp_path / "class" / name / "lab08_adam.py").write_text(text)
    outcome = wamnet("course", "grade", "class", "-o", "out", "--workers", "1", "--trusted")
    assert outcome.status == 0
    assert "wrote index.html, grades.csv and findings.csv to out" in outcome.out
    lines = (tmp_path / "out/grades.csv").read_text().splitlines()
    assert lines[1].startswith("ada,,,,,,,,6/6,")
    assert lines[2].startswith("bob,,,,,,,,0/6,")
    assert "SystemExit" in (tmp_path / "out/findings.csv").read_text()
    assert (tmp_path / "out/index.html").read_text().startswith("<!DOCTYPE html>")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ("check 13", "lab '13': there is none of this name"),
        ("check 1 nowhere", "folder of answers 'nowhere': it is no folder (wamnet course start makes one"),
        ("check 1 --seconds 0", "--seconds 0: it must be 1 to 3600"),
        ("check 1 --memory 1000000", "--memory 1000000: it must be 1 to 65536"),
        ("grade nowhere -o out", "folder of students 'nowhere': it is no folder"),
        ("grade empty -o out", "folder of students 'empty': it holds no folders"),
        ("grade full -o full", "output folder 'full': is not empty"),
        ("grade full -o out --workers 0", "--workers 0: it must be at least 1"),
        ("grade full -o out --lab x", "lab 'x': there is none of this name"),
        ("start nowhere/mine", "output folder 'nowhere': not found"),
    ],
)
def test_bad_input_is_refused(arguments, words, refused, tmp_path):
    (tmp_path / "empty").mkdir()
    (tmp_path / "full/ada").mkdir(parents=True)
    assert words in refused("course", *arguments.split())
    assert not (tmp_path / "out").exists()


def test_without_a_command_it_shows_help(wamnet):
    outcome = wamnet("course")
    assert outcome.status == 0
    assert "start" in outcome.out


@pytest.mark.nightly
def test_the_folder_works_with_pytest_and_make(started):
    (started / "lab08_adam.py").write_text((SOLUTIONS / "lab08_adam.py").read_text())
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-k", "lab08 or lab01"]
    done = subprocess.run(command, cwd=started, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert f"{len(LABS[0].checks)} failed, {len(LABS[7].checks)} passed" in done.stdout
    assert "it is still to be written" in done.stdout
    make = ["make", "--no-print-directory", "lab8", f"WAMNET={sys.executable} -m wamnet.cli"]
    done = subprocess.run(make, cwd=started, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (0, "lab08_adam: 6 of 6 checks, passed\n")


def test_without_a_sandbox_the_command_asks_for_trust(refused, wamnet, tmp_path, monkeypatch):
    (tmp_path / "class/ada").mkdir(parents=True)
    (tmp_path / "class/ada" / "lab01_sphere.py").write_text((SOLUTIONS / "lab01_sphere.py").read_text())
    monkeypatch.setenv("PATH", "")
    message = refused("course", "grade", "class", "-o", "out", "--lab", "1")
    assert message.count("\n") == 1
    assert "sandbox 'bwrap: No such file or directory'" in message
    assert "install bubblewrap, or add --trusted" in message
    # A lab that is named twice is graded once.
    outcome = wamnet("course", "grade", "class", "-o", "out", "--lab", "1", "--lab", "sphere", "--trusted")
    assert outcome.status == 0
    assert (tmp_path / "out/grades.csv").read_text().splitlines()[1] == "ada,11/11,1"
