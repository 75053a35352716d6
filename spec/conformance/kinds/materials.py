"""Kinds of materials: how paths continue, what light from a direction is worth, heuristics, the sky."""

from __future__ import annotations

from typing import Any, NamedTuple, cast

import numpy as np

from ....refimpl.light import environment, transport
from ....refimpl.light.intersection import reflecting
from ....refimpl.light.materials import Conductor, Dielectric, Lambertian, Mirror
from ....refimpl.light.materials.conductor import distribution, sample_visible_normal, schlick
from ....refimpl.light.materials.dielectric import fresnel, refract
from ....refimpl.light.materials.material import Site
from ....refimpl.light.scene import Sky
from ....refimpl.vectors import dot
from ..functions import Numbers
from .light import pair, unit
from .tables import direct, function
from .views import scene

# ---- surfaces ---------------------------------------------------------------------------------------------


def _site(given: Numbers, parameter: Any = None, outside: Any = None) -> Site:
    """Return the vertex with a throughput of 1."""
    reflectance = given["reflectance"]
    one = np.ones_like(reflectance)
    return Site(given["wo"], given["normal"], outside, reflectance, one, one * reflectance, parameter)


def _sampled(material: Any, given: Numbers, **of_site: Any) -> dict[str, Any]:
    """Return how a path continues."""
    found = material.sample(_site(given, **of_site), given["u0"], given["u1"], given["u_choice"])
    return {name: getattr(found, name) for name in ("direction", "beta", "pdf")}


def _valued(given: Numbers, dtype: Any) -> dict[str, Any]:
    """Return value and density."""
    site, wi = _site(given, parameter=given["roughness"]), given["wi"]
    cosine = np.maximum(dot(site.normal, wi), 0.0)
    color, factor = Conductor.value(site, wi, cosine)
    return {"value": color * factor[..., np.newaxis], "pdf": Conductor.pdf(site, wi, cosine)}


def _refracted(wo: Any, normal: Any, ratio: Any) -> tuple[Any, Any]:
    """Return the direction behind a surface, and its cosine."""
    nothing = np.zeros_like(wo)
    site = Site(wo, normal, None, nothing, nothing, nothing, None)
    return refract(site, np.minimum(np.maximum(dot(wo, normal), 0.0), 1.0), ratio)


def _facing(direction: Any, normal: Any) -> Any:
    """Return a direction, or its opposite, on the side of a normal."""
    return direction if float(normal.astype(np.float64) @ direction) > 0.0 else -direction


def _vertex(u: Any) -> dict[str, Any]:
    """Return a vertex and three uniform numbers from others."""
    normal = unit(u[:3])
    vertex = {"normal": normal, "wo": _facing(unit(u[3:6]), normal), "reflectance": u[6:9]}
    return {**vertex, "u0": u[9], "u1": u[10], "u_choice": u[11]}


def _raised(u: Any) -> Any:
    """Return a unit vector above the surface, in local terms."""
    found = unit(u)
    return found * np.sign(found[2])


# ---- lights -----------------------------------------------------------------------------------------------

NO_SETTINGS = cast(transport.Settings, None)
"""Settings where nobody reads any."""

SKY = Sky((0.16, 0.30, 0.62), (0.62, 0.70, 0.80), (0.18, 0.16, 0.14), (0.6, 0.8, 0.0), (2.6, 2.2, 1.6), 64.0)
"""The sky of all directions."""


class Heuristic(NamedTuple):
    """All that a weight reads of settings."""

    heuristic: str


def _sky(given: Numbers, dtype: Any) -> dict[str, Any]:
    """Return radiance and density."""
    sky, direction = environment.build(SKY, dtype), given["direction"]
    return {"radiance": environment.radiance(sky, direction), "pdf": environment.pdf(sky, direction)}


def _sky_sample(given: Numbers, dtype: Any) -> dict[str, Any]:
    """Return a direction."""
    numbers = (given[name] for name in ("u_choice", "u0", "u1"))
    return {"direction": environment.sample(environment.build(SKY, dtype), *numbers)}


def _unshadowed(given: Numbers, dtype: Any) -> dict[str, Any]:
    """Return the light of the terrace's lamps at points of its surfaces."""
    world = transport.build(scene("terrace"), NO_SETTINGS, dtype)
    surface = reflecting(given["point"], given["normal"], given["reflectance"])
    return {"unshadowed": transport.unshadowed(world, surface)}


def _light_pdf(given: Numbers, dtype: Any) -> dict[str, Any]:
    """Return the densities of both lamps of the terrace."""
    lights = transport.build(scene("terrace"), NO_SETTINGS, dtype).lights
    assert lights is not None
    square, cosine = given["square"], given["cosine"]
    index = np.zeros_like(square, np.int32)
    return {f"lamp_{k}": transport.light_pdf(lights, index + np.int32(k), square, cosine) for k in (0, 1)}


FUNCTIONS = (
    direct("material.ggx", distribution, lambda u: {"m": unit(u), "roughness": 0.05 + 0.9 * u[3]}, draws=4),
    direct("material.schlick", schlick, lambda u: {"reflectance": u[:3], "cosine": u[3]}, draws=3),
    direct(
        "material.visible_normal",
        sample_visible_normal,
        lambda u: {**pair(u), "wo": _raised(u[2:]), "roughness": 0.05 + 0.9 * u[5]},
        draws=4,
    ),
    direct("material.refracted", _refracted, lambda u: {**_vertex(u), "ratio": 0.5 + 0.5 * u[6]}, draws=4),
    direct(
        "material.fresnel",
        fresnel,
        lambda u: {"cosine": u[0], "behind": u[1], "ratio": 0.25 + 3.0 * u[2]},
        draws=4,
    ),
    function(
        "transport.light_pdf",
        _light_pdf,
        lambda u: {"square": 4.0 * u[0], "cosine": u[1]},
        draws=3,
    ),
    function("material.lambertian", lambda given, dtype: _sampled(Lambertian, given), _vertex, draws=4),
    function("material.mirror", lambda given, dtype: _sampled(Mirror, given), _vertex, draws=4),
    function(
        "material.conductor",
        lambda given, dtype: _sampled(Conductor, given, parameter=given["roughness"]),
        lambda u: {**_vertex(u), "roughness": 0.05 + 0.9 * u[12]},
    ),
    function(
        "material.conductor_value",
        _valued,
        lambda u: {
            **_vertex(u),
            "wi": _facing(unit(u[9:12]), unit(u[:3])),
            "roughness": 0.05 + 0.9 * u[12],
        },
        draws=4,
    ),
    function(
        "material.dielectric",
        lambda given, dtype: _sampled(
            Dielectric, given, parameter=given["ior"], outside=given["outside"] > 0.5
        ),
        lambda u: {**_vertex(u), "ior": 1.0 + u[12], "outside": round(u[13])},
    ),
    direct(
        "transport.mis_weight",
        lambda pdf, other: tuple(
            transport.mis_weight(cast(Any, Heuristic(name)), pdf, other) for name in ("balance", "power")
        ),
        lambda u: {"pdf": 4.0 * u[0], "other": 4.0 * u[1]},
        draws=4,
    ),
    function(
        "transport.unshadowed",
        _unshadowed,
        lambda u: {"point": 4.0 * u[:3] - 2.0, "normal": unit(u[3:])},
        draws=4,
    ),
    function("sky.radiance", _sky, lambda u: {"direction": unit(u)}, draws=4),
    function("sky.sample", _sky_sample, lambda u: {"u_choice": u[0], "u0": u[1], "u1": u[2]}, draws=6),
)
"""The functions of this module."""
