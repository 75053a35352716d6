"""Answers to the labs of the course, right and wrong ones, and what the grader finds in them."""

import json
import os
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

from wamnet_course import judged as students_process
from wamnet_course.frame import Ended, Wrong, of_exception, outcome
from wamnet_course.labs import Lab
from wamnet_course.student import Functions, deadline
from wamnet_course.wire import Channel

COURSE = Path(__file__).parents[1] / "course"
"""Folder of right and wrong answers."""

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
    path = COURSE / "wrong" / f"{lab.name.partition('_')[0]}.json"
    rows = json.loads(path.read_text(encoding="utf-8"))
    return [Answer(old, *row) for old, some in rows.items() for row in some]


def right_answer(lab: Lab) -> str:
    return (COURSE / "solutions" / lab.file).read_text(encoding="utf-8")


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
            # As in the grader's process: the next answer may be as long, and of the same second.
            sys.dont_write_bytecode = True
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
