"""A scene for other formats: plain parts, numbers as text, and what cannot be said.

1. [`parts_of`] gives boxes, spheres and sheets; a room is six sheets, and each lamp one that emits to its
   front.
2. A writer refuses what its format cannot say with [`NotExpressed`], and the cases are "not tested" for that
   reason. Nothing is left out in silence.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...refimpl.light.materials import Conductor, Dielectric, Material, Mirror
from ...refimpl.light.scene import Box, Camera, Scene, Sphere
from ...refimpl.light.shapes.quad import light_radiance
from ..bench.peers.peer_mitsuba import room_walls

Array = NDArray[np.float64]

MATTE, MIRROR, METAL, GLASS = "matte", "mirror", "metal", "glass"
"""Kinds of surfaces."""

KINDS: dict[type[Material], str] = {Mirror: MIRROR, Conductor: METAL, Dielectric: GLASS}
"""Kinds by material; a surface without one is matte, and so is any other material."""


class NotExpressed(Exception):
    """What a format cannot say of a scene, in a few words."""


@dataclass(frozen=True)
class Look:
    """A surface: its kind, reflectance and emission (3,), and the material's number (roughness or index)."""

    kind: str
    reflectance: tuple[float, ...]
    emission: tuple[float, ...]
    number: float

    @property
    def emits(self) -> bool:
        """Tell whether it emits."""
        return any(self.emission)


@dataclass(frozen=True)
class Sheet:
    """A parallelogram: corner and edges (3,); `front`: it emits only to the side of edge_u x edge_v."""

    corner: Array
    edge_u: Array
    edge_v: Array
    look: Look
    front: bool = False

    @property
    def corners(self) -> Array:
        """The corners (4, 3), counter-clockwise as seen from the front."""
        u, v = self.edge_u, self.edge_v
        return np.stack([self.corner, self.corner + u, self.corner + u + v, self.corner + v])


@dataclass(frozen=True)
class Parts:
    """All surfaces of a scene by shape, the closed ones with their looks."""

    sheets: tuple[Sheet, ...]
    boxes: tuple[tuple[Box, Look], ...]
    spheres: tuple[tuple[Sphere, Look], ...]


def parts_of(scene: Scene) -> Parts:
    """Return the parts of a scene; a sky that is not the same everywhere is not expressed by any writer."""
    if scene.environment is not None:
        raise NotExpressed("a sky that differs by direction")
    sheets = [
        Sheet(np.array(quad.corner), np.array(quad.edge_u), np.array(quad.edge_v), look_of(quad))
        for quad in scene.quads
    ]
    if scene.room is not None:
        room = scene.room
        looks = (Look(MATTE, r, room.emission, 0.0) for r in room.reflectances)
        walls = zip(room_walls(room), looks, strict=True)
        sheets += [Sheet(np.array(corner), u, v, look, front=True) for (corner, u, v), look in walls]
    for light in scene.lights:
        radiance = tuple(map(float, light_radiance(light)))
        look = Look(MATTE, (0.0, 0.0, 0.0), radiance, 0.0)
        corner, u, v = (np.array(each) for each in (light.corner, light.edge_u, light.edge_v))
        sheets.append(Sheet(corner, u, v, look, front=True))
    boxes = tuple((box, look_of(box)) for box in scene.boxes)
    return Parts(tuple(sheets), boxes, tuple((ball, look_of(ball)) for ball in scene.spheres))


def look_of(part: Any) -> Look:
    """Return the look of a box, a sphere or a quad."""
    kind = KINDS.get(type(part.material), MATTE)
    number = 0.0 if part.material is None or part.material.parameter is None else part.material.parameter
    return Look(kind, part.reflectance, part.emission, float(number))


def axes_of(box: Box) -> Array:
    """Return the map (3, 4) from the cube [-1, 1]^3 to a box: columns are half axes, and the centre."""
    return np.column_stack([np.array(box.rotation).T * box.half_extent, box.center])


def frame_of(camera: Camera) -> Array:
    """Return right, up, back and position of a camera as columns (3, 4)."""
    forward = np.subtract(camera.look_at, camera.position)
    forward = forward / np.linalg.norm(forward)
    right = np.cross(forward, camera.up)
    right = right / np.linalg.norm(right)
    return np.column_stack([right, np.cross(right, forward), -forward, camera.position])


def text(values: Iterable[float], between: str = ", ") -> str:
    """Return numbers that read back as they are."""
    return between.join(repr(float(value)) for value in values)
