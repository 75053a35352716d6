"""Wrong answers to the labs are caught and explained: a part of them at once, the others with `--slow`."""

from __future__ import annotations

import importlib.util
import os
import re
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

import pytest

from wamnet_course import judged as students_process
from wamnet_course.frame import Ended, Wrong, of_exception, outcome
from wamnet_course.labs import LABS, Lab
from wamnet_course.student import Functions, deadline
from wamnet_course.wire import Channel

HERE = Path(__file__).parent
"""Right and wrong answers."""

STEP = 6
"""Every sixth wrong answer of a lab is asked at once."""

LONGEST_S = 60
"""A changed answer that takes longer does not end, and is caught."""

WITHOUT = {("extra2_rewrite", "old operands")}
"""What is caught and gets another explanation."""


class Answer(NamedTuple):
    """A wrong answer: pieces of text, the mistake, and words (a pattern) of the explanation."""

    old: str
    new: str
    mistake: str
    words: str


def answers(lab: Lab) -> list[Answer]:
    """Return the wrong answers to a lab."""
    path = HERE / "wrong" / f"{lab.name.partition('_')[0]}.py"
    spec = importlib.util.spec_from_file_location(path.stem, path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return [Answer(*row) for row in module.WRONG]


def right_answer(lab: Lab) -> str:
    return (HERE / "solutions" / lab.file).read_text(encoding="utf-8")


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


@pytest.mark.parametrize("part", ["some", pytest.param("others", marks=pytest.mark.slow)])
@pytest.mark.parametrize("lab", LABS, ids=[lab.name for lab in LABS])
def test_wrong_answers_are_caught_and_explained(lab, part, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    right = right_answer(lab)
    for number, answer in enumerate(answers(lab)):
        if (number % STEP == 0) == (part == "some"):
            wrong = finding(lab, right.replace(answer.old, answer.new, 1), tmp_path)
            assert wrong is not None, f"{answer.mistake}: not caught"
            if (lab.name, answer.mistake) not in WITHOUT:
                assert re.search(answer.words, wrong.likely), f"{answer.mistake}: {wrong}"


@pytest.mark.parametrize("lab", LABS, ids=[lab.name for lab in LABS])
def test_wrong_answers_are_changes_of_the_right_one(lab):
    right = right_answer(lab)
    found = answers(lab)
    assert len(found) >= 5
    assert [answer.mistake for answer in found if answer.old not in right or answer.old == answer.new] == []
    assert [answer.mistake for answer in found if re.search(answer.words, "")] == []
    pieces = [(answer.old, answer.new) for answer in found]
    assert len(set(pieces)) == len(pieces)
