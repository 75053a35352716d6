"""A class is graded: what students' code does to its process is survived and named."""

from __future__ import annotations

import csv
import io
import os
from pathlib import Path

import pytest

from wamnet.cli.course import table
from wamnet.cli.course.grading import Limits, grade, grade_class
from wamnet.cli.course.labs import lab_named
from wamnet.cli.course.sandbox import Confinement, Forbidden

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
    "writes": ("open(__file__.rpartition('/')[0] + '/../x', 'w')", "Forbidden: it writes", "no files"),
    "deletes": ("import os; os.remove(os.__file__)", "Forbidden: it deletes", "no files"),
    "prints": ("print('x' * (1 << 22), flush=True)", "File too large", "remove the prints"),
    "imports": ("import no_such_package", "no_such_package", "NumPy and wamnet only"),
}
"""Bodies of `step`, what is found or expected, and the likeliest mistake."""


def answer(body: str) -> str:
    """Return the right answer with a body of `step` that comes first."""
    text = (SOLUTIONS / LAB.file).read_text()
    head = "def step(theta, g, m, v, t, learning_rate):\n"
    assert head in text
    return text.replace(head, f"{head}    {body}\n")


@pytest.fixture(scope="module")
def graded(tmp_path_factory):
    """Give the results of a class of such students, by name, and its folder."""
    folder = tmp_path_factory.mktemp("class")
    bodies = {name: answer(body) for name, (body, _, _) in STUDENTS.items()}
    bodies |= {"right": answer("pass"), "=formula": answer("1 / 0"), "<b>bold</b>": answer("return '<i>'")}
    bodies["own-module"] = answer("from helper import twice")
    bodies["own-file"] = answer("pass") + "open('mine.txt', 'w').write('x')\nimport os\nos.remove(__file__)\n"
    for name, text in bodies.items():
        place = folder / name.replace("</b>", "")
        place.mkdir()
        (place / LAB.file).write_text(text)
    (folder / "own-module/helper.py").write_text("twice = 2")
    (folder / "nothing").mkdir()
    (folder / ".hidden").mkdir()
    (folder / "a-file.txt").write_text("not a student")
    before = {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    students = grade_class(folder, (LAB,), LIMITS, workers=2)
    after = {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    assert before == after, "a student's files are copied, not used"
    return {student.name: student for student in students}


@pytest.mark.parametrize("name", STUDENTS)
def test_what_a_student_does_is_survived_and_named(graded, name):
    _, found, likely = STUDENTS[name]
    result = graded[name].of(LAB)
    assert not result.right
    told = f"{result.first.expected} | {result.first.found} | {' '.join(result.notes)}"
    assert found in told
    assert likely in result.first.likely


def test_right_answers_pass_beside_them(graded):
    for name in ("right", "own-module"):
        assert graded[name].of(LAB).right, graded[name].of(LAB).first
        assert graded[name].complete == 1


def test_files_in_the_own_folder_are_noted(graded):
    result = graded["own-file"].of(LAB)
    assert result.right
    assert result.notes == ("it wrote mine.txt", "it deleted lab08_adam.py")


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
    assert "<b>bold" not in page
    assert "&lt;b&gt;bold" in page
    assert "<script" not in page
    assert "http" not in page


@pytest.mark.parametrize(
    ("event", "given", "told"),
    [
        ("open", ("outside", None, os.O_WRONLY | os.O_CREAT), "writes .*outside"),
        ("os.remove", ("outside",), "deletes .*outside"),
        ("shutil.rmtree", ("..",), r"deletes \.\."),
        ("os.rename", ("work/a", "outside"), "renames .*outside"),
        ("os.system", ("true",), "starts a program"),
        ("subprocess.Popen", ("true",), "starts a program"),
        ("os.fork", (), "starts a process"),
        ("os.kill", (1, 9), "sends a signal"),
        ("socket.connect", (None, ("127.0.0.1", 9)), "uses the network"),
        ("resource.setrlimit", (0, (1, 1)), "changes its limits"),
    ],
)
def test_what_leaves_the_folder_is_refused_and_noted(event, given, told, tmp_path, monkeypatch):
    """The hook by itself: one that is added to this process could not be removed again."""
    monkeypatch.chdir(tmp_path)
    notes = []
    hook = Confinement(tmp_path / "work", LIMITS, notes.append)
    with pytest.raises(Forbidden, match=f"it {told}"):
        hook(event, given)
    assert len(notes) == 1


def test_what_stays_in_the_folder_passes(tmp_path):
    hook = Confinement(tmp_path, LIMITS, pytest.fail)
    hook("open", (str(tmp_path / "mine"), "w", os.O_WRONLY | os.O_CREAT))
    hook("open", ("/etc/hostname", "r", os.O_RDONLY))
    hook("open", (os.devnull, "w", os.O_WRONLY))
    hook("os.remove", (str(tmp_path / "mine"), -1))
    hook("import", ("numpy", None, None, None, None))
    told = []
    few = Confinement(tmp_path, LIMITS._replace(files=2), told.append)
    for _ in range(2):
        few("open", (str(tmp_path / "mine"), "w", os.O_WRONLY))
    with pytest.raises(Forbidden, match="writes more than 2 files"):
        few("open", (str(tmp_path / "mine"), "w", os.O_WRONLY))


def test_a_print_is_shown_to_its_student(tmp_path, capfd):
    (tmp_path / LAB.file).write_text(answer("print('seen by me')"))
    assert grade(LAB, tmp_path, shows=True).right
    assert "seen by me" in capfd.readouterr().out


def test_a_file_that_hides_numpy_hides_nothing(tmp_path):
    (tmp_path / LAB.file).write_text(answer("pass"))
    (tmp_path / "numpy.py").write_text("1 / 0")
    (tmp_path / "wamnet.py").write_text("1 / 0")
    assert grade(LAB, tmp_path).right


def test_links_and_large_files_are_not_copied(tmp_path):
    secret = tmp_path / "secret.py"
    secret.write_text(answer("pass"))
    student = tmp_path / "student"
    student.mkdir()
    (student / LAB.file).symlink_to(secret)
    assert "no such file" in grade(LAB, student).first.found
