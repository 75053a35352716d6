"""Kinds of materials: how paths continue, what light from a direction is worth, heuristics, the sky."""

from __future__ import annotations

from functools import cache
from typing import Any, NamedTuple, cast

import numpy as np

from ....refimpl.light import environment, transport
from ....refimpl.light import scene as scene_module
from ....refimpl.light.intersection import reflecting
from ....refimpl.light.materials import Conductor, Dielectric, Lambertian, Mirror
from ....refimpl.light.materials.conductor import distribution, sample_visible_normal, schlick
from ....refimpl.light.materials.dielectric import fresnel, refract
from ....refimpl.light.materials.material import Site
from ....refimpl.light.scene import Scene, Sky
from ....refimpl.vectors import dot
from ..case import FOLDER
from ..functions import Numbers
from .tables import direct, function

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


# ---- lights -----------------------------------------------------------------------------------------------

NO_SETTINGS = cast(transport.Settings, None)
"""Settings where nobody reads any."""

SKY = Sky((0.16, 0.30, 0.62), (0.62, 0.70, 0.80), (0.18, 0.16, 0.14), (0.6, 0.8, 0.0), (2.6, 2.2, 1.6), 64.0)
"""The sky of all directions."""


@cache
def _terrace() -> Scene:
    """Return the scene whose lamps are sampled."""
    return scene_module.from_json((FOLDER / "scenes/terrace.json").read_text(encoding="utf-8"))


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
    world = transport.build(_terrace(), NO_SETTINGS, dtype)
    surface = reflecting(given["point"], given["normal"], given["reflectance"])
    return {"unshadowed": transport.unshadowed(world, surface)}


def _light_pdf(given: Numbers, dtype: Any) -> dict[str, Any]:
    """Return the densities of both lamps of the terrace."""
    lights = transport.build(_terrace(), NO_SETTINGS, dtype).lights
    assert lights is not None
    square, cosine = given["square"], given["cosine"]
    index = np.zeros_like(square, np.int32)
    return {f"lamp_{k}": transport.light_pdf(lights, index + np.int32(k), square, cosine) for k in (0, 1)}


FUNCTIONS = (
    direct("material.ggx", distribution),
    direct("material.schlick", schlick),
    direct("material.visible_normal", sample_visible_normal),
    direct("material.refracted", _refracted),
    direct("material.fresnel", fresnel),
    function("transport.light_pdf", _light_pdf),
    function("material.lambertian", lambda given, dtype: _sampled(Lambertian, given)),
    function("material.mirror", lambda given, dtype: _sampled(Mirror, given)),
    function(
        "material.conductor", lambda given, dtype: _sampled(Conductor, given, parameter=given["roughness"])
    ),
    function("material.conductor_value", _valued),
    function(
        "material.dielectric",
        lambda given, dtype: _sampled(
            Dielectric, given, parameter=given["ior"], outside=given["outside"] > 0.5
        ),
    ),
    direct(
        "transport.mis_weight",
        lambda pdf, other: tuple(
            transport.mis_weight(cast(Any, Heuristic(name)), pdf, other) for name in ("balance", "power")
        ),
    ),
    function("transport.unshadowed", _unshadowed),
    function("sky.radiance", _sky),
    function("sky.sample", _sky_sample),
)
"""The functions of this module."""
