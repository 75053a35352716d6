"""Wrong answers to the labs are caught and explained: a part of them at once, the others with `--nightly`."""

import re

import pytest
from answers import answers, finding, right_answer

from wamnet_course.labs import LABS

pytestmark = pytest.mark.needs("programs")  # answers run in processes of their own

STEP = 12
"""Every twelfth wrong answer of a lab is asked at once."""

WITHOUT = {("extra2_rewrite", "old operands")}
"""What is caught and gets another explanation."""


@pytest.mark.parametrize("part", ["some", pytest.param("others", marks=pytest.mark.nightly)])
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
