"""Lambertian reflection: the same radiance into all directions, f = reflectance / pi.

1. [`Lambertian.sample`] draws a cosine-weighted direction; f cos / pdf is then the reflectance itself.
2. [`Lambertian.value`] and [`Lambertian.pdf`] are both cos / pi, times the reflectance in the first.

Lambert, "Photometria", 1760; Malley's method for the directions (sampling.py).
"""

from __future__ import annotations

from dataclasses import dataclass

from ...vectors import Colors, Directions, Floats
from .. import sampling
from .material import Material, Scattered, Site


@dataclass(frozen=True)
class Lambertian(Material):
    """A matte surface; surfaces without a material are matte."""

    kind = "lambertian"

    @staticmethod
    def sample(site: Site, u0: Floats, u1: Floats, u_choice: Floats) -> Scattered:
        """Return cosine-weighted directions around the normal."""
        local = sampling.sample_cosine_hemisphere(u0, u1)
        direction = sampling.to_world(local, site.normal)
        return Scattered(direction, site.tinted, sampling.cosine_hemisphere_pdf(local[..., 2]), None)

    @staticmethod
    def value(site: Site, wi: Directions, cos_surface: Floats) -> tuple[Colors, Floats]:
        """Return beta * reflectance, and cos / pi."""
        return site.tinted, sampling.INV_PI * cos_surface

    @staticmethod
    def pdf(site: Site, wi: Directions, cos_surface: Floats) -> Floats:
        """Return cos / pi."""
        return sampling.cosine_hemisphere_pdf(cos_surface)
