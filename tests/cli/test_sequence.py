"""Sequences of frames: names, results, overlap, failures, and resuming after an interruption."""

import os
import re
import shutil
import threading
from pathlib import Path

import numpy as np
import pytest

from wamnet.cli.commands import denoise
from wamnet.cli.common import sequence
from wamnet.cli.common.sequence import frames_of, outputs_of, overlapped
from wamnet.cli.files import exr, images
from wamnet.refimpl.errors import InputError, WamnetError


@pytest.fixture
def here(samples, tmp_path):
    """Put a model and five frames into the working folder, the third of other pixels."""
    shutil.copy(samples / "model.safetensors", tmp_path / "m.safetensors")
    (tmp_path / "shot").mkdir()
    for number in range(8, 13):
        source = "reference.exr" if number == 10 else "noisy.exr"
        shutil.copy(samples / source, tmp_path / f"shot/a.{number:04d}.exr")
    return tmp_path


# ---- names ---------------------------------------------------------------------------------------------

NAMES = ("a.9.exr", "a.0010.exr", "a.0009.exr", "a.10000.exr", "a.x.exr", "b[1].exr", "c*.exr", "d%04d.exr")

EXPANDED = {
    "a.%04d.exr": ["a.0009.exr", "a.0010.exr", "a.10000.exr"],
    "a.%d.exr": ["a.0009.exr", "a.9.exr", "a.0010.exr", "a.10000.exr"],
    "a.?.exr": ["a.9.exr", "a.x.exr"],
    "b[1].exr": ["b[1].exr"],  # a file of this name is itself, and no pattern
    "c*.exr": ["c*.exr"],
    "d%04d.exr": ["d%04d.exr"],
    "nothing.exr": ["nothing.exr"],
}


@pytest.mark.parametrize("pattern", EXPANDED)
def test_a_pattern_stands_for_its_files_in_order(tmp_path, pattern):
    for name in NAMES:
        (tmp_path / name).touch()
    assert [path.name for path in frames_of([tmp_path / pattern])] == EXPANDED[pattern]
    assert frames_of([tmp_path / pattern, tmp_path / pattern]) == frames_of([tmp_path / pattern])


@pytest.mark.parametrize(
    ("pattern", "rule"), [("z*.exr", "not found"), ("%d.%d.exr", "one number"), ("%d/x.exr", "one number")]
)
def test_a_pattern_that_stands_for_no_file_is_refused(tmp_path, pattern, rule):
    with pytest.raises(InputError, match=rule):
        frames_of([tmp_path / pattern])


RESULTS = {
    "out": ["out/s.0001.exr", "out/s.0002.exr"],
    "out/%04d.png": ["out/0001.png", "out/0002.png"],
    "out/x%d.exr": ["out/x1.exr", "out/x2.exr"],
}


@pytest.mark.parametrize("output", RESULTS)
def test_results_have_the_names_or_the_numbers_of_the_frames(output):
    frames = [Path("in/s.0001.exr"), Path("in/s.0002.exr")]
    assert list(map(str, outputs_of(frames, Path(output)))) == RESULTS[output]
    assert outputs_of(frames[:1], Path("one.png")) == [Path("one.png")]


REFUSED = {
    "one.png": (["a1.exr", "a2.exr"], "2 frames need a folder, or a pattern"),
    "o": (["x/a1.exr", "y/a1.exr"], "both x/a1.exr and y/a1.exr"),
    "o/%d.exr": (["x/a1.exr", "y/b1.exr"], "both x/a1.exr and y/b1.exr"),
    "p/%d.exr": (["a.exr"], "its name has no number"),
    "x": (["x/a1.exr", "x/a2.exr"], "is one of the input frames"),
}


@pytest.mark.parametrize("output", REFUSED)
def test_results_that_meet_each_other_or_a_frame_are_refused(tmp_path, monkeypatch, output):
    monkeypatch.chdir(tmp_path)
    frames, rule = REFUSED[output]
    for name in frames:
        Path(name).parent.mkdir(exist_ok=True)
        Path(name).touch()
    with pytest.raises(InputError, match=re.escape(rule)):
        outputs_of([Path(name) for name in frames], Path(output))


# ---- overlap -------------------------------------------------------------------------------------------


def test_work_is_in_order_in_this_thread_and_failures_are_left_out():
    threads, written, done = set(), [], []

    def fails(stage, item):
        if item in stage:
            raise InputError(f"item {item}", item, "it fails", "do nothing")
        return item

    def work(item):
        threads.add(threading.current_thread())
        return fails({4}, item)

    failed = overlapped(
        range(9),
        lambda item: fails({0, 1}, item) if item != 1 else Path("/dev/null/frame").stat(),
        work,
        lambda item, result: written.append(fails({7, 8}, item)) if item == result else None,
        done.append,
    )
    assert written == [2, 3, 5, 6]
    assert sorted(item for item, _ in failed) == [0, 1, 4, 7, 8]
    assert all(isinstance(error, WamnetError) for item, error in failed if item != 1)
    assert "/dev/null/frame" in str(dict(failed)[1]), "what the system refuses fails too"
    assert done == [1] * 9
    assert threads == {threading.current_thread()}


@pytest.mark.parametrize("error", [KeyboardInterrupt, ZeroDivisionError])
def test_an_interruption_and_a_bug_end_it(error):
    worked = []

    def work(item):
        worked.append(item)
        if item == 2:
            raise error

    with pytest.raises(error):
        overlapped(range(1000), lambda item: item, work, lambda *_: None, lambda _: None)
    assert worked == [0, 1, 2]


# ---- the command ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("executor", ["numpy", "c"])
@pytest.mark.parametrize("output", ["out", "out/d.%04d.png"])
def test_a_sequence_is_what_its_frames_are_one_by_one(wamnet, here, executor, output, executor_named):
    executor_named(executor)
    how = ["--executor", executor]
    outcome = wamnet("denoise", "m.safetensors", "shot/a.%04d.exr", *how, "-o", output)
    assert outcome.status == 0
    assert re.search(rf"{re.escape(output)}: 5 frames in .* frames per second; {executor} \(", outcome.out)
    for number in range(8, 13):
        suffix = Path(output).suffix or ".exr"
        assert (
            wamnet("denoise", "m.safetensors", f"shot/a.{number:04d}.exr", *how, "-o", f"one{suffix}").status
            == 0
        )
        path = here / (f"out/a.{number:04d}.exr" if suffix == ".exr" else f"out/d.{number:04d}.png")
        read = images.read_png if suffix == ".png" else lambda path: exr.read_frame(path)["color"]
        assert np.array_equal(read(path), read(here / f"one{suffix}"))


def test_a_frame_that_fails_is_reported_and_the_others_go_on(wamnet, here):
    bad = here / "shot/a.0009.exr"
    bad.write_bytes(bad.read_bytes()[:700])
    outcome = wamnet("denoise", "m.safetensors", "shot/a.*.exr", "shot/a.0099.exr", "-o", "out")
    assert outcome.status == 2
    assert "out: 4 frames in" in outcome.out
    lines = outcome.err.splitlines()
    assert len(lines) == 3
    assert "shot/a.0009.exr" in lines[0]
    assert "shot/a.0099.exr': not found" in lines[1]
    assert "number of frames that failed '2 of 6" in lines[2]
    assert sorted(path.name for path in (here / "out").iterdir()) == [
        f"a.{n:04d}.exr" for n in (8, 10, 11, 12)
    ]


@pytest.mark.parametrize("output", ["out", "out/%04d.png"])
def test_only_what_is_missing_or_changed_is_made(wamnet, here, output):
    command = ("denoise", "m.safetensors", "shot/a.*.exr", "-o", output)
    assert wamnet(*command).status == 0
    before = {path: path.stat().st_mtime_ns for path in (here / "out").iterdir()}
    assert "out: 0 frames" in wamnet(*command).out.replace(output, "out")
    assert {path: path.stat().st_mtime_ns for path in (here / "out").iterdir()} == before
    missing, damaged, *_ = sorted(before)
    missing.unlink()
    damaged.write_bytes(damaged.read_bytes()[:-50])
    os.utime(here / "shot/a.0011.exr", (1, 1))
    outcome = wamnet(*command)
    assert re.search(": 3 frames in .*; 2 were there already;", outcome.out)
    assert not any(path.name.startswith(".") for path in (here / "out").iterdir())
    assert "5 frames in" in wamnet(*command, "--profile", "native").out, "another profile is another result"


def test_an_interrupted_sequence_says_how_to_go_on(wamnet, here, monkeypatch):
    write, count = denoise.Job.write, []

    def interrupted(job, output, *rest):
        count.append(output)
        if len(count) == 2:
            raise KeyboardInterrupt
        write(job, output, *rest)

    monkeypatch.setattr(denoise.Job, "write", interrupted)
    outcome = wamnet("denoise", "m.safetensors", "shot/a.*.exr", "-o", "out")
    assert outcome.status == 130
    assert "out: the same command resumes" in outcome.err
    monkeypatch.setattr(denoise.Job, "write", write)
    assert re.search(
        r": [1-4] frames? in .*; [1-4] were there already",
        wamnet("denoise", "m.safetensors", "shot/a.*.exr", "-o", "out").out,
    )


def test_no_more_is_in_memory_than_is_said():
    lock, alive, most = threading.Lock(), 0, 0

    def count(step):
        nonlocal alive, most
        with lock:
            alive += step
            most = max(most, alive)

    overlapped(range(40), lambda _: count(1), lambda _: None, lambda *_: count(-1), lambda _: None)
    assert alive == 0
    assert most <= 2 * sequence.AHEAD + 2, "read ahead, worked on, waiting and being written"


def test_what_is_said_of_several_frames_is_said_once(wamnet, here):
    for path in sorted((here / "shot").iterdir()):
        frame = exr.read_frame(path)
        frame.info.pop("scene")
        color = frame["color"].copy()
        color[0, 0] = np.inf
        openexr = exr.need("OpenEXR", "to write")
        channels = {c: np.ascontiguousarray(color[:, :, i]) for i, c in enumerate("RGB")}
        channels |= {
            f"normal.{c}": np.ascontiguousarray(frame["normal"][:, :, i]) for i, c in enumerate("XYZ")
        }
        openexr.File({"type": openexr.scanlineimage}, channels).write(str(path))
    out = wamnet("denoise", "m.safetensors", "shot/a.*.exr", "-o", "out").out
    assert "shot/a.0008.exr and 4 more: 1 pixels of color are not finite" in out
    assert out.count("another program's frame") == 1


def test_frames_of_a_sequence_may_have_several_sizes(wamnet, here):
    frame = exr.read_frame(here / "shot/a.0009.exr")
    exr.write_frame(
        here / "shot/a.0009.exr", type(frame)({n: v[:7, :5] for n, v in frame.layers.items()}, frame.info)
    )
    assert wamnet("denoise", "m.safetensors", "shot/a.*.exr", "-o", "out").status == 0
    assert exr.read_frame(here / "out/a.0009.exr")["color"].shape == (7, 5, 3)
    assert exr.read_frame(here / "out/a.0010.exr")["color"].shape == (12, 13, 3)
