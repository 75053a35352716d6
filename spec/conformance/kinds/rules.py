"""Scenes at the limits of each rule: one of every part, changed in a place, to be read or to be refused.

1. [`each`] is a small scene with one of every part and every optional field.
2. [`good`] are changes to what is just allowed, and fields that may be left out; [`bad`] are changes to what
   just is not, required fields left out one by one, and a key too many in every object.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from typing import Any

LEFT_OUT = object()
"""Stands for a key that is not there."""


def each() -> dict[str, Any]:
    """Return a scene with one of every part, as JSON."""
    metal, glass = {"kind": "conductor", "roughness": 0.5}, {"kind": "dielectric", "ior": 1.25}
    shine = {"reflectance": [0.5, 0.25, 0.75], "emission": [0.0, 0.5, 1.0]}
    edges = {"corner": [0, 1, 0], "edge_u": [1, 0, 0], "edge_v": [0, 0, 1]}
    turn = [[0.6, 0.8, 0.0], [-0.8, 0.6, 0.0], [0.0, 0.0, 1.0]]
    camera = {"position": [0, 1, 4], "look_at": [0, 0, 0], "up": [0, 1, 0], "vertical_fov_deg": 45}
    walls = {
        "reflectances": [[0.5, 0.5, 0.5]] * 6,
        "emission": [0, 0, 0.5],
        "materials": [None] * 5 + [metal],
    }
    return {
        "format": "wamnet-scene",
        "version": 1,
        "name": "each",
        "camera": camera,
        "room": {"low": [-2, 0, -2], "high": [2, 3, 2], **walls},
        "boxes": [
            {"center": [0, 1, 0], "half_extent": [1, 0.5, 1], "rotation": turn, "material": glass, **shine}
        ],
        "spheres": [{"center": [0, 2, 0], "radius": 0.5, "material": glass, **shine}],
        "quads": [{**edges, "material": metal, **shine}],
        "lights": [{**edges, "color": [1, 0.5, 0.25], "power": 2}],
        "background": [0.25, 0.5, 0.75],
        "info": {"author": "somebody"},
    }


def changed(*changes: tuple[str, Any]) -> str:
    """Return the text of that scene with values at paths replaced, added, or left out."""
    data = each()
    for path, value in changes:
        *above, last = [int(part) if part.isdigit() else part for part in path.split(".")]
        place: Any = data
        for part in above:
            place = place[part]
        if value is LEFT_OUT:
            del place[last]
        else:
            place[last] = value
    return json.dumps(data)


SKY = {
    "zenith": [0, 0.5, 1],
    "horizon": [1, 1, 1],
    "ground": [0.5, 0.25, 0],
    "sun_direction": [1, 2, 0],
    "sun_irradiance": [2, 1, 1],
    "sun_concentration": 100,
}
"""A sky, which takes the background's place."""


def under(name: str, value: Any) -> str:
    """Return the text of that scene under a sky of which one fact is another, or left out."""
    sky = {key: kept for key, kept in {**SKY, name: value}.items() if kept is not LEFT_OUT}
    return changed(("background", LEFT_OUT), ("environment", sky))


PARTS = ("room", "boxes.0", "spheres.0", "quads.0", "lights.0")
"""Places of the parts."""

OPTIONAL = (
    "camera.up", "camera.vertical_fov_deg", "room", "room.emission", "room.materials", "boxes",
    "boxes.0.rotation", "boxes.0.emission", "boxes.0.material", "spheres.0.emission", "spheres.0.material",
    "spheres", "quads.0.emission", "quads.0.material", "quads", "lights", "background", "info",
    "boxes.0.material.ior", "quads.0.material.roughness",
)  # fmt: skip
"""What may be left out."""

REQUIRED = (
    "name", "camera", "camera.position", "camera.look_at", "room.low", "room.high", "room.reflectances",
    "boxes.0.center", "boxes.0.half_extent", "boxes.0.reflectance", "spheres.0.center", "spheres.0.radius",
    "spheres.0.reflectance", "quads.0.corner", "quads.0.edge_u", "quads.0.edge_v", "quads.0.reflectance",
    "lights.0.corner", "lights.0.edge_u", "lights.0.edge_v", "lights.0.color", "lights.0.power",
)  # fmt: skip
"""What may not."""

MIRROR = {"kind": "mirror"}
"""A material without numbers."""

ALLOWED: Mapping[str, Any] = {
    "camera.position.0": 1e12,
    "camera.position.2": -1e12,
    "camera.vertical_fov_deg": 179.9990234375,
    "camera.up": [1e-3, 1e-3, 0],
    "room.reflectances.2": [0, 1, 0.5],
    "room": None,
    "room.materials": [],
    "room.materials.0": MIRROR,
    "boxes.0.reflectance": [1, 0, 1],
    "boxes.0.material": None,
    "boxes.0.material.ior": 1,
    "boxes.0.rotation.2": [0.0, 0.0, 1.0000004],
    "spheres.0.material.ior": 4,
    "spheres.0.radius": 5e-324,
    "quads.0.material.roughness": 0.001,
    "quads.0.edge_v": [1, 0, 1.0000021e-6],
    "lights.0.power": 0,
    "lights.0.color": [0, 0, 0],
    "boxes": [],
    "name": "",
    "info": {},
}
"""What is just allowed, by path."""

REFUSED: Mapping[str, Any] = {
    "camera.position.0": 1.0000001e12,
    "camera.position.2": -1.0000001e12,
    "camera.vertical_fov_deg": 0,
    "camera.up": [0, 1, 4],
    "room.reflectances.2": [0, 1.0000001, 0.5],
    "room.reflectances.5": [-1e-9, 0, 0],
    "room.high.1": 0,
    "room.high.2": -2,
    "room.emission.0": -1e-9,
    "room.materials": [None] * 7,
    "room.materials.1": {"kind": "conductor", "roughness": 1.0000001},
    "boxes.0.reflectance.1": -1e-9,
    "boxes.0.emission.1": -1e-9,
    "boxes.0.half_extent.2": -1,
    "boxes.0.material.ior": 4.0000001,
    "boxes.0.rotation.2": [0.0, 0.0, 1.000002],
    "boxes.0.rotation": [[1, 0, 0], [0, 1, 0]],
    "spheres.0.radius": 0,
    "spheres.0.reflectance.2": 1.0000001,
    "spheres.0.emission.0": -1e-9,
    "spheres.0.material.ior": 0.9999999,
    "quads.0.material.roughness": 0.0009999999,
    "quads.0.material": {"kind": "dielectric"},
    "quads.0.edge_v": [1, 0, 9.9e-7],
    "quads.0.reflectance.0": -1e-9,
    "quads.0.emission.2": -1e-9,
    "lights.0.edge_u": [0, 0, 0],
    "lights.0.color.2": -1e-9,
    "lights.0.power": True,
    "background.1": -1e-9,
    "name": 1,
    "camera": [],
    "boxes": {},
    "lights": None,
    "info": {"author": 1},
    "quads.0.material.kind": 1,
    "boxes.0.material.kind": [],
    "boxes.0.rotation.2.2": 0.9,
    "boxes.0.rotation.1": [-0.8, 0.6, 1e-3],
    "room.materials.5.kind": "mirror",
}
"""What is just not, by path."""

SKY_ALLOWED: Mapping[str, Any] = {
    "sun_direction": LEFT_OUT,
    "sun_irradiance": LEFT_OUT,
    "sun_concentration": LEFT_OUT,
    "zenith": [0, 0, 0],
    "ground": [1e12, 0, 0],
}
"""Facts of a sky that are just allowed."""

SKY_REFUSED: Mapping[str, Any] = {
    "zenith": LEFT_OUT,
    "horizon": LEFT_OUT,
    "ground": LEFT_OUT,
    "sun_concentration": -1e-9,
    "sun_irradiance": [0, -1e-9, 0],
    "clouds": 1,
    **{
        f"{name} ": value
        for name, value in (("zenith", [0, 0, -1]), ("horizon", [-1, 0, 0]), ("ground", [0, -1, 0]))
    },
}
"""Facts of a sky that are just not; a space at the end of a name only tells it from the one above."""


GOVERNING = {".rotation": "BOX-1", ".edge_": "SHP-3", ".radius": "SPH-1"}
"""Clauses of single numbers, by what a note says of them."""


PARALLEL = (([1, 1, 0], [2, 2, 0]), ([1, 0, 1], [2, 0, 2]), ([0, 1, 1], [0, 2, 2]), ([1, 2, 3], [-1, -2, -3]))
"""Edges that span no area."""


def _edges(length: float, aside: float) -> tuple[tuple[str, Any], tuple[str, Any]]:
    """Return edges of a length, of which one is a little aside of the other."""
    return ("quads.0.edge_u", [length, 0, 0]), ("quads.0.edge_v", [length, 0, aside])


def governing(note: str, otherwise: str) -> str:
    """Return the clause that a change to a scene is about."""
    return next((clause for part, clause in GOVERNING.items() if part in note), otherwise)


REFUSING = {"left out": "SCN-6", ".material": "SCN-7", "sky": "SCN-9", "camera only": "SCN-6"}
"""Clauses that a refusal of a scene is blamed on, by what a note says of it; else the rules of numbers."""


def refusal(note: str) -> str:
    """Return the clause that the refusal of a scene that is valid is blamed on."""
    found = next((clause for part, clause in REFUSING.items() if part in note), "SCN-7")
    # The first scene with a list of records: a reader that cannot have those refuses it.
    return "RDG-3" if note.startswith("a sphere:") else governing(note, found)


def first_good() -> Iterator[tuple[str, str]]:
    """Yield notes and texts of the least scenes that have a part of one kind."""
    head = {name: each()[name] for name in ("format", "version", "name")}
    camera = {"position": [0, 0, 4], "look_at": [0, 0, 0]}
    plain = {"reflectance": [0.5, 0.5, 0.5]}
    edges = {"corner": [0, 0, 0], "edge_u": [1, 0, 0], "edge_v": [0, 2, 0]}
    parts: dict[str, dict[str, Any]] = {
        "camera only": {},
        "a sphere: its .radius": {"spheres": [{"center": [0, 0, 0], "radius": 1, **plain}]},
        "a quad: its .edge_u and .edge_v": {"quads": [{**edges, **plain}]},
        "a lamp: its .edge_u and .edge_v": {"lights": [{**edges, "color": [1, 1, 1], "power": 1}]},
        "a box: its .rotation": {"boxes": [{**each()["boxes"][0], "material": None}]},
        "a box of glass: its .material": {"boxes": [each()["boxes"][0]]},
        "a room": {"room": {"low": [-1, -1, -1], "high": [1, 1, 1], "reflectances": [[0.5] * 3] * 6}},
        "a sky": {"environment": SKY},
    }
    yield from ((note, json.dumps({**head, "camera": camera, **part})) for note, part in parts.items())


def good() -> Iterator[tuple[str, str]]:
    """Yield notes and texts of scenes that are read."""
    yield "one of each", changed()
    yield from ((f"{path} left out", changed((path, LEFT_OUT))) for path in OPTIONAL)
    yield from ((f"{path} = {json.dumps(value)}", changed((path, value))) for path, value in ALLOWED.items())
    yield from ((_of_sky(name, value), under(name, value)) for name, value in SKY_ALLOWED.items())
    yield "quads.0.edge_u = 1000 long, edge_v less parallel", changed(*_edges(1000, 2e-3))
    yield "quads.0.edge_u = 0.001 long, edge_v less parallel", changed(*_edges(0.001, 2e-9))
    for concentration in (0, 1_000_000):
        yield _of_sky("sun_concentration", concentration), under("sun_concentration", concentration)


def bad() -> Iterator[tuple[str, str]]:
    """Yield notes and texts of scenes that are refused."""
    yield from ((f"{path} left out", changed((path, LEFT_OUT))) for path in REQUIRED)
    for path in ("", *PARTS, "camera", "room.materials.5", "boxes.0.material"):
        yield f"a key too many in {path or 'the scene'}", changed((f"{path}.color2".lstrip("."), 1))
    yield from ((f"{path} = {json.dumps(value)}", changed((path, value))) for path, value in REFUSED.items())
    yield from ((_of_sky(n, value), under(n.strip(), value)) for n, value in SKY_REFUSED.items())
    yield "quads.0.edge_u = 1000 long, edge_v nearly parallel", changed(*_edges(1000, 5e-4))
    yield "quads.0.edge_u = 0.001 long, edge_v nearly parallel", changed(*_edges(0.001, 5e-10))
    yield "a sky and a background of one channel", changed(("environment", SKY), ("background", [0, 0.5, 0]))
    for u, v in PARALLEL:
        yield f"quads.0.edge_u = {u}, edge_v = {v}", changed(("quads.0.edge_u", u), ("quads.0.edge_v", v))
    yield "spheres.0.radius = -0.5", changed(("spheres.0.radius", -0.5))
    yield (
        "camera: up along a view between two axes",
        changed(("camera.look_at", [1, 2, 4]), ("camera.up", [2, 2, 0])),
    )


def last_good() -> Iterator[tuple[str, str]]:
    """Yield notes and texts of scenes that are read and come last: those before keep their numbers."""
    skew = [[1, 0, 0], [1e-6, 1, 0], [0, 0, 1]]
    yield f"boxes.0.rotation = {skew}, as far off as may be", changed(("boxes.0.rotation", skew))
    yield (
        f"boxes.0.rotation.2 = {LONG_AXES[0]}, nearly too long",
        changed(("boxes.0.rotation.2", LONG_AXES[0])),
    )
    yield "quads.0.material.roughness = 1", changed(("quads.0.material.roughness", 1))
    for name in ("\x7f\x80\x9f", "\u2028\ufeff\uffff", "\U0001f3e0"):
        yield f"name = {json.dumps(name)} as it is: letters that need no escape", _named(name)
    for version in ("1.0", "1e0", "10E-1", "0.1e+1"):
        yield f"version {version}: the number 1", _versioned(version)
    yield "name: every escape", _named(r"\"\\\/\b\f\n\r\t\u00e9\u00E9\uD83C\udfe0")


def last_bad() -> Iterator[tuple[str, str]]:
    """Yield notes and texts of scenes that are refused and come last."""
    for part in ("pos", "_at"):
        yield f"a key too many in camera, a part of another: {part}", changed((f"camera.{part}", [0, 0, 0]))
    for half in ("\ud800", "\udfff"):
        yield f"name = {json.dumps(half)}", changed(("name", half))
    yield f"boxes.0.rotation.2 = {LONG_AXES[1]}, just too long", changed(("boxes.0.rotation.2", LONG_AXES[1]))
    yield (
        "camera: up along a view from a place off all axes",
        changed(("camera.position", [2, 3, 5]), ("camera.look_at", [3, 4, 6]), ("camera.up", [1, 1, 1])),
    )
    for version in ("1.5", "0", "-1", '"1"', "[1]", "null", "10", "1.0000000000000002"):
        yield f"version {version}: not the number 1", _versioned(version)
    for count in (1, 5):
        yield f"room.materials: {count} for six walls", changed(("room.materials", [MIRROR] * count))


def _versioned(text: str) -> str:
    """Return the text of that scene with another version."""
    return changed().replace('"version": 1,', f'"version": {text},')


def no_texts() -> Iterator[tuple[str, str]]:
    """Yield notes and texts of scenes whose name has a character or an escape that no text of JSON has."""
    yield from ((f"U+{ord(c):04X} as it is in the name", _named(f"ea{c}ch")) for c in CONTROLS)
    yield from ((f"the escape {escape} in the name", _named(f"ea{escape}ch")) for escape in NO_ESCAPES)
    yield "a name that ends in an escape", _named("each" + chr(92))


def _named(letters: str) -> str:
    """Return the text of that scene with letters in place of its name, as they are."""
    return changed(("name", "each")).replace('"each"', f'"{letters}"')


CONTROLS = "\0\x01\b\t\n\v\f\r\x1b\x1f"
"""Characters that a text of JSON has in escapes only."""

NO_ESCAPES = (
    r"\a", r"\v", r"\0", r"\'", r"\ ", r"\x41", r"\U00000041", r"\N{BULLET}", r"\u", r"\u12", r"\u00g0",
    r"\u+041", r"\u 041", r"\ud83c", r"\udfe0\ud83c", r"\ud83c\ud83c", "\\\n",
)  # fmt: skip
"""Escapes of other languages, and halves of characters."""


LONG_AXES = ([0, 0, 1.0000004999], [0, 0, 1.0000005002])
"""Axes whose squared lengths are just within 1e-6 of 1, and just not."""


def _of_sky(name: str, value: Any) -> str:
    """Return the note of a fact of a sky."""
    return f"sky: {name.strip()} " + ("left out" if value is LEFT_OUT else f"= {json.dumps(value)}")
