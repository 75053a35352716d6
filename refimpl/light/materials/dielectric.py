"""A smooth dielectric such as glass or water: it mirrors the share that Fresnel gives and refracts the rest.

1. [`refract`] gives the refracted direction by Snell's law, and its cosine; 0 under total reflection.
2. [`fresnel`] is the share of unpolarised light that is mirrored.
3. [`Dielectric.sample`] mirrors with that probability, so that both ways have the same weight: the surface's
   reflectance, which tints both.

Formulas: Fresnel's equations as in Born and Wolf, "Principles of Optics", 1999, section 1.5.2, divided by the
index on the far side, so that one ratio r = n_near / n_far is all that is needed. The square of the refracted
cosine is written 1 - r^2 + (r cos)^2: for r = 1 its root is the cosine itself, to the bit, and a body of
index 1 is not there.

What a path carries is basic radiance, radiance over the square of the index (Nicodemus, "Radiance", American
Journal of Physics 31(5), 1963): refraction leaves it as it is, and throughputs never grow.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ... import vectors
from ...errors import InputError
from ...vectors import Floats
from .material import LEAST_SQUARE, SINGLE_PDF, Scattered, Single, Site, mirrored, unit

LEAST_INDEX, LARGEST_INDEX = 1.0, 4.0
"""Range of the index of refraction: from nothing to germanium. Below 1 would be a bubble: give the body
around it."""


@dataclass(frozen=True)
class Dielectric(Single):
    """The inside of a closed body of index `ior`, in a world of index 1."""

    ior: float = 1.5

    kind = "dielectric"
    transmits = True

    def check(self, path: str) -> None:
        """Refuse an index outside its range."""
        if not LEAST_INDEX <= self.ior <= LARGEST_INDEX:
            rule = f"an index of refraction must lie in [{LEAST_INDEX:g}, {LARGEST_INDEX:g}]"
            raise InputError(f"{path}.ior", self.ior, rule, "glass has 1.5, water 1.33, diamond 2.42")

    @property
    def parameter(self) -> float:
        """The index of refraction."""
        return self.ior

    @staticmethod
    def sample(site: Site, u0: Floats, u1: Floats, u_choice: Floats) -> Scattered:
        """Return mirrored directions with the probability that Fresnel gives, else refracted ones."""
        mirror, cosine = mirrored(site)
        ior: Floats = site.parameter
        ratio = np.where(site.outside, np.reciprocal(ior), ior)
        refracted, cos_far = refract(site, cosine, ratio)
        through = u_choice >= fresnel(cosine, cos_far, ratio)
        direction = vectors.choose(through, refracted, mirror)
        return Scattered(direction, site.tinted, np.full_like(cosine, SINGLE_PDF), through)


def refract(site: Site, cosine: Floats, ratio: Floats) -> tuple[Any, Any]:
    """Return the refracted directions (..., 3) of wo, and their cosines (...) to the normal behind.

    cosine (...) is that of wo; ratio (...) is n_near / n_far.
    """
    near = ratio * cosine
    cos_far = np.sqrt(np.maximum((1.0 - ratio) * (1.0 + ratio) + near * near, 0.0))
    along, against = vectors.scale(site.normal, near - cos_far), vectors.scale(site.wo, ratio)
    return unit(along - against), cos_far


def fresnel(cosine: Floats, cos_far: Floats, ratio: Floats) -> Floats:
    """Return the share (...) of unpolarised light that is mirrored, given the cosines on both sides.

    Where cos_far is 0 on the way out, reflection is total.
    """
    parallel = (cosine - ratio * cos_far) / np.maximum(cosine + ratio * cos_far, LEAST_SQUARE)
    across = (ratio * cosine - cos_far) / np.maximum(ratio * cosine + cos_far, LEAST_SQUARE)
    share = 0.5 * (parallel * parallel + across * across)
    return np.where((cos_far > 0.0) | (ratio <= 1.0), share, np.ones_like(share))
