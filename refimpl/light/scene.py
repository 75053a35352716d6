"""Scenes as frozen data, and their JSON form, validated at the border.

A scene has a pinhole camera, a constant background radiance or a sky, at most one room, and any number of
boxes, spheres, quads and area lights. Lengths are in scene units, colours are linear RGB. Coordinates are
right-handed with y up.

1. [`from_json`] reads a text, refuses what breaks a rule with the path of the value
   (`scene.boxes[2].rotation`), and returns a [`Scene`]; [`validate`] applies the same rules to a scene made
   in Python.
2. [`to_json`] writes the canonical text: `from_json(to_json(s)) == s`.
3. [`scene_digest`] names a scene by the SHA-256 of that text.

Inside, nothing is checked again.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable
from dataclasses import dataclass, field, fields, is_dataclass
from typing import Any

from ..errors import NO_VALUE, InputError, choice
from ..reading import parse_json, to_dataclass
from .materials import MATERIALS, Material
from .shapes import SHAPES, Shape
from .shapes import Box as Box
from .shapes import Light as Light
from .shapes import Quad as Quad
from .shapes import Sphere as Sphere
from .shapes.box import IDENTITY as IDENTITY
from .shapes.shape import BLACK, OMITTED, length, require, spans_area
from .shapes.shape import Matrix as Matrix
from .shapes.shape import Vector as Vector

FORMAT = "wamnet-scene"
"""Value of the JSON key `format`, by which a scene file is recognised."""

VERSION = 1
"""Version of the JSON form; readers refuse others."""

LARGEST_NUMBER = 1e12
"""Largest magnitude of any number of a scene: squares of such distances are far from float32's overflow."""

LARGEST_CONCENTRATION = 1e6
"""Largest concentration of a sun's lobe: it is then 0.05 degrees wide, and float32 still resolves it."""

WALLS = ("low_x", "high_x", "low_y", "high_y", "low_z", "high_z")
"""Order of a room's walls: 2 * axis + (1 at the high end). `low_y` is the floor."""


@dataclass(frozen=True)
class Camera:
    """Pinhole camera at `position` looking at `look_at`; `vertical_fov_deg` spans the image's height."""

    position: Vector
    look_at: Vector
    up: Vector = (0.0, 1.0, 0.0)
    vertical_fov_deg: float = 40.0


@dataclass(frozen=True)
class Room:
    """Axis-aligned box seen from inside: a wall is only there for rays that leave through it.

    A camera outside therefore looks in through the near walls. `reflectances` follow the order of [`WALLS`],
    as do `materials`, of which there are six or none."""

    low: Vector
    high: Vector
    reflectances: tuple[Vector, Vector, Vector, Vector, Vector, Vector]
    emission: Vector = BLACK
    materials: tuple[Material | None, ...] = field(default=(), metadata=OMITTED)


@dataclass(frozen=True)
class Sky:
    """Light from infinitely far, in place of a constant background: a gradient and a soft sun.

    zenith, horizon and ground are radiances straight up, level, and straight down; between them radiance is
    linear in the height of the direction. The sun's lobe around `sun_direction` sends `sun_irradiance` (W /
    m^2 per channel) onto a surface that faces it; `sun_concentration` k makes it narrow: half of its light
    comes from within 1 - cos = 1 / (1 + k)."""

    zenith: Vector
    horizon: Vector
    ground: Vector
    sun_direction: Vector = (0.0, 1.0, 0.0)
    sun_irradiance: Vector = BLACK
    sun_concentration: float = 1000.0


@dataclass(frozen=True)
class Scene:
    """Everything that a picture depends on except its size, samples and seed."""

    name: str
    camera: Camera
    room: Room | None = None
    boxes: tuple[Box, ...] = ()
    spheres: tuple[Sphere, ...] = ()
    quads: tuple[Quad, ...] = ()
    lights: tuple[Light, ...] = ()
    background: Vector = BLACK
    environment: Sky | None = field(default=None, metadata=OMITTED)
    info: dict[str, str] = field(default_factory=dict, compare=False)


# -----------------------------------------------------------------------------------------------------------
# JSON out


def to_json(scene: Scene) -> str:
    """Return the canonical JSON text of a scene: fixed key order, shortest numbers that round-trip."""
    data = {"format": FORMAT, "version": VERSION, **_plain(scene)}
    return json.dumps(data, indent=1, allow_nan=False) + "\n"


def scene_digest(scene: Scene) -> str:
    """Return the SHA-256, in hexadecimal, of the scene's canonical JSON without its free-form `info`."""
    data = _plain(scene)
    del data["info"]
    return hashlib.sha256(json.dumps(data, allow_nan=False).encode()).hexdigest()


def _plain(value: Any) -> Any:
    """Turn dataclasses and tuples into dictionaries and lists, and every number into a float."""
    if is_dataclass(value):
        kind = {"kind": value.kind} if isinstance(value, Material) else {}
        parts = ((f, getattr(value, f.name)) for f in fields(value))
        # [`OMITTED`] fields are in the text only where they differ from their default.
        named = {f.name: _plain(each) for f, each in parts if not (f.metadata and each == f.default)}
        return {**kind, **named}
    if isinstance(value, tuple):
        return [_plain(item) for item in value]
    return float(value) if isinstance(value, int) else value


# -----------------------------------------------------------------------------------------------------------
# JSON in


def from_json(text: str | bytes) -> Scene:
    """Return the scene in a JSON text, which may be a file's bytes.

    Raises InputError, with the path of the value, where it breaks a rule.
    """
    data = parse_json(text, "scene", "fix the text: a scene is a JSON object")
    if not isinstance(data, dict):
        raise InputError("scene", data, "must be a JSON object", "take one from `wamnet scene`")
    form, version = data.pop("format", None), data.pop("version", None)
    if form != FORMAT:
        raise InputError("scene.format", form, f"must be {FORMAT!r}", "check that the file is a scene")
    if version is True or version != VERSION:
        rule = f"must be {VERSION}"
        raise InputError("scene.version", version, rule, "convert the file or update wamnet")
    return validate(to_dataclass(Scene, data, "scene", largest=LARGEST_NUMBER, special={Material: _material}))


def _material(value: Any, path: str) -> Material:
    """Make a material from a JSON object with its `kind`."""
    if not isinstance(value, dict):
        raise InputError(path, value, "must be a JSON object", 'give a kind: {"kind": "mirror"}')
    data = dict(value)
    kind = data.pop("kind", None)
    if not isinstance(kind, str) or kind not in MATERIALS:
        if "kind" not in value:
            raise InputError(f"{path}.kind", NO_VALUE, "missing", f"choose one of {', '.join(MATERIALS)}")
        raise InputError(f"{path}.kind", kind, "unknown material", choice(str(kind), MATERIALS))
    return to_dataclass(MATERIALS[kind], data, path, largest=LARGEST_NUMBER)


# -----------------------------------------------------------------------------------------------------------
# Rules


def validate(scene: Scene) -> Scene:
    """Return the scene itself, or raise InputError with the path of the first value that breaks a rule."""
    _check_camera(scene.camera)
    _check_finite(scene.background, "scene.background")
    _check_light(scene.background, "scene.background", "radiance")
    if scene.environment is not None:
        _check_sky(scene.environment, scene.background)
    for path, part in _parts(scene):
        _check_fields(part, path)
        if not isinstance(part, Light):
            _check_light(part.emission, f"{path}.emission", "emission")
        if isinstance(part, Shape):
            _check_share(part.reflectance, f"{path}.reflectance")
            _check_material(part.material, f"{path}.material", has_inside=part.closed)
        if isinstance(part, Room):
            _check_room(part, path)
        else:
            part.check(path)
    return scene


def primitives(scene: Scene) -> int:
    """Return the number of shapes and lights, all but the room."""
    return sum(len(getattr(scene, kind)) for kind in _lists())


def _lists() -> tuple[str, ...]:
    """Return the names of a scene's lists."""
    return (*SHAPES, "lights")


def _parts(scene: Scene) -> Iterable[tuple[str, Any]]:
    """Yield (path, primitive) for all of the scene's primitives."""
    if scene.room is not None:
        yield "scene.room", scene.room
    for kind in _lists():
        for i, part in enumerate(getattr(scene, kind)):
            yield f"scene.{kind}[{i}]", part


def _check_fields(part: Any, path: str) -> None:
    """Refuse NaN and infinities anywhere in a primitive."""
    for f in fields(part):
        _check_finite(getattr(part, f.name), f"{path}.{f.name}")


def _check_finite(value: Any, path: str) -> None:
    rule = f"all values must be finite and at most {LARGEST_NUMBER:g} in magnitude"
    require(all(abs(x) <= LARGEST_NUMBER for x in _numbers(value)), value, path, rule, "fix the number")


def _check_light(value: Vector, path: str, what: str) -> None:
    require(min(value) >= 0.0, value, path, f"{what} must not be negative", "use 0 or more")


def _check_share(value: Vector, path: str) -> None:
    rule, way_out = "a reflectance must lie in [0, 1]", "energy cannot grow: scale it down"
    require(min(value) >= 0.0 and max(value) <= 1.0, value, path, rule, way_out)


def _check_camera(camera: Camera) -> None:
    path, fov, target = "scene.camera", camera.vertical_fov_deg, camera.look_at
    _check_fields(camera, path)
    rule, way_out = "must lie between 0 and 180", "40 is a usual angle"
    require(0.0 < fov < 180.0, fov, f"{path}.vertical_fov_deg", rule, way_out)
    x, y, z = (b - a for a, b in zip(camera.position, target, strict=True))
    forward = (x, y, z)
    require(
        length(forward) != 0.0, target, f"{path}.look_at", "must differ from position", "move one of them"
    )
    rule, way_out = "must not be parallel to the view", "choose another up"
    require(spans_area(forward, camera.up), camera.up, f"{path}.up", rule, way_out)


def _check_sky(sky: Sky, background: Vector) -> None:
    path, sun, narrow = "scene.environment", sky.sun_direction, sky.sun_concentration
    _check_fields(sky, path)
    for name in ("zenith", "horizon", "ground", "sun_irradiance"):
        _check_light(getattr(sky, name), f"{path}.{name}", "light")
    require(length(sun) != 0.0, sun, f"{path}.sun_direction", "must not be zero", "straight up is 0, 1, 0")
    rule, way_out = f"must lie in [0, {LARGEST_CONCENTRATION:g}]", "1000 is a sun in haze"
    require(0.0 <= narrow <= LARGEST_CONCENTRATION, narrow, f"{path}.sun_concentration", rule, way_out)
    rule, way_out = "an environment takes the background's place", "make it 0, or remove the environment"
    require(max(background) <= 0.0, background, "scene.background", rule, way_out)


def _check_room(room: Room, path: str) -> None:
    for i, (low, high) in enumerate(zip(room.low, room.high, strict=True)):
        require(low < high, high, f"{path}.high[{i}]", f"must exceed low[{i}] = {low}", "swap or move them")
    for i, reflectance in enumerate(room.reflectances):
        _check_share(reflectance, f"{path}.reflectances[{i}]")
    count, rule = len(room.materials), "must be six or none"
    way_out = "use null for matte walls"
    require(count in (0, len(WALLS)), f"{count} entries", f"{path}.materials", rule, way_out)
    for i, material in enumerate(room.materials):
        _check_material(material, f"{path}.materials[{i}]", has_inside=False)


def _check_material(material: Material | None, path: str, has_inside: bool) -> None:
    if material is None:
        return
    rule = "light passes only into closed bodies"
    way_out = "give it to a box or a sphere; use a thin box for a pane"
    require(has_inside or not material.transmits, material.kind, path, rule, way_out)
    _check_fields(material, path)
    material.check(path)


def _numbers(value: Any) -> Iterable[float]:
    """Yield all numbers in nested tuples."""
    if isinstance(value, tuple):
        for item in value:
            yield from _numbers(item)
    elif isinstance(value, (int, float)):
        yield value
