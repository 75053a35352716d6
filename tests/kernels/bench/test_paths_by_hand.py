"""Path tracers by hand, with Embree and with Numba, show the pictures of our kernels, by Welch's test."""

from __future__ import annotations

import sys

import numpy as np
import pytest
from statistical import SIGNIFICANCE, assert_all_plausible, sidak, welch_p

from wamnet.compiler.scenes.lower_scene import lower_scene
from wamnet.compiler.scenes.path_kernel import compile_path
from wamnet.kernels.bench.crowd import crowd
from wamnet.kernels.devices.kernel import Part
from wamnet.refimpl.errors import ExecutorUnavailable, InputError
from wamnet.refimpl.light import scenes
from wamnet.refimpl.light.scene import Box, Camera, Light, Quad, Scene, Sphere
from wamnet.refimpl.light.transport import Settings
from wamnet.refimpl.light.variation import Variation, varied
from wamnet_peers import peer_embree, peer_numba

WIDTH, HEIGHT, BLOCK = 24, 16, 8
"""A picture that is not square, a packet and a half wide, and its blocks."""

BATCHES, SPP = 24, 64
"""Independent pictures of each side, and their samples."""

SCENES = {
    "minicubes": varied(scenes.minicubes(time=1.3), Variation(yaw_deg=20.0)),
    "cornell": scenes.cornell(),
    "mixture": crowd("mixture", 30),
    "without a room": Scene(
        "without a room",
        Camera((1.0, 2.0, 5.0), (0.0, 0.0, 0.0)),
        boxes=(Box((-1.0, 0.0, 0.0), (0.4, 0.5, 0.3), (0.5, 0.6, 0.7), emission=(0.1, 0.2, 0.1)),),
        spheres=(Sphere((0.5, 0.0, 0.3), 0.6, (0.8, 0.3, 0.3), emission=(0.2, 0.1, 0.0)),),
        quads=(Quad((-3.0, -1.0, -3.0), (6.0, 0.0, 0.0), (0.0, 0.0, 6.0), (0.5, 0.5, 0.5)),),
        lights=(
            Light((-1.0, 3.0, -1.0), (2.0, 0.0, 0.0), (0.0, 0.0, 2.0), (1.0, 0.9, 0.8), 20.0),
            Light((2.0, 0.0, -1.0), (0.0, 0.0, 1.0), (0.0, 1.0, 0.0), (0.2, 0.9, 0.8), 5.0),
        ),
        background=(0.3, 0.4, 0.5),
    ),
}
"""Cameras within a room, outside of one, and without; all kinds of primitives."""


BY_HAND = {"embree": peer_embree.Embree, "numba": peer_numba.Numba}
"""Both programs."""

pytestmark = [pytest.mark.nightly, pytest.mark.apart]

EACH = pytest.mark.parametrize("kind", BY_HAND)
"""Test both."""


def opened(kind, scene, settings=None):
    try:
        return BY_HAND[kind](scene, WIDTH, HEIGHT, settings)
    except ExecutorUnavailable as error:
        pytest.skip(f"MISSING: {error}")


def numbers(images):
    """Return, for images (B, H, W, 3), colours of blocks and of the whole (B, N)."""
    b = images.astype(np.float64).reshape(BATCHES, HEIGHT // BLOCK, BLOCK, WIDTH // BLOCK, BLOCK, 3)
    blocks = b.mean(axis=(2, 4)).reshape(BATCHES, -1)
    return np.concatenate([blocks, images.mean(axis=(1, 2, 3))[:, np.newaxis]], axis=1)


def p_values(executor, kind, scene, settings):
    """Return Welch's p-values for equal means of our kernel's numbers and the program's."""
    kernel = compile_path(
        lower_scene(SCENES[scene], Settings()), executor.name, lanes=executor.lanes, groups=("color",)
    )
    parts = [Part(WIDTH, HEIGHT, 0, HEIGHT, SPP * k, SPP, 7) for k in range(BATCHES)]
    ours = numbers(np.stack([np.moveaxis(executor.trace(kernel, part), 0, -1) for part in parts]) / SPP)
    peer = opened(kind, SCENES[scene], settings)
    theirs = numbers(np.stack([peer.render(SPP, seed) for seed in range(BATCHES)]))
    means = [(x.mean(axis=0), x.var(axis=0, ddof=1), BATCHES) for x in (ours, theirs)]
    return welch_p(*means[0], *means[1])


@EACH
@pytest.mark.parametrize("name", SCENES)
def test_they_show_the_same_picture(executor_named, kind, name):
    p = p_values(executor_named("opencl"), kind, name, Settings())
    assert_all_plausible(p, sidak(SIGNIFICANCE, len(SCENES) * len(BY_HAND)))


@EACH
def test_one_scattering_less_is_caught(executor_named, kind):
    p = p_values(executor_named("opencl"), kind, "cornell", Settings(max_depth=4))
    with pytest.raises(AssertionError, match="least p-value"):
        assert_all_plausible(p, sidak(SIGNIFICANCE, len(SCENES) * len(BY_HAND)))


@EACH
def test_seeds_give_pictures_of_their_own_and_again_the_same(kind):
    peer = opened(kind, SCENES["cornell"])
    first, again, other = (peer.render(2, seed) for seed in (1, 1, 2))
    assert np.array_equal(first, again)
    assert not np.array_equal(first, other)


def test_a_program_that_has_ended_is_reported():
    peer = opened("embree", SCENES["cornell"])
    peer._process.kill()
    peer._process.wait()
    with pytest.raises(ExecutorUnavailable, match="embree: its program has ended"):
        peer.render(1, 0)


@EACH
@pytest.mark.parametrize(
    ("name", "message"), [("glossy", "only matte surfaces are given"), ("daylight", "no sky is given")]
)
def test_what_they_would_show_differently_is_refused(kind, name, message):
    with pytest.raises(InputError, match=message):
        BY_HAND[kind](getattr(scenes, name)(), WIDTH, HEIGHT)


def test_without_numba_it_says_so(monkeypatch):
    monkeypatch.setitem(sys.modules, "numba", None)
    with pytest.raises(ExecutorUnavailable, match="numba: the package is not installed"):
        BY_HAND["numba"](SCENES["cornell"], WIDTH, HEIGHT)


@pytest.mark.nightly
@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("SOURCE", peer_embree.SOURCE.with_name("nothing.c"), "its program does not compile .*libembree-dev"),
        ("LINKED", ("-lno_such_library",), "its program does not compile"),
    ],
)
def test_what_is_missing_is_said(monkeypatch, name, value, message):
    monkeypatch.setattr(peer_embree, name, value)
    with pytest.raises(ExecutorUnavailable, match=message):
        peer_embree.Embree(SCENES["cornell"], WIDTH, HEIGHT)
