"""Cases of light: what a picture's colour must be.

A camera of one degree looks at a place where the answer is known [`look`]; its pixels are samples of one
value. Colours differ between channels, so that exchanged or joined channels show.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from wamnet.refimpl import encoding
from wamnet.refimpl.light.materials import Conductor, Dielectric, Material, Mirror
from wamnet.refimpl.light.scene import Box, Camera, Light, Quad, Room, Scene, Sphere
from wamnet.refimpl.light.shapes.shape import Vector

from . import answers
from .case import DISPLAY_SLACK, Question, Shot

VIEW_DEG = 1.0
"""Field of view: as narrow as Blender's cameras can be, with some room."""

COLOR: Vector = (0.2, 0.5, 0.8)
"""Reflectance of matte surfaces."""

WHITE: Vector = (1.0, 1.0, 1.0)
"""A sky of radiance 1, and what reflects all."""

BLACK: Vector = (0.0, 0.0, 0.0)
"""No light, and what reflects none."""

GLASS = 1.5
"""Index of glass, unless a case says another."""

MANY = 64
"""Scatterings of closed rooms: of a reflectance of 0.8 the tail is 5e-7."""


def look(position: Vector, at: Vector, up: Vector = (0.0, 1.0, 0.0), fov: float = VIEW_DEG) -> Camera:
    """Return a camera that sees next to nothing but a point."""
    return Camera(position, at, up, fov)


def grey(value: float) -> Vector:
    """Return a colour of equal channels."""
    return (value, value, value)


def level(center: Vector, half: float, reflectance: Vector, emission: Vector = BLACK) -> Quad:
    """Return a horizontal square that faces up."""
    x, y, z = center
    return Quad(
        (x - half, y, z - half), (0.0, 0.0, 2.0 * half), (2.0 * half, 0.0, 0.0), reflectance, emission
    )


def lamp(center: Vector, half: float, color: Vector, power: float) -> Light:
    """Return a horizontal square lamp that faces down."""
    x, y, z = center
    return Light((x - half, y, z - half), (2.0 * half, 0.0, 0.0), (0.0, 0.0, 2.0 * half), color, power)


# ---- what a picture holds ------------------------------------------------------------------------------


def radiances() -> Iterator[Question]:
    """Yield skies and lamps that are looked at."""
    for name, sky in (("dim", (0.02, 0.2, 0.5)), ("bright", (1.0, 4.0, 20.0))):
        scene = Scene(f"sky-{name}", look((0.0, 0.0, 0.0), (0.0, 0.0, -1.0)), background=sky)
        yield Question(
            f"sky-{name}", "radiance", Shot(f"sky-{name}", scene, spp=16), sky, "the sky's own radiance"
        )
    front, back = (
        look((0.0, -3.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
        look((0.0, 3.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
    )
    shines = lamp((0.0, 0.0, 0.0), 1.0, (0.25, 0.5, 1.0), 4.0 * math.pi)
    answer = (0.25, 0.5, 1.0)
    scene = Scene("lamp-front", front, lights=(shines,))
    source = "power colour / (pi area) = colour: a Lambertian emitter of 4 pi W and 4 square units"
    yield Question("lamp-front", "radiance", Shot("lamp-front", scene, spp=16), answer, source)
    scene = Scene("lamp-back", back, lights=(shines,))
    both = {"two-sided-lamps": answer}
    source = "a lamp reflects nothing, and its back emits nothing"
    yield Question("lamp-back", "one-sided", Shot("lamp-back", scene, spp=16), BLACK, source, intents=both)


def displays() -> Iterator[Question]:
    """Yield skies in pictures for a screen."""
    for name, sky in (("dark", (0.002, 0.02, 0.2)), ("light", (0.5, 1.0, 4.0))):
        scene = Scene(f"display-{name}", look((0.0, 0.0, 0.0), (0.0, 0.0, -1.0)), background=sky)
        shot = Shot(f"display-{name}", scene, spp=16, display=True)
        encoded = tuple(float(encoding.to_display(np.array(channel))) for channel in sky)
        source = "IEC 61966-2-1, clipped to [0, 1]"
        yield Question(f"display-{name}", "display", shot, encoded, source, "display", slack=DISPLAY_SLACK)


# ---- matte surfaces ------------------------------------------------------------------------------------


def mattes() -> Iterator[Question]:
    """Yield convex matte bodies under a white sky."""
    ball = Sphere((0.0, 0.0, 0.0), 1.0, COLOR)
    scene = Scene("matte-ball", look((0.0, 0.0, 4.0), (0.0, 0.0, 0.0)), spheres=(ball,), background=WHITE)
    source = "all directions bring 1, and the reflectance is left of it"
    yield Question("matte-ball", "matte", Shot("matte-ball", scene), COLOR, source)
    # At 80 degrees, where a lost or doubled cosine to the camera shows.
    eye = (3.0 * math.sin(math.radians(80.0)), 3.0 * math.cos(math.radians(80.0)), 0.0)
    floor = level((0.0, 0.0, 0.0), 20.0, COLOR)
    scene = Scene("matte-floor", look(eye, (0.0, 0.0, 0.0)), quads=(floor,), background=WHITE)
    yield Question("matte-floor", "matte", Shot("matte-floor", scene), COLOR, source)


def floor_seen(
    name: str, x: float, z: float, below: float, reflectance: Vector = COLOR, **parts: object
) -> Scene:
    """Return a matte floor with what is above it, seen at (x, 0, z) from straight above."""
    camera = look((x, below, z), (x, 0.0, z), (0.0, 0.0, 1.0))
    floor = level((0.0, 0.0, 0.0), 50.0, reflectance)
    quads = (floor, *parts.pop("quads", ()))  # type: ignore[misc]
    return Scene(name, camera, quads=quads, **parts)  # type: ignore[arg-type]


def lit(irradiance: Vector) -> Vector:
    """Return what the matte floor shows under an irradiance."""
    red, green, blue = (r * e / math.pi for r, e in zip(COLOR, irradiance, strict=True))
    return (red, green, blue)


def directs() -> Iterator[Question]:
    """Yield a floor under lamps."""
    power, square = 16.0 * math.pi, (-1.0, 1.0, -1.0, 1.0)
    source = "form factor of a parallel rectangle (Howell, B-3)"
    for name, x, z, height in (("below", 0.0, 0.0, 1.0), ("aside", 2.0, 1.0, 1.0), ("close", 0.5, 0.0, 0.5)):
        scene = floor_seen(name, x, z, 0.4 * height, lights=(lamp((0.0, height, 0.0), 1.0, WHITE, power),))
        answer = lit(grey(4.0 * answers.rectangle_irradiance(x, z, square, height)))
        yield Question(f"lamp-{name}", "direct", Shot(f"lamp-{name}", scene, spp=128), answer, source)
    # Two lamps of unequal power: red at the left, green at the right, both with some blue.
    left, right = (
        lamp((-2.0, 1.0, 0.0), 0.5, (1.0, 0.0, 0.5), math.pi),
        lamp((2.0, 1.0, 0.0), 0.5, (0.0, 1.0, 0.5), 9.0 * math.pi),
    )
    scene = floor_seen("lamps-two", 0.0, 0.0, 0.4, lights=(left, right))
    share = answers.rectangle_irradiance(0.0, 0.0, (1.5, 2.5, -0.5, 0.5), 1.0)
    answer = lit((share, 9.0 * share, 5.0 * share))
    yield Question("lamps-two", "direct", Shot("lamps-two", scene, spp=512), answer, source + ", twice")
    shines = Sphere((0.0, 2.0, 0.0), 0.8, BLACK, grey(8.0))
    scene = floor_seen("lamp-ball", 0.0, 0.0, 0.4, spheres=(shines,))
    answer = lit(grey(8.0 * answers.sphere_irradiance(0.8, 2.0)))
    source = "pi L (radius / distance)^2, the sphere being wholly above the floor"
    yield Question("lamp-ball", "direct", Shot("lamp-ball", scene, spp=512), answer, source)


def shadows() -> Iterator[Question]:
    """Yield a floor from which half of a lamp, or all of it, is hidden."""
    shines = lamp((0.0, 1.0, 0.0), 1.0, WHITE, 16.0 * math.pi)
    hides = Quad((0.0, 0.6, -3.0), (0.0, 0.0, 6.0), (3.0, 0.0, 0.0), BLACK)
    scene = floor_seen("half-shadow", 0.0, 0.0, 0.4, lights=(shines,), quads=(hides,))
    answer = lit(grey(2.0 * answers.rectangle_irradiance(0.0, 0.0, (-1.0, 1.0, -1.0, 1.0), 1.0)))
    source = "half of the lamp by symmetry, below the straight edge of a black sheet"
    yield Question("half-shadow", "shadow", Shot("half-shadow", scene, spp=128), answer, source)
    hides = level((0.0, 0.6, 0.0), 3.0, BLACK)
    scene = floor_seen("shadow", 0.0, 0.0, 0.4, lights=(shines,), quads=(hides,))
    yield Question("shadow", "shadow", Shot("shadow", scene), BLACK, "the lamp is hidden as a whole")


# ---- mirrors and metal ---------------------------------------------------------------------------------


def mirrors() -> Iterator[Question]:
    """Yield a mirror that shows a small emitter, and two of them."""
    tint: Vector = (0.9, 0.6, 0.3)
    mirror = Quad((-5.0, 0.0, -5.0), (0.0, 0.0, 10.0), (10.0, 0.0, 0.0), tint, material=Mirror())
    # Down at 30 degrees below the horizon to the origin, and up again to what emits.
    run, rise = math.cos(math.radians(30.0)), math.sin(math.radians(30.0))
    shown = Quad((2.0 * run, 2.0 * rise - 0.2, -0.2), (0.0, 0.4, 0.0), (0.0, 0.0, 0.4), BLACK, grey(2.0))
    scene = Scene("mirror", look((-2.0 * run, 2.0 * rise, 0.0), (0.0, 0.0, 0.0)), quads=(mirror, shown))
    answer = (1.8, 1.2, 0.6)
    source = "reflectance times the radiance of what is at the mirrored angle, and nothing else emits"
    fades = {"schlick-metals": tuple(2.0 * r for r in answers.schlick(tint, 0.5))}
    yield Question("mirror", "mirror", Shot("mirror", scene, spp=16), answer, source, intents=fades)
    # A periscope: down to a mirror at 45 degrees, along to another, and up into the sky.
    first = Quad((-1.0, -1.0, -1.0), (0.0, 0.0, 2.0), (2.0, 2.0, 0.0), (0.9, 0.6, 0.3), material=Mirror())
    second = Quad((-4.0, 1.0, -1.0), (2.0, -2.0, 0.0), (0.0, 0.0, 2.0), (0.5, 0.8, 0.9), material=Mirror())
    scene = Scene(
        "mirrors-two",
        look((0.0, 3.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
        quads=(first, second),
        background=WHITE,
    )
    source = "the product of both reflectances, under a white sky"
    both = [answers.schlick(quad.reflectance, math.sqrt(0.5)) for quad in (first, second)]
    fades = {"schlick-metals": tuple(a * b for a, b in zip(*both, strict=True))}
    answer = (0.45, 0.48, 0.27)
    yield Question("mirrors-two", "mirror", Shot("mirrors-two", scene, spp=16), answer, source, intents=fades)


def metals() -> Iterator[Question]:
    """Yield rough white metal under a white sky."""
    source = "quadrature over the microscopic normals: GGX, Smith's height-correlated masking, one scattering"
    for alpha, angle in ((0.1, 0.0), (0.5, 0.0), (0.5, 70.0), (1.0, 0.0), (1.0, 70.0)):
        name = f"metal-{alpha:g}-{angle:g}"
        sheet = Quad(
            (-20.0, 0.0, -20.0), (0.0, 0.0, 40.0), (40.0, 0.0, 0.0), WHITE, material=Conductor(alpha)
        )
        turn = math.radians(angle)
        eye = (3.0 * math.sin(turn), 3.0 * math.cos(turn), 0.0)
        scene = Scene(name, look(eye, (0.0, 0.0, 0.0), (0.0, 0.0, 1.0)), quads=(sheet,), background=WHITE)
        answer = grey(answers.rough_metal(angle, alpha))
        separable = grey(answers.rough_metal(angle, alpha, correlated=False))
        intents = {"separable-masking": separable, "compensates": WHITE}
        yield Question(name, "metal", Shot(name, scene, spp=256), answer, source, intents=intents)


# ---- glass ---------------------------------------------------------------------------------------------

PANE = Box((0.0, -0.5, 0.0), (20.0, 0.5, 20.0), WHITE, material=Dielectric(GLASS))
"""A wide pane of glass, one unit thick, whose upper side is at height 0."""


def eye_at(angle_deg: float, distance: float = 3.0) -> Vector:
    """Return a point that sees the origin at an angle to the vertical, from the side of negative x."""
    turn = math.radians(angle_deg)
    return (-distance * math.sin(turn), distance * math.cos(turn), 0.0)


def facing_strip(center: Vector, along: Vector, half: float, emission: float) -> Quad:
    """Return an emitter around a point; `along` is its direction across the strip, which is wide in z."""
    x, y, z = (c - half * a for c, a in zip(center, along, strict=True))
    across = (2.0 * half * along[0], 2.0 * half * along[1], 2.0 * half * along[2])
    return Quad((x, y, z - 0.5), across, (0.0, 0.0, 1.0), BLACK, grey(emission))


def fresnels() -> Iterator[Question]:
    """Yield the front of a pane that mirrors a narrow emitter; what its back mirrors misses the emitter."""
    for angle in (60.0, 80.0):
        turn = math.radians(angle)
        x, y, _ = eye_at(angle)
        shown = facing_strip((-x, y, 0.0), (math.cos(turn), -math.sin(turn), 0.0), 0.1, 4.0)
        name = f"fresnel-{angle:g}"
        scene = Scene(name, look((x, y, 0.0), (0.0, 0.0, 0.0)), boxes=(PANE,), quads=(shown,))
        answer = grey(4.0 * float(answers.fresnel(math.cos(turn), GLASS)))
        source = "Fresnel's share of unpolarised light, index 1.5 (Born and Wolf, 1.5.2)"
        yield Question(name, "fresnel", Shot(name, scene, spp=512), answer, source)


def snells() -> Iterator[Question]:
    """Yield emitters that are only seen where Snell's law sends a ray."""
    cosine = math.cos(math.radians(45.0))
    sine = answers.sine_inside(cosine, GLASS)
    slope = sine / math.sqrt(1.0 - sine * sine)
    passed = (1.0 - float(answers.fresnel(cosine, GLASS))) ** 2
    # Through the pane the ray is moved by its slope inside; one unit below it has moved by one more.
    shown = level((slope + 1.0, -2.0, 0.0), 0.2, BLACK, grey(1.0))
    scene = Scene("snell", look(eye_at(45.0), (0.0, 0.0, 0.0)), boxes=(PANE,), quads=(shown,))
    source = "(1 - F)^2, the emitter being where Snell's law sends the ray through a pane at 45 degrees"
    yield Question("snell", "snell", Shot("snell", scene, spp=256), grey(passed), source)
    # Into a cube's top, totally mirrored at its side, and out below.
    cube = Box((0.0, 0.0, 0.0), grey(1.0), WHITE, material=Dielectric(GLASS))
    fall = 0.7 / slope
    leaves = 1.0 - (2.0 - fall) * slope
    x, y, _ = eye_at(45.0)
    shown = level((leaves - 1.0, -2.0, 0.0), 0.1, BLACK, grey(1.0))
    camera = look((0.3 + x, 1.0 + y, 0.0), (0.3, 1.0, 0.0))
    scene = Scene("total-reflection", camera, boxes=(cube,), quads=(shown,))
    source = "(1 - F)^2 where a ray leaves a cube that it has crossed by one total reflection"
    yield Question(
        "total-reflection", "snell", Shot("total-reflection", scene, spp=256), grey(passed), source
    )


def glasses() -> Iterator[Question]:
    """Yield clear glass under a white sky."""
    source = "nothing absorbs, and every path ends in the sky; the factor of the index cancels"
    for ior in (1.1, 1.5, 2.4):
        name = f"glass-ball-{ior:g}"
        ball = Sphere((0.0, 0.0, 0.0), 1.0, WHITE, material=Dielectric(ior))
        # Off the centre, at 44 degrees to the normal.
        camera = look((0.7, 0.0, 4.0), (0.7, 0.0, 0.0))
        scene = Scene(name, camera, spheres=(ball,), background=WHITE)
        yield Question(name, "glass", Shot(name, scene, depth=MANY), WHITE, source)
    scene = Scene("glass-pane", look(eye_at(60.0), (0.0, 0.0, 0.0)), boxes=(PANE,), background=WHITE)
    yield Question("glass-pane", "glass", Shot("glass-pane", scene, depth=MANY), WHITE, source)


# ---- many bounces --------------------------------------------------------------------------------------


def room(emission: float, reflectance: Vector) -> Room:
    """Return a closed cube whose walls all reflect and emit alike."""
    return Room(grey(-2.0), grey(2.0), (reflectance,) * 6, grey(emission))


def rooms() -> Iterator[Question]:
    """Yield closed rooms of even radiance."""
    camera = look((0.1, 0.2, 1.5), (0.3, 0.1, -2.0), fov=30.0)
    source = "L = 1 + a L: radiance is the same everywhere"
    answer = tuple(1.0 / (1.0 - a) for a in COLOR)
    scene = Scene("room", camera, room(1.0, COLOR))
    yield Question("room", "series", Shot("room", scene, spp=16, depth=MANY), answer, source)
    answer = tuple(100.0 / (1.0 - a) for a in COLOR)
    scene = Scene("room-bright", camera, room(100.0, COLOR))
    shot = Shot("room-bright", scene, spp=16, depth=MANY)
    yield Question("room-bright", "bright", shot, answer, source, intents={"clamps": None})
    bodies: tuple[tuple[str, Material], ...] = (("mirror", Mirror()), ("glass", Dielectric(GLASS)))
    source = "in equilibrium every direction brings 1 / (1 - a), whatever it meets"
    for name, material in bodies:
        ball = Sphere((0.3, 0.1, -0.5), 0.7, WHITE, material=material)
        eye = look((0.1, 0.2, 1.5), (0.6, 0.2, -0.5))
        scene = Scene(f"room-{name}", eye, room(1.0, grey(0.5)), spheres=(ball,))
        shot = Shot(f"room-{name}", scene, spp=16, depth=MANY)
        yield Question(f"room-{name}", "equilibrium", shot, grey(2.0), source, intents={"no-caustics": None})


def caustics() -> Iterator[Question]:
    """Yield a matte floor close below a wide pane under a white sky."""
    above = Box((0.0, 0.6, 0.0), (50.0, 0.5, 50.0), WHITE, material=Dielectric(GLASS))
    scene = floor_seen("floor-below-pane", 0.0, 0.0, 0.08, boxes=(above,), background=WHITE)
    red, green, blue = (answers.floor_below_pane(a, GLASS) for a in COLOR)
    source = "L = rho (T + (1 - T) L) with the pane's mean T over the hemisphere, by quadrature"
    shot = Shot("floor-below-pane", scene, spp=128, depth=MANY)
    intents = {"no-caustics": None}
    yield Question("floor-below-pane", "caustic", shot, (red, green, blue), source, intents=intents)


GROUPS = (
    radiances,
    displays,
    mattes,
    directs,
    shadows,
    mirrors,
    metals,
    fresnels,
    snells,
    glasses,
    rooms,
    caustics,
)
"""What yields questions about light."""
