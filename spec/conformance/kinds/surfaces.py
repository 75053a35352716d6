"""Kinds of surfaces: rays against boxes and rooms, with the normals that they are given."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from ....refimpl.light import intersection
from ....refimpl.light.scene import Box, Camera, Light, Quad, Room, Scene, Sphere
from ....refimpl.light.shapes.box import slabs
from ....refimpl.light.shapes.shape import inverse
from ..functions import Field, Function, Numbers
from .light import RAY_FIELDS, T, _aimed

GRAY = (0.5, 0.5, 0.5)
"""A reflectance, which these cases do not ask for."""

EYE = Camera((0.0, 0.0, 4.0), (0.0, 0.0, 0.0))
"""A camera, which they do not ask for either."""

HALVES = ((0.8, 0.6, 0.0), (-0.6, 0.8, 0.0), (0.0, 0.0, 1.0))
"""A rotation about z."""

LEVEL = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
"""The rotation of what is parallel to the axes."""

BOX = Box((0.25, -0.5, 0.125), (0.5, 0.75, 1.0), GRAY, LEVEL)
"""The box of all rays."""

TURNED = Box((0.25, -0.5, 0.125), (0.5, 0.75, 1.0), GRAY, HALVES)
"""The same one, turned."""

ROOM = Room((-2.0, -1.0, -3.0), (2.0, 1.5, 3.0), (GRAY,) * 6)
"""The room of all rays."""

MIXED = Scene(
    "mixed",
    EYE,
    boxes=(Box((0.0, -0.5, 0.0), (1.0, 0.5, 1.0), GRAY, LEVEL),),
    spheres=(Sphere((0.0, 0.5, 0.0), 0.5, GRAY),),
    quads=(Quad((-1.0, 1.0, -1.0), (2.0, 0.0, 0.0), (0.0, 0.0, 2.0), GRAY),),
)
"""A sphere between a box and a quad, which it touches."""

FOUND = {**T, "normal": Field("unit normal against the ray; 0 where nothing is hit", 3, clause="ISC-8")}
"""What the answers hold."""


def _met(scene: Scene) -> Any:
    """Return the function from rays to distance, normal and number of the surface."""

    def call(given: Numbers, dtype: Any) -> dict[str, Any]:
        geometry = intersection.build(scene, dtype)
        hit = intersection.closest_hit(geometry, given["origin"], given["direction"])
        surface = intersection.surface_at(geometry, hit, given["origin"], given["direction"])
        return {"t": hit.t, "normal": surface.normal, "surface": hit.surface.astype(dtype)}

    return call


def _ray(origin: Any, direction: Any) -> dict[str, Any]:
    """Return the inputs of a ray, its direction made a unit one."""
    vector = np.array(direction, np.float64)
    return {"origin": origin, "direction": vector / np.sqrt(vector @ vector)}


def _slabs(given: Numbers, dtype: Any) -> dict[str, Any]:
    """Return where a ray enters and leaves each slab."""
    half = np.asarray(BOX.half_extent, dtype)
    enter, leave = slabs(np.asarray(BOX.center, dtype), half, given["origin"], inverse(given["direction"]))
    return {"enter": enter, "leave": leave}


def _nearly_parallel() -> Iterator[tuple[str, Numbers, str]]:
    """Yield rays with one component that is near 0, of either sign, or zero, on each axis."""
    for axis in range(3):
        for component in (-1e-16, 1e-16, -9e-16, 9e-16, -2e-15, 2e-15, -1e-9, 0.0, -0.0):
            direction = np.roll((0.0, 0.6, -0.8), axis)
            direction[axis] = component
            note = f"a component {'xyz'[axis]} of {component:g}"
            yield note, {"origin": (0.5, 0.0, 4.0), "direction": direction}, "ISC-5"


SLABS = Function(
    "intersection.slabs",
    f"The slabs of the box around {BOX.center} with the half extents {BOX.half_extent}",
    "ISC-3",
    RAY_FIELDS,
    {
        "enter": Field("distances at which the ray enters the slabs of x, y and z", 3),
        "leave": Field("distances at which it leaves them", 3),
    },
    _slabs,
    [
        ("at right angles to no slab", _ray((3.0, 2.0, 4.0), (-2, -1, -2))),
        ("from inside", _ray((0.5, -0.25, 0.5), (2, -1, 2))),
        ("parallel to two slabs, outside one", _ray((2.0, -0.5, 4.0), (0, 0, -1)), "ISC-5"),
        ("a component that is the other zero", _ray((0.5, -0.25, 4.0), (-0.0, 0.0, -1)), "ISC-5"),
        *_nearly_parallel(),
    ],
    _aimed,
    draws=4,
)
"""Rays and slabs."""

BOXES = Function(
    "intersection.box",
    f"The box around {BOX.center} with the half extents {BOX.half_extent}, parallel to the axes",
    "ISC-4",
    RAY_FIELDS,
    FOUND,
    _met(Scene("box", EYE, boxes=(BOX,))),
    [
        ("from outside", _ray((0.25, -0.5, 4.0), (0, 0, -1))),
        ("from inside: the exit, with a normal that faces the ray", _ray(BOX.center, (0, 1, 0))),
        ("parallel to two slabs, outside one", _ray((2.0, -0.5, 4.0), (0, 0, -1)), "ISC-5"),
        ("behind the ray", _ray((0.25, -0.5, 4.0), (0, 0, 1))),
        ("along a face", _ray((0.75, -0.5, 4.0), (0, 0, -1))),
        ("through an edge", _ray((2.75, 0.25, 0.125), (-1, 0, 0))),
        ("into a corner", _ray((2.75, 2.25, 3.125), (-1, -1, -1))),
        ("a component that is the other zero", _ray((0.25, -0.5, 4.0), (-0.0, 0.0, -1)), "ISC-5"),
        ("on a face, leaving", _ray((0.75, -0.5, 0.125), (1, 0, 0))),
        ("on a face, entering", _ray((0.75, -0.5, 0.125), (-1, 0, 0))),
        ("into an edge of y and z", _ray((0.25, 2.25, 3.125), (0, -1, -1))),
        ("into an edge of x and z", _ray((2.75, -0.5, 3.125), (-1, 0, -1))),
        ("out of a corner", _ray((0.25, -0.25, -0.375), (0.5, 0.5, 1.5))),
    ],
    _aimed,
    decided=[
        # At x = 0.75 the ray enters at (2 - 0.5)/|d|, and leaves at (0.75 + 0.75)/|d| through y = 0.25.
        ("through an edge, where entry and exit are equal", _ray((2.25, -1.25, 0.125), (-1, 1, 0)), "ISC-4"),
        # 0.5/|d| - 0.5/|d| is 0 whatever 1/|d| is rounded to.
        ("from a face into the box: the entry is 0", _ray((0.75, -0.5, 0.125), (-1, 0, 0)), "ISC-4"),
        ("from a face, aslant", _ray((0.75, -0.5, 0.125), (-0.6, 0.0, 0.8)), "ISC-4"),
        ("from a face out of the box: the exit is 0", _ray((0.75, -0.5, 0.125), (1, 0, 0)), "ISC-4"),
        ("out of an edge of x and y", _ray((0.0, -0.5, 0.125), (1, 1, 0)), "ISC-8"),
    ],
)
"""Rays and a box."""

TURNED_BOXES = Function(
    "intersection.turned_box",
    f"The same box turned: its axes are {HALVES}",
    "VEC-4",
    RAY_FIELDS,
    FOUND,
    _met(Scene("turned box", EYE, boxes=(TURNED,))),
    [
        ("into a part that is beside it if it is turned the other way", _ray((0.19, 0.33, 4.0), (0, 0, -1))),
        ("past it, where it would be if it were", _ray((0.31, 0.33, 4.0), (0, 0, -1))),
        ("from outside", _ray((0.25, -0.5, 4.0), (0, 0, -1))),
        ("from inside", _ray(BOX.center, (0, 1, 0))),
    ],
    _aimed,
)
"""Rays and a turned box."""

ROOMS = Function(
    "intersection.room",
    f"The room from {ROOM.low} to {ROOM.high}, seen from inside and outside",
    "SCN-2",
    RAY_FIELDS,
    {**FOUND, "surface": Field("number of the wall; 6 where nothing is hit", clause="ISC-13")},
    _met(Scene("room", EYE, ROOM)),
    [
        ("from inside to the right wall", _ray((0, 0, 0), (1, 0, 0))),
        ("from inside to the floor", _ray((0, 0, 0), (0.5, -1, 0))),
        ("from outside: the near wall is not there", _ray((0, 0, 8), (0, 0, -1))),
        ("from outside, past it", _ray((5, 0, 8), (0, 0, -1))),
        ("into a corner: the first axis wins", _ray((0, 0.25, 0), (2, 1.25, 3))),
        ("on a wall, leaving", _ray((2, 0, 0), (1, 0, 0))),
        ("into an edge of y and z", _ray((0, 0.25, 0), (0, 1.25, 3))),
        ("to the wall in front", _ray((0, 0, 0), (0.25, 0.125, -1))),
        ("to the left wall", _ray((0, 0, 0), (-1, 0.125, 0.25))),
        ("to the ceiling", _ray((0, 0, 0), (0.125, 1, 0.25))),
    ],
    _aimed,
    decided=[
        # Both exits are 3/|d|: (0 + 1)/|d| + 2/|d| is rounded as 3/|d| is.
        ("equal exits of x and z: the first axis", _ray((-1, 0.25, 0), (1, 0, 1)), "ISC-13"),
        ("equal exits of x and z, the other way", _ray((1, 0.25, 0), (-1, 0, -1)), "ISC-13"),
        ("on a wall, leaving: its exit is 0", _ray((2, 0, 0), (1, 0, 0)), "ISC-4"),
    ],
)
"""Rays and a room."""

NEAREST = Function(
    "intersection.nearest",
    f"A box around {MIXED.boxes[0].center} with the half extents {MIXED.boxes[0].half_extent}, on it a "
    f"sphere of radius {MIXED.spheres[0].radius} around {MIXED.spheres[0].center}, and a quad that touches "
    f"it from above: corner {MIXED.quads[0].corner}, edges {MIXED.quads[0].edge_u}, {MIXED.quads[0].edge_v}",
    "ISC-1",
    RAY_FIELDS,
    {**FOUND, "surface": Field("number: 0 the box, 1 the sphere, 2 the quad, 3 nothing")},
    _met(MIXED),
    [
        ("where quad and sphere touch, from above", _ray((0, 3, 0), (0, -1, 0))),
        ("between sphere and box", _ray((3, 0.5, 0), (-1, -0.125, 0))),
        ("the quad from below", _ray((0.75, 0.5, 0.75), (0, 1, 0))),
        ("nothing", _ray((0, 3, 0), (0, 1, 0))),
        ("out of the sphere, from beyond its middle", _ray((0, 0.5, 0.25), (0, 0, 1)), "ISC-6"),
        ("into the far corner of the quad, which belongs to it", _ray((1, 3, 1), (0, -1, 0)), "ISC-7"),
    ],
    _aimed,
)
"""Rays and a scene."""

HALL = replace(
    MIXED,
    name="hall",
    room=Room((-3.0, -1.0, -3.0), (3.0, 3.0, 3.0), (GRAY,) * 6),
    lights=(Light((-0.5, 2.0, -0.5), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0), GRAY, 1.0),),
)
"""The same shapes and a light in a room."""


def _occluded(given: Numbers, dtype: Any) -> dict[str, Any]:
    """Return 1 where something is nearer than a distance."""
    geometry = intersection.build(HALL, dtype)
    found = intersection.occluded(geometry, given["origin"], given["direction"], given["distance"])
    one = np.ones_like(given["distance"])
    return {"occluded": np.where(found, one, 0.0 * one)}


def _shadow(origin: Any, direction: Any, distance: float) -> dict[str, Any]:
    """Return the inputs of a ray and a distance on it."""
    return {**_ray(origin, direction), "distance": distance}


OCCLUDED = Function(
    "intersection.occluded",
    "Whether anything is between two points: the scene of intersection.nearest in a room from "
    f"{HALL.room.low} to {HALL.room.high}, with a light: "  # type: ignore[union-attr]
    f"corner {HALL.lights[0].corner}, edges {HALL.lights[0].edge_u}, {HALL.lights[0].edge_v}",
    "ISC-10",
    {**RAY_FIELDS, "distance": Field("distance of the other point", 0, 0.0, 100.0)},
    {"occluded": Field("1 if something is nearer than it, else 0")},
    _occluded,
    [
        ("a light in front, seen from below", _shadow((0, 1.5, 0), (0, 1, 0), 0.75)),
        ("a light in front, seen from above", _shadow((0, 2.5, 0), (0, -1, 0), 0.75)),
        ("the same light, farther than the point", _shadow((0, 1.5, 0), (0, 1, 0), 0.25)),
        ("past the light", _shadow((0.75, 1.5, 0), (0, 1, 0), 1.25)),
        ("past the light, to a point beyond the ceiling", _shadow((0.75, 1.5, 0), (0, 1, 0), 1.75)),
        ("a wall in front", _shadow((0, 1.5, 2), (1, 0, 0), 3.25)),
        ("a wall, farther than the point", _shadow((0, 1.5, 2), (1, 0, 0), 2.75)),
        ("from outside: the near wall is not there", _shadow((0, 1.5, 5), (0, 0, -1), 4.0)),
        ("a box in front", _shadow((2, -0.5, 0.25), (-1, 0, 0), 1.5)),
        ("a box, farther than the point", _shadow((2, -0.5, 0.25), (-1, 0, 0), 0.75)),
        ("a box around the point", _shadow((0.25, -0.5, 0.25), (1, 0, 0), 1.5)),
        ("a box behind the ray", _shadow((2, -0.5, 0.25), (1, 0, 0), 0.75)),
        ("a sphere in front", _shadow((2, 0.5, 0.25), (-1, 0, 0), 2.0)),
        ("a sphere, farther than the point", _shadow((2, 0.5, 0.25), (-1, 0, 0), 1.25)),
        ("a sphere around the point", _shadow((0, 0.5, 0.25), (0, 0, 1), 0.5)),
        ("a quad in front, from below", _shadow((0.75, 0.5, 0.75), (0, 1, 0), 1.0)),
        ("a quad in front, from above", _shadow((0.75, 1.75, 0.75), (0, -1, 0), 1.0)),
        ("a quad, farther than the point", _shadow((0.75, 0.5, 0.75), (0, 1, 0), 0.25)),
        ("on the quad, leaving", _shadow((0.75, 1.0, 0.75), (0, 1, 0), 0.5)),
    ],
    lambda u: {**_aimed(u), "distance": 8.0 * u[7]},
)
"""Rays and what is between two points."""

FUNCTIONS = (SLABS, BOXES, TURNED_BOXES, ROOMS, NEAREST, OCCLUDED)
"""The functions of this module."""
