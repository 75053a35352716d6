"""What surfaces and skies are in Mitsuba: the plugins that stand for wamnet's materials and its sky.

1. [`bsdf`]: matte is `diffuse`. A mirror is `conductor` of no material, whose Fresnel reflectance is 1. Glass
   is `dielectric`; both of its ways are tinted by the surface's reflectance. It scales radiance by the ratio
   of the squared indices at each crossing, and ours carries basic radiance (spec/dielectric.md, DIE-5): for
   a camera and lamps outside, the factors cancel.
2. Rough metal is `principled` with metallic = 1 and roughness = sqrt(alpha), which it squares: GGX, visible
   normals, Schlick's reflectance. It multiplies masking by shadowing, G1(wi) G1(wo). Ours are
   height-correlated (spec/conductor.md, CDR-2), and with Lambda = 1 / G1 - 1

       1 / (1 + Lambda(wi) + Lambda(wo)) = G1(wi) G1(wo) / (G1(wi) + G1(wo) - G1(wi) G1(wo)),

   so that Mitsuba's value is divided by that denominator [`correlated`], with Mitsuba's own G1.
3. The sky is `envmap`: a table of latitude and longitude [`sky_table`] of the formula of spec/environment.md,
   ENV-1, written here by the angle's cosine; its rows begin and end at the poles, and its columns show
   longitudes (k + 1/2) / COLUMNS of the turn from -z over x.

Mitsuba: Jakob et al., its documentation of BSDFs and emitters, https://mitsuba.readthedocs.io. Masking:
Heitz, "Understanding the Masking-Shadowing Function in Microfacet-Based BRDFs", JCGT 3(2), 2014, equations 98
and 99.
"""

from __future__ import annotations

import importlib
import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wamnet.refimpl.light.materials import Conductor, Dielectric, Material, Mirror
from wamnet.refimpl.light.scene import Sky

METAL = "wamnet_metal"
"""Name of the plugin of rough metal."""

COLUMNS, ROWS = 2048, 1025
"""Size of the sky's table: its texels are h = 2 pi / 2048 = 0.0031 rad wide and high."""

LARGEST_TABLED = 2000.0
"""Largest concentration k of a sun in the table. At its peak 1 / (1 + k (1 - cos))^2 has the curvature -2 k,
so that linear interpolation, in two directions, is off by h^2 k / 2 there: 1 % at most, 0.2 % for k = 400."""


def bsdf(reflectance: Any, material: Material | None) -> dict[str, Any]:
    """Return Mitsuba's BSDF of a surface that is seen from outside."""
    color = rgb(reflectance)
    if isinstance(material, Mirror):
        return {"type": "conductor", "material": "none", "specular_reflectance": color}
    if isinstance(material, Dielectric):
        tints = {"specular_reflectance": color, "specular_transmittance": color}
        return {"type": "dielectric", "int_ior": material.ior, "ext_ior": 1.0, **tints}
    if isinstance(material, Conductor):
        rough = math.sqrt(material.roughness)
        own = {"type": "principled", "metallic": 1.0, "roughness": rough, "base_color": color}
        return {"type": METAL, "alpha": material.roughness, "separable": own}
    return {"type": "diffuse", "reflectance": color}


def rgb(color: Any) -> dict[str, Any]:
    """Return linear RGB as Mitsuba's variants *_rgb take it: unchanged."""
    return {"type": "rgb", "value": [float(c) for c in color]}


def register(mi: Any) -> None:
    """Add the plugin of rough metal to the variant that is set."""
    mi.register_bsdf(METAL, _metal_class(mi))


def correlated(one: Any, other: Any) -> Any:
    """Return height-correlated masking and shadowing over their product, from G1 of both directions."""
    return 1.0 / (one + other - one * other)


def _metal_class(mi: Any) -> Any:
    """Return the class of a BSDF that corrects the masking of another."""
    dr = importlib.import_module("drjit")

    class Metal(mi.BSDF):  # type: ignore[misc]
        """The BSDF `separable`, of roughness `alpha`, with height-correlated masking and shadowing."""

        def __init__(self, given: Any) -> None:
            super().__init__(given)
            self.separable = given["separable"]
            self.facets = mi.MicrofacetDistribution(mi.MicrofacetType.GGX, given["alpha"])
            self.m_components = [
                self.separable.flags(part) for part in range(self.separable.component_count())
            ]
            self.m_flags = self.separable.flags()

        def _factor(self, wi: Any, wo: Any) -> Any:
            """Return what its value is multiplied by; 0 where neither direction sees the other."""
            half = dr.normalize(wi + wo)
            one, other = self.facets.smith_g1(wi, half), self.facets.smith_g1(wo, half)
            seen = one * other > 0.0
            # In the scalar variant both sides are worked out, and a division by 0 ends the program.
            return dr.select(seen, correlated(dr.select(seen, one, 1.0), dr.select(seen, other, 1.0)), 0.0)

        def sample(self, context: Any, at: Any, u: Any, uv: Any, active: Any = True) -> Any:
            found, weight = self.separable.sample(context, at, u, uv, active)
            return found, weight * self._factor(at.wi, found.wo)

        def eval(self, context: Any, at: Any, wo: Any, active: Any = True) -> Any:
            return self.separable.eval(context, at, wo, active) * self._factor(at.wi, wo)

        def pdf(self, context: Any, at: Any, wo: Any, active: Any = True) -> Any:
            return self.separable.pdf(context, at, wo, active)

        def eval_pdf(self, context: Any, at: Any, wo: Any, active: Any = True) -> Any:
            return self.eval(context, at, wo, active), self.pdf(context, at, wo, active)

        def traverse(self, visitor: Any) -> None:
            """Nothing here is to be changed or differentiated."""

        def to_string(self) -> str:
            return "Metal[]"

    return Metal


def sky_table(sky: Sky) -> NDArray[np.float32]:
    """Return the sky's radiance (ROWS, COLUMNS, 3), rows from the zenith, columns from -z over x."""
    polar = np.linspace(0.0, np.pi, ROWS)[:, np.newaxis]
    turn = 2.0 * np.pi * (np.arange(COLUMNS) + 0.5) / COLUMNS
    y = np.cos(polar) + 0.0 * turn
    direction = np.stack([np.sin(polar) * np.sin(turn), y, -np.sin(polar) * np.cos(turn)], axis=-1)
    height = np.abs(y)[..., np.newaxis]
    pole = np.where(y[..., np.newaxis] > 0.0, sky.zenith, sky.ground)
    gradient = (1.0 - height) * np.array(sky.horizon) + height * pole
    sun, k = np.array(sky.sun_direction), sky.sun_concentration
    cosine = direction @ (sun / np.linalg.norm(sun))
    lobe = (1.0 + 2.0 * k) / (4.0 * np.pi * (1.0 + k * (1.0 - cosine)) ** 2)
    return np.asarray(gradient + lobe[..., np.newaxis] * np.array(sky.sun_irradiance), np.float32)


def emitter(mi: Any, sky: Sky) -> dict[str, Any]:
    """Return Mitsuba's emitter of a sky."""
    return {"type": "envmap", "bitmap": mi.Bitmap(sky_table(sky))}
