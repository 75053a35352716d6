"""A ray meets a sphere.

A ray is a point `origin` and a unit `direction`; its points are origin + t * direction, t > 0. One that only
touches the sphere misses it. Arguments are not changed. Tutorial: page 1. Clauses: ISC-6, ISC-2.

A plain solution passes all checks but the last one, which asks for a small sphere that is far away, in single
precision: there b * b - (f . f - r * r) has lost the radius. Measure the discriminant at the point of the ray
that is nearest to the centre instead. (float64 on the way would do too; most shaders have none.)
"""

from __future__ import annotations

from typing import Any

MISS = 1e30
"""The distance of a ray that meets nothing."""


def meet_sphere(center: Any, radius: Any, origin: Any, direction: Any) -> Any:
    """Return the distance (...) at which rays, origin and direction (..., 3), meet a sphere, or MISS.

    One origin (3,) may have many directions. From outside it is that of the entry, from inside that of the
    exit. center is (3,), radius a number; all are of one float type, and so is the result.
    """
    raise NotImplementedError("meet_sphere")
