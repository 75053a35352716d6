"""The graders of the course: right answers pass, in other styles too; skeletons and wrong answers do not."""

import shutil
from pathlib import Path

import answers
import pytest

from wamnet.refimpl.errors import InputError
from wamnet_course.frame import Wrong
from wamnet_course.labs import LABS, lab_named
from wamnet_course.wire import RECORDS, STUDENT, named

SOLUTIONS = Path(__file__).parent / "solutions"
"""Right answers: for these tests, not for students."""

STYLES = Path(__file__).parent / "styles"
"""Other right answers: as a different student writes them."""

pytestmark = pytest.mark.needs("programs")  # answers run in processes of their own

ROOT = Path(__file__).resolve().parents[2]

EVERY = [pytest.param(lab, id=lab.name) for lab in LABS]


def first_wrong(lab, folder, here):
    """Return the first finding about a lab's file in a folder, or None."""
    return answers.finding(lab, (folder / lab.file).read_text(), here)


@pytest.fixture
def here(tmp_path, monkeypatch):
    """Work in an empty folder."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_records_go_by_the_name_that_their_class_has():
    """A class that moved is not a record for a student's process any more."""
    ours = {key: named(*where) for key, where in RECORDS.items() if not key.startswith(STUDENT)}
    wrong = [key for key, one in ours.items() if key != f"{one.__module__}:{one.__qualname__}"]
    assert not wrong


@pytest.mark.parametrize("lab", EVERY)
def test_a_right_answer_passes(lab, here):
    assert first_wrong(lab, SOLUTIONS, here) is None


@pytest.mark.parametrize("path", sorted(STYLES.glob("*.py")), ids=lambda path: path.stem)
def test_another_style_passes(path, here):
    lab = lab_named(path.stem.rpartition("_")[0])
    shutil.copy(path, here / lab.file)
    assert first_wrong(lab, here, here) is None


@pytest.mark.parametrize("lab", EVERY)
def test_a_skeleton_is_still_to_be_written(lab, here):
    (here / lab.file).write_text(lab.skeleton)
    wrong = first_wrong(lab, here, here)
    assert "NotImplementedError" in wrong.found
    assert wrong.likely == "it is still to be written"


@pytest.mark.parametrize("lab", EVERY)
def test_a_lab_is_whole(lab):
    """It has a page with hints, a solution, and clauses that the spec has."""
    page = (ROOT / "docs/course" / f"{lab.name.replace('_', '-')}.md").read_text()
    assert page.count("<details") >= 2
    assert (SOLUTIONS / lab.file).is_file()
    spec = "".join(path.read_text() for path in (ROOT / "spec").glob("*.md"))
    assert [clause for clause in lab.clauses.split(", ") if f"**{clause}**" not in spec] == []


def test_the_solutions_are_not_installed():
    """The skeletons raise everywhere; no folder of the package holds an answer."""
    for lab in LABS:
        assert lab.skeleton.count("raise NotImplementedError") >= 1
    assert not list((ROOT / "cli").rglob("*solution*"))


@pytest.mark.parametrize(
    ("word", "name"),
    [
        ("3", "lab03_sampling"),
        ("lab3", "lab03_sampling"),
        ("lab03", "lab03_sampling"),
        ("Sampling", "lab03_sampling"),
        ("lab03_sampling.py", "lab03_sampling"),
        ("12", "lab12_integers"),
        ("extra1", "extra1_sine"),
    ],
)
def test_a_lab_has_many_names(word, name):
    assert lab_named(word).name == name


def test_an_unknown_lab_is_refused():
    with pytest.raises(
        InputError, match=r"lab '13': there is none .* \(known are lab1, lab2, .* extra3, and all"
    ):
        lab_named("13")


@pytest.mark.parametrize(
    ("code", "found", "likely"),
    [
        ("def meet_sphere(*a):\n    return np.zeros(3)", "NameError", "import numpy as np"),
        ("def meet_sphere(*a):\n    pass", "None", "no `return`"),
        ("def meet_sphere(*a):\n    return 'x'", "str", "one array belongs"),
        ("def meet_sphere(*a):\n    exit()", "SystemExit", "return a value"),
        ("def meet_sphere(*a)\n    pass", "SyntaxError: .*, line 1", "not Python"),
        ("import no_such_package", "ModuleNotFoundError", "NumPy and wamnet only"),
        ("import sys\nsys.exit(3)", "SystemExit: 3", "return a value"),
        ("x = 1", "AttributeError", "gone or renamed"),
        ("def meet_sphere(*a):\n    return meet_sphere(*a)", "RecursionError", "without an end"),
        ("import numpy as np\ndef meet_sphere(c, r, o, d):\n    return [o, d, o]", "shape|", ""),
    ],
)
def test_what_python_says_is_explained(code, found, likely, here):
    (here / "lab01_sphere.py").write_text(code)
    wrong = first_wrong(lab_named("1"), here, here)
    pattern = found.partition("|")[0].split(": .*")[0]
    assert pattern in f"{wrong.what} {wrong.found}"
    assert likely in wrong.likely


def test_an_assertion_is_not_the_exception_that_a_lab_demands(here):
    lab = next(lab for lab in LABS if lab.name.endswith("window"))
    code = (SOLUTIONS / lab.file).read_text()
    refusal = 'if not 1 <= size <= 64:\n        raise ValueError(f"size {size}")'
    assert refusal in code
    (here / lab.file).write_text(code.replace(refusal, 'assert 1 <= size <= 64, "size"'))
    wrong = first_wrong(lab, here, here)
    assert (wrong.clause, wrong.expected, wrong.found) == ("DAT-9", "ValueError", "AssertionError: size")


def test_a_message_says_all_in_one_line():
    wrong = Wrong("ISC-6", "a distance", "3", "-3\x1b[2J", "the sign of b")
    assert str(wrong) == "ISC-6: a distance: 3 expected, -3\\x1b[2J found; likely: the sign of b"
