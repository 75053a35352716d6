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
from ..functions import Field, Function, Numbers
from .light import UNIFORM, _pair, _unit
from .terrace import TERRACE

VERTEX = {
    "wo": Field("unit direction back along the path", 3, -1.0),
    "normal": Field("unit normal on the side of wo", 3, -1.0),
    "reflectance": Field("of the surface", 3),
}
"""What a vertex is."""

CHOICES = {**UNIFORM, "u_choice": Field("third uniform number")}
"""The numbers that choose a direction."""

OF_SKY = {
    **UNIFORM,
    "u_choice": Field("uniform number that chooses sun or sky, the first of its block (ENV-2)"),
}
"""The numbers that choose a direction to the sky."""

GONE_ON = {
    "direction": Field("unit direction in which the path continues", 3),
    "beta": Field("throughput, for a throughput of 1 before", 3),
    "pdf": Field("density of the direction, 1/sr"),
}
"""How a path continues."""

GOLD = (1.0, 0.78, 0.34)
"""A reflectance."""

SLANT = (0.6, 0.8, 0.0)
"""A direction."""


def _site(given: Numbers, parameter: Any = None, outside: Any = None) -> Site:
    """Return the vertex with a throughput of 1."""
    reflectance = given["reflectance"]
    one = np.ones_like(reflectance)
    return Site(given["wo"], given["normal"], outside, reflectance, one, one * reflectance, parameter)


def _sampled(material: Any, given: Numbers, **of_site: Any) -> dict[str, Any]:
    """Return how a path continues."""
    found = material.sample(_site(given, **of_site), given["u0"], given["u1"], given["u_choice"])
    return {name: getattr(found, name) for name in GONE_ON}


def _vertex(u: Any) -> dict[str, Any]:
    """Return a vertex and three uniform numbers from others."""
    normal, wo = _unit(u[:3]), _unit(u[3:6])
    wo = wo if float(normal.astype(np.float64) @ wo) > 0.0 else -wo
    return {"normal": normal, "wo": wo, "reflectance": u[6:9], "u0": u[9], "u1": u[10], "u_choice": u[11]}


def _at(u0: float, u1: float, u_choice: float = 0.5, wo: Any = SLANT, **more: Any) -> dict[str, Any]:
    """Return a vertex with the normal +y."""
    vertex = {"normal": (0.0, 1.0, 0.0), "wo": wo, "reflectance": GOLD}
    return {**vertex, "u0": u0, "u1": u1, "u_choice": u_choice, **more}


LAMBERTIAN = Function(
    "material.lambertian",
    "A matt surface sends a path on",
    "LAM-1",
    {**VERTEX, **CHOICES},
    GONE_ON,
    lambda given, dtype: _sampled(Lambertian, given),
    [("straight up", _at(0.5, 0.5)), ("at the horizon", _at(0.0, 0.25))],
    _vertex,
    draws=4,
)
"""Matte surfaces."""

MIRROR = Function(
    "material.mirror",
    "A mirror sends a path on",
    "MIR-1",
    {**VERTEX, **CHOICES},
    {**GONE_ON, "direction": GONE_ON["direction"]._replace(clause="MAT-3")},
    lambda given, dtype: _sampled(Mirror, given),
    [
        ("straight down", _at(0.5, 0.5, wo=(0.0, 1.0, 0.0))),
        ("grazing", _at(0.5, 0.5, wo=(1.0, 2.0**-20, 0.0))),
        ("from behind: n . wo counts as 0", _at(0.5, 0.5, wo=(0.6, -0.8, 0.0))),
    ],
    _vertex,
    draws=4,
)
"""Mirrors."""

ROUGHNESS = Field("GGX's alpha", 0, 0.001)
"""Roughness of a metal."""

LOCAL = {"roughness": ROUGHNESS}
"""What a microscopic mirror depends on."""

GGX = Function(
    "material.ggx",
    "The density of the normals of microscopic mirrors",
    "CDR-1",
    {"m": Field("unit normal in local terms", 3, -1.0), **LOCAL},
    {"density": Field("D(m), 1/sr")},
    lambda given, dtype: {"density": distribution(given["m"], given["roughness"])},
    [
        ("the surface's own normal", {"m": (0.0, 0.0, 1.0), "roughness": 0.5}),
        ("as rough as can be", {"m": SLANT, "roughness": 1.0}),
        ("two horizontal parts", {"m": (0.48, 0.6, 0.64), "roughness": 0.25}),
    ],
    lambda u: {"m": _unit(u), "roughness": 0.05 + 0.9 * u[3]},
    draws=4,
)
"""GGX."""

SCHLICK = Function(
    "material.schlick",
    "The reflectance of a metal at an angle",
    "CDR-4",
    {"reflectance": VERTEX["reflectance"], "cosine": Field("wo . m", 0, -1.25, 1.25)},
    {"reflected": Field("F", 3)},
    lambda given, dtype: {"reflected": schlick(given["reflectance"], given["cosine"])},
    [
        ("from above", {"reflectance": GOLD, "cosine": 1.0}),
        ("along the surface", {"reflectance": GOLD, "cosine": 0.0}),
        ("at 60 degrees", {"reflectance": GOLD, "cosine": 0.5}),
        ("from behind: 1 - wo . m is clamped", {"reflectance": GOLD, "cosine": -0.25}),
        ("rounded beyond 1", {"reflectance": GOLD, "cosine": 1.25}),
    ],
    lambda u: {"reflectance": u[:3], "cosine": u[3]},
    draws=3,
)
"""Schlick's approximation."""

VISIBLE = Function(
    "material.visible_normal",
    "A normal of a microscopic mirror as seen from wo",
    "CDR-3",
    {**UNIFORM, "wo": Field("unit direction in local terms, above the surface", 3, -1.0), **LOCAL},
    {"m": Field("unit normal in local terms", 3)},
    lambda given, dtype: {
        "m": sample_visible_normal(given["u0"], given["u1"], given["wo"], given["roughness"])
    },
    [
        ("from above", {"u0": 0.25, "u1": 0.625, "wo": (0.0, 0.0, 1.0), "roughness": 0.25}),
        ("slanted", {"u0": 0.25, "u1": 0.625, "wo": (0.48, 0.6, 0.64), "roughness": 0.5}),
    ],
    lambda u: {**_pair(u), "wo": _raised(u[2:]), "roughness": 0.05 + 0.9 * u[5]},
    draws=4,
)
"""Heitz's normals."""


def _raised(u: Any) -> Any:
    """Return a unit vector above the surface, in local terms."""
    found = _unit(u)
    return found * np.sign(found[2])


CONDUCTOR = Function(
    "material.conductor",
    "A rough metal sends a path on",
    "CDR-3",
    {**VERTEX, **CHOICES, "roughness": ROUGHNESS},
    GONE_ON,
    lambda given, dtype: _sampled(Conductor, given, parameter=given["roughness"]),
    [
        ("seen from above", _at(0.25, 0.625, wo=(0.0, 1.0, 0.0), roughness=0.25)),
        ("slanted", _at(0.25, 0.625, roughness=0.25)),
        ("as rough as can be", _at(0.75, 0.125, roughness=1.0)),
        ("below the surface: nothing is carried", _at(0.25, 0.0, roughness=1.0)),
        ("below it, at a grazing angle", _at(0.5625, 0.03125, wo=(0.96, 0.28, 0.0), roughness=1.0)),
    ],
    lambda u: {**_vertex(u), "roughness": 0.05 + 0.9 * u[12]},
)
"""Metals."""

CONDUCTOR_VALUE = Function(
    "material.conductor_value",
    "What light from a direction is worth at a rough metal, and the density of that direction",
    "CDR-2",
    {
        **VERTEX,
        "wi": Field("unit direction to the light, above the surface", 3, -1.0),
        "roughness": ROUGHNESS,
    },
    {"value": Field("f cos, for a throughput of 1", 3), "pdf": Field("density of wi, 1/sr")},
    lambda given, dtype: _valued(given),
    [
        ("the mirrored direction", {**_at(0, 0), "wi": (-0.6, 0.8, 0.0), "roughness": 0.25}),
        ("back where it came from", {**_at(0, 0), "wi": SLANT, "roughness": 0.5}),
        ("off the lobe", {**_at(0, 0), "wi": (0.0, 0.6, 0.8), "roughness": 0.0625}),
        (
            "seen along the surface: its height counts as 1e-7",
            {**_at(0, 0, wo=(1.0, 0.0, 0.0)), "wi": (-1.0, 1e-6, 0.0), "roughness": 1.0},
        ),
    ],
    lambda u: {**_vertex(u), "wi": _above(u), "roughness": 0.05 + 0.9 * u[12]},
    draws=4,
)
"""Metals and light samples."""


def _above(u: Any) -> Any:
    """Return a direction above the surface of [`_vertex`]."""
    normal, wi = _unit(u[:3]), _unit(u[9:12])
    return wi if float(normal.astype(np.float64) @ wi) > 0.0 else -wi


def _valued(given: Numbers) -> dict[str, Any]:
    """Return value and density."""
    site, wi = _site(given, parameter=given["roughness"]), given["wi"]
    cosine = np.maximum(
        (site.normal[..., 0] * wi[..., 0] + site.normal[..., 1] * wi[..., 1])
        + site.normal[..., 2] * wi[..., 2],
        0.0,
    )
    color, factor = Conductor.value(site, wi, cosine)
    return {"value": color * factor[..., np.newaxis], "pdf": Conductor.pdf(site, wi, cosine)}


NEAR = 1.5
"""The index at which numbers are also much nearer to the mirrored share."""


def _beside() -> list[tuple[str, Numbers, str]]:
    """Return vertices whose number is a fiftieth beside the mirrored share, or less, at several angles."""
    rows: list[tuple[str, Numbers, str]] = []
    for x, y, ior, outside in (
        (0.8, 0.6, 1.5, 1),
        (0.96, 0.28, 1.25, 1),
        (0.28, 0.96, 2.0, 0),
        (0.6, 0.8, 1.125, 0),
    ):
        ratio = 1.0 / ior if outside else ior
        far = np.sqrt((1.0 - ratio) * (1.0 + ratio) + (ratio * y) ** 2)
        share = float(fresnel(np.array(y), np.array(far), np.array(ratio)))
        for factor in (0.98, 1.02, *((0.9998, 1.0002) if ior == NEAR else ())):
            note = f"{factor:g} of the mirrored share, cosine {y:g}, index {ior:g}"
            rows.append((note, _at(0, 0, factor * share, wo=(x, y, 0.0), ior=ior, outside=outside), "DIE-3"))
    return rows


REFRACTED = Function(
    "material.refracted",
    "The refracted direction, and its cosine",
    "DIE-2",
    {name: VERTEX[name] for name in ("wo", "normal")} | {"ratio": Field("r = n_near/n_far", 0, 0.25, 4.0)},
    {"direction": Field("unit direction behind the surface", 3), "cosine": Field("c'")},
    lambda given, dtype: _refracted(given),
    [
        ("in", {"wo": SLANT, "normal": (0.0, 1.0, 0.0), "ratio": 0.625}),
        ("out", {"wo": (0.28, 0.96, 0.0), "normal": (0.0, 1.0, 0.0), "ratio": 1.5}),
        ("a ratio of 1", {"wo": SLANT, "normal": (0.0, 1.0, 0.0), "ratio": 1.0}),
        ("at right angles", {"wo": (0.0, 1.0, 0.0), "normal": (0.0, 1.0, 0.0), "ratio": 1.5}),
        ("along the surface, in", {"wo": (1.0, 0.0, 0.0), "normal": (0.0, 1.0, 0.0), "ratio": 0.625}),
        ("total reflection: the root is 0", {"wo": (0.8, 0.6, 0.0), "normal": (0.0, 1.0, 0.0), "ratio": 1.5}),
    ],
    lambda u: {**{name: _vertex(u)[name] for name in ("wo", "normal")}, "ratio": 0.5 + 0.5 * u[6]},
    draws=4,
)
"""Snell's law."""


def _refracted(given: Numbers) -> dict[str, Any]:
    """Return the direction behind a surface, and its cosine."""
    nothing = np.zeros_like(given["wo"])
    site = Site(given["wo"], given["normal"], None, nothing, nothing, nothing, None)
    cosine = np.minimum(np.maximum(dot(site.wo, site.normal), 0.0), 1.0)
    direction, behind = refract(site, cosine, given["ratio"])
    return {"direction": direction, "cosine": behind}


MIRRORED_SHARE = Function(
    "material.fresnel",
    "The share of light that glass mirrors",
    "DIE-3",
    {"cosine": Field("c"), "behind": Field("c', behind the surface"), "ratio": Field("r", 0, 0.25, 4.0)},
    {"share": Field("F")},
    lambda given, dtype: {"share": fresnel(given["cosine"], given["behind"], given["ratio"])},
    [
        ("in", {"cosine": 0.6, "behind": 0.85, "ratio": 0.625}),
        ("out", {"cosine": 0.96, "behind": 0.90625, "ratio": 1.5}),
        ("total reflection", {"cosine": 0.25, "behind": 0.0, "ratio": 1.5}),
        ("along the surface, in", {"cosine": 0.0, "behind": 0.75, "ratio": 0.625}),
        ("along the surface, out: reflection is total", {"cosine": 0.0, "behind": 0.0, "ratio": 1.5}),
        ("nearly along it, out", {"cosine": 2.0**-20, "behind": 0.0, "ratio": 1.0 + 2.0**-20}),
        ("at right angles, in", {"cosine": 1.0, "behind": 1.0, "ratio": 0.625}),
        ("at right angles, out", {"cosine": 1.0, "behind": 1.0, "ratio": 3.0}),
        ("just before total reflection", {"cosine": 0.75, "behind": 2.0**-12, "ratio": 1.5}),
        ("along the surface behind, on the way in", {"cosine": 0.75, "behind": 0.0, "ratio": 0.75}),
        ("a ratio of 1: nothing is mirrored", {"cosine": 0.5, "behind": 0.5, "ratio": 1.0}),
        ("along the surface, a ratio of 1: 0/0 counts as 0", {"cosine": 0.0, "behind": 0.0, "ratio": 1.0}),
        ("hardly a cosine, out: what divides is small", {"cosine": 1e-35, "behind": 0.0, "ratio": 1.5}),
        ("hardly a cosine behind: it is not 0", {"cosine": 0.0, "behind": 1e-35, "ratio": 1.5}),
    ],
    lambda u: {"cosine": u[0], "behind": u[1], "ratio": 0.25 + 3.0 * u[2]},
    draws=4,
)
"""Fresnel's equations."""

DIELECTRIC = Function(
    "material.dielectric",
    "Glass sends a path on: mirrored or refracted",
    "DIE-4",
    {
        **VERTEX,
        **CHOICES,
        "ior": Field("index of refraction", 0, 1.0, 4.0),
        "outside": Field("1: the normal points out of the body, 0: into it"),
    },
    GONE_ON,
    lambda given, dtype: _sampled(Dielectric, given, parameter=given["ior"], outside=given["outside"] > 0.5),
    [
        ("in, refracted", _at(0, 0, 0.9, ior=1.5, outside=1)),
        ("in, mirrored", _at(0, 0, 0.0, ior=1.5, outside=1)),
        ("out, refracted", _at(0, 0, 0.9, wo=(0.28, 0.96, 0.0), ior=1.5, outside=0)),
        ("out, totally reflected", _at(0, 0, 0.999, wo=(0.96, 0.28, 0.0), ior=1.5, outside=0)),
        ("an index of 1: the body is not there", _at(0, 0, 0.5, ior=1.0, outside=1)),
        ("below the mean of both polarisations, above one", _at(0, 0, 0.03125, ior=1.5, outside=1), "DIE-3"),
        ("above the mean, below the other", _at(0, 0, 0.0625, ior=1.5, outside=1), "DIE-3"),
        *_beside(),
        (
            "nothing mirrors, and the number is 0",
            _at(0, 0, 0.0, wo=(0.0, 1.0, 0.0), ior=1.0, outside=1),
            "DIE-3",
        ),
        ("the densest glass, from within", _at(0, 0, 0.5, wo=(0.0, 1.0, 0.0), ior=4.0, outside=0)),
    ],
    lambda u: {**_vertex(u), "ior": 1.0 + u[12], "outside": round(u[13])},
)
"""Glass."""

NO_SETTINGS = cast(transport.Settings, None)
"""Settings where nobody reads any."""


class Heuristic(NamedTuple):
    """All that a weight asks settings for."""

    heuristic: str


MIS = Function(
    "transport.mis_weight",
    "Weights of two techniques",
    "LTR-5",
    {"pdf": Field("density of the technique", 0, 0.0, 2e30), "other": Field("of the other one", 0, 0.0, 1e6)},
    {"balance": Field("weight by the balance heuristic"), "power": Field("by the power heuristic")},
    lambda given, dtype: {
        name: transport.mis_weight(cast(Any, Heuristic(name)), given["pdf"], given["other"])
        for name in transport.HEURISTICS
    },
    [
        ("alike", {"pdf": 0.25, "other": 0.25}),
        ("the other one cannot find it", {"pdf": 0.25, "other": 0.0}),
        ("a camera ray", {"pdf": 1e30, "other": 3.0}),
        ("three to one: 3/4 and 9/10", {"pdf": 3.0, "other": 1.0}),
        ("a density of 0 counts as 1e-15", {"pdf": 0.0, "other": 1e-16}),
    ],
    lambda u: {"pdf": 4.0 * u[0], "other": 4.0 * u[1]},
    draws=4,
)
"""Heuristics."""

SKY = Sky((0.16, 0.30, 0.62), (0.62, 0.70, 0.80), (0.18, 0.16, 0.14), (0.6, 0.8, 0.0), (2.6, 2.2, 1.6), 64.0)
"""The sky of all directions."""


def _sky(given: Numbers, dtype: Any) -> dict[str, Any]:
    """Return radiance and density."""
    sky = environment.build(SKY, dtype)
    direction = given["direction"]
    return {"radiance": environment.radiance(sky, direction), "pdf": environment.pdf(sky, direction)}


RADIANCE = Function(
    "sky.radiance",
    f"{SKY}".replace("Sky(", "The sky with ").rstrip(")"),
    "ENV-1",
    {"direction": Field("unit direction", 3, -1.0)},
    {
        "radiance": Field("radiance from there", 3),
        "pdf": Field("density of the direction, 1/sr", clause="ENV-3"),
    },
    _sky,
    [
        ("the zenith", {"direction": (0.0, 1.0, 0.0)}),
        ("the horizon", {"direction": (1.0, 0.0, 0.0)}),
        ("the ground", {"direction": (0.0, -1.0, 0.0)}),
        ("the sun", {"direction": SKY.sun_direction}),
    ],
    lambda u: {"direction": _unit(u)},
    draws=4,
)
"""The sky's light."""

SKY_SAMPLE = Function(
    "sky.sample",
    "A direction to the same sky",
    "ENV-2",
    OF_SKY,
    {"direction": Field("unit direction", 3)},
    lambda given, dtype: {
        "direction": environment.sample(
            environment.build(SKY, dtype), given["u_choice"], given["u0"], given["u1"]
        )
    },
    [
        ("the middle of the sun", {"u_choice": 0.0, "u0": 0.0, "u1": 0.5}),
        ("anywhere", {"u_choice": 0.999, "u0": 0.5, "u1": 0.25}),
    ],
    lambda u: {"u_choice": u[0], "u0": u[1], "u1": u[2]},
    draws=6,
)
"""Samples of the sky."""


def _unshadowed(given: Numbers, dtype: Any) -> dict[str, Any]:
    """Return the light of the terrace's lamps at points of its surfaces."""
    world = transport.build(TERRACE, NO_SETTINGS, dtype)
    surface = reflecting(given["point"], given["normal"], given["reflectance"])
    return {"unshadowed": transport.unshadowed(world, surface)}


def _lit(point: Any, normal: Any) -> dict[str, Any]:
    """Return the inputs of a point of a surface."""
    return {"point": point, "normal": normal, "reflectance": GOLD}


def _light_pdf(given: Numbers, dtype: Any) -> dict[str, Any]:
    """Return the densities of both lamps of the terrace."""
    lights = transport.build(TERRACE, NO_SETTINGS, dtype).lights
    assert lights is not None
    square, cosine = given["square"], given["cosine"]
    index = np.zeros_like(square, np.int32)
    return {f"lamp_{k}": transport.light_pdf(lights, index + np.int32(k), square, cosine) for k in (0, 1)}


LIGHT_PDF = Function(
    "transport.light_pdf",
    "Densities of points of both lamps of scenes/terrace.json, half of whose light samples go to the sky",
    "LTR-3",
    {"square": Field("s^2", 0, 0.0, 100.0), "cosine": Field("cos_l")},
    {"lamp_0": Field("q of the first lamp, 1/sr"), "lamp_1": Field("q of the second")},
    _light_pdf,
    [
        ("at right angles", {"square": 4.0, "cosine": 1.0}),
        ("aslant", {"square": 0.5, "cosine": 0.25}),
        ("along the lamp: a cosine of 0 counts as 1e-15", {"square": 1e-15, "cosine": 0.0}),
    ],
    lambda u: {"square": 4.0 * u[0], "cosine": u[1]},
    draws=3,
)
"""Light samples' densities."""

UNSHADOWED = Function(
    "transport.unshadowed",
    "Light of the lamps of scenes/terrace.json, as if nothing stood in between",
    "LTR-11",
    {
        "point": Field("point of a surface", 3, -4.0, 4.0),
        "normal": Field("unit normal", 3, -1.0),
        "reflectance": Field("of the surface", 3),
    },
    {"unshadowed": Field("radiance", 3)},
    _unshadowed,
    [
        ("under a lamp", _lit((0.5, 0.0, 0.5), (0.0, 1.0, 0.0))),
        ("close to it", _lit((0.5, 1.6875, 0.5), (0.0, 1.0, 0.0))),
        ("below all lamps, facing away", _lit((0.5, 0.0, 0.5), (0.0, -1.0, 0.0))),
        ("behind both lamps", _lit((-0.5, 2.0, 3.0), (0.0, 0.0, -1.0))),
    ],
    lambda u: _lit(4.0 * u[:3] - 2.0, _unit(u[3:])),
    draws=4,
)
"""Light without shadows."""

FUNCTIONS = (
    GGX,
    SCHLICK,
    VISIBLE,
    REFRACTED,
    MIRRORED_SHARE,
    LIGHT_PDF,
    LAMBERTIAN,
    MIRROR,
    CONDUCTOR,
    CONDUCTOR_VALUE,
    DIELECTRIC,
    MIS,
    UNSHADOWED,
    RADIANCE,
    SKY_SAMPLE,
)
"""The functions of this module."""
