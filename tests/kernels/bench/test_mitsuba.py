"""Mitsuba 3 shows the same pictures: another renderer, written by others, agrees by Welch's test."""

from __future__ import annotations

import sys
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from statistical import SIGNIFICANCE, assert_all_plausible, sidak, welch_p

from wamnet.compiler.scenes.lower_scene import lower_scene
from wamnet.compiler.scenes.path_kernel import compile_path
from wamnet.kernels.bench.peers import peer_mitsuba
from wamnet.kernels.devices.executor import Part
from wamnet.refimpl.errors import ExecutorUnavailable, InputError
from wamnet.refimpl.light import scenes
from wamnet.refimpl.light.scene import Box, Camera, Light, Quad, Scene, Sphere
from wamnet.refimpl.light.transport import Settings
from wamnet.refimpl.light.variation import Variation, varied

WIDTH, HEIGHT, BLOCK = 16, 12, 4
BATCHES = 32
"""Independent renders of each scene by each renderer: their spread is the error of their mean."""

pytestmark = pytest.mark.apart

SPP = 256
"""Samples per pixel of a batch."""

SPP_FROM_OUTSIDE = 8
"""The same for Mitsuba's pictures from outside a room: its scalar variant asks Python for each ray."""

EVEN = 1e-5
"""Numbers that spread less, relative to their size, show the background, where there is nothing to test but
the rounding of 256 sums (15 u = 9e-7 for random ones)."""

EVERYTHING = Scene(
    "everything",
    Camera((1.0, 2.0, 5.0), (0.0, 0.0, 0.0)),
    boxes=(Box((-1.0, 0.0, 0.0), (0.4, 0.5, 0.3), (0.5, 0.6, 0.7), emission=(0.1, 0.2, 0.1)),),
    spheres=(Sphere((0.5, 0.0, 0.3), 0.6, (0.8, 0.3, 0.3), emission=(0.2, 0.1, 0.0)),),
    quads=(
        Quad((-3.0, -1.0, -3.0), (6.0, 0.0, 0.0), (0.0, 0.0, 6.0), (0.5, 0.5, 0.5)),
        Quad((-2.0, -1.0, -1.0), (1.0, 0.0, 0.0), (0.0, 2.0, 0.0), (0.5, 0.5, 0.5), (0.5, 0.6, 0.7)),
    ),
    lights=(Light((-1.0, 3.0, -1.0), (2.0, 0.0, 0.0), (0.0, 0.0, 2.0), (1.0, 0.9, 0.8), 20.0),),
    background=(0.3, 0.4, 0.5),
)
"""A scene of all kinds of primitives, emitting ones too, without a room."""


def seen_from(scene, position, look_at, fov):
    return replace(scene, camera=Camera(position, look_at, vertical_fov_deg=fov))


SCENES = {
    "minicubes": seen_from(scenes.minicubes(time=1.3), (-1.9, 1.2, 1.8), (0.2, -0.3, -0.5), 65.0),
    "cornell": seen_from(scenes.cornell(), (0.6, 1.4, 0.95), (-0.3, 0.6, -0.6), 80.0),
    "everything": EVERYTHING,
}
"""Scenes whose camera is outside no room; no symmetry hides a mirrored picture."""

FROM_OUTSIDE = {
    "minicubes outside": varied(scenes.minicubes(time=1.3), Variation(yaw_deg=20.0)),
    "cornell outside": scenes.cornell(),
}
"""Scenes that are seen through the near walls of their rooms."""


def numbers(images):
    """Return, for images (B, H, W, 3), the numbers (B, N) to compare: blocks' colours and the whole mean."""
    b = images.reshape(BATCHES, HEIGHT // BLOCK, BLOCK, WIDTH // BLOCK, BLOCK, 3).mean(axis=(2, 4))
    return np.concatenate([b.reshape(BATCHES, -1), images.mean(axis=(1, 2, 3))[:, np.newaxis]], axis=1)


def ours(executor, scene, settings):
    """Return the numbers (B, N) of our kernel."""
    programs = lower_scene(scene, settings)
    kernel = compile_path(programs, executor.name, lanes=executor.lanes, groups=("color",))
    parts = [Part(WIDTH, HEIGHT, 0, HEIGHT, SPP * k, SPP, 7) for k in range(BATCHES)]
    images = np.stack([executor.trace(kernel, part) for part in parts]).astype(np.float64) / SPP
    return numbers(np.moveaxis(images, 1, -1))


@pytest.fixture(scope="module")
def theirs(mitsuba):
    """Give a function that returns the numbers (B, N) of Mitsuba for a scene's name; each is made once."""
    known = {}

    def made(name):
        if name not in known:
            spp, scene = (SPP, SCENES[name]) if name in SCENES else (SPP_FROM_OUTSIDE, FROM_OUTSIDE[name])
            loaded = mitsuba.load_dict(peer_mitsuba.export(mitsuba, scene, WIDTH, HEIGHT, Settings()))
            images = [peer_mitsuba.render(mitsuba, loaded, spp, seed) for seed in range(BATCHES)]
            known[name] = numbers(np.stack(images).astype(np.float64))
        return known[name]

    return made


def p_values(a, b):
    """Return Welch's p-values for equal means of those numbers of a, b (B, N) that spread."""
    noisy = np.minimum(a.std(axis=0), b.std(axis=0)) > EVEN * a.mean(axis=0)
    assert noisy.sum() >= 0.8 * a.shape[1]
    a, b = a[:, noisy], b[:, noisy]
    (mean_a, var_a), (mean_b, var_b) = ((x.mean(axis=0), x.var(axis=0, ddof=1)) for x in (a, b))
    return welch_p(mean_a, var_a, BATCHES, mean_b, var_b, BATCHES)


@pytest.mark.parametrize("name", [*SCENES, *FROM_OUTSIDE])
def test_mitsuba_shows_the_same_picture(executor_named, theirs, name):
    a = ours(executor_named("opencl"), {**SCENES, **FROM_OUTSIDE}[name], Settings())
    assert_all_plausible(p_values(a, theirs(name)), sidak(SIGNIFICANCE, len(SCENES) + len(FROM_OUTSIDE)))


def redder(scene):
    """Return a scene whose wall on the left reflects three percent more."""
    first, *others = scene.room.reflectances
    reflectances = (tuple(1.03 * c for c in first), *others)
    return replace(scene, room=replace(scene.room, reflectances=reflectances))


@pytest.mark.parametrize("name", ["minicubes", "cornell"])
@pytest.mark.parametrize(("change", "depth"), [(redder, 5), (lambda scene: scene, 4)])
def test_small_faults_are_caught(executor_named, theirs, name, change, depth):
    """A wall that reflects 3 % more, or paths with one scattering less, are other pictures."""
    a = ours(executor_named("opencl"), change(SCENES[name]), Settings(max_depth=depth))
    with pytest.raises(AssertionError, match="least p-value"):
        assert_all_plausible(p_values(a, theirs(name)), sidak(SIGNIFICANCE, len(SCENES) + len(FROM_OUTSIDE)))


# ---- what is left to Mitsuba's own classes ---------------------------------------------------------------


def test_a_room_is_entered_by_cameras_outside_alone(mitsuba):
    kinds = {
        name: peer_mitsuba.export(mitsuba, scene, 4, 4, Settings())["sensor"]["type"]
        for name, scene in {**SCENES, **FROM_OUTSIDE}.items()
    }
    assert {name for name, kind in kinds.items() if kind == "wamnet_inside"} == set(FROM_OUTSIDE)


def test_background_alone(mitsuba):
    """Constant radiance: 4 u of float32 for a product and a mean."""
    loaded = mitsuba.load_dict(peer_mitsuba.export(mitsuba, scenes.empty(), 4, 3, Settings(max_depth=1)))
    assert np.abs(peer_mitsuba.render(mitsuba, loaded, 2, 0) - 0.25).max() <= 4 * 2.0**-24


# ---- refusals --------------------------------------------------------------------------------------------

ROOM = scenes.furnace()


@pytest.mark.parametrize(
    ("scene", "settings", "message"),
    [
        (ROOM, Settings(roulette_depth=2), "the peer combines both strategies by the power heuristic"),
        (ROOM, Settings(strategy="light"), "use the default ones except for max_depth"),
        (scenes.glossy(), Settings(), "scene with materials is glossy: only matte surfaces are exported"),
        (scenes.daylight(), Settings(), "scene with .* is daylight: .* compare a scene without"),
        (
            replace(ROOM, environment=scenes.daylight().environment),
            Settings(),
            "scene with a sky is furnace: no sky is exported",
        ),
        (ROOM, Settings(heuristic="balance"), "without roulette; use the default ones"),
        (
            replace(ROOM, spheres=(Sphere((0.5, 0.0, 0.0), 0.6, (0.5,) * 3),)),
            Settings(),
            r"primitive is Sphere\(.*nothing may reach out of it; make the room larger",
        ),
        (
            replace(ROOM, boxes=(Box((0.0, 0.0, -0.6), (0.1, 0.1, 0.5), (0.5,) * 3),)),
            Settings(),
            r"primitive is Box\(.*nothing may reach out of it",
        ),
        (
            replace(ROOM, quads=(Quad((0.0, 0.0, 0.0), (0.0, 1.1, 0.0), (0.5, 0.0, 0.0), (0.5,) * 3),)),
            Settings(),
            r"primitive is Quad\(.*nothing may reach out of it",
        ),
        (
            replace(ROOM, spheres=(Sphere((0.1, 0.2, 0.6), 0.2, (0.5,) * 3),)),
            Settings(),
            r"camera inside is Sphere\(.*shows solids from outside; move the camera out",
        ),
        (
            replace(ROOM, boxes=(Box((0.1, 0.2, 0.6), (0.2, 0.2, 0.2), (0.5,) * 3),)),
            Settings(),
            r"camera inside is Box\(",
        ),
    ],
)
def test_what_mitsuba_would_show_differently_is_refused(scene, settings, message):
    with pytest.raises(InputError, match=message):
        peer_mitsuba.check(scene, settings)


def test_missing_mitsuba_is_told(monkeypatch):
    monkeypatch.setitem(sys.modules, "mitsuba", None)
    with pytest.raises(ExecutorUnavailable, match=r"package is not installed; pip install 'wamnet\[bench\]'"):
        peer_mitsuba.open_mitsuba("scalar_rgb")


@pytest.mark.parametrize(("version", "found"), [(16, "LLVM 16"), (-1, "none")])
def test_missing_or_old_llvm_is_told(monkeypatch, version, found):
    library = SimpleNamespace(detail=SimpleNamespace(llvm_version=lambda: (version, 0, 6)))
    monkeypatch.setitem(sys.modules, "mitsuba", SimpleNamespace())
    monkeypatch.setitem(sys.modules, "drjit", library)
    with pytest.raises(ExecutorUnavailable, match=f"libLLVM 17 or newer and finds {found}; apt-get install"):
        peer_mitsuba.open_mitsuba("llvm_ad_rgb")
