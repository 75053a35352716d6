"""A class is graded: what students' code does to its process ends only its own lab, and is named."""

import csv
import io
from pathlib import Path

import packages
import pytest

from wamnet_course import table
from wamnet_course.grading import Limits, grade, grade_class
from wamnet_course.labs import lab_named

pytestmark = pytest.mark.needs("programs")

SOLUTIONS = Path(__file__).parent / "solutions"

LAB = lab_named("adam")

LIMITS = Limits(seconds=2, memory_mb=512)
"""Enough for the lab, and quick to end what does not end."""

STUDENTS = {
    "endless": ("while True: pass", "an end within 2 s", "a loop that does not end"),
    "hog": ("x = [bytearray(1 << 24) for _ in range(1000)]", "MemoryError", "grows"),
    "leaves": ("import sys; sys.exit(0)", "SystemExit: 0", "return a value"),
    "vanishes": ("import os; os._exit(0)", "ended with status 0", "os._exit"),
    "crashes": ("import ctypes; ctypes.string_at(0)", "SIGSEGV", "crash"),
    "starts": ("import subprocess; subprocess.run(['true'])", "PermissionError", "no files, processes"),
    "connects": ("import socket; socket.socket()", "PermissionError", "no files, processes or network"),
    "fills": ("open('x', 'wb').write(bytes(1 << 22))", "File too large", "no files"),
    "imports": ("import no_such_package", "no_such_package", "NumPy and wamnet only"),
    "hostile": ("raise ValueError('\\udcff \\x1b[31m \\x00 \\u202e')", "\\udcff \\x1b[31m \\x00 \\u202e", ""),
    "signals": ("import signal; signal.raise_signal(40)", "an end by signal 40", "crash"),
    "huge": ("return (np.zeros((1000, 1000, 3)),) * 3", "InputError: result '96", ""),
    "odd": ("return {'theta': object(), 1: [len]}, 10**5000, (1,) * 9999", "three steps", ""),
}
"""Bodies of `step`, what is found or expected, and the likeliest mistake."""


def answer(body: str) -> str:
    """Return the right answer with a body of `step` that comes first."""
    text = (SOLUTIONS / LAB.file).read_text()
    head = "def step(theta, g, m, v, t, learning_rate):\n"
    assert head in text
    return text.replace(head, f"{head}    {body}\n")


@pytest.fixture(scope="module", params=["sandbox", pytest.param("trusted", marks=pytest.mark.nightly)])
def graded(request, tmp_path_factory):
    """Give the results of a class of such students, by name."""
    if request.param == "sandbox":
        packages.needed_sandbox()
    folder = tmp_path_factory.mktemp("class")
    bodies = {name: answer(body) for name, (body, _, _) in STUDENTS.items()}
    bodies |= {"right": answer("print('x' * 100)"), "=formula": answer("1 / 0")}
    bodies |= {"<b>bold": answer("return '<i>'"), "\x1b[31m\udcff": answer("pass")}
    bodies["own-module"] = answer("from helper import twice")
    bodies["own-file"] = (
        answer("pass") + "import os\nopen('mine.txt', 'w').write('x')\nopen(os.devnull, 'w')\n"
    )
    for name, text in bodies.items():
        (folder / name).mkdir()
        (folder / name / LAB.file).write_text(text)
    (folder / "own-module/helper.py").write_text("twice = 2")
    (folder / "nothing").mkdir()
    (folder / ".hidden").mkdir()
    (folder / "a-file.txt").write_text("not a student")
    students = grade_class(folder, (LAB,), LIMITS, workers=2, trusted=request.param == "trusted")
    return {student.name: student for student in students}


@pytest.mark.parametrize("name", STUDENTS)
def test_what_a_student_does_is_survived_and_named(graded, name):
    _, found, likely = STUDENTS[name]
    result = graded[name].of(LAB)
    assert not result.right
    assert found in str(result.first)
    assert likely in result.first.likely


def test_right_answers_pass_beside_them(graded):
    for name in ("right", "own-module", "own-file", r"\x1b[31m\udcff"):
        assert graded[name].of(LAB).right, graded[name].of(LAB).first
        assert graded[name].complete == 1


def test_a_student_without_files_is_in_the_table(graded):
    assert graded["nothing"].results == ()
    assert ".hidden" not in graded


def test_the_tables(graded):
    students = list(graded.values())
    rows = list(csv.reader(io.StringIO(table.grades(students, (LAB,)))))
    assert rows[0] == ["student", "lab08_adam", "labs complete"]
    by_name = {row[0]: row[1:] for row in rows}
    assert by_name["right"] == ["6/6", "1"]
    assert by_name["nothing"] == ["", "0"]
    # A spreadsheet takes no name for a formula.
    assert "'=formula" in by_name
    found = list(csv.DictReader(io.StringIO(table.findings(students))))
    assert {row["student"] for row in found} >= set(STUDENTS)
    page = table.page(students, (LAB,))
    for text in (page, table.grades(students, (LAB,)), table.findings(students)):
        assert text.replace("\n", "").isprintable()
    assert "<b>bold" not in page
    assert "&lt;b&gt;bold" in page
    assert "<script" not in page
    assert "http" not in page


def test_a_print_is_shown_to_its_student(tmp_path, capfd):
    (tmp_path / LAB.file).write_text(answer("print('seen by me')"))
    assert grade(LAB, tmp_path, trusted=True, shows=True).right
    assert "seen by me" in capfd.readouterr().out


def test_links_and_large_files_are_not_read(tmp_path):
    secret = tmp_path / "secret.py"
    secret.write_text(answer("pass"))
    student = tmp_path / "student"
    student.mkdir()
    (student / LAB.file).symlink_to(secret)
    assert "no such file" in grade(LAB, student, trusted=True).first.found
    (student / LAB.file).unlink()
    (student / LAB.file).write_text("#" * (1 << 21))
    assert "no such file" in grade(LAB, student, trusted=True).first.found


def test_a_file_that_hides_numpy_hides_nothing(tmp_path):
    (tmp_path / LAB.file).write_text(answer("pass"))
    (tmp_path / "numpy.py").write_text("1 / 0")
    (tmp_path / "wamnet.py").write_text("1 / 0")
    assert grade(LAB, tmp_path, trusted=True).right


def test_who_sleeps_is_ended(tmp_path, monkeypatch):
    monkeypatch.setattr(Limits, "longest_wait_s", 2)
    (tmp_path / LAB.file).write_text(answer("import time; time.sleep(600)"))
    result = grade(LAB, tmp_path, trusted=True)
    assert result.first.found == "no end within 2 s"
    assert result.checks[-1][1].likely == "what stopped the process before it"
