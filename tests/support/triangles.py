"""Scene files of triangles: what was read of one [`ReadFile`], and whether it is the scene [`differences`].

Nothing of the writers is asked: corners of parallelograms, the volume, the closedness and the equation of
bodies, materials and the camera's rays come from the scene itself.
"""

from dataclasses import dataclass

import numpy as np

from wamnet.refimpl.light.camera import camera_basis, camera_ray
from wamnet.refimpl.light.materials import Conductor, Dielectric, Mirror
from wamnet.refimpl.light.shapes.quad import light_radiance

U32, U64 = 2.0**-24, 2.0**-53
"""Half of the distance from 1 to the next number of each kind."""

SINK = 1.0 - np.cos(np.hypot(np.pi / 256, np.pi / 256))
"""Most that a triangle of a sphere is below it, in radii: corners of a patch of 1/128 by 1/256 of the angles
pi and 2 pi are at most half of its diagonal away from its middle."""

BLACK, WHITE = (0.0, 0.0, 0.0), (1.0, 1.0, 1.0)


@dataclass(eq=False)
class ReadSurface:
    """Points and normals (N, 3), corners (M, 3), and what the material says.

    `number` is GGX's alpha of metal or the index of glass, else 0; `thick` what a body of glass says.
    """

    points: np.ndarray
    normals: np.ndarray
    corners: np.ndarray
    kind: str
    color: tuple[float, ...]
    emission: tuple[float, ...]
    number: float
    front: bool
    thick: float


@dataclass(eq=False)
class ReadFile:
    """Surfaces, the camera's axes and position (3, 4), its angle in degrees, and size, samples and so on."""

    surfaces: list[ReadSurface]
    frame: np.ndarray
    fov: float
    asked: dict[str, int]


@dataclass(frozen=True)
class Wanted:
    """A surface of a scene: its part, or a parallelogram's corner and edges, and its look."""

    part: object
    color: tuple[float, ...]
    emission: tuple[float, ...]
    material: object
    front: bool


def wanted(scene):
    """Return the surfaces of a scene: quads, walls, lamps, boxes, spheres."""
    found = [
        Wanted((q.corner, q.edge_u, q.edge_v), q.reflectance, q.emission, q.material, False)
        for q in scene.quads
    ]
    if scene.room is not None:
        low, edges = np.array(scene.room.low), np.diag(np.subtract(scene.room.high, scene.room.low))
        for number, reflectance in enumerate(scene.room.reflectances):
            axis, far = divmod(number, 2)
            u, v = edges[(axis + 1) % 3], edges[(axis + 2) % 3]
            sides = (low + edges[axis], v, u) if far else (low, u, v)
            found.append(Wanted(sides, reflectance, scene.room.emission, None, True))
    for lamp in scene.lights:
        sides = (lamp.corner, lamp.edge_u, lamp.edge_v)
        found.append(Wanted(sides, BLACK, tuple(light_radiance(lamp)), None, True))
    bodies = (*scene.boxes, *scene.spheres)
    return found + [Wanted(b, b.reflectance, b.emission, b.material, True) for b in bodies]


def differences(read, shot, seed, emission_slack=2 * U64):
    """Yield what of a file is not the shot; `emission_slack` is relative to the largest channel."""
    expected = wanted(shot.scene)
    if len(read.surfaces) != len(expected):
        yield f"{len(read.surfaces)} surfaces and not {len(expected)}"
    for number, (found, want) in enumerate(zip(read.surfaces, expected, strict=False)):
        for word in (*shape_differences(found, want), *look_differences(found, want, emission_slack)):
            yield f"surface {number}: {word}"
    yield from camera_differences(read, shot.scene.camera)
    asked = {"width": shot.size, "height": shot.size, "samples": shot.spp, "depth": shot.depth, "seed": seed}
    if read.asked != asked:
        yield "size, samples, depth or seed"


def areas(surface):
    """Return the area vectors (M, 3) of triangles, to the side from which they are counter-clockwise."""
    a, b, c = (surface.points[surface.corners[:, k]] for k in range(3))
    return 0.5 * np.cross(b - a, c - a)


def volume(surface):
    """Return what triangles surround, negative where they face inwards."""
    middle = surface.points[surface.corners].mean(axis=1)
    return float(np.sum(areas(surface) * middle) / 3.0)


def shape_differences(found, want):
    """Yield what of a surface's triangles is wrong."""
    lengths = np.linalg.norm(found.normals, axis=1)
    # A component is rounded by U32 of it, and the squares by as much twice.
    if np.abs(lengths - 1.0).max() > 4 * U32:
        yield "normals are not unit vectors"
    vectors = areas(found)
    if np.min(np.linalg.norm(vectors, axis=1)) <= 0.0:
        yield "a triangle without area"
    sides = np.sum(vectors[:, None] * found.normals[found.corners], axis=-1)
    if sides.min() <= 0.0:
        yield "a normal on the other side than its triangle's"
    if isinstance(want.part, tuple):
        yield from sheet_differences(found, *map(np.array, want.part))
    elif hasattr(want.part, "radius"):
        yield from sphere_differences(found, want.part)
    else:
        yield from box_differences(found, want.part)


def sheet_differences(found, corner, u, v):
    """Yield what is not the parallelogram; points are rounded to float32."""
    size = np.abs([corner, corner + u, corner + v, corner + u + v]).max()
    expected = np.array([corner, corner + u, corner + u + v, corner + v])
    apart = np.abs(found.points[:, None] - expected).max(axis=-1).min(axis=0)
    if apart.max() > 2 * U32 * size:
        yield "corners of the parallelogram"
    normal = np.cross(u, v)
    # Each of the points is off by that much, across edges of up to twice the size.
    if np.abs(areas(found).sum(axis=0) - normal).max() > 64 * U32 * size**2:
        yield "area or side of the parallelogram"
    if np.abs(found.normals - normal / np.linalg.norm(normal)).max() > 2 * U32:
        yield "normals of the parallelogram"


def closed_differences(found):
    """Yield whether a body has a hole: each edge is walked once in each direction."""
    places = np.unique(found.points, axis=0, return_inverse=True)[1].reshape(-1)[found.corners]
    begin, end = (np.stack([places, np.roll(places, -1, axis=1)]).reshape(2, -1)).astype(np.int64)
    base = places.max() + 1
    one_way, other_way = np.sort(begin * base + end), np.sort(end * base + begin)
    if np.any(np.diff(one_way) == 0) or np.any(one_way != other_way):
        yield "the body is not closed"


def sphere_differences(found, ball):
    """Yield what is not on the sphere, or too far below it."""
    out = found.points - np.array(ball.center)
    size = ball.radius + np.abs(ball.center).max()
    if np.abs(out - ball.radius * found.normals).max() > 4 * U32 * size:
        yield "points or normals of the sphere"
    ratio = volume(found) / (4.0 / 3.0 * np.pi * ball.radius**3)
    # The polyhedron holds a sphere of 1 - SINK radii.
    if not (1.0 - SINK) ** 3 - 64 * U32 <= ratio <= 1.0:
        yield "volume of the sphere"
    yield from closed_differences(found)


def box_differences(found, box):
    """Yield what is not a corner of the box, or a side that is missing."""
    local = (found.points - np.array(box.center)) @ np.array(box.rotation).T
    half = np.array(box.half_extent)
    size = float(np.linalg.norm(half) + np.abs(box.center).max())
    if np.abs(np.abs(local) - half).max() > 8 * U32 * size:
        yield "corners of the box"
    ratio = volume(found) / (8.0 * np.prod(half))
    if np.abs(ratio - 1.0) > 64 * U32 * size / half.min():
        yield "volume of the box"
    yield from closed_differences(found)


def look_differences(found, want, emission_slack):
    """Yield what of a material is wrong; a number that is converted and back is off by a few roundings."""
    kinds = {Mirror: "mirror", Conductor: "metal", Dielectric: "glass"}
    kind = kinds.get(type(want.material), "matte")
    if found.kind != kind:
        yield f"{found.kind} and not {kind}"
    number = want.material.parameter if kind in ("metal", "glass") else 0.0
    if np.abs(found.number - number) > 16 * U64 * number:
        yield "roughness or index"
    if np.abs(np.subtract(found.color, want.color)).max() > U32:
        yield "reflectance"
    if np.abs(np.subtract(found.emission, want.emission)).max() > emission_slack * max(want.emission):
        yield "emission"
    if found.front != want.front:
        yield "one side or two"
    if kind == "glass" and found.thick <= 0.0:
        yield "glass without a thickness"


def camera_differences(read, camera):
    """Yield what of the camera is wrong: rays through the corners of a picture, and where they begin."""
    right, up, back, position = read.frame.T
    half = np.tan(np.radians(read.fov) / 2.0)
    basis = camera_basis(camera)
    for x, y in ((0.0, 0.0), (0.0, 1.0), (1.0, 0.0), (1.0, 1.0)):
        toward = -back + half * ((2.0 * x - 1.0) * right + (1.0 - 2.0 * y) * up)
        origin, direction = camera_ray(basis, *map(np.float64, (x, y)), 0.0, 0.0, 1, 1)
        # A few dozen roundings of numbers near 1.
        if np.abs(toward / np.linalg.norm(toward) - direction).max() > 64 * U64:
            yield "a ray of the camera"
        if np.any(origin != position):
            yield "position of the camera"
