"""What moves in the scene of an export: numbers that its path kernel is given, and what a host makes them of.

1. Time is a table: a row of numbers for each of its moments. Camera, lights and positions are a host's own:
   scenes in which they are drawn show which numbers depend on them [`drawn`].
2. All these numbers are inputs of the path kernel [`Motion.inputs`, compiler/scenes/scene_inputs.py].
3. A manifest says of each where it is in the scene's tables, and the formula of that table [`FORMULAS`].
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...compiler.kernel.interface import SCENE_NUMBERS
from ...compiler.scenes.lower_scene import PathPrograms
from ...compiler.scenes.path_kernel import numbers_of
from ...compiler.scenes.scene_inputs import SceneInputs, varying
from ...refimpl import rng
from ...refimpl.errors import InputError, choice
from ...refimpl.light.scene import Scene
from ...refimpl.light.transport import Settings

TIME, CAMERA, LIGHTS, POSITIONS = "time", "camera", "lights", "positions"
"""What may move: all that follows time; the camera; colours and powers of lamps; where primitives are."""

KINDS = (TIME, CAMERA, LIGHTS, POSITIONS)
"""All of them."""

SAMPLES = 4
"""Drawn scenes: with three or more, numbers that are equal by chance are not taken for one."""

ROWS_NAME = f"{SCENE_NUMBERS}.f32"
"""The file of the table, in the folder of the path kernel."""

FORMULAS: Mapping[str, str] = {
    "camera.position": "the camera's position",
    "camera.forward": "normalize(look_at - position)",
    "camera.right": "normalize(cross(forward, up))",
    "camera.up": "cross(right, forward)",
    "camera.tan_half_fov": "tan(vertical_fov / 2)",
    "world.lights.corner": "[3 k + c]: corner of lamp k",
    "world.lights.radiance": "[3 k + c]: power color[c] / (pi area) of lamp k",
    "world.lights.cumulative": "[k]: sum of power (r + g + b) of lamps 0 to k, divided by that of all",
    "world.lights.probability": "[k]: share (cumulative[k] - cumulative[k - 1]), of the rounded numbers; "
    "share is 1, or a half where there is a sky",
    "world.geometry.emission": "[3 s + c]: radiance of surface s, if it is a lamp",
    "world.geometry.groups.*.rotation": "[3 i + c]: axis i of the boxes, or [9 b + 3 i + c] of box b",
    "world.geometry.groups.*.centers": "[3 b + c]: rotation times centre of box b of the group",
    "world.geometry.groups.*.tables.0": "[3 p + c]: centre of sphere p of the group, or corner of quad p",
}
"""What a host computes the numbers of a table from, by the table's path: CAM-1, SCN-5 and LTR-3, and the
chapters of box, sphere and quad. In 64 bits, each number rounded once to float32."""


def formula_of(table: str) -> str | None:
    """Return the formula of a table's numbers, None where only the rows of the times say them."""
    return next((text for path, text in FORMULAS.items() if fnmatchcase(table, path)), None)


@dataclass(frozen=True)
class Motion:
    """A scene at times in seconds, which is compiled at the first of them, and the kinds of what moves."""

    times: tuple[float, ...]
    scenes: tuple[Scene, ...]
    kinds: tuple[str, ...] = (TIME,)

    def __post_init__(self) -> None:
        """Refuse what cannot move."""
        for kind in self.kinds:
            if kind not in KINDS:
                raise InputError("--moving", kind, "unknown", choice(kind, KINDS))

    def inputs(self, settings: Settings) -> SceneInputs:
        """Return the numbers that are inputs, or refuse a scene in which nothing moves."""
        others = (
            []
            if set(self.kinds) <= {TIME}
            else [drawn(self.scenes[0], self.kinds, n) for n in range(SAMPLES)]
        )
        found = varying([*self.scenes, *others], settings)
        if not found.places:
            rule = f"changes nothing in scene {self.scenes[0].name}"
            raise InputError(
                "--moving", ", ".join(self.kinds), rule, f"choose some of {', '.join(KINDS)}, or leave it out"
            )
        return found

    def rows(self, settings: Settings) -> NDArray[np.float32]:
        """Return the numbers (times, n) at all times."""
        inputs = self.inputs(settings)
        return np.stack([inputs.values(scene) for scene in self.scenes])

    def other(self, settings: Settings) -> NDArray[np.float32]:
        """Return the numbers (n,) of another moment than the first: in the middle of the times, or drawn."""
        middle = len(self.times) // 2
        scene = self.scenes[middle] if middle else drawn(self.scenes[0], self.kinds, 0)
        return self.inputs(settings).values(scene)

    def facts(self, programs: PathPrograms) -> dict[str, Any]:
        """Return what a manifest says of the numbers of a path kernel with these programs."""
        listed = []
        for each in numbers_of(programs):
            # A place that a host knows how to compute comes first.
            places = sorted(each["places"], key=lambda place: formula_of(place["table"]) is None)
            listed.append({**each, "places": places, "formula": formula_of(places[0]["table"])})
        shape = [len(self.times), len(listed)]
        rows = {"file": f"path/{ROWS_NAME}", "shape": shape, "format": "little-endian float32, a row a time"}
        return {"moving": list(self.kinds), "list": listed, "times": list(self.times), "rows": rows}


def drawn(scene: Scene, kinds: Collection[str], number: int) -> Scene:
    """Return the scene with drawn values of what moves, apart from time; another number draws others."""
    words = rng.counter(np.arange(MOST_DRAWS))
    shares, *_ = rng.uniforms(rng.counter(number), words, rng.counter(0), rng.counter(0), np.float64)
    draw = iter(shares.tolist())
    if CAMERA in kinds:
        camera = scene.camera
        view = camera.vertical_fov_deg * (0.8 + 0.4 * next(draw))
        places = {"position": _moved(camera.position, draw), "look_at": _moved(camera.look_at, draw)}
        scene = replace(scene, camera=replace(camera, **places, vertical_fov_deg=view))
    if LIGHTS in kinds:
        lights = []
        for light in scene.lights:
            color = (0.1 + next(draw), 0.1 + next(draw), 0.1 + next(draw))
            lights.append(replace(light, color=color, power=light.power * (0.5 + next(draw))))
        scene = replace(scene, lights=tuple(lights))
    if POSITIONS in kinds:
        shapes: dict[str, Any] = {
            kind: tuple(replace(one, **{at: _moved(getattr(one, at), draw)}) for one in getattr(scene, kind))
            for kind, at in PLACES.items()
        }
        scene = replace(scene, **shapes)
    return scene


PLACES: Mapping[str, str] = {"boxes": "center", "spheres": "center", "quads": "corner", "lights": "corner"}
"""What says where a primitive is, by its kind."""

FARTHEST = 0.2
"""How far a drawn position is from the scene's own, at most, in scene units."""

MOST_DRAWS = 2**16
"""Numbers that a scene may draw: its primitives are far fewer."""


def _moved(place: tuple[float, float, float], draw: Iterator[float]) -> tuple[float, float, float]:
    """Return a place near another."""
    x, y, z = (value + FARTHEST * (2 * next(draw) - 1) for value in place)
    return x, y, z
