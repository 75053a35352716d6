"""Peers of whole pictures show the moments that they are given: what is kept between pictures is right.

Mitsuba's LLVM variant and Blender are skipped where they are missing; the text is that of the benchmark.
"""

import sys
from contextlib import ExitStack
from pathlib import Path

import numpy as np
import pytest
from packages import needed
from statistical import assert_all_plausible, welch_p

from wamnet.cli.common.inputs import load_model
from wamnet.kernels import open_executor
from wamnet.kernels.run.render_on import render_on
from wamnet.refimpl.errors import ExecutorUnavailable, InputError
from wamnet.refimpl.light import scenes
from wamnet.refimpl.light.render import Job
from wamnet.refimpl.light.transport import Settings
from wamnet_peers import moving, peer_cycles, pipelines

pytestmark = [pytest.mark.nightly, pytest.mark.apart, pytest.mark.needs("packages")]

SIZE, SPP, TURNS = 24, 64, 8
"""Width of the pictures, samples per pixel, and pictures whose spread is the error of their mean."""

FIRST, LATER = (scenes.minicubes(time=time) for time in (0.05, 1.25))
"""Two moments, whose boxes are turned apart by half a right angle."""


@pytest.fixture
def opened():
    """Give a function that opens a peer, or skips; what was opened is closed."""
    made = []

    def open_one(kind, scene, **options):
        try:
            made.append(kind(scene, SIZE, **options))
        except ExecutorUnavailable as error:
            pytest.skip(str(error))
        return made[-1]

    yield open_one
    for peer in made:
        peer.close()


def means(pictures):
    """Return the mean colours (N, 3) of pictures."""
    return np.stack([np.mean(picture, axis=(0, 1), dtype=np.float64) for picture in pictures])


def assert_as_bright(theirs, executor, scene):
    """Mean colours of independent pictures agree with ours by Welch's test, channel by channel."""
    ours = means(
        render_on(executor, scene, Job(SIZE, SIZE, SPP, seed)).frame["color"] for seed in range(TURNS)
    )
    numbers = [(x.mean(axis=0), x.var(axis=0, ddof=1), TURNS) for x in (means(theirs), ours)]
    assert_all_plausible(welch_p(*numbers[0], *numbers[1]))


def test_mitsuba_shows_the_moment(opened, executor_named) -> None:
    needed("pyoidn")
    peer = opened(moving.MitsubaOidn, FIRST, spp=SPP)
    peer.show(LATER)
    assert_as_bright([peer.render(seed)["color"] for seed in range(TURNS)], executor_named("opencl"), LATER)


def test_cycles_shows_the_moment(opened, executor_named) -> None:
    """Its edges, bounces, sides of walls and lights, and units are ours."""
    peer = opened(peer_cycles.Cycles, FIRST, spp=SPP)
    assert_as_bright([peer.picture(LATER, seed) for seed in range(TURNS)], executor_named("opencl"), LATER)


def test_missing_blender_is_told(monkeypatch) -> None:
    monkeypatch.setattr(peer_cycles, "find_spec", lambda name: None)
    with pytest.raises(ExecutorUnavailable, match="cycles: the package bpy is not installed; pip install"):
        peer_cycles.Cycles(FIRST, SIZE)


def test_a_process_that_ends_is_told(monkeypatch) -> None:
    monkeypatch.setattr(peer_cycles, "find_spec", lambda name: object())
    monkeypatch.setattr(sys, "executable", "/bin/false")
    with pytest.raises(ExecutorUnavailable, match="Blender's process has ended; try import bpy by itself"):
        peer_cycles.Cycles(FIRST, SIZE)


@pytest.mark.parametrize("scene", [scenes.furnace(), scenes.glossy(), scenes.daylight()])
def test_what_cycles_would_show_differently_is_refused(scene) -> None:
    with pytest.raises(InputError, match=f"scene.* '{scene.name}': (only matte|no sky)"):
        peer_cycles.check(scene, Settings())


def test_a_bundled_model_gets_the_layers_that_it_reads() -> None:
    """Features that a renderer writes on request, where the benchmark renders and denoises apart."""
    with ExitStack() as stack:
        executor = stack.enter_context(open_executor("numpy"))
        ways = pipelines.Ours(executor, load_model(Path("minicubes")), "minicubes", 8, 4).ways(stack)
        ways["separate"]()
    assert pipelines.MOVING in ways
