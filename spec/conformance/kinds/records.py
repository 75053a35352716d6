"""Kinds of texts that stand for records: a camera, and scenes, written well, badly, and otherwise.

1. What fails for a camera makes every scene and model fail: JSON (RDG-2) and records (RDG-3) are read in
   one way. `cameras.json` has a row for each text: note, clause, the clause that its refusal is blamed on,
   or null if it must be refused, and the text.
2. `scenes.json` has a small scene with one of every part and every optional field, `each`, and rows: note,
   clause, null or the clauses of a refusal and of the digest; then the scene that is changed, and the
   changes [`_changed`], or a text. They are at the limits of each rule: what is just allowed, what just is
   not, fields left out one by one, a key too many in every object.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import numpy as np

from ....refimpl.light import scene as scene_module
from ....refimpl.light.scene import Camera, Scene
from ....refimpl.reading import parse_json, to_dataclass
from ..case import Case, exact
from .tables import kind, table
from .views import SCENES, scene_text


def spelled(text: Any) -> str:
    """Return a text of a table: itself, or pieces of which some are repeated, each with a count."""
    if isinstance(text, str):
        return text
    return "".join(piece if isinstance(piece, str) else piece[0] * piece[1] for piece in text)


# ---- cameras ----------------------------------------------------------------------------------------------


def _camera(inputs: Mapping[str, Any]) -> dict[str, Any]:
    """Return the numbers of a camera."""
    data = parse_json(inputs["text"], "camera", "fix the text")
    camera = to_dataclass(Camera, data, "camera", largest=scene_module.LARGEST_NUMBER)
    scene_module.validate(Scene("camera", camera))
    vectors = {name: np.array(getattr(camera, name)) for name in ("position", "look_at", "up")}
    return {**vectors, "vertical_fov_deg": np.float64(camera.vertical_fov_deg)}


def _camera_cases() -> list[Case]:
    """Return texts that are read, and those that are refused; what is left out is blamed on its default."""
    cases = []
    for note, clause, refusal, written, *plain in table("cameras"):
        text = spelled(written)
        own = {name: "SCN-6" for name in ("up", "vertical_fov_deg") if f'{name}"' not in text}
        inputs = {"text": text}
        expected = None
        if refusal is not None:
            blamed = {name: "" if plain else own.get(name, refusal) for name in _camera(inputs)}
            expected = exact(_camera(inputs), clause=blamed.__getitem__)
        cases.append(Case(clause, inputs, expected, note, refusal or ""))
    return cases


# ---- scenes -----------------------------------------------------------------------------------------------


def _scene(inputs: Mapping[str, Any]) -> dict[str, Any]:
    """Return what a scene's text stands for."""
    return {"digest": scene_module.scene_digest(scene_module.from_json(inputs["text"]))}


def _changed(base: str, each: str, changes: list[Any]) -> str:
    """Return the text of a scene changed.

    A change is a path and its new value, or a path by itself, which is left out. The last one may be pieces
    of the text that others replace."""
    if base in SCENES and not changes:
        return scene_text(base)
    replaced = changes.pop() if changes and isinstance(changes[-1], dict) else {}
    data = json.loads(each if base == "each" else scene_text(base))
    for path, *value in changes:
        *above, last = [int(part) if part.isdigit() else part for part in path.split(".")]
        place: Any = data
        for part in above:
            place = place[part]
        if value:
            place[last] = value[0]
        else:
            del place[last]
    text = json.dumps(data)
    for old, new in replaced.items():
        text = text.replace(old, spelled(new))
    return text


def _scene_cases() -> list[Case]:
    """Return good and bad scenes."""
    scenes, cases = table("scenes"), []
    each = json.dumps(scenes["each"])
    for note, clause, told, base, *changes in scenes["rows"]:
        text = _changed(base, each, changes) if base in ("each", *SCENES) else spelled(base)
        refusal, own = told or ("", "")
        expected = exact(_scene({"text": text}), clause={"digest": own}.__getitem__) if told else None
        cases.append(Case(clause, {"text": text}, expected, note, refusal))
    return cases


CAMERA_KIND = kind("file.camera", _camera_cases, _camera)
"""Cameras."""

SCENE_KIND = kind("file.scene", _scene_cases, _scene)
"""Scenes."""
