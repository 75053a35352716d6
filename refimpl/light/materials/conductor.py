"""A rough conductor: microscopic mirrors whose normals have the distribution of Trowbridge and Reitz (GGX).

With local directions around the normal, z = n . w and q(w) = sqrt(z^2 + alpha^2 (x^2 + y^2)):

1. [`distribution`]: D(m) = alpha^2 / (pi (m_x^2 + m_y^2 + alpha^2 m_z^2)^2). Trowbridge and Reitz, "Average
   Irregularity Representation of a Rough Surface for Ray Reflection", JOSA 65(5), 1975; the form without
   tangents keeps its digits where alpha is small.
2. Smith's masking is Lambda(w) = (q / z - 1) / 2, and masking and shadowing are height-correlated:
   G2 = 1 / (1 + Lambda(wo) + Lambda(wi)). Heitz, "Understanding the Masking-Shadowing Function in
   Microfacet-Based BRDFs", JCGT 3(2), 2014, equations 72 and 99.
3. [`sample_visible_normal`] draws a normal m in proportion to its area as seen from wo. Heitz, "Sampling the
   GGX Distribution of Visible Normals", JCGT 7(4), 2018; its disk is sampling.py's, which can be inverted.
4. [`Conductor.sample`] mirrors wo about m. The density of the direction is D / (2 (q_o + z_o)), and
   f cos / pdf = F z_i (q_o + z_o) / (q_o z_i + q_i z_o): all divisions by z have cancelled.
5. F is Schlick's approximation with the surface's reflectance at normal incidence [`schlick`]. Schlick, "An
   Inexpensive BRDF Model for Physically-Based Rendering", 1994.

Light that hits a second microscopic mirror is lost: rough surfaces are too dark (spec/conductor.md, CDR-5).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ... import vectors
from ...errors import InputError
from ...vectors import Colors, Directions, Floats, Normals
from .. import sampling
from .material import LEAST_SQUARE, Material, Scattered, Site, unit

LEAST_ROUGHNESS = 1e-3
"""Least width alpha of a lobe. In float32 a half vector is off by some 1e-7, 1e-4 of such a lobe's width;
sharper ones would lose their digits, and look like mirrors anyway."""

LARGEST_FOLLOWED = 0.1
"""Largest roughness alpha of a metal past which features look (following.py): half of the normals of its
microscopic mirrors are then within atan(0.1), six degrees, of the surface's own."""

LEAST_HEIGHT = 1e-7
"""Least cosine between normal and wo: half an ulp of 1, below which a direction's own rounding decides on
which side of the surface it is. It keeps q + z away from zero on lanes that hit nothing."""


@dataclass(frozen=True)
class Conductor(Material):
    """A metal; `roughness` is GGX's alpha, the slope of a typical microscopic mirror."""

    roughness: float = 0.2

    kind = "conductor"
    black_reflects = True  # of grazing light (1 - cos)^5, whatever the reflectance

    def check(self, path: str) -> None:
        """Refuse a roughness outside its range."""
        if not LEAST_ROUGHNESS <= self.roughness <= 1.0:
            rule = f"a roughness must lie in [{LEAST_ROUGHNESS:g}, 1]"
            raise InputError(f"{path}.roughness", self.roughness, rule, "for smoother ones, use a mirror")

    @property
    def parameter(self) -> float:
        """The roughness alpha."""
        return self.roughness

    @staticmethod
    def sample(site: Site, u0: Floats, u1: Floats, u_choice: Floats) -> Scattered:
        """Return wo mirrored about a visible normal; paths that would go below the surface carry nothing."""
        wo = _local_wo(site)
        m = sample_visible_normal(u0, u1, wo, site.parameter)
        cosine = vectors.dot(wo, m)
        wi = vectors.scale(m, 2.0 * cosine) - wo
        up = wi[..., 2] > 0.0
        z_o, q_o, z_i, q_i = _heights(wo, wi, site.parameter)
        share = np.where(up, z_i * (q_o + z_o) / np.maximum(q_o * z_i + q_i * z_o, LEAST_SQUARE), 0.0)
        beta = vectors.scale(site.beta * schlick(site.reflectance, cosine), share)
        pdf = distribution(m, site.parameter) / (2.0 * (q_o + z_o))
        return Scattered(unit(sampling.to_world(wi, site.normal)), beta, pdf, None)

    @staticmethod
    def value(site: Site, wi: Directions, cos_surface: Floats) -> tuple[Colors, Floats]:
        """Return beta F, and D z_i / (2 (q_o z_i + q_i z_o))."""
        wo, local, m = _half(site, wi)
        z_o, q_o, z_i, q_i = _heights(wo, local, site.parameter)
        denominator = np.maximum(2.0 * (q_o * z_i + q_i * z_o), LEAST_SQUARE)
        factor = distribution(m, site.parameter) * z_i / denominator
        return site.beta * schlick(site.reflectance, vectors.dot(wo, m)), factor

    @staticmethod
    def pdf(site: Site, wi: Directions, cos_surface: Floats) -> Floats:
        """Return D / (2 (q_o + z_o)); 0 below the surface."""
        wo, local, m = _half(site, wi)
        z_o, q_o, _, _ = _heights(wo, local, site.parameter)
        pdf = distribution(m, site.parameter) / (2.0 * (q_o + z_o))
        return np.where(cos_surface > 0.0, pdf, 0.0)

    @staticmethod
    def follows(parameter: Floats) -> Any:
        """Tell (...) whether a metal of this roughness (...) is nearly a mirror."""
        return parameter <= LARGEST_FOLLOWED


def distribution(m: Normals, alpha: Floats) -> Floats:
    """Return the density D (...), in 1/sr, of unit normals m (..., 3) for the roughness alpha (...)."""
    x, y, az = m[..., 0], m[..., 1], alpha * m[..., 2]
    spread = x * x + y * y + az * az
    return sampling.INV_PI * alpha * alpha / np.maximum(spread * spread, LEAST_SQUARE)


def schlick(reflectance: Colors, cosine: Floats) -> Colors:
    """Return the reflectance (..., 3) at an angle, from that at normal incidence: R + (1 - R)(1 - cos)^5."""
    x = np.minimum(np.maximum(1.0 - cosine, 0.0), 1.0)
    return reflectance + vectors.scale(1.0 - reflectance, (x * x) * (x * x) * x)


def sample_visible_normal(u0: Floats, u1: Floats, wo: Directions, alpha: Floats) -> Normals:
    """Map u0, u1 (...) to normals (..., 3) as seen from wo (..., 3), which is local with z >= 0."""
    axis, tangent, bitangent, share = _stretched(wo, alpha)
    # Sample the disk that the stretched hemisphere shows to wo: a half disk and a squeezed half.
    x, y = sampling.sample_concentric_disk(u0, u1)
    chord = np.sqrt(np.maximum(1.0 - x * x, 0.0))
    y = (1.0 - share) * chord + share * y
    # Lift it to the hemisphere, and undo the stretching.
    z = np.sqrt(np.maximum(1.0 - x * x - y * y, 0.0))
    n = vectors.scale(tangent, x) + vectors.scale(bitangent, y) + vectors.scale(axis, z)
    return unit(vectors.vector(alpha * n[..., 0], alpha * n[..., 1], np.maximum(n[..., 2], 0.0)))


def _stretched(wo: Directions, alpha: Floats) -> tuple[Any, Any, Any, Any]:
    """Return wo's direction (..., 3) where the lobe is a hemisphere, two tangents, and a share (...).

    The share is that of the disk's lower half, seen in full; the upper one is squeezed to the rest. The
    first tangent is horizontal; where wo is the normal itself any is."""
    axis = vectors.normalize(vectors.vector(alpha * wo[..., 0], alpha * wo[..., 1], wo[..., 2]))
    x, y, z = axis[..., 0], axis[..., 1], axis[..., 2]
    square, nothing = x * x + y * y, np.zeros_like(x)
    upright, length = square < LEAST_SQUARE, np.sqrt(np.maximum(square, LEAST_SQUARE))
    tangent = vectors.vector(
        np.where(upright, np.ones_like(x), -y / length), np.where(upright, nothing, x / length), nothing
    )
    return axis, tangent, vectors.cross(axis, tangent), 0.5 * (1.0 + z)


def _heights(wo: Directions, wi: Directions, alpha: Floats) -> tuple[Any, Any, Any, Any]:
    """Return z and q (...) of wo, then of wi (..., 3), local; a z below 0 counts as 0."""
    return (*_height(wo, alpha), *_height(wi, alpha))


def _height(w: Directions, alpha: Floats) -> tuple[Floats, Floats]:
    """Return z and q = sqrt(z^2 + alpha^2 (x^2 + y^2)), (...), of local directions w (..., 3)."""
    x, y, z = alpha * w[..., 0], alpha * w[..., 1], np.maximum(w[..., 2], 0.0)
    return z, np.sqrt(x * x + y * y + z * z)


def _local_wo(site: Site) -> Directions:
    """Return wo (..., 3) around the normal; rounding could put it below the surface."""
    wo = sampling.to_local(site.wo, site.normal)
    return vectors.vector(wo[..., 0], wo[..., 1], np.maximum(wo[..., 2], LEAST_HEIGHT))


def _half(site: Site, wi: Directions) -> tuple[Any, Any, Any]:
    """Return wo, wi and the unit vector between them (..., 3), all around the normal."""
    wo, local = _local_wo(site), sampling.to_local(wi, site.normal)
    return wo, local, unit(wo + local)
