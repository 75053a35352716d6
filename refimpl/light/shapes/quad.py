"""Parallelograms: quads, which look alike from both sides, and lights, which emit from one.

Lights are numbered after the quads and are in the same tables: a ray meets both in the same way.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from ... import vectors
from ...vectors import Directions, Floats, Normals, Points
from ..materials import Material
from .shape import (
    BLACK,
    MISS,
    OMITTED,
    Constant,
    Extent,
    Group,
    Met,
    Rows,
    Shape,
    Vector,
    away_from_zero,
    cross,
    facing,
    length,
    require,
    spans_area,
)

if TYPE_CHECKING:
    from ..scene import Scene


@dataclass(frozen=True)
class Parallelogram:
    """Points corner + a edge_u + b edge_v for a, b in [0, 1]."""

    corner: Vector
    edge_u: Vector
    edge_v: Vector

    def check(self, path: str) -> None:
        """Refuse edges that span no area."""
        rule, way_out = "the edges must span an area", "make it not parallel to edge_u"
        require(spans_area(self.edge_u, self.edge_v), self.edge_v, f"{path}.edge_v", rule, way_out)

    @property
    def extent(self) -> Extent:
        """The corners' least and greatest coordinates; a hit's error moves an edge by 1 / sine as much."""
        corner, u, v = (np.array(numbers, np.float64) for numbers in (self.corner, self.edge_u, self.edge_v))
        corners = np.array([corner, corner + u, corner + v, corner + u + v])
        area = cross(self.edge_u, self.edge_v)
        sine = length(area) / (length(self.edge_u) * length(self.edge_v))
        return Extent(corners.min(axis=0), corners.max(axis=0), 1.0 + 2.0 / sine)


@dataclass(frozen=True)
class Quad(Parallelogram, Shape):
    """Parallelogram both of whose sides reflect and emit alike."""

    kind = "quads"

    reflectance: Vector
    emission: Vector = BLACK
    material: Material | None = field(default=None, metadata=OMITTED)

    @staticmethod
    def distance(row: tuple[Any, ...], origin: Points, direction: Directions) -> Floats:
        """Return the distance (...) at which rays meet a quad."""
        return quad_distance(row, origin, direction)

    @classmethod
    def parts(cls, scene: Scene) -> tuple[Quad | Light, ...]:
        """Return the scene's quads and lights."""
        return scene.quads + scene.lights

    @classmethod
    def groups(cls, parts: Sequence[Quad | Light], first_id: int, constant: Constant) -> tuple[Group, ...]:
        """Return the tables of quads: corner, dual edges and unit normal, (N, 3) each."""
        columns = zip(*map(quad_row, parts), strict=True)
        tables = tuple(constant(column) for column in columns)
        return (QuadGroup(cls, first_id, tables),) if tables else ()


@dataclass(frozen=True)
class Light(Parallelogram):
    """Parallelogram that emits from the side of edge_u x edge_v, and reflects nothing.

    `power` (W) times `color` (relative, linear RGB) is the flux that leaves it, so its radiance per channel
    is power * color / (pi * area): a Lambertian emitter.
    """

    color: Vector
    power: float

    def check(self, path: str) -> None:
        """Refuse edges that span no area, and negative light."""
        super().check(path)
        light = "use 0 or more"
        require(min(self.color) >= 0.0, self.color, f"{path}.color", "a colour must not be negative", light)
        require(self.power >= 0.0, self.power, f"{path}.power", "power must not be negative", light)


@dataclass(frozen=True)
class QuadGroup(Rows):
    """Quads and lights."""

    @property
    def fronts(self) -> Any:
        """The normals (N, 3) on the side of edge_u x edge_v."""
        return self.tables[-1]

    def normal(self, met: Met) -> Normals:
        """Return the quads' own normals (..., 3), turned to face the rays' origins."""
        return facing(vectors.look_up_rows(met.fronts, met.surface), met.direction)


def quad_row(quad: Parallelogram) -> tuple[Any, ...]:
    """Return corner, dual edges and unit normal: (p - corner) . dual is p's coordinate along the edge."""
    u, v = np.array(quad.edge_u, np.float64), np.array(quad.edge_v, np.float64)
    normal = vectors.cross(u, v)
    square = vectors.dot(normal, normal)
    dual_u, dual_v = vectors.cross(v, normal) / square, vectors.cross(normal, u) / square
    return np.array(quad.corner, np.float64), dual_u, dual_v, normal / np.sqrt(square)


def quad_area_pdf(quad: Parallelogram) -> float:
    """Return 1 / area of a quad."""
    normal = np.cross(np.array(quad.edge_u, np.float64), np.array(quad.edge_v, np.float64))
    return float(1.0 / np.sqrt(normal @ normal))


def light_radiance(light: Light) -> Vector:
    """Return the radiance per channel, W / (sr m^2), that a light emits: power color / (pi area)."""
    area = 1.0 / quad_area_pdf(light)
    red, green, blue = (light.power * c / (np.pi * area) for c in light.color)
    return red, green, blue


def quad_distance(quad: tuple[Any, ...], origin: Points, direction: Directions) -> Floats:
    """Return the distance (...) at which rays meet a quad (corner, dual edges, normal) from either side."""
    corner, dual_u, dual_v, normal = quad
    t = vectors.dot(corner - origin, normal) / away_from_zero(vectors.dot(direction, normal))
    offset = origin + vectors.scale(direction, t) - corner
    a, b = vectors.dot(offset, dual_u), vectors.dot(offset, dual_v)
    return np.where((t > 0.0) & (a >= 0.0) & (a <= 1.0) & (b >= 0.0) & (b <= 1.0), t, MISS)
