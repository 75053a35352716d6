"""Tests of rendering by an executor's name: the reference's bits, in bands or shared, and the refusal."""

import multiprocessing
import threading
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest

from wamnet.kernels.run import render_pool
from wamnet.kernels.run.render_frame import RENDERERS, render_frame
from wamnet.refimpl.errors import InputError
from wamnet.refimpl.light.environment import sun_of
from wamnet.refimpl.light.render import Job, join_rows, render
from wamnet.refimpl.light.scenes import canonical

SCENE = canonical("cornell")


REQUIRED = {"numpy": "numpy", "opencl": "opencl", "opengl": "opengl-egl", "c": "c"}
"""The executor whose absence skips or fails a renderer's tests, by the renderer's name."""


@pytest.mark.parametrize("name", RENDERERS)
def test_bands_are_the_frame(executor_named, name) -> None:
    """Rows rendered apart and joined are all rows, to the bit."""
    executor_named(REQUIRED[name])
    job = Job(7, 5, 2, 3, feature_spp=4)
    whole = render_frame(name, SCENE, job)
    assert whole.frame.height == 5
    parts = join_rows([render_frame(name, SCENE, job, rows=rows) for rows in ((0, 2), (2, 5))])
    assert all((parts.frame[layer] == values).all() for layer, values in whole.frame.layers.items())


@pytest.mark.nightly(but="numpy")
@pytest.mark.parametrize("name", ["numpy", "opencl"])
def test_a_frame_says_where_the_sun_is(executor_named, name) -> None:
    """ENV-6: in bands too, and beside features of their own rays; the scene of above has no sun."""
    executor_named(REQUIRED[name])
    scene, job = canonical("daylight", time=1.0), Job(7, 5, feature_spp=2, seen=True)
    parts = join_rows([render_frame(name, scene, job, rows=rows) for rows in ((0, 2), (2, 5))])
    assert parts.frame["sun"].shape == (5, 7, 3)
    assert np.allclose(parts.frame["sun"], sun_of(scene), rtol=0, atol=2.0**-24)
    assert set(parts.frame.layers) == {*job.layers, "sun"}
    assert "sun" not in render_frame(name, SCENE, job).frame


@pytest.mark.parametrize("name", ["opencl", "opengl"])
def test_kernels_take_more_rays_for_features(executor_named, name) -> None:
    """The colour's bits are those of a job without; the features are those of as many samples."""
    executor_named(REQUIRED[name])
    job, counted = Job(7, 5, 1, 3), []
    found = render_frame(name, SCENE, replace(job, feature_spp=6), on_progress=counted.append).frame
    plain = render_frame(name, SCENE, job).frame
    assert (found["color"] == plain["color"]).all()
    assert sum(counted) == 7 * 5 * (1 + 6)
    want = render_frame("numpy", SCENE, replace(job, feature_spp=6)).frame
    for layer in ("albedo", "normal", "position"):
        # As above: at most one ray of 210 may pass an edge by less than rounding, and moves one pixel.
        near = np.abs(found[layer] - want[layer]) <= 1e-5 * (1 + np.abs(want[layer]))
        assert near.all(axis=-1).mean() >= 0.97
    assert not np.array_equal(found["position"], plain["position"])


@pytest.mark.parametrize("name", RENDERERS)
def test_rows_outside_the_picture_are_refused(executor_named, name) -> None:
    """By all of them in the same words."""
    executor_named(REQUIRED[name])
    with pytest.raises(InputError, match=r"rows \(2, 9\): must be a range within 0 to 5"):
        render_frame(name, SCENE, Job(7, 5), rows=(2, 9))


def test_threads_have_devices_of_their_own(executor_named) -> None:
    """A graphics context belongs to one thread; a worker of a cluster renders in a thread of its own."""
    executor_named("opengl-egl")
    job = Job(5, 4, 1, 3)
    with ThreadPoolExecutor(1) as pool:
        other = pool.submit(render_frame, "opengl", SCENE, job).result()
    assert (other.frame["color"] == render_frame("opengl", SCENE, job).frame["color"]).all()


def test_numpy_is_the_reference() -> None:
    """Also with workers, and the samples are counted."""
    job, counted = Job(6, 4, 2, feature_spp=3), []
    want = render(SCENE, job).frame["color"]
    for workers in (1, 2, None):
        got = render_frame("numpy", SCENE, job, workers=workers, on_progress=counted.append)
        assert (got.frame["color"] == want).all()
    assert sum(counted) == 3 * 6 * 4 * (2 + 3)


def test_an_unknown_executor_is_refused() -> None:
    """The names are listed."""
    text = r"executor that renders 'abacus': unknown \(choose one of numpy"
    with pytest.raises(InputError, match=text):
        render_frame("abacus", SCENE, Job(2, 2))


# ---- the pool of processes -------------------------------------------------------------------------------


def test_an_interrupt_leaves_neither_threads_nor_processes(monkeypatch) -> None:
    """A thread of the pool that closes its pipes while the interpreter ends is a traceback after the end."""

    def interrupt(*_arguments: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(render_pool, "_watch", interrupt)
    threads, processes = set(threading.enumerate()), set(multiprocessing.active_children())
    with pytest.raises(KeyboardInterrupt):
        render_pool.render_parallel(canonical("cornell"), Job(512, 512, 4), workers=2)
    assert set(threading.enumerate()) <= threads
    assert set(multiprocessing.active_children()) <= processes
