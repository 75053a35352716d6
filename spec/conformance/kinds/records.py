"""Kinds of texts that stand for a record: a camera, the least of them, written well, badly, and otherwise.

What fails here makes every scene and model fail: JSON (RDG-2) and records (RDG-3) are read in one way.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from ....refimpl.light import scene as scene_module
from ....refimpl.light.scene import Camera, Scene
from ....refimpl.reading import LONGEST_NUMBER, parse_json, to_dataclass
from ..case import Case, Kind, Output

FACTS = {"position": [0, 1.5, -4e0], "look_at": [0.5, 0, 0], "up": [0, 1, 0], "vertical_fov_deg": 45}
"""A camera."""


def _camera(inputs: Mapping[str, Any]) -> dict[str, Any]:
    """Return the numbers of a camera."""
    data = parse_json(inputs["text"], "camera", "fix the text")
    camera = to_dataclass(Camera, data, "camera", largest=scene_module.LARGEST_NUMBER)
    scene_module.validate(Scene("camera", camera))
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

NO_SPACES = {
    "a vertical tab": "\v",
    "a form feed": "\f",
    "U+0000": "\0",
    "U+001F": "\x1f",
    "U+0085": "\x85",
    "a space that does not break": "\xa0",
    "a separator of lines": "\u2028",
    "a byte order mark": "\ufeff",
}
"""Characters that other readers skip as they do spaces, and RFC 8259 does not."""

NO_NUMBERS = (
    "-", "- 45", "--45", "-.5", "-045", "00", "45.e1", "1e", "1e+", "1.5.5", "4_5", "0x2D", "45f", "4 5",
    "-Infinity", "-NaN", "inf", "nan", "\uff14\uff15",
)  # fmt: skip
"""What other readers take for a number; the last are digits of another width."""

NO_FORM = {
    "a list that ends as an object": _raw("-4.0]", "-4.0}"),
    "an object that ends as a list": _text()[:-1] + "]",
    "no comma between two keys": _raw('], "up"', '] "up"'),
    "two commas between two keys": _raw('], "up"', '],, "up"'),
    "a comma before the first key": _raw("{", "{,"),
    "two commas in a list": _raw("1.5, -4.0", "1.5,, -4.0"),
    "no comma in a list": _raw("1.5, -4.0", "1.5 -4.0"),
    "a semicolon in a list": _raw("1.5, -4.0", "1.5; -4.0"),
    "no colon": _raw('"up":', '"up"'),
    "two colons": _raw('"up":', '"up"::'),
    "an equals sign for a colon": _raw('"up":', '"up" ='),
    "a number as key": _raw('"up"', "3"),
    "a key that does not end": _raw('"up"', '"up'),
    "a key twice, the second time in escapes": _text()[:-1] + ', "\\u0075p": [0, 1, 0]}',
    "a comment in a list": _raw("1.5,", "1.5, /* y */"),
    "two objects": _text() * 2,
    "null in capitals": _raw("45", "NULL"),
    "a part of null": _raw("45", "nul"),
    "true with a capital, as Python writes it": _raw("45", "True"),
    "undefined": _raw("45", "undefined"),
}
"""Texts that break the grammar in one place."""


def no_json() -> Iterator[tuple[str, str]]:
    """Yield notes and texts that came later: no spaces, no numbers, and what breaks the grammar."""
    for name, character in NO_SPACES.items():
        yield f"{name} before the object", character + _text()
        yield f"{name} after the object", _text() + character
        yield f"{name} between two tokens", _raw('"up": ', f'"up":{character}')
    yield from ((f"{text!a} for a number", _raw("45", text)) for text in NO_NUMBERS)
    yield from NO_FORM.items()


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


NO_CAMERA = {
    "an angle of 0": _text(vertical_fov_deg=0),
    "an angle of 180 degrees": _text(vertical_fov_deg=180),
    "an angle below 0": _text(vertical_fov_deg=-45),
    "a camera that looks at itself": _text(look_at=FACTS["position"]),
    "a camera that looks along its up": _text(up=[-1, 3, -8]),
    "an up of no direction": _text(up=[0, 0, 0]),
}
"""Cameras that see nothing."""

DEEPEST = 20_000
"""Objects in objects: a reader that calls itself for each and counts none runs out of its stack."""


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
    for note, text in no_json():
        cases.append(Case(f"file.camera/{len(cases)}", "RDG-2", {"text": text}, None, (), note))
    for clause, note, text in (
        ("RDG-2", "objects in objects in objects", '{"":' * DEEPEST),
        *(("SCN-7", note, text) for note, text in NO_CAMERA.items()),
    ):
        cases.append(Case(f"file.camera/{len(cases)}", clause, {"text": text}, None, (), note))
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
