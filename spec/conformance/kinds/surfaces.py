"""Kinds of surfaces: rays against boxes and rooms, with the normals that they are given."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from ....refimpl.light import intersection
from ....refimpl.light.scene import Box, Camera, Light, Quad, Room, Scene, Sphere
from ....refimpl.light.shapes.box import slabs
from ....refimpl.light.shapes.shape import inverse
from ..functions import Numbers
from .tables import function

GRAY = (0.5, 0.5, 0.5)
"""A reflectance, which these cases do not depend on."""

EYE = Camera((0.0, 0.0, 4.0), (0.0, 0.0, 0.0))
"""A camera, which they do not depend on either."""

HALVES = ((0.8, 0.6, 0.0), (-0.6, 0.8, 0.0), (0.0, 0.0, 1.0))
"""A rotation about z."""

LEVEL = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
"""The rotation of what is parallel to the axes."""

BOX = Box((0.25, -0.5, 0.125), (0.5, 0.75, 1.0), GRAY, LEVEL)
"""The box of all rays."""

MIXED = Scene(
    "mixed",
    EYE,
    boxes=(Box((0.0, -0.5, 0.0), (1.0, 0.5, 1.0), GRAY, LEVEL),),
    spheres=(Sphere((0.0, 0.5, 0.0), 0.5, GRAY),),
    quads=(Quad((-1.0, 1.0, -1.0), (2.0, 0.0, 0.0), (0.0, 0.0, 2.0), GRAY),),
)
"""A sphere between a box and a quad, which it touches."""

HALL = replace(
    MIXED,
    name="hall",
    room=Room((-3.0, -1.0, -3.0), (3.0, 3.0, 3.0), (GRAY,) * 6),
    lights=(Light((-0.5, 2.0, -0.5), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0), GRAY, 1.0),),
)
"""The same shapes and a light in a room."""

SCENES = {
    "intersection.box": Scene("box", EYE, boxes=(BOX,)),
    "intersection.turned_box": Scene("turned box", EYE, boxes=(replace(BOX, rotation=HALVES),)),
    "intersection.room": Scene("room", EYE, Room((-2.0, -1.0, -3.0), (2.0, 1.5, 3.0), (GRAY,) * 6)),
    "intersection.nearest": MIXED,
}
"""What the rays of each kind meet; the titles say it too."""


def _met(scene: Scene) -> Any:
    """Return the function from rays to distance, normal and number of the surface."""

    def call(given: Numbers, dtype: Any) -> dict[str, Any]:
        geometry = intersection.build(scene, dtype)
        hit = intersection.closest_hit(geometry, given["origin"], given["direction"])
        surface = intersection.surface_at(geometry, hit, given["origin"], given["direction"])
        return {"t": hit.t, "normal": surface.normal, "surface": hit.surface.astype(dtype)}

    return call


def _slabs(given: Numbers, dtype: Any) -> dict[str, Any]:
    """Return where a ray enters and leaves each slab."""
    half = np.asarray(BOX.half_extent, dtype)
    enter, leave = slabs(np.asarray(BOX.center, dtype), half, given["origin"], inverse(given["direction"]))
    return {"enter": enter, "leave": leave}


def _occluded(given: Numbers, dtype: Any) -> dict[str, Any]:
    """Return 1 where something is nearer than a distance."""
    geometry = intersection.build(HALL, dtype)
    found = intersection.occluded(geometry, given["origin"], given["direction"], given["distance"])
    one = np.ones_like(given["distance"])
    return {"occluded": np.where(found, one, 0.0 * one)}


FUNCTIONS = (
    function("intersection.slabs", _slabs),
    *(function(name, _met(scene)) for name, scene in SCENES.items()),
    function("intersection.occluded", _occluded),
)
"""The functions of this module."""
