"""What a material is: four functions of lanes, and the numbers that a scene gives it.

1. A material is a frozen dataclass; its fields are what a scene's JSON says of it beside `kind`. A surface's
   `reflectance` belongs to the surface, and each material says how it uses it.
2. `sample` turns uniform numbers into the direction in which a path continues [`Scattered`].
3. `value` and `pdf` say what light from a given direction is worth, and how likely `sample` was to find that
   direction: light sampling and multiple importance sampling ask for them. Materials that reflect into single
   directions (`single` is true) have neither: no light sample ever meets those directions [`Single`].
4. `follows` says whether features are those of what the path meets next, and not the surface's own
   (following.py).

A vertex is described by a [`Site`]. Materials neither know the scene nor which surface they are on: what
differs from surface to surface is in the site's `parameter` [`Material.parameter`].
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import numpy as np

from ... import vectors
from ...vectors import Colors, Directions, Floats, Normals, Truths

SINGLE_PDF = 1e30
"""Density of a direction that is not random, in 1/sr: a mirror's, and a camera ray's. Light sampling is not
an alternative to it, so that the weight of what it meets is 1."""

LEAST_SQUARE = 1e-30
"""Floor of squared lengths and of denominators; it acts on directions that cancel out, and on lanes that hit
nothing."""


class Site(NamedTuple):
    """A vertex: wo (..., 3) back along the path, unit normal (..., 3) on the side of wo, and more.

    outside (...) tells whether the normal points out of the body (None where no material of the scene asks).
    reflectance, beta and tinted = beta * reflectance are (..., 3); parameter (...) is the material's own.
    """

    wo: Directions
    normal: Normals
    outside: Any
    reflectance: Colors
    beta: Colors
    tinted: Colors
    parameter: Any


class Scattered(NamedTuple):
    """How paths continue: unit direction (..., 3), throughput beta (..., 3), its pdf (...) in 1/sr.

    through (...) tells who passes to the other side of the surface; None where the material lets nobody pass.
    """

    direction: Directions
    beta: Colors
    pdf: Floats
    through: Truths | None


@dataclass(frozen=True)
class Material:
    """A kind of material; a subclass is one file, and one line in the registry."""

    kind: ClassVar[str]
    single: ClassVar[bool] = False
    transmits: ClassVar[bool] = False
    black_reflects: ClassVar[bool] = False  # whether a reflectance of 0 leaves any light to scatter

    def check(self, path: str) -> None:
        """Raise InputError, with the path of the value, where a number breaks a rule."""

    @property
    def parameter(self) -> float | None:
        """The number that the material needs at each vertex, if it needs one."""
        return None

    @staticmethod
    def sample(site: Site, u0: Floats, u1: Floats, u_choice: Floats) -> Scattered:
        """Return how paths continue, for three uniform numbers (...)."""
        raise NotImplementedError

    @staticmethod
    def value(site: Site, wi: Directions, cos_surface: Floats) -> tuple[Colors, Floats]:
        """Return a colour (..., 3) and a factor (...) whose product is beta f cos for light from wi (..., 3).

        cos_surface (...) is the cosine between normal and wi, 0 where wi is below the surface.
        """
        raise NotImplementedError

    @staticmethod
    def pdf(site: Site, wi: Directions, cos_surface: Floats) -> Floats:
        """Return the density (...), in 1/sr, with which `sample` finds wi (..., 3)."""
        raise NotImplementedError

    @staticmethod
    def follows(parameter: Any) -> Any:
        """Tell (...) whether features look past surfaces of this parameter (...), or None for any."""
        return False


class Single(Material):
    """A material that scatters into single directions: light samples are worth nothing to it."""

    single = True

    @staticmethod
    def value(site: Site, wi: Directions, cos_surface: Floats) -> tuple[Colors, Floats]:
        """Return nothing: no direction of positive measure is reflected."""
        return site.tinted, np.zeros_like(cos_surface)

    @staticmethod
    def pdf(site: Site, wi: Directions, cos_surface: Floats) -> Floats:
        """Return 0: the density of all directions but one."""
        return np.zeros_like(cos_surface)

    @staticmethod
    def follows(parameter: Any) -> Any:
        """Return true: what is there to be seen is elsewhere."""
        return True


def unit(a: Directions) -> Directions:
    """Return a (..., 3) divided by its length, and vectors that are (nearly) zero as they are."""
    return a / np.sqrt(np.maximum(vectors.dot(a, a), LEAST_SQUARE))[..., np.newaxis]


def mirrored(site: Site) -> tuple[Directions, Floats]:
    """Return the direction (..., 3) that mirrors wo about the normal, and the cosine (...) between them."""
    cosine = np.minimum(np.maximum(vectors.dot(site.wo, site.normal), 0.0), 1.0)
    return unit(vectors.scale(site.normal, 2.0 * cosine) - site.wo), cosine
