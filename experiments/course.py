"""Wrong answers to the labs of the course: how many are caught, and how many get the right explanation.

    python experiments/course.py
    python experiments/course.py --lab 1 --missed
    python experiments/course.py --students 30

1. Right answers are in tests/course/solutions; a wrong one is such an answer with one piece of text replaced
   [tests/course/wrong]. Each was written with the mistake in words, and with words of the explanation.
2. It is caught when a check fails, and explained when the first finding's likeliest mistake has these words.
3. Mechanical changes come on top: one sign or number of a right answer is another one [`mutants`], at places
   that are spread over it. They have no explanation; those that change nothing count as not caught.
4. With `--students` a class of so many is graded, and timed: every third one is right in a lab, the others
   have the wrong answers in turn [`graded`].
"""

from __future__ import annotations

import argparse
import csv
import importlib.util
import os
import re
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

from wamnet_course import judged as students_process
from wamnet_course.frame import Ended, Wrong, of_exception, outcome
from wamnet_course.labs import LABS, Lab, lab_named
from wamnet_course.student import Functions, deadline
from wamnet_course.wire import Channel

COURSE = Path(__file__).resolve().parents[1] / "tests/course"
"""Right and wrong answers."""


CHANGES = ((" + ", " - "), (" - ", " + "), (" * ", " / "), (" / ", " * "), (" < ", " >= "), (" > ", " <= "))
"""Signs and what replaces them; a number grows by one."""

MUTANTS = 100
"""Mechanical changes of each lab, at most: all that there are."""

LONGEST_S = 60
"""A changed answer that takes longer does not end, and is caught."""


class Answer(NamedTuple):
    """A wrong answer: pieces of text, the mistake, and words (a pattern) of the explanation."""

    old: str
    new: str
    mistake: str
    words: str


def answers(lab: Lab) -> list[Answer]:
    """Return the wrong answers to a lab."""
    path = COURSE / "wrong" / f"{lab.name.partition('_')[0]}.py"
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return [Answer(*row) for row in module.WRONG]


@contextmanager
def forked(folder: Path) -> Iterator[Functions]:
    """Give a student's functions in a fork of this process, which has no time to lose on imports."""
    (their_reader, writer), (reader, their_writer) = os.pipe(), os.pipe()
    child = os.fork()
    if child == 0:
        try:
            os.close(writer)
            os.close(reader)
            os.chdir(folder)
            with Path(os.devnull).open("wb") as nowhere:
                os.dup2(nowhere.fileno(), 1)
            students_process.serve(Channel(os.fdopen(their_reader, "rb"), os.fdopen(their_writer, "wb")))
        finally:
            os._exit(0)
    os.close(their_reader)
    os.close(their_writer)
    with os.fdopen(reader, "rb") as incoming, os.fdopen(writer, "wb") as outgoing:
        try:
            yield Functions(Channel(incoming, outgoing))
        finally:
            os.kill(child, signal.SIGKILL)
            os.waitpid(child, 0)


def finding(lab: Lab, text: str, folder: Path) -> Wrong | None:
    """Return the first thing that is wrong with an answer; an answer that takes too long is."""
    (folder / lab.file).write_text(text, encoding="utf-8")
    with forked(folder) as student:
        try:
            with deadline(LONGEST_S):
                student.request(students_process.load, lab.file, {})
                return next(filter(None, (outcome(check, student) for check in lab.checks)), None)
        except Ended as error:
            return Wrong("", "this answer", "an end", str(error) or "none")
        except Exception as error:  # noqa: BLE001
            return of_exception(error, "loading the file")


def judged(lab: Lab, folder: Path) -> Iterator[tuple[Answer, Wrong | None, bool]]:
    """Yield each wrong answer, what is found, and whether the explanation is right."""
    right = (COURSE / "solutions" / lab.file).read_text(encoding="utf-8")
    for answer in answers(lab):
        assert right.count(answer.old) >= 1, f"{lab.name}: {answer.old!r} is gone"
        wrong = finding(lab, right.replace(answer.old, answer.new, 1), folder)
        yield answer, wrong, wrong is not None and bool(re.search(answer.words, wrong.likely))


def mutants(text: str) -> list[str]:
    """Return a right answer with one sign or number changed, MUTANTS times, at places spread over it."""
    found = []
    for number, line in enumerate(lines := text.splitlines(keepends=True)):
        if line.startswith(('"""', "from ", "import ", "def ", "class ")) or "#" in line:
            continue
        changed = [
            line[:at] + new + line[at + len(old) :] for old, new in CHANGES for at in places(line, old)
        ]
        numbers = re.finditer(r"(?<![\w.])\d+(?![\w.])", line)
        changed += [f"{line[: m.start()]}{int(m[0]) + 1}{line[m.end() :]}" for m in numbers]
        found += ["".join([*lines[:number], one, *lines[number + 1 :]]) for one in changed]
    step = max(1, len(found) // MUTANTS)
    return found[::step][:MUTANTS]


def places(line: str, old: str) -> list[int]:
    """Return where a text begins in a line."""
    return [m.start() for m in re.finditer(re.escape(old), line)]


def difference(lab: Lab, text: str) -> str:
    """Return the changed line."""
    right = (COURSE / "solutions" / lab.file).read_text(encoding="utf-8")
    pairs = zip(right.splitlines(), text.splitlines(), strict=True)
    return next(other.strip() for one, other in pairs if one != other)


def class_of(students: int, labs: Sequence[Lab], folder: Path) -> int:
    """Write the folders of a class; return how many of its answers are wrong."""
    wrong = 0
    for lab in labs:
        right = (COURSE / "solutions" / lab.file).read_text(encoding="utf-8")
        mistakes = answers(lab)
        for student in range(students):
            text = right
            if student % 3:
                answer = mistakes[student % len(mistakes)]
                text, wrong = right.replace(answer.old, answer.new, 1), wrong + 1
            home = folder / f"student{student:02d}"
            home.mkdir(exist_ok=True)
            (home / lab.file).write_text(text, encoding="utf-8")
    return wrong


def graded(students: int, labs: Sequence[Lab]) -> str:
    """Grade a class by the command, and return a table of one row: its size, what is found, and the time."""
    with tempfile.TemporaryDirectory() as made:
        folder, output = Path(made, "class"), Path(made, "grades")
        folder.mkdir()
        wrong = class_of(students, labs, folder)
        command = ["-m", "wamnet.cli", "course", "grade", str(folder), "-o", str(output)]
        start = time.perf_counter()
        chosen = [word for lab in labs for word in ("--lab", lab.name)]
        subprocess.run([sys.executable, *command, *chosen], check=True, stdout=subprocess.DEVNULL)
        seconds = time.perf_counter() - start
        with (output / "grades.csv").open(encoding="utf-8") as file:
            marks = [row[lab.name].split("/") for row in csv.DictReader(file) for lab in labs]
    complete = sum(passed == checks for passed, checks in marks)
    row = (students, len(labs), students * len(labs) - wrong, wrong, complete, f"{seconds:.0f}")
    heads = ("students", "labs", "right answers", "wrong answers", "complete", "seconds")
    return f"| {' | '.join(heads)} |\n|{' --- |' * len(heads)}\n| {' | '.join(map(str, row))} |"


def main(arguments: Sequence[str] | None = None) -> None:
    """Print a table with a line a lab."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--lab", nargs="+", default=[lab.name for lab in LABS], help="labs by name or number")
    parser.add_argument("--missed", action="store_true", help="show what is not caught or not explained")
    parser.add_argument("--students", type=int, default=0, help="grade and time a class of so many instead")
    options = parser.parse_args(arguments)
    labs = [lab_named(word) for word in options.lab]
    if options.students:
        print(graded(options.students, labs))
        return
    rows: list[tuple[Any, ...]] = []
    with tempfile.TemporaryDirectory() as made:
        os.chdir(made)
        for lab in labs:
            found = list(judged(lab, Path(made)))
            seen, told = sum(w is not None for _, w, _ in found), sum(good for _, _, good in found)
            changed = mutants((COURSE / "solutions" / lab.file).read_text(encoding="utf-8"))
            noticed = [finding(lab, text, Path(made)) is not None for text in changed]
            rows.append((lab.name, len(found), seen, told, len(changed), sum(noticed)))
            if options.missed:
                for text in (t for t, good in zip(changed, noticed, strict=True) if not good):
                    print(f"{lab.name}: not caught: {difference(lab, text)}")
            for answer, wrong, good in found:
                if options.missed and not good:
                    print(f"{lab.name}: {answer.mistake}: wanted {answer.words!r}: {wrong or 'not caught'}")
        os.chdir(COURSE)
    print("| lab | wrong answers | caught | explained | changes | noticed |\n|" + " --- |" * 6)
    rows.append(("all", *(sum(row[i] for row in rows) for i in range(1, 6))))
    for row in rows:
        print(f"| {' | '.join(map(str, row))} |")


if __name__ == "__main__":
    main()
