"""Tests of the plan of a data set: times between times, seeds of their own, bands that cover, refusals."""

from __future__ import annotations

import pickle
from dataclasses import replace
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from wamnet.kernels import frame_plan
from wamnet.kernels.frame_plan import Request, carry_out, frame_times, join, plan, tasks_of
from wamnet.refimpl.errors import InputError
from wamnet.refimpl.render import render
from wamnet.refimpl.scenes import canonical

TINY = Request("minicubes", frames=2, test_frames=1, size_px=6, spp=2)


def test_the_times_by_hand() -> None:
    """Four training times in 8 s; two tests in the middle of the first and third gap; three and six share."""
    request = Request("minicubes", frames=4, test_frames=2)
    assert frame_times(request) == [
        ("train", 0.0),
        ("train", 2.0),
        ("train", 4.0),
        ("train", 6.0),
        ("test", 1.0),
        ("test", 5.0),
    ]
    crowded = frame_times(replace(request, frames=2, test_frames=6, start_s=1.0))
    assert [time for _, time in crowded] == [1.0, 5.0, 2.0, 3.0, 4.0, 6.0, 7.0, 8.0]


@given(st.integers(1, 40), st.integers(0, 90), st.sampled_from([0.0, -3.7, 1e6]), st.sampled_from([0.1, 8.0]))
def test_no_test_time_is_a_training_time(frames, tests, start, seconds) -> None:
    """All times differ and lie in the animation; every gap has its share of tests, give or take one."""
    request = Request("minicubes", start_s=start, seconds=seconds, frames=frames, test_frames=tests)
    times = frame_times(request)
    assert len({time for _, time in times}) == frames + tests
    end = start + seconds
    assert all(start <= time < end for _, time in times)
    train = sorted(time for split, time in times if split == "train")
    counts = [0] * frames
    for split, time in times:
        if split == "test":
            counts[sum(known < time for known in train) - 1] += 1
    assert max(counts) - min(counts) <= 1


def test_pictures_have_names_and_seeds_of_their_own() -> None:
    """Training first; a target has the request's samples, a noisy picture one."""
    frames = plan(replace(TINY, seed=10))
    pictures = [picture for frame in frames for picture in frame.pictures.values()]
    names = [
        f"{s}-{kind}.exr" for s in ("train/00000", "train/00001", "test/00000") for kind in frame_plan.KINDS
    ]
    assert [picture.name for picture in pictures] == names
    assert [picture.job.seed for picture in pictures] == list(range(10, 16))
    assert [picture.job.spp for picture in pictures] == [1, 2] * 3
    assert pictures[-1].scene == canonical("minicubes", time=2.0)
    facts = frame_plan.describe(frames[0])
    assert (facts["split"], facts["time_s"], facts["noisy"]["spp"]) == ("train", 0.0, 1)


def test_rays_of_features_and_samples_of_tests() -> None:
    """Noisy pictures alone have rays for features; test targets have samples of their own number."""
    request = replace(TINY, feature_spp=16, test_spp=5)
    jobs = [{kind: p.job for kind, p in frame.pictures.items()} for frame in plan(request)]
    assert [job["noisy"].feature_spp for job in jobs] == [16, 16, 16]
    assert [job["target"].feature_spp for job in jobs] == [0, 0, 0]
    assert [job["target"].spp for job in jobs] == [2, 2, 5]
    noisy = frame_plan.describe(plan(request)[0])["noisy"]
    assert (noisy["spp"], noisy["feature_spp"]) == (1, 16)
    assert "feature_spp" not in frame_plan.describe(plan(TINY)[0])["noisy"]
    assert {"feature_spp": 16, "test_spp": 5}.items() <= request.as_data().items()
    assert not {"feature_spp", "test_spp"} & TINY.as_data().keys()  # as texts of the time before had it
    task = tasks_of(plan(request)[0].pictures["noisy"])[0]
    assert task.samples == 6 * 6 * (1 + 16)
    assert carry_out(task).info["feature_spp"] == "16"


def test_small_pictures_are_one_task_and_large_ones_many() -> None:
    """Bands have at least a tile of pixels; together they are all rows."""
    small, large = plan(TINY)[0].pictures["target"], plan(replace(TINY, size_px=1024, spp=1024))[0].pictures
    assert [task.rows for task in tasks_of(small)] == [(0, 6)]
    rows = [task.rows for task in tasks_of(large["target"])]
    assert len(rows) == 128
    assert rows[0][0] == 0
    assert rows[-1][1] == 1024
    assert all(a[1] == b[0] for a, b in pairwise(rows))
    assert sum(task.samples for task in tasks_of(large["target"])) == 1 << 30
    assert len(tasks_of(large["noisy"])) == 1


def test_joined_bands_are_the_reference(monkeypatch) -> None:
    """A task travels as a pickle; the joined frame has the reference's bits and facts."""
    monkeypatch.setattr(frame_plan, "TASK_SAMPLES", 1)
    monkeypatch.setattr(frame_plan, "TILE_PIXELS", 12)
    picture = plan(TINY)[1].pictures["target"]
    tasks = [pickle.loads(pickle.dumps(task)) for task in tasks_of(picture)]
    assert len(tasks) == 3
    counted: list[int] = []
    got = join([carry_out(task, counted.append) for task in tasks])
    want = render(picture.scene, picture.job).frame
    assert all((got[name] == values).all() for name, values in want.layers.items())
    assert got.info == want.info
    assert sum(counted) == 6 * 6 * 2


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"frames": 0}, "frames is 0: it must be an integer from 1 to"),
        ({"test_frames": -1}, "test_frames is -1: it must be an integer from 0 to"),
        ({"seconds": 0.0}, r"animation \(start, seconds\) is \(0.0, 0.0\): it must be finite and last"),
        ({"start_s": float("nan")}, "it must be finite and last"),
        ({"start_s": 1e18}, "seconds of the animation is 8.0: 3 different times must fit into it"),
        ({"seed": -1}, "seed is -1: seeds up to that plus twice"),
        ({"seed": (1 << 32) - 5}, "seed is 4294967291: seeds up to that plus twice"),
        ({"executor": "abacus"}, "executor that renders is abacus"),
        ({"scene": "nowhere"}, "scene is nowhere: no canonical scene"),
        ({"parameters": {"time": 1.0}}, "parameter time is 1.0: each frame has its own; use --start"),
        ({"size_px": 0}, "width is 0"),
        ({"spp": 0}, "spp is 0"),
    ],
)
def test_refusals(change, text) -> None:
    """Before anything is rendered."""
    with pytest.raises(InputError, match=text):
        plan(replace(TINY, **change))


def test_a_worker_of_another_version_refuses() -> None:
    """Its error keeps its parts on the way through a pickle."""
    (task,) = tasks_of(plan(TINY)[0].pictures["noisy"])
    text = "version of wamnet on a worker is .*: the data set is made by 99, and every worker must have the"
    with pytest.raises(InputError, match=text) as caught:
        carry_out(replace(task, version="99"))
    copy = pickle.loads(pickle.dumps(caught.value))
    assert str(copy) == str(caught.value)
    assert copy.way_out == "install that one there"


def test_animation_times() -> None:
    """From the start to before the end; one at least; refusals."""
    assert frame_plan.animation_times(1.0, 0.5, 8.0) == [1.0, 1.125, 1.25, 1.375]
    assert frame_plan.animation_times(0.0, 0.1, 1.0) == [0.0]
    for wrong in ((0.0, -1.0, 5.0), (0.0, 1.0, 0.0), (float("inf"), 1.0, 5.0)):
        with pytest.raises(InputError, match="it must be finite and last; change it"):
            frame_plan.animation_times(*wrong)
    with pytest.raises(InputError, match="number of pictures is 1000000: a film has 100000 at most"):
        frame_plan.animation_times(0.0, 1000.0, 1000.0)
