"""Readers and commands on changed files: what was once found, and some of each kind on every run.

`make fuzz MINUTES=10` goes on for as long as is wanted [fuzz.py]. What it finds is mended, and its file is
put into corpus/TARGET/ [`CORPUS`].
"""

from __future__ import annotations

import json
from pathlib import Path
from random import Random

import fuzz
import mutations
import numpy as np
import pytest
from targets import Good

from wamnet.refimpl.errors import InputError

CORPUS = sorted(Path(__file__).with_name("corpus").glob("*/*"))
"""Inputs that once gave something else than a value or an error of ours, by target."""

SEED = 20_26
"""Of the inputs that are the same on every run."""

INPUTS = {
    "wamnet": 5,
    "options,": 5,
    "apart,": 2,
    "model": 30,
    "certificate": 30,
    "kernel": 30,
    "weights": 30,
}
"""Inputs of a target, by the first word of its name; of others 150."""

NEVER_REFUSED = ("cache", "weights", "request to view", "options, executors")
"""Damaged entries of the cache are ignored; a certificate is refused by an outcome of its own; a request gets
an answer."""


@pytest.fixture(scope="module")
def targets(tmp_path_factory):
    folder = tmp_path_factory.mktemp("good")
    patch = pytest.MonkeyPatch()
    patch.setenv("WAMNET_CACHE", str(folder / "cache"))
    patch.setenv("COLUMNS", "200")
    good = Good(folder)
    yield {target.name: target for target in fuzz.every(good)}
    patch.undo()


def check(target, content):
    outcome, what = fuzz.tried(target, content)
    assert outcome != "FOUND", what
    return outcome


@pytest.mark.parametrize("path", CORPUS, ids=lambda path: f"{path.parent.name}-{path.name}")
def test_what_was_found_once(targets, path):
    check(targets[path.parent.name], path.read_bytes())


def test_good_files_are_accepted(targets):
    for target in targets.values():
        for example in target.examples:
            assert check(target, example) == "accepted", target.name


def test_changed_files_are_refused_or_right(targets):
    """Each target gets inputs of all outcomes that it has, and none is a finding."""
    for target in targets.values():
        count = INPUTS.get(target.name.split()[0], 150)
        outcomes = {check(target, fuzz.changed(target, SEED, number)) for number in range(count)}
        if target.name not in NEVER_REFUSED and count > 2:
            assert "refused" in outcomes, target.name


# ---- the fuzzer itself ------------------------------------------------------------------------------------


@pytest.mark.parametrize("way", mutations.WAYS)
def test_an_input_is_a_function_of_its_number(targets, way):
    target = next(target for target in targets.values() if target.way == way)
    inputs = [fuzz.changed(target, 1, number) for number in range(40)]
    assert inputs == [fuzz.changed(target, 1, number) for number in range(40)]
    assert len(set(inputs)) > 30
    assert len(set(inputs) - set(target.examples)) > 30


def test_changed_json_is_json_most_of_the_time():
    text = json.dumps({"a": [1, 2.5, {"b": "x"}], "c": None, "d": "[1, 2]"}).encode()
    whole = 0
    for number in range(400):
        try:
            json.loads(mutations.of_json(Random(number), text))
        except ValueError:
            continue
        whole += 1
    assert 200 < whole < 400


@pytest.mark.parametrize(
    ("use", "what"),
    [
        (lambda *_: {}["x"], "KeyError"),
        (lambda *_: [0] * 10**12, "bytes of memory"),
        (lambda *_: (_ for _ in ()).throw(fuzz.Hang()), "a hang"),
        (lambda *_: np.testing.assert_array_equal(1, 2), "AssertionError"),
    ],
)
def test_what_is_a_finding(targets, use, what):
    target = fuzz.Target("planted", "bytes", [b""], use)
    outcome, told = fuzz.tried(target, b"")
    assert outcome == "FOUND"
    assert what in told


def test_what_is_none(targets):
    def refuse(*_):
        raise InputError("thing", 1, "rule", "way out")

    assert fuzz.tried(fuzz.Target("planted", "bytes", [b""], refuse), b"") == ("refused", "")
    assert fuzz.tried(fuzz.Target("planted", "bytes", [b""], lambda *_: 0), b"") == ("accepted", "")
