"""The canonical scenes, as functions of time and a few parameters.

`minicubes` is the kind of scene that the paper describes: a room with tinted walls, 27 mini cubes of
different colours in a 3x3x3 frame that turns with time, two coloured area lights, soft shadows. The paper
does not give its geometry; the numbers here are decisions (spec/scenes.md). `glossy` shows metal, glass and
a mirror on a turntable, `vitrine` lets metal and glass go round a mirror that turns. `cornell` is a box with
two turning blocks; `furnace`, `lone_light` and `empty` have answers in closed form."""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable
from itertools import product
from typing import Any

import numpy as np

from ..errors import InputError, choice
from .materials import Conductor, Dielectric, Mirror
from .scene import Box, Camera, Light, Matrix, Quad, Room, Scene, Sky, Sphere, Vector, validate

TURN_SECONDS = 8.0
"""Time in which the mini cubes turn once, in seconds: slow enough to follow, fast enough for a loop."""

LARGEST_TIME_S = 1e9
"""Farthest time from 0, in seconds: thirty years, where an angle is still exact to 1e-6 rad; far beyond it a
turn has no angle, and 2 pi times the time no value."""

CUBE_SPACING = 0.72
"""Distance between the centres of neighbouring mini cubes, in scene units (the room is 4 wide)."""

CUBE_HALF_EXTENT = 0.25
"""Half the edge of a mini cube, in scene units. The gaps, 0.22 wide, let light through; the turning frame,
of radius 1.68, stays inside the room."""

TILT_RAD = math.radians(28.0)
"""Tilt of the mini cubes' axis of rotation against the vertical, so that their tops are seen."""

WARM: Vector = (1.0, 0.72, 0.42)
"""Colour of the first light of `minicubes`, linear RGB, relative."""

COOL: Vector = (0.45, 0.66, 1.0)
"""Colour of the second light of `minicubes`, linear RGB, relative."""


def minicubes(time: float = 0.0, warm: Vector = WARM, cool: Vector = COOL) -> Scene:
    """Return the scene of the mini cubes at a time in seconds; light colours are parameters."""
    white, red, green = (0.74, 0.74, 0.72), (0.70, 0.26, 0.22), (0.26, 0.56, 0.30)
    room = Room((-2.0, -2.0, -2.0), (2.0, 2.0, 2.0), (red, green, white, white, (0.42, 0.46, 0.66), white))
    # The warm light hangs below the ceiling, the cool one is in front of the right wall.
    ceiling = Light((-1.1, 1.98, -0.5), (1.2, 0.0, 0.0), (0.0, 0.0, 1.2), warm, 48.0)
    side = Light((1.98, -0.6, -1.2), (0.0, 0.0, 1.0), (0.0, 1.4, 0.0), cool, 30.0)
    camera = Camera((0.0, 0.25, 6.6), (0.0, -0.05, 0.0), vertical_fov_deg=41.0)
    return Scene(
        "minicubes", camera, room, boxes=_cubes(time), lights=(ceiling, side), info={"time": repr(time)}
    )


def _cubes(time: float) -> tuple[Box, ...]:
    """Return the 27 cubes; position in the frame gives the colour."""
    rotation = _turn(2.0 * math.pi * time / TURN_SECONDS)
    half = (CUBE_HALF_EXTENT,) * 3
    boxes = []
    for cell in product((-1, 0, 1), repeat=3):
        offset = [CUBE_SPACING * c for c in cell]
        # The rows of a rotation are the box's axes: the centre is the sum of axes times offsets.
        center = tuple(sum(offset[k] * rotation[k][i] for k in range(3)) for i in range(3))
        reflectance = tuple(0.48 + 0.34 * c for c in cell)
        boxes.append(Box(center, half, reflectance, rotation))  # type: ignore[arg-type]
    return tuple(boxes)


def _turn(angle_rad: float) -> Matrix:
    """Return the box axes of the frame: turned about its own axis, which is tilted about x."""
    c, s = math.cos(angle_rad), math.sin(angle_rad)
    ct, st = math.cos(TILT_RAD), math.sin(TILT_RAD)
    return ((c, s * st, -s * ct), (0.0, ct, st), (s, -c * st, c * ct))


def glossy(time: float = 0.0, roughness: float = 0.22, ior: float = 1.5) -> Scene:
    """Return a turntable with balls of glass, gold and matte coral, blocks of copper and glass, and a mirror.

    roughness is that of the gold ball, ior that of the glass.
    """
    white, red, teal = (0.74, 0.74, 0.72), (0.66, 0.28, 0.22), (0.20, 0.46, 0.46)
    room = Room((-2.0, -2.0, -2.0), (2.0, 2.0, 2.0), (red, teal, (0.5, 0.5, 0.52), white, white, white))
    ceiling = Light((-0.9, 1.98, -0.7), (1.6, 0.0, 0.0), (0.0, 0.0, 1.6), WARM, 60.0)
    side = Light((1.98, -1.2, 0.2), (0.0, 0.0, 1.2), (0.0, 2.2, 0.0), COOL, 34.0)
    angle = 2.0 * math.pi * time / TURN_SECONDS
    turned = _about_y(angle)

    def on_table(x: float, y: float, z: float) -> Vector:
        """Return a point of the turning table, whose middle is on the floor."""
        c, s = math.cos(angle), math.sin(angle)
        return (c * x + s * z, y - 2.0, c * z - s * x)

    table = Box((0.0, -1.95, 0.0), (1.4, 0.05, 1.4), (0.62, 0.60, 0.56), turned)
    ball = Sphere(on_table(0.74, 0.68, 0.74), 0.57, (0.98, 0.98, 0.98), material=Dielectric(ior))
    gold = Sphere(on_table(-0.74, 0.68, 0.74), 0.57, (1.0, 0.78, 0.34), material=Conductor(roughness))
    coral = Sphere(on_table(0.0, 0.46, 0.0), 0.35, (0.80, 0.22, 0.16))
    copper = Box(
        on_table(0.76, 0.6, -0.76), (0.38, 0.49, 0.38), (0.93, 0.62, 0.50), turned, material=Conductor(0.08)
    )
    block = Box(
        on_table(-0.76, 0.65, -0.76), (0.36, 0.54, 0.36), (0.86, 0.95, 0.92), turned, material=Dielectric(ior)
    )
    mirror = Quad(
        (-1.6, -1.5, -1.85), (3.2, 0.0, 0.0), (0.0, 2.6, -0.12), (0.88, 0.88, 0.88), material=Mirror()
    )
    return Scene(
        "glossy",
        Camera((0.0, 1.35, 6.1), (0.0, -0.72, 0.0), vertical_fov_deg=37.0),
        room,
        boxes=(table, copper, block),
        spheres=(coral, gold, ball),
        quads=(mirror,),
        lights=(ceiling, side),
        info={"time": repr(time)},
    )


def vitrine(time: float = 0.0, roughness: float = 0.15, ior: float = 1.5) -> Scene:
    """Return a ball of brass and a block of glass that go round a mirror, which turns against them.

    roughness is that of the brass, ior that of the glass. A matte ball lies in a corner.
    """
    white, ochre, blue = (0.74, 0.74, 0.72), (0.72, 0.52, 0.22), (0.22, 0.34, 0.62)
    room = Room((-2.0, -2.0, -2.0), (2.0, 2.0, 2.0), (ochre, blue, (0.46, 0.44, 0.42), white, white, white))
    ceiling = Light((-0.8, 1.98, -0.4), (1.6, 0.0, 0.0), (0.0, 0.0, 1.2), WARM, 60.0)
    side = Light((-1.98, -0.4, 1.2), (0.0, 0.0, -1.4), (0.0, 1.6, 0.0), COOL, 34.0)
    angle = 2.0 * math.pi * time / TURN_SECONDS
    c, s, rise = math.cos(angle), math.sin(angle), 0.2 * math.sin(2.0 * angle)
    brass = Sphere((1.15 * c, rise - 0.55, 1.15 * s), 0.45, (0.92, 0.74, 0.40), material=Conductor(roughness))
    block = Box(
        (-1.15 * c, -rise - 0.55, -1.15 * s),
        (0.28, 0.46, 0.28),
        (0.90, 0.95, 0.93),
        _about_y(angle),
        material=Dielectric(ior),
    )
    mirror = Quad(
        (-0.55 * c, -1.7, 0.55 * s),
        (1.1 * c, 0.0, -1.1 * s),
        (0.0, 2.6, 0.0),
        (0.9, 0.9, 0.9),
        material=Mirror(),
    )
    coral = Sphere((-1.3, -1.65, -1.2), 0.35, (0.80, 0.24, 0.16))
    return Scene(
        "vitrine",
        Camera((0.0, 0.7, 6.2), (0.0, -0.5, 0.0), vertical_fov_deg=37.0),
        room,
        boxes=(block,),
        spheres=(coral, brass),
        quads=(mirror,),
        lights=(ceiling, side),
        info={"time": repr(time)},
    )


def daylight(time: float = 0.0, sun_concentration: float = 400.0) -> Scene:
    """Return a gold ball, a glass ball and a matte block on a plain, under a sky whose sun goes round.

    sun_concentration is that of the sun's lobe: the lower, the softer its shadows.
    """
    angle = 2.0 * math.pi * time / TURN_SECONDS
    sky = Sky(
        (0.16, 0.30, 0.62),
        (0.62, 0.70, 0.80),
        (0.18, 0.16, 0.14),
        (math.cos(angle + 0.9), 0.75, math.sin(angle + 0.9)),
        (2.6, 2.2, 1.6),
        sun_concentration,
    )
    plain = Quad((-40.0, 0.0, -40.0), (0.0, 0.0, 80.0), (80.0, 0.0, 0.0), (0.52, 0.48, 0.42))
    block = Box((0.1, 0.46, -1.1), (0.45, 0.45, 0.45), (0.24, 0.42, 0.62), _about_y(math.radians(25.0)))
    gold = Sphere((-0.85, 0.61, 0.1), 0.6, (1.0, 0.78, 0.34), material=Conductor(0.18))
    glass = Sphere((0.75, 0.56, 0.35), 0.55, (0.98, 0.98, 0.98), material=Dielectric())
    return Scene(
        "daylight",
        Camera((0.0, 1.5, 4.6), (0.0, 0.45, 0.0), vertical_fov_deg=36.0),
        boxes=(block,),
        spheres=(gold, glass),
        quads=(plain,),
        environment=sky,
        info={"time": repr(time)},
    )


def cornell(time: float = 0.0) -> Scene:
    """Return a box with a red and a green wall, one light and two blocks that turn in opposite directions."""
    white, red, green = (0.73, 0.73, 0.73), (0.65, 0.06, 0.05), (0.12, 0.45, 0.15)
    room = Room((-1.0, 0.0, -1.0), (1.0, 2.0, 1.0), (red, green, white, white, white, white))
    angle = 2.0 * math.pi * time / TURN_SECONDS
    blocks = (
        Box((-0.33, 0.6, -0.30), (0.29, 0.6, 0.29), white, _about_y(math.radians(17.0) + angle)),
        Box((0.35, 0.3, 0.28), (0.29, 0.3, 0.29), white, _about_y(math.radians(-18.0) - angle)),
    )
    light = Light((-0.25, 1.99, -0.25), (0.5, 0.0, 0.0), (0.0, 0.0, 0.5), (1.0, 0.78, 0.5), 14.0)
    camera = Camera((0.0, 1.0, 4.4), (0.0, 1.0, 0.0), vertical_fov_deg=37.0)
    return Scene("cornell", camera, room, boxes=blocks, lights=(light,), info={"time": repr(time)})


def _about_y(angle_rad: float) -> Matrix:
    """Return the box axes of a block that is turned about the vertical."""
    c, s = math.cos(angle_rad), math.sin(angle_rad)
    return ((c, 0.0, -s), (0.0, 1.0, 0.0), (s, 0.0, c))


def furnace(time: float = 0.0, albedo: float = 0.5, emission: float = 1.0) -> Scene:
    """Return a closed box whose walls all reflect `albedo` and emit `emission`.

    Radiance is the same everywhere and in every direction: emission (1 + a + a^2 + ...) = emission / (1 - a).
    """
    room = Room((-1.0, -1.0, -1.0), (1.0, 1.0, 1.0), ((albedo,) * 3,) * 6, (emission,) * 3)
    camera = Camera((0.1, 0.2, 0.7), (0.0, 0.0, -1.0), vertical_fov_deg=60.0)
    return Scene("furnace", camera, room, info={"time": repr(time)})


def lone_light(
    time: float = 0.0, reflectance: float = 0.5, height: float = 1.0, power: float = 10.0
) -> Scene:
    """Return one square light, two units wide, at `height` over the centre of a wide plane that it faces.

    Where the plane reflects once, radiance is reflectance / pi times the irradiance of a parallel rectangle,
    which has a closed form (tests/refimpl/test_closed_forms.py).
    """
    plane = Quad((-50.0, 0.0, -50.0), (0.0, 0.0, 100.0), (100.0, 0.0, 0.0), (reflectance,) * 3)
    light = Light((-1.0, height, -1.0), (2.0, 0.0, 0.0), (0.0, 0.0, 2.0), (1.0, 1.0, 1.0), power)
    camera = Camera((0.0, 0.5 * height, 6.0), (0.0, 0.0, 0.0), vertical_fov_deg=30.0)
    return Scene("lone_light", camera, quads=(plane,), lights=(light,), info={"time": repr(time)})


def empty(time: float = 0.0, background: float = 0.25) -> Scene:
    """Return a scene with nothing in it: every pixel shows the background's radiance."""
    camera = Camera((0.0, 0.0, 0.0), (0.0, 0.0, -1.0))
    return Scene("empty", camera, background=(background,) * 3, info={"time": repr(time)})


CANONICAL: dict[str, Callable[..., Scene]] = {
    "minicubes": minicubes,
    "glossy": glossy,
    "vitrine": vitrine,
    "daylight": daylight,
    "cornell": cornell,
    "furnace": furnace,
    "lone_light": lone_light,
    "empty": empty,
}
"""The canonical scenes by name: a new one is a function and a line here."""


def canonical(name: str, **parameters: Any) -> Scene:
    """Return a canonical scene by name; raise InputError for an unknown name, and wrong parameters."""
    if name not in CANONICAL:
        raise InputError("scene", name, "unknown", choice(name, CANONICAL) + ", or give a .json file")
    known = inspect.signature(CANONICAL[name]).parameters
    for parameter, value in parameters.items():
        if parameter not in known:
            raise InputError("parameter", parameter, f"unknown to scene {name}", choice(parameter, known))
        default = known[parameter].default
        if np.shape(value) != np.shape(default):
            wanted = "three numbers with commas" if np.shape(default) else "one number"
            rule = f"scene {name} needs {wanted}"
            raise InputError(f"parameter {parameter}", value, rule, f"for example {default}")
    time = parameters.get("time", 0.0)
    if not abs(time) <= LARGEST_TIME_S:
        rule = f"must be a number from {-LARGEST_TIME_S:g} to {LARGEST_TIME_S:g} seconds"
        raise InputError("time", time, rule, f"the scenes repeat every {TURN_SECONDS:g} seconds")
    return validate(CANONICAL[name](**parameters))
