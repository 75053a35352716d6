"""Scenes: JSON in and out, and a clear refusal of everything that breaks a rule."""

import json
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from wamnet.refimpl.errors import InputError
from wamnet.refimpl.light import scene as S
from wamnet.refimpl.light import scenes
from wamnet.refimpl.light.materials import Conductor, Dielectric, Lambertian, Mirror

GREY = (0.5, 0.5, 0.5)
EVERYTHING = S.Scene(
    "everything",
    S.Camera((0.0, 0.0, 5.0), (0.0, 0.0, 0.0)),
    room=S.Room((-2.0, -2.0, -2.0), (2.0, 2.0, 2.0), (GREY,) * 6),
    boxes=(S.Box((0.0, 0.0, 0.0), (0.5, 0.5, 0.5), GREY),),
    spheres=(S.Sphere((1.0, 0.0, 0.0), 0.25, GREY),),
    quads=(S.Quad((-1.0, -1.0, -1.0), (2.0, 0.0, 0.0), (0.0, 0.0, 2.0), GREY),),
    lights=(S.Light((-0.5, 1.9, -0.5), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0), (1.0, 1.0, 1.0), 10.0),),
    background=(0.1, 0.1, 0.1),
)


DIGEST = "2f2ce480f6526cb81867dd6597947c678f6e9bf39a174ce3574acdafcc590165"
"""Digest of EVERYTHING, computed before scenes had materials."""

MATERIALS = replace(
    EVERYTHING,
    room=replace(EVERYTHING.room, materials=(Mirror(), None, Conductor(0.5), Lambertian(), None, None)),
    boxes=(replace(EVERYTHING.boxes[0], material=Dielectric(1.33)),),
    spheres=(replace(EVERYTHING.spheres[0], material=Conductor()),),
    quads=(replace(EVERYTHING.quads[0], material=Mirror()),),
)
DAY = replace(EVERYTHING, background=S.BLACK, environment=S.Sky(GREY, GREY, GREY))


@pytest.mark.parametrize(
    "scene",
    [EVERYTHING, MATERIALS, DAY, *(make() for make in scenes.CANONICAL.values())],
    ids=lambda s: s.name,
)
def test_json_round_trip(scene):
    again = S.from_json(S.to_json(scene))
    assert again == scene
    assert S.to_json(again) == S.to_json(scene)
    assert S.scene_digest(again) == S.scene_digest(scene)


def test_materials_are_in_the_text_only_where_there_are_some():
    """Texts and digests of scenes without materials are those of the time before there were any."""
    assert "material" not in S.to_json(EVERYTHING)
    assert "environment" not in S.to_json(EVERYTHING)
    assert S.scene_digest(EVERYTHING) == DIGEST
    text = json.loads(S.to_json(MATERIALS))
    assert text["boxes"][0]["material"] == {"kind": "dielectric", "ior": 1.33}
    assert text["quads"][0]["material"] == {"kind": "mirror"}
    assert text["room"]["materials"][:2] == [{"kind": "mirror"}, None]
    default = replace(EVERYTHING, spheres=(replace(EVERYTHING.spheres[0], material=Lambertian()),))
    assert S.scene_digest(default) != S.scene_digest(EVERYTHING)


@given(st.lists(st.floats(-1e6, 1e6, width=64), min_size=3, max_size=3).map(tuple))
def test_json_keeps_every_bit_of_a_number(center):
    scene = replace(EVERYTHING, spheres=(S.Sphere(center, 0.25, GREY),))
    assert S.from_json(S.to_json(scene)).spheres[0].center == center


@pytest.mark.nightly
def test_a_text_of_a_hundred_thousand_boxes_is_read():
    """It was refused by the reader: 103 values too many."""
    data = json.loads(S.to_json(scenes.canonical("minicubes", time=1.0)))
    data["boxes"] = (data["boxes"] * 4000)[:100_000]
    assert len(S.from_json(json.dumps(data)).boxes) == 100_000


def test_digest_depends_on_content_and_not_on_spelling():
    data = json.loads(S.to_json(EVERYTHING))
    spelled = json.dumps(dict(reversed(data.items()))).replace("5.0", "5")
    assert S.scene_digest(S.from_json(spelled)) == S.scene_digest(EVERYTHING)
    moved = replace(EVERYTHING, background=(0.1, 0.1, 0.2))
    assert S.scene_digest(moved) != S.scene_digest(EVERYTHING)
    assert S.scene_digest(replace(EVERYTHING, info={"note": "x"})) == S.scene_digest(EVERYTHING)


@pytest.mark.parametrize("version", ["1", "1.0", "1e0", "10e-1"])
def test_the_version_is_a_number_however_it_is_written(version):
    text = S.to_json(EVERYTHING).replace('"version": 1,', f'"version": {version},')
    assert f'"version": {version},' in text
    assert S.from_json(text) == EVERYTHING


def changed(path: str, value: object) -> str:
    """Return the JSON of EVERYTHING with the value at a dotted path replaced; a value of ... removes the
    key."""
    data = json.loads(S.to_json(EVERYTHING))
    *parents, last = [int(key) if key.isdigit() else key for key in path.split(".")]
    target = data
    for key in parents:
        target = target[key]
    if value is ...:
        del target[last]
    else:
        target[last] = value
    return json.dumps(data)


REFUSALS = [
    ("format", "other", r"scene.format 'other': must be 'wamnet-scene'"),
    ("version", 2, r"scene.version 2: must be 1"),
    ("version", "1", r"scene.version '1': must be 1"),
    ("version", True, r"scene.version True: must be 1"),
    ("version", 1.5, r"scene.version 1.5: must be 1"),
    ("name", "\ud800", r"scene.name '.*': half a character .* cannot be written"),
    ("spheres.0.radius", 10**400, r"spheres\[0\].radius 'inf': must be a finite number"),
    ("spheres.0.center", [0, 1e39, 0], r"center\[1\] 1e\+39: must be a finite number of at most 1e\+12"),
    ("name", 3, "scene.name 3: must be a string"),
    ("name", ..., "scene.name: missing"),
    ("info", [], r"scene.info \[\]: must map strings to strings"),
    ("colour", 1, r"scene.colour 1: Scene has no such key \(choose one of name, camera"),
    ("camera", 1, r"scene.camera 1: must be a JSON object \(give the keys of a camera"),
    ("camera.position", [0, 0], r"scene.camera.position \[0, 0\]: must have 3 entries"),
    ("camera.position", "x", r"scene.camera.position 'x': must be a list"),
    ("camera.position.1", True, r"scene.camera.position\[1\] True: must be a finite number"),
    ("camera.position.1", "1", r"scene.camera.position\[1\] '1': must be a finite number"),
    ("camera.vertical_fov_deg", 180, r"vertical_fov_deg 180.0: must lie between 0 and 180"),
    ("camera.look_at", [0, 0, 5], "look_at .*: must differ from position"),
    ("camera.up", [0, 0, 1], "up .*: must not be parallel to the view"),
    ("background", [0, -1, 0], "scene.background .*: radiance must not be negative"),
    ("room.high.1", -2.0, r"scene.room.high\[1\] -2.0: must exceed low\[1\] = -2.0"),
    ("room.reflectances.2", [0, 0, 1.5],
     r"scene.room.reflectances\[2\] .*: a reflectance must lie in \[0, 1\]"),
    ("room.emission", [0, 0, -1], "scene.room.emission .*: emission must not be negative"),
    ("boxes.0.half_extent", [1, 0, 1], r"scene.boxes\[0\].half_extent .*: half extents must be positive"),
    ("boxes.0.rotation.0", [2, 0, 0], r"scene.boxes\[0\].rotation .*: its rows must be orthonormal"),
    ("boxes.0.rotation.0", [-1, 0, 0], r"scene.boxes\[0\].rotation .*: its rows must be orthonormal"),
    ("boxes.0.reflectance", [1.1, 0, 0], r"scene.boxes\[0\].reflectance '.*': energy|a reflectance"),
    ("spheres.0.radius", 0, r"scene.spheres\[0\].radius 0.0: must be positive"),
    ("quads.0.edge_v", [1, 0, 0], r"scene.quads\[0\].edge_v .*: the edges must span an area"),
    ("lights.0.color", [-1, 0, 0], r"scene.lights\[0\].color .*: a colour must not be negative"),
    ("boxes.0.material", "glass", r"scene.boxes\[0\].material 'glass': must be a JSON object \(give a kind"),
    ("boxes.0.material", {"ior": 2}, r"scene.boxes\[0\].material.kind: missing \(choose one of lam"),
    ("boxes.0.material", {"kind": "wood"}, r"material.kind 'wood': unknown material \(choose one of lamb"),
    ("boxes.0.material", {"kind": "mirror", "ior": 2}, r"material.ior 2: Mirror has no such key \(remove it"),
    ("boxes.0.material", {"kind": "dielectric", "ior": 0.5},
     r"material.ior 0.5: an index of refraction must"),
    ("spheres.0.material", {"kind": "conductor", "roughness": 0}, r"roughness 0.0: a roughness must lie in"),
    ("quads.0.material", {"kind": "dielectric"},
     r"scene.quads\[0\].material 'dielectric': light passes only into c"),
    ("room.materials", [None] * 5, r"scene.room.materials '5 entries': must be six or none \(use null"),
    ("room.materials", [{"kind": "dielectric"}] + [None] * 5,
     r"materials\[0\] 'dielectric': light passes only into"),
    ("lights.0.power", -1, r"scene.lights\[0\].power -1.0: power must not be negative"),
]  # fmt: skip


@pytest.mark.parametrize(("path", "value", "message"), REFUSALS, ids=[f"{p}={v}" for p, v, _ in REFUSALS])
def test_refuses(path, value, message):
    with pytest.raises(InputError, match=message):
        S.from_json(changed(path, value))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"zenith": (0.0, -1.0, 0.0)}, r"environment.zenith .*: light must not be negative \(use 0 or more"),
        ({"sun_irradiance": (0.0, -1.0, 0.0)}, "environment.sun_irradiance .*: light must not be negative"),
        ({"sun_direction": (0.0, 0.0, 0.0)}, r"environment.sun_direction .*: must not be zero \(straight up"),
        (
            {"sun_concentration": -1.0},
            r"environment.sun_concentration -1.0: must lie in \[0, 1e\+06\] \(1000 is",
        ),
        (
            {"sun_concentration": float("nan")},
            r"environment.sun_concentration nan: all values must be finite",
        ),
    ],
)
def test_refuses_a_sky(change, message):
    with pytest.raises(InputError, match=message):
        S.validate(replace(DAY, environment=replace(DAY.environment, **change)))


def test_refuses_a_sky_before_a_background():
    with pytest.raises(
        InputError, match=r"scene.background .*: an environment takes the background's place \(m"
    ):
        S.validate(replace(DAY, background=GREY))


@pytest.mark.parametrize("text", ["", "{", "[1]", '"x"', "NaN", "[" * 100_000])
def test_refuses_texts_that_are_no_scene(text):
    with pytest.raises(InputError, match=r"scene .*|scene.format"):
        S.from_json(text)


@pytest.mark.parametrize("number", ["NaN", "Infinity", "-Infinity", "1e999"])
def test_refuses_infinite_numbers_in_json(number):
    text = S.to_json(EVERYTHING).replace("0.25", number)
    with pytest.raises(InputError, match=r"scene.spheres\[0\].radius '.*': must be a finite number"):
        S.from_json(text)
