"""Spheres.

Source: Haines et al., "Precision Improvements for Ray/Sphere Intersection", Ray Tracing Gems, 2019 (no
cancellation for far or large spheres).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ... import vectors
from ...vectors import Directions, Floats, Normals, Points
from ..materials import Material
from .shape import BLACK, LEAST_COMPONENT, MISS, OMITTED, Extent, Met, Shape, Vector, require


@dataclass(frozen=True)
class Sphere(Shape):
    """Sphere of `radius` around `center`."""

    kind = "spheres"
    closed = True

    center: Vector
    radius: float
    reflectance: Vector
    emission: Vector = BLACK
    material: Material | None = field(default=None, metadata=OMITTED)

    def check(self, path: str) -> None:
        """Refuse a radius of 0 and below."""
        require(self.radius > 0.0, self.radius, f"{path}.radius", "must be positive", "use a positive radius")

    @property
    def extent(self) -> Extent:
        """The radius, to all sides."""
        return Extent(np.array(self.center) - self.radius, np.array(self.center) + self.radius)

    @property
    def row(self) -> tuple[Any, ...]:
        """Centre and radius."""
        return self.center, self.radius

    @staticmethod
    def distance(row: tuple[Any, ...], origin: Points, direction: Directions) -> Floats:
        """Return the distance (...) at which rays meet a sphere; from inside, that of the exit."""
        center, radius = row
        return sphere_distance(center, radius, origin, direction)

    @staticmethod
    def normal(row: tuple[Any, ...], met: Met) -> Normals:
        """Return the direction from the centre."""
        center, radius = row
        outward: Normals = (met.point - center) / radius[..., np.newaxis]
        return outward


def sphere_distance(center: Points, radius: Floats, origin: Points, direction: Directions) -> Floats:
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
