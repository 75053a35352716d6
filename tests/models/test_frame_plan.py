"""Tests of the plan of a data set: times between times, seeds of their own, bands that cover, refusals."""

import pickle
from dataclasses import replace
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from wamnet.kernels.run.before import carry_out
from wamnet.models.data import frame_plan
from wamnet.models.data.frame_plan import Request, frame_draws, join, plan
from wamnet.refimpl.errors import InputError
from wamnet.refimpl.light.render import render
from wamnet.refimpl.light.scenes import canonical
from wamnet.refimpl.light.variation import ranges_from_json

TINY = Request("minicubes", frames=2, test_frames=1, size_px=6, spp=2)


@given(st.integers(1, 40), st.integers(0, 30), st.sampled_from([0.0, -3.7, 1e6]), st.sampled_from([0.1, 8.0]))
def test_no_time_is_another(frames, tests, start, seconds) -> None:
    """All times differ and lie in the animation without its arc; tests continue the training's sequence."""
    request = Request(
        "minicubes", start_s=start, seconds=seconds, frames=frames, test_frames=tests, arc_s=seconds / 4
    )
    draws = frame_draws(request)
    assert [split for split, _ in draws] == ["train"] * frames + ["test"] * tests
    moments = [draw.time_s for _, draw in draws]
    assert len(set(moments)) == frames + tests
    low, high = request.ranges.time_s
    assert (low, high) == (start, start + seconds - seconds / 4)
    assert all(low <= moment < high for moment in moments)
    only = replace(request, frames=frames + tests, test_frames=0)
    assert moments == [draw.time_s for _, draw in frame_draws(only)]


def test_splits_and_draws() -> None:
    """Training, inside, outside; each frame's scene is its draw's, and says the ranges."""
    request = replace(
        TINY, outside_frames=3, arc_s=1.0, yaw_deg=(-24.0, 24.0), saturation=(0.0, 0.7), test_frames=2
    )
    frames = plan(request)
    assert [f.name for f in frames] == [
        *("train/00000", "train/00001", "test/00000", "test/00001"),
        *("outside/00000", "outside/00001", "outside/00002"),
    ]
    assert [f.draw.outside for f in frames] == ["", "", "", "", "time", "camera", "lamps"]
    facts = [frame.describe() for frame in frames]
    assert [f.get("outside", "") for f in facts] == [f.draw.outside for f in frames]
    assert facts[5]["yaw_deg"] == -34.0
    assert len(facts[0]["lights"]) == 2
    scene = frames[5].pictures["noisy"].scene
    assert scene.info["yaw_deg"] == "-34.0"
    assert ranges_from_json(scene.info["ranges"]) == request.ranges
    assert request.ranges.time_s == (0.0, 7.0)
    found = frame_plan.compared(frames)
    assert list(found) == ["test", "outside"]


def test_frames_that_are_alike_are_refused() -> None:
    """A scene that does not move has no unseen frames, unless its camera does."""
    still = replace(TINY, scene="daylight")
    with pytest.raises(InputError, match="test frame 'test/00000"):
        frame_plan.compared(plan(still))
    assert frame_plan.compared(plan(replace(still, test_frames=0))) == {}
    assert set(frame_plan.compared(plan(replace(still, yaw_deg=(-20.0, 20.0))))) == {"test"}


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
    scene = canonical("minicubes", time=frames[-1].draw.time_s)
    assert replace(pictures[-1].scene, info={}) == replace(scene, info={})
    facts = frames[0].describe()
    assert (facts["split"], facts["yaw_deg"], facts["noisy"]["spp"]) == ("train", 0.0, 1)


def test_rays_of_features_and_samples_of_tests() -> None:
    """Only noisy pictures have rays for features; test targets have samples of their own number."""
    request = replace(TINY, feature_spp=16, test_spp=5)
    jobs = [{kind: p.job for kind, p in frame.pictures.items()} for frame in plan(request)]
    assert [job["noisy"].feature_spp for job in jobs] == [16, 16, 16]
    assert [job["target"].feature_spp for job in jobs] == [0, 0, 0]
    assert [job["target"].spp for job in jobs] == [2, 2, 5]
    noisy = plan(request)[0].describe()["noisy"]
    assert (noisy["spp"], noisy["feature_spp"]) == (1, 16)
    assert noisy["feature_sampler"] == request.as_data()["feature_sampler"] == "net"
    assert not {"feature_spp", "feature_sampler"} & {*plan(TINY)[0].describe()["noisy"]}
    older = replace(request, feature_sampler="pcg4d")
    assert "feature_sampler" not in {**older.as_data(), **plan(older)[0].describe()["noisy"]}
    assert {"feature_spp": 16, "test_spp": 5}.items() <= request.as_data().items()
    task = plan(request)[0].pictures["noisy"].tasks()[0]
    assert task.samples == 6 * 6 * (1 + 16)
    assert carry_out(task).info["feature_spp"] == "16"


def test_small_pictures_are_one_task_and_large_ones_many() -> None:
    """Bands have at least a tile of pixels; together they are all rows."""
    small, large = plan(TINY)[0].pictures["target"], plan(replace(TINY, size_px=1024, spp=1024))[0].pictures
    assert [task.rows for task in small.tasks()] == [(0, 6)]
    rows = [task.rows for task in large["target"].tasks()]
    assert len(rows) == 128
    assert rows[0][0] == 0
    assert rows[-1][1] == 1024
    assert all(a[1] == b[0] for a, b in pairwise(rows))
    assert sum(task.samples for task in large["target"].tasks()) == 1 << 30
    assert len(large["noisy"].tasks()) == 1


def test_joined_bands_are_the_reference(monkeypatch) -> None:
    """A task travels as a pickle; the joined frame has the reference's bits and facts."""
    monkeypatch.setattr(frame_plan, "TASK_SAMPLES", 1)
    monkeypatch.setattr(frame_plan, "TILE_PIXELS", 12)
    picture = plan(TINY)[1].pictures["target"]
    tasks = [pickle.loads(pickle.dumps(task)) for task in picture.tasks()]
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
        ({"frames": 0}, "frames 0: must be an integer from 1 to"),
        ({"test_frames": -1}, "test_frames -1: must be an integer from 0 to"),
        ({"seconds": 0.0}, r"animation \(start, seconds\) \(0.0, 0.0\): must be finite and last"),
        ({"start_s": float("nan")}, "must be finite and last"),
        ({"start_s": 1e18}, "range of time_s '1e\\+18:1e\\+18': must be LOW:HIGH within"),
        ({"start_s": 9e8, "seconds": 1e-9}, "3 different times must fit into it"),
        ({"seed": -1}, "seed -1: seeds up to that plus twice"),
        ({"seed": (1 << 32) - 5}, "seed 4294967291: seeds up to that plus twice"),
        ({"outside_frames": -1}, "outside_frames -1"),
        ({"outside_frames": 1}, "number of frames outside 1"),
        ({"arc_s": 8.0}, "arc_s 8.0: training leaves it out of the animation"),
        ({"yaw_deg": (10.0, -10.0)}, "range of yaw_deg '10.0:-10.0"),
        ({"scene": "nowhere"}, "scene 'nowhere': unknown"),
        ({"parameters": {"time": 1.0}}, r"parameter time 1.0: each frame has its own \(use --start"),
        ({"before": -1}, "before -1: must be from 0 to 256 frames"),
        ({"size_px": 0}, "width 0"),
        ({"spp": 0}, "spp 0"),
    ],
)
def test_refusals(change, text) -> None:
    """Before anything is rendered."""
    with pytest.raises(InputError, match=text):
        plan(replace(TINY, **change))


def test_an_unknown_executor_is_rejected() -> None:
    """Where a task is carried out: plans know no executors."""
    (task,) = plan(replace(TINY, executor="abacus"))[0].pictures["noisy"].tasks()
    with pytest.raises(InputError, match=r"executor that renders 'abacus': unknown \(choose one of numpy"):
        carry_out(task)


def test_a_worker_of_another_version_refuses() -> None:
    """Its error keeps its parts on the way through a pickle."""
    (task,) = plan(TINY)[0].pictures["noisy"].tasks()
    text = "version of wamnet on a worker '.*': the data set is made by 99, and every worker must have the"
    with pytest.raises(InputError, match=text) as caught:
        carry_out(replace(task, version="99"))
    copy = pickle.loads(pickle.dumps(caught.value))
    assert str(copy) == str(caught.value)
    assert copy.way_out == "install that version there"


def test_animation_times() -> None:
    """From the start to before the end; one at least; refusals."""
    assert frame_plan.animation_times(1.0, 0.5, 8.0) == [1.0, 1.125, 1.25, 1.375]
    assert frame_plan.animation_times(0.0, 0.1, 1.0) == [0.0]
    for wrong in ((0.0, -1.0, 5.0), (0.0, 1.0, 0.0), (float("inf"), 1.0, 5.0)):
        with pytest.raises(InputError, match=r"must be finite and last \(change it"):
            frame_plan.animation_times(*wrong)
    with pytest.raises(InputError, match="number of frames 1000000: an animation has 100000 at most"):
        frame_plan.animation_times(0.0, 1000.0, 1000.0)
