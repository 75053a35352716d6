"""Faults that are kept back, in the program in JavaScript: what is counted, and that the program is right."""

from __future__ import annotations

import json
import shutil

import held_back
import pytest
from lab import trial
from lab.trial import Outcome

from wamnet.refimpl.errors import ExecutorUnavailable
from wamnet.spec.conformance import vectors
from wamnet.spec.conformance.kinds import KINDS
from wamnet.spec.conformance.protocol import Session

pytestmark = pytest.mark.nightly  # it runs with the experiments

FAULTS = [
    {
        "file": "random.mjs",
        "old": "return (word >>> 8) / 2 ** 24;",
        "new": "return word / 2 ** 32;",
        "clause": "RNG-5",
        "says": "All 32 bits make the float.",
    },
    {
        "file": "random.mjs",
        "old": "export const LARGEST_WORD = 2 ** 32 - 1;",
        "new": "export const LARGEST_WORD = 0xffffffff;",
        "clause": "RNG-8",
        "says": "The same number.",
        "equal": "it is the same number",
    },
]
"""One that cases see, and one that none can."""


@pytest.fixture
def asked(tmp_path):
    """Give a function that asks the kinds of random numbers about faults."""
    if shutil.which("node") is None:
        pytest.skip("MISSING: Node; in Debian: apt-get install nodejs")
    folder = tmp_path / "vectors"
    folder.mkdir()
    for path in vectors.FOLDER.glob("random.*.json"):
        shutil.copy(path, folder)

    def ask(faults):
        path = tmp_path / "faults.json"
        path.write_text(json.dumps(faults), encoding="utf-8")
        words = ["-o", str(tmp_path / "out"), "--faults", str(path), "--vectors", str(folder), "--jobs", "1"]
        return held_back.main(words)

    return ask


def test_each_fault_changes_one_place_and_breaks_a_clause():
    found = held_back.faults()
    assert len(found) == 100
    assert len({fault.name for fault in found}) == len(found)
    for fault in found:
        text = (held_back.PROGRAM / fault.file).read_text(encoding="utf-8")
        assert text.count(fault.old) == 1, fault.name
        assert fault.clause in held_back.chapters(), fault.name
        assert not (fault.equal and fault.shown_by), fault.name


@pytest.mark.needs("programs")
def test_faults_are_counted_and_not_asked_again(asked, capsys, monkeypatch):
    assert asked(FAULTS) == 0
    printed = capsys.readouterr().out
    assert "| all | 2 | 1 | 1 | 0 | 100.0 | 100.0 | 100.0 |" in printed
    assert "| random.mjs | RNG-8 | The same number. | equal: it is the same number |" in printed
    monkeypatch.setattr(held_back, "tried", None)
    assert asked(FAULTS) == 0


@pytest.mark.needs("programs")
def test_a_fault_that_is_missed_ends_with_status_1(asked, capsys):
    shown = {**FAULTS[1], "equal": "", "shown_by": "nothing: it is the same number"}
    assert asked([FAULTS[0], shown]) == 1
    assert "| The same number. | missed: nothing: it is the same number |" in capsys.readouterr().out


@pytest.mark.needs("programs")
def test_a_fault_that_is_caught_is_not_equal(asked):
    with pytest.raises(AssertionError, match="said to be equal"):
        asked([{**FAULTS[0], "equal": "a wrong claim"}])


def test_blame_is_near_in_the_same_chapter():
    assert held_back.near("ISC-6", "ISC-1")
    assert held_back.near("BOX-1", "ISC-3")
    assert not held_back.near("ENC-5", "DAT-1")
    fault = held_back.Fault("m.mjs", "a", "b", "ENC-5", "Words.")
    table = held_back.elsewhere([fault], {fault.name: Outcome(1, "image.features/0", "DAT-1", "", "fail")})
    assert table.splitlines()[-1] == "| m.mjs | ENC-5 | Words. | DAT-1 | image.features/0 |"


def test_node_is_asked_for(monkeypatch, tmp_path):
    monkeypatch.setattr(held_back.shutil, "which", lambda name: None)
    with pytest.raises(ExecutorUnavailable, match="node is not there"):
        held_back.program(tmp_path)


@pytest.mark.needs("programs")
def test_the_program_without_a_fault_passes_all_cases(tmp_path):
    if shutil.which("node") is None:
        pytest.skip("MISSING: Node; in Debian: apt-get install nodejs")
    with Session(held_back.program(tmp_path), held_back.LIMIT_S) as session:
        assert set(session.hello()["kinds"]) == set(KINDS)
    outcome = held_back.tried(None, trial.in_order())
    assert outcome == Outcome(outcome.asked)
