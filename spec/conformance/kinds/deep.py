"""Scenes of the vectors' own that decide what the others leave open.

1. [`DEEP`]: a floor under a lamp far out along each axis, at negative coordinates: what is in proportion to
   the size of a place must take its magnitude.
2. [`TWINS`]: two equal boxes, balls and quads at one place: equal in their distances to the bit.
3. [`RAIL`]: a lamp beside a matte floor and a quad of metal, whose kind is the last one (SHD-1).
"""

from __future__ import annotations

from ....refimpl.light.materials.conductor import Conductor
from ....refimpl.light.scene import Box, Camera, Light, Quad, Scene, Sphere

FAR = -1000.0
"""Where the floors are, in scene units: a point of 1,000 is lifted by 64 2^-24 2,000 = 0.0076 (LTR-3)."""

EYE = Camera((0.0, 0.0, 4.0), (0.0, 0.0, 0.0))
"""A camera, which these scenes are not seen by."""

GRAY, OTHER = (0.5, 0.5, 0.5), (0.25, 0.5, 0.75)
"""Reflectances: of the first of two, and of the second."""

TURNED = ((0.8, 0.6, 0.0), (-0.6, 0.8, 0.0), (0.0, 0.0, 1.0))
"""The rotation of both boxes."""

Place = tuple[float, float, float]
"""Three numbers along the axes."""


def along(axis: int, own: float, next_one: float, last: float) -> Place:
    """Return a place by its number along an axis, and along the two after it in turn."""
    numbers = (own, next_one, last)
    x, y, z = (numbers[(k - axis) % 3] for k in range(3))
    return x, y, z


def _floor(axis: int) -> Quad:
    """Return a floor at right angles to an axis."""
    return Quad(along(axis, FAR, -2.0, -2.0), along(axis, 0.0, 4.0, 0.0), along(axis, 0.0, 0.0, 4.0), GRAY)


def _lamp(axis: int) -> Light:
    """Return the lamp one unit before it, which shines at it."""
    edges = along(axis, 0.0, 0.0, 0.5), along(axis, 0.0, 0.5, 0.0)
    return Light(along(axis, FAR + 1.0, -0.25, -0.25), *edges, (1.0, 0.75, 0.5), 40.0)


DEEP = Scene(
    "deep",
    EYE,
    quads=tuple(_floor(axis) for axis in range(3)),
    lights=tuple(_lamp(axis) for axis in range(3)),
)
"""Floors and lamps far out, the first along x."""

TWINS = Scene(
    "twins",
    EYE,
    boxes=tuple(Box((0.25, -0.5, 0.125), (0.5, 0.75, 1.0), r, TURNED) for r in (GRAY, OTHER)),
    spheres=tuple(Sphere((4.0, 0.5, 0.25), 0.75, r) for r in (GRAY, OTHER)),
    quads=tuple(Quad((-4.0, -1.0, 0.5), (1.5, 0.0, 0.25), (0.25, 2.0, 0.0), r) for r in (GRAY, OTHER)),
)
"""Two of each shape."""

RAIL = Scene(
    "rail",
    EYE,
    quads=(
        Quad((-2.0, -1.0, -2.0), (0.0, 0.0, 4.0), (4.0, 0.0, 0.0), GRAY),
        Quad((-2.0, -1.0, -2.0), (0.0, 2.0, 0.0), (0.0, 0.0, 4.0), OTHER, material=Conductor(0.25)),
    ),
    lights=(Light((-0.5, 1.0, -0.5), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0), (1.0, 0.75, 0.5), 0.25),),
)
"""A dim lamp, on which a metal's reflectance at grazing angles must not continue a path."""
