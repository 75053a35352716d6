"""Wrong answers to the labs are caught and explained: a part of them here, all by experiments/course.py."""

from __future__ import annotations

import re

import pytest

import course as measured
from wamnet_course.labs import LABS

STEP = 6
"""Every sixth wrong answer of a lab is asked."""

WITHOUT = {("extra2_rewrite", "old operands")}
"""What is caught and gets another explanation."""


@pytest.mark.nightly(but=("lab01_sphere", "lab04_light", "lab10_emitter", "lab11_bound"))
@pytest.mark.parametrize("lab", LABS, ids=[lab.name for lab in LABS])
def test_wrong_answers_are_caught_and_explained(lab, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    right = (measured.COURSE / "solutions" / lab.file).read_text()
    for answer in measured.answers(lab)[::STEP]:
        wrong = measured.finding(lab, right.replace(answer.old, answer.new, 1), tmp_path)
        assert wrong is not None, f"{answer.mistake}: not caught"
        if (lab.name, answer.mistake) not in WITHOUT:
            assert re.search(answer.words, wrong.likely), f"{answer.mistake}: {wrong}"


@pytest.mark.parametrize("lab", LABS, ids=[lab.name for lab in LABS])
def test_wrong_answers_are_changes_of_the_right_one(lab):
    right = (measured.COURSE / "solutions" / lab.file).read_text()
    found = measured.answers(lab)
    assert len(found) >= 5
    assert [answer.mistake for answer in found if answer.old not in right or answer.old == answer.new] == []
    assert [answer.mistake for answer in found if re.search(answer.words, "")] == []
    pieces = [(answer.old, answer.new) for answer in found]
    assert len(set(pieces)) == len(pieces)


def test_changes_are_single_and_spread():
    text = '"""Text."""\n\na = 1 + 2\nb = a * 3 - 1\n'
    found = measured.mutants(text)
    assert "a = 1 - 2" in found[0]
    assert all(one != text for one in found)
    assert any("b = a / 3 - 1" in one for one in found)
    assert any("b = a * 4 - 1" in one for one in found)
