"""Kinds of texts that stand for a record: a camera, the least of them, written well, badly, and otherwise.

What fails here makes every scene and model fail: JSON (RDG-2) and records (RDG-3) are read in one way.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import numpy as np

from ....refimpl.light import scene as scene_module
from ....refimpl.light.scene import Camera
from ....refimpl.reading import LONGEST_NUMBER, parse_json, to_dataclass
from ..case import Case, Kind, Output

FACTS = {"position": [0, 1.5, -4e0], "look_at": [0.5, 0, 0], "up": [0, 1, 0], "vertical_fov_deg": 45}
"""A camera."""


def _camera(inputs: Mapping[str, Any]) -> dict[str, Any]:
    """Return the numbers of a camera."""
    data = parse_json(inputs["text"], "camera", "fix the text")
    camera = to_dataclass(Camera, data, "camera", largest=scene_module.LARGEST_NUMBER)
    vectors = {name: np.array(getattr(camera, name)) for name in ("position", "look_at", "up")}
    return {**vectors, "vertical_fov_deg": np.float64(camera.vertical_fov_deg)}


def _text(**changes: Any) -> str:
    """Return the text of the camera with facts changed, or left out with None."""
    return json.dumps({key: value for key, value in {**FACTS, **changes}.items() if value is not None})


def _raw(old: str, new: str) -> str:
    """Return that text with a piece of it replaced."""
    return _text().replace(old, new)


LONG = "45." + "0" * (LONGEST_NUMBER - 3)
"""A number of as many characters as may be."""

READ = {
    "as JSON is written": _text(),
    "without what has a default": _text(up=None, vertical_fov_deg=None),
    "in another order, with other spaces": '\n{ "look_at":[0,0,\t1.0E+0],"position":[-0,2.5e-1,0.0] }\r\n',
    "a key in escapes": _raw('"up"', '"\\u0075p"'),
    "a number of 1,000 characters": _raw("45", LONG),
    "a number that is nearly 0": _raw("0.5", "1e-400"),
}
"""Texts that are read."""

OF_JSON = (
    "in another order, with other spaces",
    "a key in escapes",
    "a number of 1,000 characters",
    "a number that is nearly 0",
)
"""Those of them that are plain records, and unusual JSON."""

NO_JSON = {
    "nothing": "",
    "an object that does not end": _text()[:-1],
    "more after the end": _text() + "}",
    "a comma at the end of a list": _raw("-4.0]", "-4.0,]"),
    "a comma at the end of an object": _text()[:-1] + ",}",
    "quotation marks of another kind": _text().replace('"', "'"),
    "a key without them": _raw('"up"', "up"),
    "a number that begins with a point": _raw("0.5", ".5"),
    "a number that ends with one": _raw("45", "45."),
    "a number with a zero too many": _raw("45", "045"),
    "a number with a plus": _raw("45", "+45"),
    "NaN": _raw("45", "NaN"),
    "an infinity": _raw("45", "Infinity"),
    "a number beyond the largest double": _raw("45", "1e400"),
    "a number of 1,001 characters": _raw("45", LONG + "0"),
    "a key twice": _text()[:-1] + ', "up": [0, 1, 0]}',
    "half a character": _raw('"up"', '"u\\ud800p"'),
    "lists in lists in lists": "[" * 65 + "]" * 65,
    "a comment": _text() + " // a camera",
}
"""Texts that are not JSON as it is read here."""

NO_RECORD = {
    "a list": "[]",
    "a text": '"camera"',
    "nothing in particular": "null",
    "a key that is not known": _text(lens=1),
    "no position": _text(position=None),
    "no look_at": _text(look_at=None),
    "a number as text": _text(vertical_fov_deg="45"),
    "a boolean for a number": _text(vertical_fov_deg=True),
    "a list for a number": _text(vertical_fov_deg=[45]),
    "null for a number": _raw("45", "null"),
    "a number for a list": _text(up=1),
    "an object for a list": _text(up={"x": 0, "y": 1, "z": 0}),
    "two numbers for three": _text(up=[0, 1]),
    "four numbers for three": _text(up=[0, 1, 0, 0]),
    "a text in a list": _text(up=[0, "1", 0]),
    "a boolean in a list": _text(up=[False, True, False]),
    "a number beyond 1e12": _text(position=[0, 0, 1.0000001e12]),
    "an integer beyond the largest double": _text(position=[0, 0, 10**400]),
}
"""Texts that are JSON and no camera."""


def _cases() -> list[Case]:
    """Return texts that are read, and those that are refused for their form or for what they hold."""
    cases: list[Case] = []
    for clause, rows in (("RDG-2", READ), ("RDG-2", NO_JSON), ("RDG-3", NO_RECORD)):
        for note, text in rows.items():
            inputs = {"text": text}
            expected, refusal = None, ""
            if rows is READ:
                refusal = "RDG-2" if note in OF_JSON else "RDG-3"
                own = {name: "SCN-6" for name in ("up", "vertical_fov_deg") if f'{name}"' not in text}
                values = _camera(inputs).items()
                expected = {name: Output(value, clause=own.get(name, refusal)) for name, value in values}
            cases.append(Case(f"file.camera/{len(cases)}", clause, inputs, expected, (), note, refusal))
    return cases


KINDS = (
    Kind(
        "file.camera",
        "The text of a camera, as in a scene",
        {"text": "text, the camera's object (SCN-6)"},
        {
            **dict.fromkeys(("position", "look_at", "up"), "float[3]"),
            "vertical_fov_deg": "float, degrees",
        },
        _cases,
        _camera,
    ),
)
"""The kinds of this module."""
