"""Peers of whole pictures show the moments that they are given: what is kept between pictures is right.

Mitsuba's LLVM variant and Blender are skipped where they are missing; the text is that of the benchmark.
"""

from __future__ import annotations

import sys
from dataclasses import replace

import numpy as np
import pytest
from packages import needed
from statistical import assert_all_plausible, welch_p

from wamnet.kernels.bench import paths, pipelines
from wamnet.kernels.bench.workload import noise
from wamnet.kernels.run.render_on import render_on
from wamnet.refimpl.errors import ExecutorUnavailable, InputError
from wamnet.refimpl.light import scenes
from wamnet.refimpl.light.render import Job
from wamnet.refimpl.light.scene import Quad
from wamnet.refimpl.light.transport import Settings
from wamnet_peers import moving, peer_cycles, table
from wamnet_peers.peer_oidn import Kept, filtered

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


QUAD = Quad((-1.0, -1.0, 1.9), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.2, 0.9, 0.2))

CHANGED = {
    "boxes": LATER,
    "lights": replace(FIRST, lights=(replace(FIRST.lights[0], power=9.0), FIRST.lights[1])),
    "quads": replace(FIRST, quads=(QUAD,)),
    "camera": replace(FIRST, camera=replace(FIRST.camera, vertical_fov_deg=30.0)),
}
"""What may differ from picture to picture: numbers that are replaced, and what is loaded again."""


@pytest.mark.parametrize("what", CHANGED)
def test_mitsuba_continues_as_if_opened_there(opened, what) -> None:
    """The same seed sends the same camera rays: first hits are the same to the bit, kept or loaded."""
    needed("pyoidn")
    kept, new = (opened(moving.MitsubaOidn, scene, spp=SPP) for scene in (FIRST, CHANGED[what]))
    kept.render(1)
    kept.show(CHANGED[what])
    found, wanted = kept.render(2), new.render(2)
    assert found.layers.keys() == {"color", "albedo", "normal"}
    for name in ("albedo", "normal"):
        assert np.array_equal(found[name], wanted[name]), name
    # Lights may be in another order, and random numbers then choose others: colours agree on the whole only.
    # A path spreads by about twice its mean, so the mean of 24 x 24 x 64 by a hundredth of itself.
    assert 0.7 <= float(found["color"].mean() / wanted["color"].mean()) <= 1.4


def test_cycles_shows_the_moment(opened, executor_named) -> None:
    """Its edges, bounces, sides of walls and lights, and units are ours."""
    peer = opened(peer_cycles.Cycles, FIRST, spp=SPP)
    assert_as_bright([peer.picture(LATER, seed) for seed in range(TURNS)], executor_named("opencl"), LATER)


def test_cycles_is_measured_by_itself(opened) -> None:
    peer = opened(peer_cycles.Cycles, FIRST)
    ways = peer.ways([FIRST, LATER])
    assert all(way() > 0.0 for way in ways.values())
    assert len(ways) == 1 + len(moving.DENOISED)


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


@pytest.mark.parametrize("quality", moving.DENOISED)
def test_a_kept_filter_is_the_filter(quality) -> None:
    """Also for a second picture, to the bit."""
    needed("pyoidn")
    kept, frames = Kept((SIZE, SIZE), quality), [noise(SIZE, seed) for seed in (1, 2)]
    for frame in frames:
        assert np.array_equal(kept(frame), filtered(frame, frame, quality=quality))
    kept.close()


@pytest.mark.nightly
def test_every_peer_can_be_named() -> None:
    assert set(pipelines.PEERS) == set(table.makers)
    assert set(paths.PEERS) == set(table.renderers)
