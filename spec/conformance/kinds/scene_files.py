"""Kinds of files: scenes, good, damaged and hostile."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from typing import Any

from ....refimpl.light import scene as scene_module
from ..case import Case, Kind, Output
from . import rules
from .views import scene_text


def _scene(inputs: Mapping[str, Any]) -> dict[str, Any]:
    """Return what a scene's text stands for."""
    scene = scene_module.from_json(inputs["text"])
    return {"digest": scene_module.scene_digest(scene)}


def _changed(path: str, value: Any) -> str:
    """Return the text of a scene with one value replaced, or removed with the value ..."""
    data = json.loads(scene_text("cornell"))
    *above, last = [int(part) if part.isdigit() else part for part in path.split(".")]
    place = data
    for part in above:
        place = place[part]
    if value is ...:
        del place[last]
    else:
        place[last] = value
    return json.dumps(data)


def _numbers() -> str:
    """Return the text of a scene with numbers of all sizes, and a name of all kinds of letters."""
    data = json.loads(_changed("camera.position", [1e-5, 123456789.125, -1e11]))
    data["name"] = 'h\u00fctte "\\\u007f \U0001f3e0\t'
    data["lights"][0]["power"] = 5e-324
    data["background"] = [0.0001, 0.1 + 0.2, -0.0]
    return json.dumps(data)


def _least() -> str:
    """Return the text of a scene without anything that has a default."""
    box = {"center": [0, 0, 0], "half_extent": [1, 1, 1], "reflectance": [0.5, 0.5, 0.5]}
    metal, glass = ({**box, "material": {"kind": kind}} for kind in ("conductor", "dielectric"))
    camera = {"position": [0, 0, 4], "look_at": [0, 0, 0]}
    sky = {"zenith": [1, 1, 1], "horizon": [1, 1, 1], "ground": [1, 1, 1]}
    data = {"format": "wamnet-scene", "version": 1, "name": "", "camera": camera, "environment": sky}
    return json.dumps({**data, "boxes": [box, metal, glass]})


def _sky(name: str, value: Any, **more: Any) -> str:
    """Return the text of a scene with facts of its sky changed."""
    data = json.loads(scene_text("daylight"))
    data["environment"] |= {name: value, **more}
    return json.dumps(data)


SCENE_GOOD: Mapping[str, Callable[[], str]] = {
    "as it was written": lambda: scene_text("cornell"),
    "with materials": lambda: scene_text("glossy"),
    "with a sky": lambda: scene_text("daylight"),
    "other facts, the same digest": lambda: _changed("info.author", "somebody"),
    "whole numbers are numbers": lambda: _changed("camera.vertical_fov_deg", 37),
    "numbers with exponents, letters that are not ASCII": _numbers,
    "what may be left out is": _least,
}
"""Scenes that are read."""


def _letters() -> str:
    """Return the text of a scene whose name has every control character, and a zero of each kind."""
    data = json.loads(_changed("background", [0.0, -0.0, 7.0]))
    data["name"] = "".join(map(chr, [*range(32), 127, 128])) + '/\\"'
    return json.dumps(data).replace("7.0]", "-0]")


MATTE = {"kind": "lambertian"}
"""The material of what names none; who names it keeps it in the canonical text (SCN-6)."""

SCENE_LATER: Mapping[str, Callable[[], str]] = {
    "letters that are escaped, zeros with a sign": _letters,
    "six walls that name no material": lambda: _changed("room.materials", [None] * 6),
    "walls of which one is said to be matte": lambda: _changed("room.materials", [MATTE, *[None] * 5]),
    "a block that is said to be matte": lambda: _changed("boxes.0.material", MATTE),
}
"""Scenes that are read, which come last: those before keep their numbers."""

SCENE_BAD: Mapping[str, Callable[[], str]] = {
    "no JSON": lambda: "{",
    "no object": lambda: "[]",
    "thousands of brackets": lambda: "[" * 20_000,
    "another format": lambda: _changed("format", "other"),
    "another version": lambda: _changed("version", 2),
    "a version that is a truth value": lambda: _changed("version", True),
    "no camera": lambda: _changed("camera", ...),
    "an unknown key": lambda: _changed("camera.lens", 1.0),
    "NaN": lambda: _changed("camera.vertical_fov_deg", float("nan")),
    "a number beyond 1e12": lambda: _changed("camera.position.0", 1.0001e12),
    "an integer of thousands of digits": lambda: _changed("camera.position.0", 10**4000),
    "a number as text": lambda: _changed("camera.vertical_fov_deg", "37"),
    "a truth value as number": lambda: _changed("camera.vertical_fov_deg", True),
    "two numbers for three": lambda: _changed("camera.position", [0.0, 1.0]),
    "an angle of 180 degrees": lambda: _changed("camera.vertical_fov_deg", 180.0),
    "a camera that looks at itself": lambda: _changed("camera.look_at", [0.0, 1.0, 4.4]),
    "a camera that looks along its up": lambda: _changed("camera.up", [0.0, 0.0, 2.0]),
    "a reflectance above 1": lambda: _changed("boxes.0.reflectance.1", 1.01),
    "a negative emission": lambda: _changed("boxes.0.emission.2", -0.5),
    "an extent of 0": lambda: _changed("boxes.1.half_extent.0", 0.0),
    "a room inside out": lambda: _changed("room.low.0", 1.0),
    "five walls": lambda: _changed("room.reflectances.5", ...),
    "a matrix that is no rotation": lambda: _changed("boxes.0.rotation.0.0", 0.9),
    "a mirror image of a rotation": lambda: _changed(
        "boxes.0.rotation", [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, -1.0]]
    ),
    "a light without an area": lambda: _changed("lights.0.edge_u", [0.0, 0.0, 1.0]),
    "a negative power": lambda: _changed("lights.0.power", -1.0),
    "an unknown material": lambda: _changed("boxes.0.material", {"kind": "velvet"}),
    "a material without a kind": lambda: _changed("boxes.0.material", {"roughness": 0.5}),
    "a roughness of 0": lambda: _changed("boxes.0.material", {"kind": "conductor", "roughness": 0.0}),
    "glass below 1": lambda: _changed("boxes.0.material", {"kind": "dielectric", "ior": 0.9}),
    "glass that is no body": lambda: _changed("room.materials", [None] * 5 + [{"kind": "dielectric"}]),
    "a sun without a direction": lambda: _sky("sun_direction", [0.0, 0.0, 0.0]),
    "a sun that is too narrow": lambda: _sky("sun_concentration", 2e6),
    "a sky and a background": lambda: json.dumps(
        {**json.loads(scene_text("daylight")), "background": [0.1, 0.1, 0.1]}
    ),
    "a sun without a direction and without light": lambda: _sky(
        "sun_direction", [0.0, 0.0, 0.0], sun_irradiance=[0.0, 0.0, 0.0]
    ),
}
"""Scenes that are refused: first for their form."""

FIRST_OF_VALUES = "an angle of 180 degrees"
"""The first one that is refused for a value."""


OF_SHAPES = {"rotation": "BOX-1", "area": "SHP-3"}
"""Clauses of what is refused by a shape's own rule, by what a note says of it."""


def _scene_cases() -> list[Case]:
    """Return good and bad scenes."""
    cases, names = list[Case](), list(SCENE_BAD)
    _add_scenes(cases, rules.first_good(), bad=False)
    for note, text in [*SCENE_GOOD.items(), *SCENE_BAD.items(), *SCENE_LATER.items()]:
        inputs, bad = {"text": text()}, note in SCENE_BAD
        own = "SCN-6" if "left out" in note else ""
        expected = None if bad else {name: Output(v, clause=own) for name, v in _scene(inputs).items()}
        form = bad and names.index(note) < names.index(FIRST_OF_VALUES)
        read = "SCN-10" if note in SCENE_LATER else "SCN-8"
        rule = next((known for part, known in OF_SHAPES.items() if part in note), "SCN-7")
        clause = read if not bad else "SCN-6" if form else rule
        refusal = "" if bad else "RDG-2" if "letters" in note else "SCN-6" if "left out" in note else "SCN-7"
        cases.append(Case(f"file.scene/{len(cases)}", clause, inputs, expected, (), note, refusal))
    for found, bad in (
        (rules.good(), False),
        (rules.bad(), True),
        (rules.last_good(), False),
        (rules.last_bad(), True),
    ):
        _add_scenes(cases, found, bad)
    for note, content in rules.no_texts():
        cases.append(Case(f"file.scene/{len(cases)}", "RDG-2", {"text": content}, None, (), note))
    return cases


def _add_scenes(cases: list[Case], found: Iterator[tuple[str, str]], bad: bool) -> None:
    """Append scenes of notes and texts, which are read or to be refused."""
    for note, content in found:
        inputs = {"text": content}
        own = "SCN-6" if "left out" in note else "SCN-8"
        expected = None if bad else {name: Output(v, clause=own) for name, v in _scene(inputs).items()}
        form = bad and ("left out" in note or "too many" in note)
        clause = "RDG-3" if form else rules.governing(note, "SCN-7" if bad else "SCN-8")
        refusal = "" if bad else rules.refusal(note)
        cases.append(Case(f"file.scene/{len(cases)}", clause, inputs, expected, (), note, refusal))


KINDS = (
    Kind(
        "file.scene",
        "Scene files",
        {"text": "text, the file"},
        {"digest": "text, the digest of SCN-8"},
        _scene_cases,
        _scene,
    ),
)
"""The kinds of this module."""
