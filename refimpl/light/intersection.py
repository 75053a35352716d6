"""Rays against the scene: the nearest surface, all lanes at once.

1. [`build`] lays the scene out as tables of one float type [`Geometry`]: the shapes in groups, kind by kind,
   and every surface gets a number (*surface id*).
2. [`closest_hit`] asks the room and each shape, row by row [`fold_distances`], for the distance along the ray
   and keeps the least positive one with its id. The formulas are the shapes' own (shapes/).
3. [`surface_at`] evaluates the winner once more for its normal, and looks its material up by id.
4. [`occluded`] is the shadow ray's question: does anything block the line between two points?
5. [`spawn_origin`] lifts an origin off its surface, by an amount that follows the rounding error of a hit.

Of coincident faces the primitive listed first wins, since a later one must be strictly closer. Normals always
face the ray's origin.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import DTypeLike, NDArray

from .. import vectors
from ..vectors import Colors, Directions, Floats, Ids, Normals, Points, Radiance, Truths
from .materials import Material
from .scene import WALLS, Scene
from .shapes import Group, Light, Shape, kinds
from .shapes.box import axis_normal, least_axis, room_distance, slabs
from .shapes.quad import light_radiance
from .shapes.shape import BLACK, MISS, Met, Take, Values, Vector, inverse

SPAWN_OFFSET = 64 * 2.0**-24
"""Offset of a spawned ray's origin along the normal, relative to the size of the numbers involved. A hit
point carries a rounding error of about 10 units of 2**-24 (distance, product, sum, and a rotation there and
back); 64 leaves a margin and is still far below what can be seen. The same in float64, so that both types
trace the same paths."""


@dataclass(frozen=True)
class Geometry:
    """A scene as constants of one float type. S surfaces have the ids 0 .. S-1; S itself means "nothing".

    Tables have a row per id (and a last row for "nothing"): reflectance and emission (S+1, 3), light (S+1,)
    the light's index or -1. A room has the corners low and high (3,).
    """

    dtype: Any
    room: tuple[Any, Any] | None
    groups: tuple[Group, ...]
    reflectance: Any
    emission: Any
    one_sided: Any
    light: Any

    @property
    def nothing(self) -> int:
        """The surface id of a ray that hits nothing."""
        return len(self.light) - 1


class Hit(NamedTuple):
    """Where rays meet the scene: distance t (...) (or [`MISS`]) and surface id (...)."""

    t: Floats
    surface: Ids


class Surface(NamedTuple):
    """Facts about hits: point, normal, reflectance, emission (..., 3) and light index (...)."""

    point: Points
    normal: Normals
    reflectance: Colors
    emission: Radiance
    light: Ids


def reflecting(point: Points, normal: Normals, reflectance: Colors) -> Surface:
    """Return a surface of which nobody asks for emission and light."""
    unknown: Any = None
    return Surface(point, normal, reflectance, unknown, unknown)


# -----------------------------------------------------------------------------------------------------------
# Layout


def build(scene: Scene, dtype: DTypeLike = np.float32) -> Geometry:
    """Return the scene's geometry as constants; computed in float64 and then rounded to dtype."""

    def constant(value: Any) -> NDArray[Any]:
        return np.asarray(value, dtype)

    groups: list[Group] = []
    first_id = len(WALLS) if scene.room is not None else 0
    for kind in kinds():
        parts = kind.parts(scene)
        groups += kind.groups(parts, first_id, constant)
        first_id += len(parts)
    rows = _rows(scene)
    numbers = iter(range(len(scene.lights)))
    light = [next(numbers) if isinstance(row.part, Light) else -1 for row in rows]
    return Geometry(
        dtype=np.dtype(dtype),
        room=None if scene.room is None else (constant(scene.room.low), constant(scene.room.high)),
        groups=tuple(groups),
        reflectance=constant([row.reflectance for row in rows]),
        emission=constant([row.emission for row in rows]),
        one_sided=np.array(light) >= 0,
        light=np.array(light, np.int32),
    )


class _Row(NamedTuple):
    """What tables hold of a surface; `part` is its shape or light, None for a wall and the background."""

    part: Shape | Light | None
    reflectance: Vector
    emission: Vector
    material: Material | None = None


def _rows(scene: Scene) -> list[_Row]:
    """Return each surface in the order of ids; the last row is the background."""
    rows = []
    if scene.room is not None:
        made_of = scene.room.materials or (None,) * len(WALLS)
        for reflectance, material in zip(scene.room.reflectances, made_of, strict=True):
            rows.append(_Row(None, reflectance, scene.room.emission, material))
    for kind in kinds():
        for part in kind.parts(scene):
            if isinstance(part, Light):
                rows.append(_Row(part, BLACK, light_radiance(part)))
            else:
                rows.append(_Row(part, part.reflectance, part.emission, part.material))
    return [*rows, _Row(None, BLACK, scene.background)]


def materials_by_id(scene: Scene) -> list[tuple[Material | None, Vector]]:
    """Return (material, centre) of each surface that reflects, in the order of ids: lights are the last.

    The centre of what has no inside is 0.
    """
    rows = _rows(scene)
    reflect = rows[: len(rows) - len(scene.lights) - 1]
    return [(row.material, getattr(row.part, "center", BLACK)) for row in reflect]


# -----------------------------------------------------------------------------------------------------------
# The scene


def closest_hit(geometry: Geometry, origin: Points, direction: Directions) -> Hit:
    """Return the nearest surface that rays (origin, unit direction; (..., 3)) meet; of equals the first."""

    def nearer(values: tuple[Any, Any], t_new: Floats, surface_new: Ids | np.int32) -> tuple[Any, Any]:
        t, surface = values
        surface = np.where(t_new < t, surface_new, surface)
        return np.minimum(t, t_new), surface

    t = np.full_like(direction[..., 0], MISS)
    surface = np.full_like(direction[..., 0], geometry.nothing, dtype=np.int32)
    t, surface = fold_distances(geometry, origin, direction, nearer, (t, surface))
    if geometry.room is not None:
        surface = np.where(surface == 0, _wall(geometry, origin, direction), surface)
    return Hit(t, surface)


def occluded(
    geometry: Geometry, origin: Points, direction: Directions, t_max: Floats, asked: Truths | None = None
) -> Truths:
    """Tell (...) whether rays meet anything nearer than t_max (...).

    The answer is of no use where asked (...) does not hold.
    """

    def nearer(values: tuple[Any], t_new: Floats, _: Ids | np.int32) -> tuple[Any]:
        return (np.minimum(values[0], t_new),)

    t = np.full_like(direction[..., 0], MISS)
    reach = t_max if asked is None else np.where(asked, t_max, 0.0)
    (t,) = fold_distances(geometry, origin, direction, nearer, (t,), reach)
    return t < t_max


def fold_distances(
    geometry: Geometry,
    origin: Points,
    direction: Directions,
    take: Take,
    values: Values,
    reach: Floats | None = None,
) -> Values:
    """Return the values after take(values, distance, surface id) for each primitive in the order of ids.

    A room has the id of its first wall. Who gives a reach (...) asks only whether a distance is below it.
    """
    if geometry.room is not None:
        t_room = room_distance(*_room_slabs(geometry, origin, direction))
        values = take(values, t_room, np.int32(0))
    for group in geometry.groups:
        values = group.fold(origin, direction, take, values, reach)
    return values


def _room_slabs(geometry: Geometry, origin: Points, direction: Directions) -> tuple[Floats, Floats]:
    """Return the slab distances of the room."""
    assert geometry.room is not None
    low, high = geometry.room
    return slabs(0.5 * (low + high), 0.5 * (high - low), origin, inverse(direction))


def _wall(geometry: Geometry, origin: Points, direction: Directions) -> Ids:
    """Return the id (...) of the wall through which rays leave the room: the axis whose slab ends first."""
    _, leave = _room_slabs(geometry, origin, direction)
    x_id, y_id, z_id = (
        np.where(
            direction[..., i] > 0.0,
            np.int32(2 * i + 1),
            np.int32(2 * i),
        )
        for i in range(3)
    )
    leaves_x, leaves_y = least_axis(leave)
    return np.where(leaves_x, x_id, np.where(leaves_y, y_id, z_id))


def spawn_origin(point: Points, normal: Normals, t: Floats) -> Points:
    """Return the origin (..., 3) of a ray that leaves a surface on the side of its normal.

    point is origin + t direction of the ray that arrived: its error grows with its coordinates and with t
    (...).
    """
    size = vectors.largest(np.abs(point)) + t
    origin: Points = point + vectors.scale(normal, SPAWN_OFFSET * size)
    return origin


# -----------------------------------------------------------------------------------------------------------
# The surface at a hit


def surface_at(geometry: Geometry, hit: Hit, origin: Points, direction: Directions) -> Surface:
    """Return point, normal and material of hits; for misses the background as emission, and zeros."""
    found = hit.surface < geometry.nothing
    t = np.where(found, hit.t, 0.0)
    point = choose_or_zero(found, origin + vectors.scale(direction, t))
    met = Met(hit.surface, point, origin, direction, _fronts(geometry))
    normal = choose_or_zero(found, _normal(geometry, met))
    emission = emission_at(geometry, hit, direction)
    light = vectors.look_up(geometry.light, hit.surface)
    return Surface(point, normal, vectors.look_up_rows(geometry.reflectance, hit.surface), emission, light)


def emission_at(geometry: Geometry, hit: Hit, direction: Directions) -> Radiance:
    """Return the radiance (..., 3) that hits send back along rays; for misses the background's."""
    emission: Radiance = vectors.look_up_rows(geometry.emission, hit.surface)
    # Lights are black behind.
    if any(group.fronts is not None for group in geometry.groups):
        front = vectors.look_up_rows(_fronts(geometry), hit.surface)
        behind = vectors.look_up(geometry.one_sided, hit.surface) & (vectors.dot(front, direction) > 0.0)
        emission = vectors.choose(behind, 0.0, emission)
    return emission


def choose_or_zero(condition: Truths, a: Points) -> Points:
    """Return vectors a (..., 3) where condition (...) holds, else zero."""
    chosen: Points = vectors.choose(condition, a, 0.0)
    return chosen


def _fronts(geometry: Geometry) -> Any:
    """Return the table (S+1, 3) of the normals of surfaces that have a front; zero for the others."""
    table = np.zeros((geometry.nothing + 1, 3), geometry.dtype)
    for group in geometry.groups:
        if group.fronts is not None:
            # Numbers that a kernel is given are objects: then so are all.
            table = table.astype(np.result_type(table, group.fronts), copy=False)
            table[group.first_id : group.first_id + len(group)] = group.fronts
    return table


def _normal(geometry: Geometry, met: Met) -> Normals:
    """Return the unit normals (..., 3), facing the rays' origins, from the kinds that the scene has."""
    normal: Normals = np.zeros_like(met.direction)
    # Each kind that the scene has gives normals to all lanes; those of its own ids are kept.
    if geometry.room is not None:
        _, leave = _room_slabs(geometry, met.origin, met.direction)
        normal = axis_normal(*least_axis(leave), met.direction)
    for group in geometry.groups:
        inside = (met.surface >= group.first_id) & (met.surface < group.first_id + len(group))
        normal = vectors.choose(inside, group.normal(met), normal)
    return normal
