"""Light on a matte surface, found in two ways and weighted.

A Lambertian surface sends f = reflectance / pi of what arrives, times the cosine. Draw the next direction
by the cosine density and little is left of that: what? Then combine this way to find a light with the other
one, points of the light, by the power heuristic. Tutorial: page 3. Clauses: LAM-1, SMP-2, LTR-5.
"""

from __future__ import annotations

from typing import Any


def bounce(reflectance: Any, u0: Any, u1: Any) -> tuple[Any, Any, Any]:
    """Return directions (..., 3) around the normal +z of a matte surface, f cos / pdf (...) and pdf (...)."""
    raise NotImplementedError("bounce")


def power_weight(pdf: Any, other: Any) -> Any:
    """Return the power heuristic's weight (...) of samples of density pdf (...), the other way's being other.

    Densities may be as large as 1e30 in single precision, and may be 0: a pdf below 1e-15 counts as 1e-15
    (LTR-5).
    """
    raise NotImplementedError("power_weight")


def by_light(reflectance: float, half: float, height: float, u0: Any, u1: Any) -> tuple[Any, Any, Any]:
    """Return (value (...), pdf (...), pdf of the same direction by `bounce` (...)) of samples of a light.

    The surface's point is the origin, its normal +z. The light is the square |x|, |y| <= half at z =
    height, faces down, and has radiance 1; its points are drawn uniformly, (2 u - 1) half. value is f cos /
    pdf, times the light's radiance; pdf is in 1/sr.
    """
    raise NotImplementedError("by_light")
