"""Tests of what is said before large work: when, how much, in which words; small work says nothing."""

import json
from dataclasses import replace

import pytest

from wamnet.cli.common import effort
from wamnet.kernels.run import before, render_frame
from wamnet.refimpl.light.scene import Box, to_json
from wamnet.refimpl.light.scenes import canonical


class StoppedError(Exception):
    """Ends a command where its work would begin."""


@pytest.fixture
def started(wamnet, capsys, monkeypatch):
    """Give a function that runs a command up to its work, and returns what it has said until then."""

    def stop(*_args, **_options):
        raise StoppedError("the work begins")

    def run(*arguments):
        with pytest.raises(StoppedError, match="the work begins"):
            wamnet(*arguments)
        return capsys.readouterr().out

    monkeypatch.setattr(render_frame, "render_frame", stop)
    monkeypatch.setattr(before, "carry_out", stop)
    monkeypatch.setattr("wamnet.compiler.scenes.lower_scene.lower_scene", stop)
    return run


def test_many_samples_are_said_before_they_start(started):
    """27 cubes, a room and two lights, times 3e9 samples of a pixel."""
    small = ("render", "minicubes", "--width", 1, "--height", 1, "--workers", 1)
    assert started(*small, "--spp", 999_999_999) == ""
    line = started(*small, "--spp", 3_000_000_000)
    assert line == (
        "30 primitives and 3,000,000,000 samples: by a rule of thumb about 156 days and 1 MiB of memory; "
        "Ctrl-C stops it\n"
    )
    assert "3,000,000,001 samples" in started(*small, "--feature-spp", 3_000_000_000)


def test_data_sets_say_it_too(started):
    line = started("dataset", "minicubes", "--frames", 1, "--test", 0, "--spp", 10**6, "--workers", 1)
    assert line.startswith("30 primitives and 4,096,004,096 samples: by a rule of thumb about ")


def test_many_primitives_are_said_before_they_start(started, monkeypatch):
    monkeypatch.setattr(effort, "MANY_PRIMITIVES", 30)
    assert started("render", "minicubes").startswith("30 primitives and 65,536 samples: by a rule of thumb")
    line = started("compile", "minicubes", "--target", "opencl")
    assert line.startswith("30 primitives: by a rule of thumb")


def test_many_boxes_are_grouped_in_one_look():
    """Each box was compared with all others, which took a hundred thousand of them an hour."""
    looks = []

    class Rotation(tuple):
        def __hash__(self):
            looks.append(self)
            return super().__hash__()

    scene = canonical("minicubes", time=1.0)
    boxes = tuple(replace(box, rotation=Rotation(box.rotation)) for box in scene.boxes * 10)
    Box.parts(replace(scene, boxes=boxes))
    assert len(looks) == len(boxes)


@pytest.mark.parametrize(
    ("seconds", "text"),
    [(0.1, "1 s"), (119, "119 s"), (120, "2 minutes"), (1e5, "28 hours"), (1e9, "32 years")],
)
def test_durations_have_units_that_people_think_in(seconds, text):
    assert effort.duration(seconds) == text


@pytest.mark.nightly
def test_a_file_of_a_hundred_thousand_boxes_is_read_and_said(started, tmp_path):
    """It was refused by the reader: 103 values too many."""
    data = json.loads(to_json(canonical("minicubes", time=1.0)))
    data["boxes"] = (data["boxes"] * 4000)[:100_000]
    (tmp_path / "many.json").write_text(json.dumps(data))
    line = started("render", tmp_path / "many.json", "--width", 4, "--height", 4)
    assert line.startswith("100,003 primitives and 16 samples: by a rule of thumb about ")
