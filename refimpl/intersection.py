"""Rays against the scene's primitives: closed formulas, one function per kind, all lanes at once.

1. [`build`] lays the scene out as tables of one float type, a row a primitive [`Geometry`]: boxes are
   grouped by the rotation that they share, so that a ray is turned once per group, and every surface gets a
   number (*surface id*). Groups of few boxes are joined, and rays turned for each box.
2. [`closest_hit`] asks each primitive, row by row [`fold_distances`], for the distance along the ray
   [`room_distance`, `box_distance`, `sphere_distance`, `quad_distance`] and keeps the least positive one with
   its id.
3. [`surface_at`] evaluates the winner once more for its normal, and looks its material up by id.
4. [`occluded`] is the shadow ray's question: does anything stand between two points?
5. [`spawn_origin`] lifts an origin off its surface, by an amount that follows the rounding error of a hit.

Sources: slabs, Kay and Kajiya 1986, in the centre and half-extent form; sphere, Haines et al., "Precision
Improvements for Ray/Sphere Intersection", Ray Tracing Gems, 2019 (no cancellation for far or large spheres).

Hard cases and their rules. A component of the direction that is (nearly) zero is replaced by
[`LEAST_COMPONENT`], so there is no 0 * infinity. Coincident faces: the primitive listed first wins, since a
later one must be strictly closer. A ray that starts inside a box or sphere meets it from inside. Normals
always face the ray's origin.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import chain, groupby
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import DTypeLike, NDArray

from . import vectors
from .materials import Material
from .scene import BLACK, IDENTITY, WALLS, Box, Light, Quad, Scene, Sphere, Vector

MISS = 1e30
"""Distance of a ray that hits nothing, in scene units; finite, so that no executor needs infinities."""

LEAST_COMPONENT = 1e-15
"""Least magnitude of a direction's component in a slab test, and of a cosine in a plane test. Over any
distance below 1e8 scene units the ray is moved by less than float32 can tell."""

SPAWN_OFFSET = 64 * 2.0**-24
"""Offset of a spawned ray's origin along the normal, relative to the size of the numbers involved. A hit
point carries a rounding error of about 10 units of 2**-24 (distance, product, sum, and a rotation there and
back); 64 leaves a margin and is still far below what can be seen. The same in float64, so that both types
trace the same paths."""

LEAST_SHARED = 4
"""Fewest boxes of a rotation for which rays are turned once instead of for each box: a scene of hundreds of
rotations is then one table of boxes, not hundreds of groups. (To turn a ray costs twice a slab test.)"""


CANCELLED = 16 * 2.0**-53
"""A sum of products below this share of its terms' magnitudes is rounding noise: centre, rotation and
products carry a few units of 2**-53 each. Boxes on a grid then share their slabs to the bit, and kernels
compute each slab once: a centre of 1e-16 here and -7e-18 there would be two."""


@dataclass(frozen=True)
class BoxGroup:
    """N boxes; per box: center in rotated axes (N, 3), half extent (N, 3).

    rotation is (3, 3) where they share it (`shared`), else (N, 3, 3).
    """

    rotation: Any
    rotated: bool
    first_id: int
    centers: Any
    half_extents: Any

    @property
    def shared(self) -> bool:
        """Tell whether all boxes have one rotation."""
        return bool(self.rotation.ndim == 2)


@dataclass(frozen=True)
class Geometry:
    """A scene as constants of one float type. S surfaces have the ids 0 .. S-1; S itself means "nothing".

    Tables have a row per id (and a last row for "nothing"): reflectance and emission (S+1, 3), light (S+1,)
    the light's index or -1. Spheres: center (N, 3), radius (N,). Quads and lights: corner, the two dual edges
    and the unit normal, (N, 3) each.
    """

    dtype: Any
    room: tuple[Any, Any] | None
    room_id: int
    groups: tuple[BoxGroup, ...]
    spheres: tuple[Any, Any]
    sphere_id: int
    quads: tuple[Any, Any, Any, Any]
    quad_id: int
    reflectance: Any
    emission: Any
    one_sided: Any
    light: Any
    background: Any

    @property
    def nothing(self) -> int:
        """The surface id of a ray that hits nothing."""
        return len(self.light) - 1


class Hit(NamedTuple):
    """Where rays meet the scene: distance t (...) (or [`MISS`]) and surface id (...)."""

    t: Any
    surface: Any


class Surface(NamedTuple):
    """Facts about hits: point, normal, reflectance, emission (..., 3) and light index (...)."""

    point: Any
    normal: Any
    reflectance: Any
    emission: Any
    light: Any


# -----------------------------------------------------------------------------------------------------------
# Layout


def build(scene: Scene, dtype: DTypeLike = np.float32) -> Geometry:
    """Return the scene's geometry as constants; computed in float64 and then rounded to dtype."""
    walls = len(WALLS) if scene.room is not None else 0
    boxes = _grouped(scene)
    sphere_id = walls + len(boxes)
    quad_id = sphere_id + len(scene.spheres)
    quads: tuple[Quad | Light, ...] = scene.quads + scene.lights
    rows = _material_rows(scene, boxes)
    light = [-1] * (quad_id + len(scene.quads)) + list(range(len(scene.lights))) + [-1]

    def constant(value: Any) -> NDArray[Any]:
        return np.asarray(value, dtype)

    return Geometry(
        dtype=np.dtype(dtype),
        room=None if scene.room is None else (constant(scene.room.low), constant(scene.room.high)),
        room_id=0,
        groups=_box_groups(scene, walls, constant),
        spheres=(
            _rows(constant([s.center for s in scene.spheres])),
            constant([s.radius for s in scene.spheres]),
        ),
        sphere_id=sphere_id,
        quads=_quad_tables(quads, constant),
        quad_id=quad_id,
        reflectance=constant([r for r, _ in rows]),
        emission=constant([e for _, e in rows]),
        one_sided=np.array(light) >= 0,
        light=np.array(light, np.int32),
        background=constant(scene.background),
    )


def _by_rotation(scene: Scene) -> list[list[Box]]:
    """Return the boxes of each rotation, in order of first use; of boxes there may be many."""
    found: dict[Any, list[Box]] = {}
    for box in scene.boxes:
        found.setdefault(box.rotation, []).append(box)
    return list(found.values())


def _grouped(scene: Scene) -> list[Box]:
    """Return the boxes in the order of their ids: by rotation."""
    return list(chain(*_by_rotation(scene)))


def _box_groups(scene: Scene, first_id: int, constant: Any) -> tuple[BoxGroup, ...]:
    """Group the boxes by rotation, join small groups, and turn the centres into the rotated axes."""
    groups = []
    for joined, run in groupby(_by_rotation(scene), _joined):
        for boxes in [list(chain(*run))] if joined else run:
            matrices = np.array([box.rotation for box in boxes], np.float64)
            centers = [_turned(m, np.array(b.center)) for m, b in zip(matrices, boxes, strict=True)]
            groups.append(
                BoxGroup(
                    rotation=constant(matrices if joined else matrices[0]),
                    rotated=boxes[0].rotation != IDENTITY,
                    first_id=first_id,
                    centers=constant(centers),
                    half_extents=constant([box.half_extent for box in boxes]),
                )
            )
            first_id += len(boxes)
    return tuple(groups)


def _joined(boxes: list[Box]) -> bool:
    """Tell whether rays are turned for each of the boxes that have a rotation, not for all at once."""
    return len(boxes) < LEAST_SHARED and boxes[0].rotation != IDENTITY


def _quad_tables(quads: tuple[Quad | Light, ...], constant: Any) -> tuple[Any, Any, Any, Any]:
    """Return the tables of the quads, (N, 3) each."""
    rows = [_quad_constants(quad) for quad in quads]
    corner, dual_u, dual_v, normal = (_rows(constant([row[i] for row in rows])) for i in range(4))
    return corner, dual_u, dual_v, normal


def _rows(table: Any) -> Any:
    """Return a table as (N, 3), also without rows."""
    return table.reshape(-1, 3)


def _turned(rotation: NDArray[np.float64], point: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return rotation (3, 3) times point (3,), with zeros where the terms cancel to their rounding errors."""
    size = np.abs(rotation) @ np.abs(point)
    turned = rotation @ point
    return np.where(np.abs(turned) <= CANCELLED * size, 0.0, turned)


def _quad_constants(quad: Quad | Light) -> tuple[Any, Any, Any, Any]:
    """Return corner, dual edges and unit normal: (p - corner) . dual is p's coordinate along the edge."""
    u, v = np.array(quad.edge_u, np.float64), np.array(quad.edge_v, np.float64)
    normal = vectors.cross(u, v)
    square = vectors.dot(normal, normal)
    dual_u, dual_v = vectors.cross(v, normal) / square, vectors.cross(normal, u) / square
    return np.array(quad.corner, np.float64), dual_u, dual_v, normal / np.sqrt(square)


def _material_rows(scene: Scene, boxes: list[Box]) -> list[tuple[Vector, Vector]]:
    """Return (reflectance, emission) of each surface in the order of ids; the last row is the background."""
    rows: list[tuple[Vector, Vector]] = []
    if scene.room is not None:
        rows += [(reflectance, scene.room.emission) for reflectance in scene.room.reflectances]
    parts: tuple[Box | Sphere | Quad, ...] = (*boxes, *scene.spheres, *scene.quads)
    rows += [(part.reflectance, part.emission) for part in parts]
    rows += [(BLACK, light_radiance(light)) for light in scene.lights]
    return [*rows, (BLACK, scene.background)]


def materials_by_id(scene: Scene) -> list[tuple[Material | None, Vector]]:
    """Return (material, centre) of each surface that reflects, in the order of ids.

    The centre of what has no inside is 0.
    """
    rows: list[tuple[Material | None, Vector]] = []
    if scene.room is not None:
        rows += [(material, BLACK) for material in scene.room.materials or (None,) * len(WALLS)]
    bodies: tuple[Box | Sphere, ...] = (*_grouped(scene), *scene.spheres)
    rows += [(body.material, body.center) for body in bodies]
    return [*rows, *((quad.material, BLACK) for quad in scene.quads)]


def light_radiance(light: Light) -> Vector:
    """Return the radiance per channel, W / (sr m^2), that a light emits: power color / (pi area)."""
    area = 1.0 / quad_area_pdf(light)
    red, green, blue = (light.power * c / (np.pi * area) for c in light.color)
    return red, green, blue


def quad_area_pdf(quad: Quad | Light) -> float:
    """Return 1 / area of a quad."""
    normal = np.cross(np.array(quad.edge_u, np.float64), np.array(quad.edge_v, np.float64))
    return float(1.0 / np.sqrt(normal @ normal))


# -----------------------------------------------------------------------------------------------------------
# One primitive


def slabs(center: Any, half_extent: Any, origin: Any, inverse: Any) -> tuple[Any, Any]:
    """Return the distances (..., 3) at which rays enter and leave the three slabs of a box.

    origin and inverse (1 / direction) are (..., 3), in the box's axes.
    """
    middle, half = (center - origin) * inverse, half_extent * np.abs(inverse)
    return middle - half, middle + half


def box_distance(enter: Any, leave: Any) -> Any:
    """Return the distance (...) at which rays meet a box, given [`slabs`]; from inside, that of the exit."""
    t_near, t_far = vectors.largest(enter), vectors.smallest(leave)
    return np.where((t_near <= t_far) & (t_far > 0.0), np.where(t_near > 0.0, t_near, t_far), MISS)


def room_distance(enter: Any, leave: Any) -> Any:
    """Return the distance (...) at which rays leave a room; the near walls are not there."""
    t_near, t_far = vectors.largest(enter), vectors.smallest(leave)
    return np.where((t_near <= t_far) & (t_far > 0.0), t_far, MISS)


def sphere_distance(center: Any, radius: Any, origin: Any, direction: Any) -> Any:
    """Return the distance (...) at which rays meet a sphere; from inside, that of the exit."""
    f = origin - center
    b = -vectors.dot(f, direction)
    # The discriminant, from the point of the ray that is nearest to the centre.
    nearest = f + vectors.scale(direction, b)
    discriminant = radius * radius - vectors.dot(nearest, nearest)
    root = np.sqrt(np.maximum(discriminant, 0.0))
    # Add numbers of the same sign for one root; the other follows from their product.
    q = b + np.where(b < 0.0, -root, root)
    other = (vectors.dot(f, f) - radius * radius) / np.where(q == 0.0, LEAST_COMPONENT, q)
    t_near, t_far = np.minimum(q, other), np.maximum(q, other)
    return np.where((discriminant > 0.0) & (t_far > 0.0), np.where(t_near > 0.0, t_near, t_far), MISS)


def quad_distance(quad: tuple[Any, Any, Any, Any], origin: Any, direction: Any) -> Any:
    """Return the distance (...) at which rays meet a quad (corner, dual edges, normal) from either side."""
    corner, dual_u, dual_v, normal = quad
    t = vectors.dot(corner - origin, normal) / _away_from_zero(vectors.dot(direction, normal))
    offset = origin + vectors.scale(direction, t) - corner
    a, b = vectors.dot(offset, dual_u), vectors.dot(offset, dual_v)
    return np.where((t > 0.0) & (a >= 0.0) & (a <= 1.0) & (b >= 0.0) & (b <= 1.0), t, MISS)


def _away_from_zero(x: Any) -> Any:
    """Return x (...) with its magnitude raised to [`LEAST_COMPONENT`] where it is smaller."""
    least = np.full_like(x, LEAST_COMPONENT)  # np.where of two Python numbers would be float64
    return np.where(np.abs(x) < LEAST_COMPONENT, np.where(x < 0.0, -least, least), x)


def _inverse(direction: Any) -> Any:
    """Return 1 / direction (..., 3), finite for rays that are parallel to an axis."""
    return np.reciprocal(_away_from_zero(direction))


# -----------------------------------------------------------------------------------------------------------
# The scene


Take = Callable[[tuple[Any, ...], Any, Any], tuple[Any, ...]]
"""(values (...), a primitive's distance (...), its surface id) -> the values after this primitive."""


def closest_hit(geometry: Geometry, origin: Any, direction: Any) -> Hit:
    """Return the nearest surface that rays (origin, unit direction; (..., 3)) meet; of equals the first."""

    def nearer(values: tuple[Any, ...], t_new: Any, surface_new: Any) -> tuple[Any, ...]:
        t, surface = values
        surface = np.where(t_new < t, surface_new, surface)
        return np.minimum(t, t_new), surface

    t = np.full_like(direction[..., 0], MISS)
    surface = np.full_like(direction[..., 0], geometry.nothing, dtype=np.int32)
    t, surface = fold_distances(geometry, origin, direction, nearer, (t, surface))
    if geometry.room is not None:
        surface = np.where(surface == geometry.room_id, _wall(geometry, origin, direction), surface)
    return Hit(t, surface)


def occluded(geometry: Geometry, origin: Any, direction: Any, t_max: Any) -> Any:
    """Tell (...) whether rays meet anything nearer than t_max (...)."""

    def nearer(values: tuple[Any, ...], t_new: Any, _: Any) -> tuple[Any, ...]:
        return (np.minimum(values[0], t_new),)

    t = np.full_like(direction[..., 0], MISS)
    (t,) = fold_distances(geometry, origin, direction, nearer, (t,))
    return t < t_max


def fold_distances(
    geometry: Geometry, origin: Any, direction: Any, take: Take, values: tuple[Any, ...]
) -> tuple[Any, ...]:
    """Return the values after take(values, distance, surface id) for each primitive in the order of ids.

    A room has the id of its first wall.
    """
    if geometry.room is not None:
        t_room = room_distance(*_room_slabs(geometry, origin, direction))
        values = take(values, t_room, np.int32(geometry.room_id))
    for group in geometry.groups:
        values = _fold_boxes(group, origin, direction, take, values)

    def meet_sphere(values: tuple[Any, ...], center: Any, radius: Any, surface: Any) -> tuple[Any, ...]:
        return take(values, sphere_distance(center, radius, origin, direction), surface)

    def meet_quad(values: tuple[Any, ...], *row: Any) -> tuple[Any, ...]:
        *quad, surface = row
        return take(values, quad_distance(tuple(quad), origin, direction), surface)

    values = _fold(meet_sphere, geometry.spheres, geometry.sphere_id, values)
    return _fold(meet_quad, geometry.quads, geometry.quad_id, values)


def _fold_boxes(
    group: BoxGroup, origin: Any, direction: Any, take: Take, values: tuple[Any, ...]
) -> tuple[Any, ...]:
    """Return the values after the boxes of a group."""
    boxes = (group.centers, group.half_extents)

    def meet(values: tuple[Any, ...], ray: tuple[Any, Any], center: Any, half: Any, surface: Any) -> Any:
        return take(values, box_distance(*slabs(center, half, *ray)), surface)

    def meet_turned(values: tuple[Any, ...], rotation: Any, *box: Any) -> Any:
        local_origin, local_direction = _into_axes(rotation, origin, direction)
        return meet(values, (local_origin, _inverse(local_direction)), *box)

    if not group.shared:
        return _fold(meet_turned, (group.rotation, *boxes), group.first_id, values)
    local_origin, local_direction = _into_group(group, None, origin, direction)
    ray = local_origin, _inverse(local_direction)
    return _fold(lambda values, *box: meet(values, ray, *box), boxes, group.first_id, values)


def _fold(step: Any, tables: tuple[Any, ...], first_id: int, values: tuple[Any, ...]) -> tuple[Any, ...]:
    """Return the values after the rows of tables whose primitives are numbered from first_id on."""
    ids = np.arange(first_id, first_id + len(tables[0]), dtype=np.int32)
    folded: tuple[Any, ...] = vectors.fold_rows(step, (*tables, ids), values)
    return folded


def _room_slabs(geometry: Geometry, origin: Any, direction: Any) -> tuple[Any, Any]:
    """Return the slab distances of the room."""
    assert geometry.room is not None
    low, high = geometry.room
    return slabs(0.5 * (low + high), 0.5 * (high - low), origin, _inverse(direction))


def _wall(geometry: Geometry, origin: Any, direction: Any) -> Any:
    """Return the id (...) of the wall through which rays leave the room: the axis whose slab ends first."""
    _, leave = _room_slabs(geometry, origin, direction)
    x_id, y_id, z_id = (
        np.where(
            direction[..., i] > 0.0,
            np.int32(geometry.room_id + 2 * i + 1),
            np.int32(geometry.room_id + 2 * i),
        )
        for i in range(3)
    )
    leaves_x, leaves_y = _least_axis(leave)
    return np.where(leaves_x, x_id, np.where(leaves_y, y_id, z_id))


def _least_axis(a: Any) -> tuple[Any, Any]:
    """Tell (...) whether x, and if not whether y, is the least component of a (..., 3)."""
    return (a[..., 0] <= a[..., 1]) & (a[..., 0] <= a[..., 2]), a[..., 1] <= a[..., 2]


def _into_group(group: BoxGroup, index: Any, origin: Any, direction: Any) -> tuple[Any, Any]:
    """Return rays in the axes of a group's boxes number index (...), which groups that share them ignore."""
    if not group.rotated:
        return origin, direction
    if group.shared:
        return _into_axes(group.rotation, origin, direction)
    rows = [vectors.look_up_rows(group.rotation[:, i], index) for i in range(3)]
    return _into_axes(rows, origin, direction)


def _into_axes(rotation: Any, origin: Any, direction: Any) -> tuple[Any, Any]:
    """Return rays in rotated axes."""
    return vectors.rotate(rotation, origin), vectors.rotate(rotation, direction)


def _out_of_group(group: BoxGroup, index: Any, normal: Any) -> Any:
    """Return normals (..., 3) in the axes of a group's boxes number index (...) as those of the scene."""
    if not group.rotated:
        return normal
    if group.shared:
        return vectors.rotate(np.swapaxes(group.rotation, 0, 1), normal)
    columns = [vectors.look_up_rows(group.rotation[:, :, i], index) for i in range(3)]
    return vectors.rotate(columns, normal)


def spawn_origin(point: Any, normal: Any, t: Any) -> Any:
    """Return the origin (..., 3) of a ray that leaves a surface on the side of its normal.

    point is origin + t direction of the ray that arrived: its error grows with its coordinates and with t
    (...).
    """
    size = vectors.largest(np.abs(point)) + t
    return point + vectors.scale(normal, SPAWN_OFFSET * size)


# -----------------------------------------------------------------------------------------------------------
# The surface at a hit


def surface_at(geometry: Geometry, hit: Hit, origin: Any, direction: Any) -> Surface:
    """Return point, normal and material of hits; for misses the background as emission, and zeros."""
    found = hit.surface < geometry.nothing
    t = np.where(found, hit.t, 0.0)
    point = choose_or_zero(found, origin + vectors.scale(direction, t))
    normal = choose_or_zero(found, _normal(geometry, hit, point, origin, direction))
    emission = vectors.look_up_rows(geometry.emission, hit.surface)
    # Lights are black behind.
    light = vectors.look_up(geometry.light, hit.surface)
    if geometry.quad_id < geometry.nothing:
        front = vectors.look_up_rows(_quad_normals(geometry), hit.surface)
        behind = vectors.look_up(geometry.one_sided, hit.surface) & (vectors.dot(front, direction) > 0.0)
        emission = vectors.choose(behind, 0.0, emission)
    return Surface(point, normal, vectors.look_up_rows(geometry.reflectance, hit.surface), emission, light)


def choose_or_zero(condition: Any, a: Any) -> Any:
    """Return vectors a (..., 3) where condition (...) holds, else zero."""
    return vectors.choose(condition, a, 0.0)


def _quad_normals(geometry: Geometry) -> Any:
    """Return the table (S+1, 3) of the quads' own normals; zero for other surfaces."""
    table = np.zeros((geometry.nothing + 1, 3), geometry.dtype)
    table[geometry.quad_id : geometry.nothing] = geometry.quads[-1]
    return table


def _normal(geometry: Geometry, hit: Hit, point: Any, origin: Any, direction: Any) -> Any:
    """Return the unit normals (..., 3), facing the rays' origins, from the kinds that the scene has."""
    normal = np.zeros_like(direction)
    # Each kind that the scene has gives normals to all lanes; those of its own ids are kept.
    if geometry.room is not None:
        _, leave = _room_slabs(geometry, origin, direction)
        normal = _axis_normal(*_least_axis(leave), direction)
    for group in geometry.groups:
        inside = (hit.surface >= group.first_id) & (hit.surface < group.first_id + len(group.centers))
        normal = vectors.choose(inside, _box_normal(group, hit, origin, direction), normal)
    if geometry.sphere_id < geometry.quad_id:
        inside = (hit.surface >= geometry.sphere_id) & (hit.surface < geometry.quad_id)
        normal = vectors.choose(inside, _sphere_normal(geometry, hit, point, direction), normal)
    if geometry.quad_id < geometry.nothing:
        inside = (hit.surface >= geometry.quad_id) & (hit.surface < geometry.nothing)
        front = vectors.look_up_rows(_quad_normals(geometry), hit.surface)
        normal = vectors.choose(inside, _facing(front, direction), normal)
    return normal


def _facing(normal: Any, direction: Any) -> Any:
    """Turn normals (..., 3) against the directions (..., 3) of the rays that meet them."""
    return vectors.choose(vectors.dot(normal, direction) > 0.0, -normal, normal)


def _axis_normal(is_x: Any, is_y: Any, direction: Any) -> Any:
    """Return the axis-parallel normals (..., 3) against direction: of x, else of y, else of z."""
    against = np.where(direction > 0.0, -np.ones_like(direction), np.ones_like(direction))
    x, y, z = against[..., 0], against[..., 1], against[..., 2]
    nothing = np.zeros_like(x)
    return vectors.vector(
        np.where(is_x, x, nothing),
        np.where(~is_x & is_y, y, nothing),
        np.where(~is_x & ~is_y, z, nothing),
    )


def _box_normal(group: BoxGroup, hit: Hit, origin: Any, direction: Any) -> Any:
    """Return the normals (..., 3) of hits on a group's boxes.

    The winner's slabs are evaluated once more, in the same way as in [`closest_hit`], so the face is the one
    that gave the distance, also at edges.
    """
    index = np.minimum(np.maximum(hit.surface - np.int32(group.first_id), 0), len(group.centers) - 1)
    local_origin, local_direction = _into_group(group, index, origin, direction)
    center = vectors.look_up_rows(group.centers, index)
    half_extent = vectors.look_up_rows(group.half_extents, index)
    enter, leave = slabs(center, half_extent, local_origin, _inverse(local_direction))
    # From outside the last slab entered decides, from inside the first one left.
    face = vectors.choose(vectors.largest(enter) > 0.0, -enter, leave)
    normal = _axis_normal(*_least_axis(face), local_direction)
    return _out_of_group(group, index, normal)


def _sphere_normal(geometry: Geometry, hit: Hit, point: Any, direction: Any) -> Any:
    """Return the normals (..., 3) of hits on spheres, for points (..., 3) on them."""
    centers, radii = geometry.spheres
    index = np.minimum(np.maximum(hit.surface - np.int32(geometry.sphere_id), 0), len(radii) - 1)
    center, radius = vectors.look_up_rows(centers, index), vectors.look_up(radii, index)
    return _facing((point - center) / radius[..., np.newaxis], direction)
