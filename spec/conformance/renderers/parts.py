"""A scene for other formats: plain parts, numbers as text, and what cannot be said.

1. [`parts_of`] gives boxes, spheres and sheets; a room is six sheets, and each lamp one that emits to its
   front.
2. [`meshes_of`] gives the same parts as triangles, for formats that have nothing else; [`sky_of`] a sky as a
   closed surface around them.
3. A writer refuses what its format cannot say with [`NotExpressed`], and the cases are "not tested" for that
   reason. Nothing is left out in silence.
"""

from __future__ import annotations

import base64
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import product
from pathlib import Path
from typing import Any

import jinja2
import numpy as np
from numpy.typing import NDArray

from wamnet.refimpl.encoding import LEVELS, srgb_decode
from wamnet.refimpl.light.materials import Conductor, Dielectric, Material, Mirror
from wamnet.refimpl.light.scene import Box, Camera, Room, Scene, Sphere
from wamnet.refimpl.light.shapes.quad import light_radiance
from wamnet.refimpl.light.shapes.shape import Vector

from .cases import Shot

Array = NDArray[np.float64]

MATTE, MIRROR, METAL, GLASS = "matte", "mirror", "metal", "glass"
"""Kinds of surfaces."""

RINGS, SEGMENTS = 128, 256
"""Bands of a sphere of triangles from pole to pole, and around: what is between corners is at most 1.5e-4 of
the radius below the sphere, a tenth of the slack of an answer."""

APART = 1e-4
"""Distance of the two sides of what emits on both, in its shorter edge."""

FAR = 4.0
"""Half of the edges of a sky that is a surface, in the largest coordinate of what it surrounds."""

KINDS: dict[type[Any], str] = {Mirror: MIRROR, Conductor: METAL, Dielectric: GLASS}
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

    @property
    def normal(self) -> Array:
        """The unit normal of the front."""
        normal: Array = np.cross(self.edge_u, self.edge_v)
        return normal / np.linalg.norm(normal)

    @property
    def axes(self) -> Array:
        """The map (3, 4) from the square [-1, 1]^2 at z = 0: half edges, the normal, the middle."""
        u, v = 0.5 * self.edge_u, 0.5 * self.edge_v
        return np.column_stack([u, v, self.normal, self.corner + u + v])

    @property
    def sides(self) -> list[Sheet]:
        """The sheet, or two of them back to back where it emits on both: for formats with a front only."""
        if not self.look.emits or self.front:
            return [self]
        u, v = self.edge_u, self.edge_v
        apart = self.normal * (0.5 * APART * min(np.linalg.norm(u), np.linalg.norm(v)))
        return [Sheet(self.corner + apart, u, v, self.look), Sheet(self.corner - apart, v, u, self.look)]


@dataclass(frozen=True)
class Parts:
    """All surfaces of a scene by shape, the closed ones with their looks."""

    sheets: tuple[Sheet, ...]
    boxes: tuple[tuple[Box, Look], ...]
    spheres: tuple[tuple[Sphere, Look], ...]


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles: points and their unit normals (N, 3) in float32, corners (M, 3) by number, and a look.

    Corners are counter-clockwise as seen from the front. `front`: there is only the front, and whatever sees
    the back sees through it. `thick`: the least thickness of a closed body, 0 of a sheet.
    """

    points: NDArray[np.float32]
    normals: NDArray[np.float32]
    corners: NDArray[np.uint32]
    look: Look
    front: bool
    thick: float = 0.0

    @property
    def colors(self) -> NDArray[np.float32]:
        """The reflectance of each point (N, 3)."""
        return np.tile(np.array(self.look.reflectance, np.float32), (len(self.points), 1))


def room_walls(room: Room) -> list[tuple[Any, Any, Any]]:
    """Return corner and edges (3,) of the walls, in the order of WALLS, whose normals point inwards."""
    low, edges = np.array(room.low), np.diag(np.subtract(room.high, room.low))
    walls = []
    for axis in range(3):
        u, v = edges[(axis + 1) % 3], edges[(axis + 2) % 3]
        walls += [(low, u, v), (low + edges[axis], v, u)]
    return walls


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
        materials = room.materials or (None,) * len(room.reflectances)
        looks = (_look(r, room.emission, m) for r, m in zip(room.reflectances, materials, strict=True))
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
    return _look(part.reflectance, part.emission, part.material)


def _look(reflectance: Vector, emission: Vector, material: Material | None) -> Look:
    """Return the look of a surface; no format has a mirror, metal or glass that emits."""
    kind = KINDS.get(type(material), MATTE)
    if any(emission) and kind != MATTE:
        raise NotExpressed(f"{kind} that emits")
    number = 0.0 if material is None or material.parameter is None else material.parameter
    return Look(kind, reflectance, emission, float(number))


def meshes_of(parts: Parts) -> list[Mesh]:
    """Return all surfaces as triangles: sheets, boxes, spheres."""
    found = [_sheet_mesh(sheet) for sheet in parts.sheets]
    found += [_box_mesh(box, look) for box, look in parts.boxes]
    return found + [_sphere_mesh(ball, look) for ball, look in parts.spheres]


def sky_of(scene: Scene, meshes: Iterable[Mesh]) -> list[Mesh]:
    """Return a scene's sky as the inside of a black cube around it that emits, or nothing of a black sky.

    From each direction it brings the radiance of the sky, however far it is.
    """
    if not any(scene.background):
        return []
    places = [np.abs(mesh.points).max() for mesh in meshes]
    half = FAR * float(max(1.0, *np.abs(scene.camera.position), *places))
    black = (0.0, 0.0, 0.0)
    look = Look(MATTE, black, tuple(map(float, scene.background)), 0.0)
    walls = room_walls(Room((-half,) * 3, (half,) * 3, (black,) * 6))
    return [_sheet_mesh(Sheet(np.array(corner), u, v, look, front=True)) for corner, u, v in walls]


def _sheet_mesh(sheet: Sheet) -> Mesh:
    """Return two triangles."""
    normals = np.tile(sheet.normal, (4, 1))
    return _mesh(sheet.corners, normals, [(0, 1, 2), (0, 2, 3)], sheet.look, sheet.front)


def _box_mesh(box: Box, look: Look) -> Mesh:
    """Return twelve triangles; each side has points of its own."""
    axes = axes_of(box)
    points, normals, corners = [], [], []
    for number in range(6):
        across, sign = number // 2, 1.0 - 2.0 * (number % 2)
        out, u, v = (axes[:, (across + turn) % 3] for turn in range(3))
        u = sign * u
        middle = axes[:, 3] + sign * out
        points += [middle - u - v, middle + u - v, middle + u + v, middle - u + v]
        normals += [sign * out / np.linalg.norm(out)] * 4
        corners += [
            (4 * number, 4 * number + 1, 4 * number + 2),
            (4 * number, 4 * number + 2, 4 * number + 3),
        ]
    return _mesh(points, normals, corners, look, True, 2.0 * float(np.min(box.half_extent)))


def _sphere_mesh(ball: Sphere, look: Look) -> Mesh:
    """Return a sphere with its own normals, in bands between two poles."""
    theta = np.pi * np.arange(1, RINGS) / RINGS
    phi = 2.0 * np.pi * np.arange(SEGMENTS) / SEGMENTS
    bands = np.stack(
        np.broadcast_arrays(
            np.outer(np.sin(theta), np.sin(phi)),
            np.cos(theta)[:, None],
            np.outer(np.sin(theta), np.cos(phi)),
        ),
        axis=-1,
    )
    normals = np.concatenate([bands.reshape(-1, 3), [(0.0, 1.0, 0.0), (0.0, -1.0, 0.0)]])
    number = np.arange((RINGS - 1) * SEGMENTS).reshape(RINGS - 1, SEGMENTS)
    beside = np.roll(number, -1, axis=1)
    upper, lower = number[:-1], number[1:]
    upper_beside, lower_beside = beside[:-1], beside[1:]
    top, bottom = np.full(SEGMENTS, number.size), np.full(SEGMENTS, number.size + 1)
    bands_of = [(upper, lower, lower_beside), (upper, lower_beside, upper_beside)]
    caps = [(top, number[0], beside[0]), (bottom, beside[-1], number[-1])]
    corners = np.concatenate([np.stack(each, axis=-1).reshape(-1, 3) for each in bands_of + caps])
    points = np.array(ball.center) + ball.radius * normals
    return _mesh(points, normals, corners, look, True, 2.0 * ball.radius)


def _mesh(points: Any, normals: Any, corners: Any, look: Look, front: bool, thick: float = 0.0) -> Mesh:
    """Return a mesh in the numbers of files."""
    return Mesh(
        np.asarray(points, np.float32),
        np.asarray(normals, np.float32),
        np.asarray(corners, np.uint32),
        look,
        front,
        thick,
    )


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


def matrix_of(camera: Camera) -> list[float]:
    """Return right, up, back and position of a camera, the four columns of its matrix one after another."""
    return [float(value) for value in np.vstack([frame_of(camera), (0.0, 0.0, 0.0, 1.0)]).T.ravel()]


def request_of(shot: Shot, seed: int) -> dict[str, int]:
    """Return what formats without words for it keep as extra data."""
    return {"width": shot.size, "height": shot.size, "samples": shot.spp, "depth": shot.depth, "seed": seed}


def arrays_of(meshes: Sequence[Mesh]) -> dict[str, Any]:
    """Return accessors, views and the buffer of glTF; all components have four bytes, and so are aligned."""
    accessors: list[dict[str, Any]] = []
    views, parts, start = [], [], 0
    for mesh, name in product(meshes, ("points", "normals", "corners")):
        array = getattr(mesh, name)
        data = array.astype(array.dtype.newbyteorder("<")).tobytes()
        # What a view is for: numbers of corners, or points and normals.
        target = 34963 if name == "corners" else 34962
        views.append({"buffer": 0, "byteOffset": start, "byteLength": len(data), "target": target})
        accessor = {"bufferView": len(accessors), "type": "VEC3", "componentType": 5126, "count": len(array)}
        if name == "corners":
            accessor |= {"type": "SCALAR", "componentType": 5125, "count": array.size}
        if name == "points":
            accessor |= {"min": array.min(axis=0).tolist(), "max": array.max(axis=0).tolist()}
        accessors.append(accessor)
        parts.append(data)
        start += len(data)
    text = base64.b64encode(b"".join(parts)).decode("ascii")
    buffer = {"byteLength": start, "uri": f"data:application/octet-stream;base64,{text}"}
    return {"accessors": accessors, "bufferViews": views, "buffers": [buffer]}


def physical(look: Look) -> tuple[float, float]:
    """Return roughness and metalness, as materials of game engines have them; glass may have no tint."""
    if look.kind == GLASS and any(channel != 1.0 for channel in look.reflectance):
        raise NotExpressed("tinted glass")
    rough = {METAL: math.sqrt(look.number), MATTE: 1.0}.get(look.kind, 0.0)
    return rough, 1.0 if look.kind in (METAL, MIRROR) else 0.0


LEVEL_SLACK = 5e-4
"""Most that an emission in levels may be off, in its largest channel: a quarter of the slack of an answer."""


def levels_of(emission: Sequence[float]) -> tuple[int, float]:
    """Return three levels of eight bits as one number, and the intensity that makes them an emission.

    Of all levels of the largest channel the one is taken for which the others are nearest to theirs. Raises
    NotExpressed where that is off by more than LEVEL_SLACK of the largest.
    """
    largest = max(emission)
    if largest <= 0.0:
        return 0, 1.0
    linear = srgb_decode(np.arange(LEVELS + 1) / LEVELS)
    shares = np.array(emission) / largest
    wanted = shares * linear[1:, None]
    nearest = np.argmin(np.abs(linear - wanted[..., None]), axis=-1)
    errors = np.abs(linear[nearest] / linear[1:, None] - shares).max(axis=-1)
    # The brightest of the best.
    best = LEVELS - 1 - int(np.argmin(errors[::-1]))
    if errors[best] > LEVEL_SLACK:
        raise NotExpressed(f"emission of {', '.join(f'{c:g}' for c in emission)} in eight-bit levels")
    red, green, blue = map(int, nearest[best])
    return red << 16 | green << 8 | blue, float(largest / linear[best + 1])


def mirrored(vector: Iterable[float]) -> str:
    """Return a point as a text in left-handed coordinates."""
    x, y, z = vector
    return text((x, y, -z))


def refuse(what: str) -> None:
    """Say in a form what it cannot say."""
    raise NotExpressed(what)


@cache
def forms() -> Any:
    """Return the forms of scene files: templates in the folder `forms`."""
    found = jinja2.Environment(
        loader=jinja2.FileSystemLoader(Path(__file__).parent / "forms"),
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        keep_trailing_newline=True,
    )
    functions: list[Any] = [parts_of, meshes_of, sky_of, arrays_of, frame_of, axes_of, matrix_of, request_of]
    functions += [levels_of, physical, refuse, math.radians, math.sqrt, tuple]
    found.globals |= {each.__name__: each for each in functions}
    found.policies["json.dumps_kwargs"] = {"allow_nan": False}
    found.filters |= {"numbers": text, "mirrored": mirrored, "any": any}
    return found


def written(name: str, shot: Shot, seed: int) -> str:
    """Return a shot for a seed in the form of a name; raises NotExpressed."""
    values = {"shot": shot, "scene": shot.scene, "camera": shot.scene.camera, "seed": seed}
    text: str = forms().get_template(f"{name}.jinja").render(values)
    return text


def text(values: Iterable[float], between: str = ", ") -> str:
    """Return numbers that read back as they are."""
    return between.join(repr(float(value)) for value in values)
