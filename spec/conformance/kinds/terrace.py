"""Scenes of the vectors' own, with what the canonical ones lack.

1. [`TERRACE`]: lamps and a sky together, one lamp seen from behind, surfaces that emit without being lamps,
   boxes whose rotations alternate (so that their numbers differ from their order), glass between a lamp and a
   floor.
2. [`FOUNDRY`]: a metal as the first kind of material, a lamp seen at a grazing angle and lit by another one,
   a background, and a camera that is rolled.
3. [`YARD`]: a room seen from outside, whose walls are of several materials and shine; blocks that share a
   rotation, channels that reflect nothing, a black ball, and a lamp without power among others.
4. [`MIRRORS`]: single directions only, so that light is never sampled, under a lamp and a sky.
5. [`BARE`]: a lamp and nothing else.
6. [`NIGHT`]: three lamps under a sky that is black.
7. [`DARK`]: lamps without power or colour.
8. [`PLATE`]: a matte floor under a distant lamp, whose samples hardly differ.
9. [`LENS`], [`PANE`] and [`BUBBLE`]: glass as the first of two kinds of material, the second, and by itself.
10. [`OVERCAST`]: a sky without a sun by a lamp without power; [`SHEET`]: a turned box whose centre cancels.
11. [`GLOW`]: no lamp and no sky, and a surface of each kind and material that emits; [`DUSK`] is the same
    with a lamp in it.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from ....refimpl.light.materials import Conductor, Dielectric, Mirror
from ....refimpl.light.scene import Box, Camera, Light, Quad, Room, Scene, Sky, Sphere

TURN = ((0.8, 0.0, 0.6), (0.0, 1.0, 0.0), (-0.6, 0.0, 0.8))
"""A rotation about y."""

TERRACE = Scene(
    "terrace",
    Camera((0.0, 1.25, 4.0), (0.0, 0.5, 0.0), (0.0, 1.0, 0.0), 50.0),
    boxes=(
        Box((-1.125, 0.3125, -0.25), (0.25, 0.3125, 0.25), (0.75, 0.5, 0.25)),
        Box((0.0, 0.375, -0.875), (0.375, 0.375, 0.25), (0.875, 0.75, 0.5), TURN, material=Conductor(0.3)),
        Box((1.375, 0.25, -0.5), (0.25, 0.25, 0.25), (0.25, 0.5, 0.75), emission=(0.125, 0.0, 0.25)),
        Box(
            (-0.5, 0.25, 0.875), (0.1875, 0.25, 0.1875), (0.875, 0.9375, 1.0), TURN, material=Dielectric(1.25)
        ),
    ),
    spheres=(
        Sphere((0.5, 0.4375, 0.5), 0.4375, (0.9375, 0.9375, 0.875), material=Dielectric(1.5)),
        Sphere((-0.3125, 1.5, -0.5), 0.25, (0.5, 0.25, 0.5), emission=(0.25, 0.5, 0.125)),
    ),
    quads=(
        Quad((-8.0, 0.0, -8.0), (0.0, 0.0, 16.0), (16.0, 0.0, 0.0), (0.5, 0.5, 0.375)),
        Quad((-2.5, 0.0, -1.5), (5.0, 0.0, -0.5), (0.0, 1.25, 0.0), (0.75, 0.75, 0.75), material=Mirror()),
    ),
    lights=(
        Light((0.25, 1.75, 0.25), (0.5, 0.0, 0.0), (0.0, 0.0, 0.5), (1.0, 0.75, 0.5), 12.0),
        Light((-1.25, 1.0, 0.25), (0.0, 0.5, 0.0), (0.5, 0.0, 0.125), (0.25, 0.5, 1.0), 4.0),
    ),
    environment=Sky(
        (0.125, 0.25, 0.5), (0.5, 0.5, 0.5), (0.25, 0.1875, 0.125), (1.0, 2.0, 1.0), (2.0, 1.5, 1.0), 40.0
    ),
)
"""Balls, blocks, a mirror and two lamps under a sky."""

FOUNDRY = Scene(
    "foundry",
    Camera((0.0, 1.0, 4.0), (0.0, 0.5, 0.0), (0.25, 1.0, 0.0), 50.0),
    spheres=(
        Sphere((-1.0, 0.75, 0.0), 0.5, (0.875, 0.75, 0.5), material=Conductor(0.375)),
        Sphere((1.25, 0.625, -0.5), 0.375, (0.25, 0.5, 0.75)),
    ),
    lights=(
        Light((-1.0, 0.25, 1.0), (2.0, 0.0, 0.0), (0.0, 0.0, -2.0), (1.0, 0.5, 0.25), 3.0),
        Light((-0.25, 2.5, -0.5), (0.5, 0.0, 0.0), (0.0, 0.0, 0.5), (0.5, 0.75, 1.0), 8.0),
    ),
    background=(0.0625, 0.125, 0.25),
)
"""A ball of metal and a matte one over a horizontal lamp, under another lamp."""

TILT = ((0.6, 0.0, -0.8), (0.48, 0.8, 0.36), (0.64, -0.6, 0.48))
"""A rotation about no axis of the scene."""

YARD = Scene(
    "yard",
    Camera((0.5, 1.5, 6.5), (0.0, 1.0, 0.0), (-0.5, 1.0, 0.125), 40.0),
    Room(
        (-2.0, 0.0, -2.5),
        (2.5, 3.0, 2.0),
        (
            (0.875, 0.75, 0.5),
            (0.25, 0.5, 0.75),
            (0.75, 0.75, 0.625),
            (0.5, 0.5, 0.5),
            (0.9375, 0.875, 0.875),
            (0.0, 0.0, 0.0),
        ),
        (0.015625, 0.03125, 0.0625),
        (Conductor(0.5), None, None, Conductor(0.25), Mirror(), None),
    ),
    boxes=(
        Box((0.0, 0.25, 1.25), (0.5, 0.25, 0.125), (0.0, 0.75, 0.5)),
        *(
            Box(
                (0.75 * i - 1.25, 0.5, -1.0),
                (0.1875, 0.5, 0.25),
                (0.25 + 0.125 * i, 0.625, 0.75 - 0.125 * i),
                TILT,
            )
            for i in range(4)
        ),
        Box((1.5, 1.25, -0.5), (0.375, 0.1875, 0.25), (0.9375, 1.0, 0.875), TURN, material=Dielectric(1.75)),
    ),
    spheres=(
        Sphere((-0.75, 0.4375, 0.5), 0.4375, (1.0, 0.9375, 0.875), material=Dielectric(1.3125)),
        Sphere((0.875, 0.375, 0.75), 0.375, (0.875, 0.0, 0.0)),
        Sphere((-1.5, 0.25, 1.25), 0.25, (0.0, 0.0, 0.0)),
        Sphere((0.375, 2.0, -0.75), 0.3125, (0.75, 0.875, 0.5), material=Conductor(0.125)),
    ),
    quads=(
        Quad((-1.0, 1.25, -1.5), (1.0, 0.25, 0.0), (0.0, 0.75, 0.5), (0.5, 0.25, 0.75), (0.0, 0.125, 0.0)),
        Quad(
            (1.75, 0.0, -2.0), (0.25, 0.0, 1.5), (0.0, 1.5, 0.0), (0.875, 0.9375, 0.9375), material=Mirror()
        ),
    ),
    lights=(
        Light((-0.5, 2.875, -0.5), (0.75, 0.0, 0.0), (0.0, 0.0, 1.0), (1.0, 0.75, 0.5), 20.0),
        Light((2.25, 1.0, 0.5), (0.0, 0.5, 0.125), (0.0, 0.0, 0.5), (0.5, 1.0, 0.75), 0.0),
        Light((-1.75, 1.5, 0.0), (0.0, 0.0, -0.5), (0.125, -0.75, 0.0), (0.25, 0.5, 1.0), 6.0),
    ),
    background=(0.25, 0.125, 0.0625),
)
"""A room of metal, a mirror and plaster, with blocks, balls and lamps in it."""

MIRRORS = Scene(
    "mirrors",
    Camera((0.0, 0.75, 4.0), (0.0, 0.5, 0.0), (0.0, 1.0, 0.0), 45.0),
    spheres=(
        Sphere((-0.75, 0.5, 0.0), 0.5, (0.875, 0.75, 0.5), material=Mirror()),
        Sphere((0.625, 0.5, 0.5), 0.5, (0.9375, 1.0, 0.9375), material=Dielectric(1.5)),
    ),
    quads=(Quad((-3.0, 0.0, -3.0), (0.0, 0.0, 6.0), (6.0, 0.0, 0.0), (0.5, 0.75, 0.75), material=Mirror()),),
    lights=(Light((-0.5, 2.0, -0.5), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0), (1.0, 0.875, 0.75), 10.0),),
    environment=Sky((0.25, 0.5, 1.0), (0.5, 0.5, 0.5), (0.125, 0.125, 0.0625)),
)
"""Two balls, one of glass, on a mirror."""

BARE = Scene(
    "bare",
    Camera((0.0, 0.5, 4.0), (0.0, 0.5, 0.0), (0.0, 1.0, 0.0), 45.0),
    lights=(Light((-1.5, -0.5, 0.0), (3.0, 0.0, 0.0), (0.0, 2.0, 0.5), (1.0, 0.875, 0.75), 10.0),),
    background=(0.125, 0.25, 0.5),
)
"""A lamp and nothing that it could light."""

NIGHT = Scene(
    "night",
    Camera((0.0, 1.0, 4.0), (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), 45.0),
    quads=(Quad((-4.0, 0.0, -4.0), (0.0, 0.0, 8.0), (8.0, 0.0, 0.0), (0.75, 0.5, 0.25)),),
    lights=(
        Light((-0.5, 1.5, -0.5), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0), (1.0, 0.875, 0.75), 10.0),
        Light((2.0, 2.0, 1.0), (0.0, 0.5, 0.0), (0.0, 0.0, -0.5), (0.5, 0.875, 1.0), 5.0),
        Light((-2.0, 0.5, 1.0), (0.0, 0.5, 0.0), (0.0, 0.0, 0.5), (1.0, 0.5, 1.0), 2.0),
    ),
    environment=Sky(
        (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), sun_concentration=0.0
    ),
)
"""A floor and three lamps under a sky that does not shine."""

DARK = Scene(
    "dark",
    NIGHT.camera,
    quads=NIGHT.quads,
    lights=(replace(NIGHT.lights[0], power=0.0), replace(NIGHT.lights[1], color=(0.0, 0.0, 0.0))),
    background=(0.5, 0.25, 0.125),
)
"""A floor under two lamps, of which neither shines."""

PLATE = Scene(
    "plate",
    Camera((0.0, 2.0, 0.5), (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), 40.0),
    quads=(Quad((-4.0, 0.0, -4.0), (0.0, 0.0, 8.0), (8.0, 0.0, 0.0), (0.75, 0.5, 0.25)),),
    lights=(Light((1.0, 4.0, 1.0), (0.5, 0.0, 0.0), (0.0, 0.0, 0.5), (1.0, 0.75, 0.5), 40.0),),
)
"""A floor and a lamp."""

BALL = Sphere((0.0, 0.75, 0.0), 0.5, (0.875, 0.9375, 1.0), material=Dielectric(1.5))
"""A ball of glass."""

LENS = Scene(
    "lens",
    Camera((0.0, 4.0, 2.0), (0.0, 0.5, 0.0), (0.0, 1.0, 0.0), 40.0),
    spheres=(BALL,),
    quads=(Quad((-4.0, 0.0, -4.0), (0.0, 0.0, 8.0), (8.0, 0.0, 0.0), (0.75, 0.5, 0.25)),),
    lights=(Light((-0.5, 2.5, -0.5), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0), (1.0, 0.875, 0.75), 10.0),),
    background=(0.125, 0.25, 0.5),
)
"""A ball of glass over a matte floor."""

PANE = replace(
    LENS,
    name="pane",
    boxes=(Box((0.0, -0.125, 0.0), (2.0, 0.125, 2.0), (0.25, 0.5, 0.75)),),
    quads=(),
    background=(0.0, 0.0, 0.0),
    environment=Sky(
        (0.0078125, 0.015625, 0.03125), (0.015625,) * 3, (0.0078125,) * 3, sun_irradiance=(0.25, 0.125, 0.0)
    ),
)
"""The same ball over a matte block, which comes first, under a sky whose light sums up to less than 1."""

BUBBLE = replace(LENS, name="bubble", quads=(), lights=())
"""The ball by itself."""

LAMP = replace(LENS, name="lamp", spheres=(), quads=())
"""The lamp by itself: a scene without a material."""

OVERCAST = Scene(
    "overcast",
    NIGHT.camera,
    quads=NIGHT.quads,
    lights=(replace(NIGHT.lights[0], power=0.0),),
    environment=Sky((0.25, 0.5, 1.0), (0.5, 0.625, 0.75), (0.125, 0.125, 0.0625)),
)
"""A floor under a sky whose sun has no light, so that its share is 0, and a lamp without power."""

SHEET = Scene(
    "sheet",
    Camera((0.0, 0.0, 4.0), (0.0, 0.0, 0.0)),
    boxes=(
        Box(
            (4.02, -5.36, 0.0),
            (3.2e-15, 8.0, 1.0),
            (0.75, 0.5, 0.25),
            ((0.8, 0.6, 0.0), (-0.6, 0.8, 0.0), (0.0, 0.0, 1.0)),
        ),
    ),
    background=(0.125, 0.25, 0.5),
)
"""A turned sheet through the origin: 0.8 * 4.02 - 0.6 * 5.36 is 0, and -4.4e-16 with rounded products.
A ray along the sheet leaves it after 3.2, because the least component of a direction is 1e-15 (ISC-5)."""

SHINE: dict[str, Any] = {"reflectance": (0.5, 0.75, 0.25), "emission": (0.25, 0.5, 1.0)}
"""A surface that emits and reflects."""

GLOW = Scene(
    "glow",
    Camera((0.0, 0.5, 2.5), (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), 60.0),
    Room((-3.0, -2.0, -3.0), (3.0, 2.0, 3.0), ((0.5, 0.5, 0.5),) * 6, (0.0625, 0.125, 0.03125)),
    boxes=(
        Box((2.0, 0.0, 0.0), (0.25, 0.25, 0.25), **SHINE),
        Box((0.0, 0.0, -2.0), (0.25, 0.25, 0.25), rotation=TURN, material=Conductor(0.5), **SHINE),
        Box((-1.5, 0.0, -1.5), (0.25, 0.25, 0.25), rotation=TURN, material=Dielectric(1.5), **SHINE),
    ),
    spheres=(
        Sphere((-2.0, 0.0, 0.0), 0.25, **SHINE),
        Sphere((1.5, 0.0, -1.5), 0.25, material=Mirror(), **SHINE),
        Sphere((0.0, 0.0, 2.0), 0.25, material=Dielectric(1.5), **SHINE),
    ),
    quads=(
        Quad((-0.25, 1.0, -0.25), (0.5, 0.0, 0.0), (0.0, 0.0, 0.5), **SHINE),
        Quad((-0.25, -1.0, -0.25), (0.5, 0.0, 0.0), (0.0, 0.0, 0.5), material=Mirror(), **SHINE),
        Quad((1.25, -0.25, 1.5), (0.5, 0.0, -0.5), (0.0, 0.5, 0.0), material=Conductor(0.5), **SHINE),
    ),
)
"""A room in which only surfaces shine."""

DUSK = replace(
    GLOW,
    name="dusk",
    lights=(Light((-1.0, 1.75, 0.0), (0.5, 0.0, 0.0), (0.0, 0.0, 0.5), (1.0, 0.5, 0.25), 2.0),),
)
"""The same room with a lamp, which has weights; its surfaces have none."""
