"""Mitsuba 3 shows the same pictures: another renderer, written by others, agrees by Welch's test."""

import sys
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from peer_pictures import SPP, ours, p_values, theirs
from statistical import SIGNIFICANCE, assert_all_plausible, sidak

from wamnet.refimpl.errors import ExecutorUnavailable, InputError
from wamnet.refimpl.light import scenes
from wamnet.refimpl.light.materials import Dielectric
from wamnet.refimpl.light.scene import Box, Camera, Light, Quad, Scene, Sphere
from wamnet.refimpl.light.transport import Settings
from wamnet.refimpl.light.variation import Variation, varied
from wamnet_peers import peer_mitsuba

pytestmark = [pytest.mark.nightly, pytest.mark.apart]

SPP_FROM_OUTSIDE = 8
"""The same for Mitsuba's pictures from outside a room: its scalar variant asks Python for each ray."""

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


@pytest.fixture(scope="module")
def mitsubas(mitsuba):
    """Give a function that returns the numbers (B, N) of Mitsuba for a scene's name; each is made once."""
    known = {}

    def made(name):
        if name not in known:
            spp, scene = (SPP, SCENES[name]) if name in SCENES else (SPP_FROM_OUTSIDE, FROM_OUTSIDE[name])
            known[name] = theirs(mitsuba, scene, Settings(), spp)
        return known[name]

    return made


@pytest.mark.parametrize("name", [*SCENES, *FROM_OUTSIDE])
def test_mitsuba_shows_the_same_picture(executor_named, mitsubas, name):
    a = ours(executor_named("opencl"), {**SCENES, **FROM_OUTSIDE}[name], Settings())
    assert_all_plausible(p_values(a, mitsubas(name)), sidak(SIGNIFICANCE, len(SCENES) + len(FROM_OUTSIDE)))


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
        (ROOM, Settings(roulette_depth=2), "Mitsuba combines both strategies by the power heuristic"),
        (ROOM, Settings(strategy="light"), "use the default ones except for max_depth"),
        (
            scenes.daylight(sun_concentration=3000.0),
            Settings(),
            r"sun_concentration 3000.0: the sky's table shows lobes up to 2000 \(make the sun softer",
        ),
        (
            replace(ROOM, spheres=(Sphere((0.0, 0.5, 0.0), 0.2, (0.9,) * 3, (0.1,) * 3, Dielectric()),)),
            Settings(),
            r"glass Sphere.*: no light may start inside \(move the light out",
        ),
        (
            replace(
                ROOM,
                boxes=(Box((0.0, 0.5, 0.0), (0.3, 0.3, 0.3), (0.9,) * 3, material=Dielectric()),),
                lights=(Light((0.0, 0.5, 0.0), (0.1, 0.0, 0.0), (0.0, 0.0, 0.1), (1.0, 1.0, 1.0), 1.0),),
            ),
            Settings(),
            "glass Box.*: no light may start inside",
        ),
        (ROOM, Settings(heuristic="balance"), r"without roulette \(use the default ones"),
        (
            replace(ROOM, spheres=(Sphere((0.5, 0.0, 0.0), 0.6, (0.5,) * 3),)),
            Settings(),
            r"primitive Sphere\(.*nothing may reach out of it \(make the room larger",
        ),
        (
            replace(ROOM, boxes=(Box((0.0, 0.0, -0.6), (0.1, 0.1, 0.5), (0.5,) * 3),)),
            Settings(),
            r"primitive Box\(.*nothing may reach out of it",
        ),
        (
            replace(ROOM, quads=(Quad((0.0, 0.0, 0.0), (0.0, 1.1, 0.0), (0.5, 0.0, 0.0), (0.5,) * 3),)),
            Settings(),
            r"primitive Quad\(.*nothing may reach out of it",
        ),
        (
            replace(ROOM, spheres=(Sphere((0.1, 0.2, 0.6), 0.2, (0.5,) * 3),)),
            Settings(),
            r"camera inside Sphere\(.*shows solids from outside \(move the camera out",
        ),
        (
            replace(ROOM, boxes=(Box((0.1, 0.2, 0.6), (0.2, 0.2, 0.2), (0.5,) * 3),)),
            Settings(),
            r"camera inside Box\(",
        ),
    ],
)
def test_what_mitsuba_would_show_differently_is_refused(scene, settings, message):
    with pytest.raises(InputError, match=message):
        peer_mitsuba.check(scene, settings)


def test_missing_mitsuba_is_told(monkeypatch):
    monkeypatch.setitem(sys.modules, "mitsuba", None)
    with pytest.raises(ExecutorUnavailable, match=r"package is not installed; pip install mitsuba"):
        peer_mitsuba.open_mitsuba("scalar_rgb")


@pytest.mark.nightly("-1-none")
@pytest.mark.parametrize(("version", "found"), [(16, "LLVM 16"), (-1, "none")])
def test_missing_or_old_llvm_is_told(monkeypatch, version, found):
    library = SimpleNamespace(detail=SimpleNamespace(llvm_version=lambda: (version, 0, 6)))
    monkeypatch.setitem(sys.modules, "mitsuba", SimpleNamespace())
    monkeypatch.setitem(sys.modules, "drjit", library)
    with pytest.raises(ExecutorUnavailable, match=f"libLLVM 17 or newer and finds {found}; apt-get install"):
        peer_mitsuba.open_mitsuba("llvm_ad_rgb")
