"""Readers and commands on changed files: what was once found, and some of each kind on every run.

`make fuzz MINUTES=10` runs for as long as is wanted [fuzz.py]. What it finds is fixed, and its file is put
into corpus/TARGET/ [`CORPUS`].
"""

import time
from pathlib import Path

import forks
import fuzz
import numpy as np
import pytest
from targets import Good

from wamnet.compiler.compile import compile_program
from wamnet.compiler.core.lower import lower
from wamnet.refimpl.network import siren
from wamnet.refimpl.network.dataset import Normalization
from wamnet.refimpl.network.denoise import Model
from wamnet.refimpl.network.window import Window

CORPUS = sorted(Path(__file__).with_name("corpus").glob("*/*"))
"""Inputs that once gave something else than a value or an error of ours, by target."""

SEED = 20_26
"""Of the inputs that are the same on every run."""

INPUTS = {
    "wamnet": 5,
    "options,": 5,
    "apart,": 2,
    "machine": 4,
    "renderer": 5,
    "model": 30,
    "certificate": 30,
    "kernel": 30,
    "weights": 30,
}
"""Inputs of a target, by the first word of its name; of others 150."""

NEVER_REFUSED = ("cache", "weights", "request to view", "options, executors", "machine", "renderer")
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


@pytest.mark.nightly
def test_good_files_are_accepted(targets):
    for target in targets.values():
        for example in target.examples:
            assert check(target, example) == "accepted", target.name


@pytest.mark.nightly
def test_changed_files_are_refused_or_right(targets):
    """Each target gets inputs of all outcomes that it has, and none is a finding."""
    for target in targets.values():
        count = INPUTS.get(target.name.split()[0], 150)
        outcomes = {check(target, fuzz.changed(target, SEED, number)) for number in range(count)}
        if target.name not in NEVER_REFUSED and count > 2:
            assert "refused" in outcomes, target.name


# ---- the fuzzer itself ------------------------------------------------------------------------------------


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


def test_a_hang_is_a_finding_and_ends_nothing(monkeypatch):
    """Nobody has prepared this process: the alarm's own action would end it."""
    monkeypatch.setattr(fuzz, "HANG_S", 0.05)
    waits = fuzz.Target("planted", "bytes", [b""], lambda *_: time.sleep(60))
    assert fuzz.tried(waits, b"") == ("FOUND", "a hang of 0.05 s")


def test_lines_run_kernels_whatever_this_process_has_opened(executor_named, tmp_path):
    """A fork of a process with OpenCL's threads lacks them, and would wait for its first kernel forever."""
    program = compile_program(lower(tiny()), "opencl")
    executor_named("opencl").run(program, {"color": np.zeros((2, 2, 3), np.float32)})
    line = "compare --paths furnace --executor opencl --width 2 --height 2 --spp 2 --max-depth 1"
    status, said, left = forks.in_child(line.split(), tmp_path, 60.0)
    assert (status, left) == (0, False), said


def test_a_line_that_does_not_end_is_a_finding(tmp_path):
    """The server tells it, and answers the next line."""
    with pytest.raises(forks.Wrong, match="did not end within"):
        forks.in_child(["executors"], tmp_path, -2 * forks.ENDING_S)
    status, said, _ = forks.in_child(["render", "nowhere"], tmp_path, 60.0)
    assert status == 2, said


def tiny():
    """A model of one pixel's colour."""
    network = siren.init((3, 4, 3), 1.0, 1.0, 1, np.float32)
    return Model(network, ("color",), Window(1, "clamp"), Normalization())
