"""Kinds of light transport: camera rays, sampling with densities, rays against shapes, materials, the sky."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from functools import cache
from typing import Any, NamedTuple, cast

import numpy as np

from ....refimpl import vectors
from ....refimpl.light import camera, environment, intersection, sampling, transport
from ....refimpl.light import scene as scene_module
from ....refimpl.light.intersection import reflecting
from ....refimpl.light.materials import Conductor, Dielectric, Lambertian, Mirror
from ....refimpl.light.materials.conductor import distribution, sample_visible_normal, schlick
from ....refimpl.light.materials.dielectric import fresnel, refract
from ....refimpl.light.materials.material import Site
from ....refimpl.light.scene import Camera, Light, Quad, Scene, Sky, Sphere
from ....refimpl.light.shapes.box import slabs
from ....refimpl.light.shapes.quad import light_radiance, quad_row
from ....refimpl.light.shapes.shape import BLACK, inverse
from ....refimpl.vectors import dot
from ..case import FOLDER, Kind, within
from ..functions import Numbers
from .tables import ROWS, direct, function, kind

ROUNDED = "float64, rounded once to float32"
"""Where bounds of numbers come from that are computed once for a scene: with a margin, one ulp."""

# ---- numbers of a scene -----------------------------------------------------------------------------------


def _layout(name: str, call: Callable[..., Any]) -> Kind:
    """Return a kind of numbers that are computed once for a scene, in float64."""

    def answer(given: Mapping[str, Any]) -> dict[str, Any]:
        return dict(call(*(np.asarray(value, np.float64).tolist() for value in given.values())))

    return kind(
        name, answer, within(lambda inputs, value: np.maximum(2.0**-23 * np.abs(value), 2.0**-26), ROUNDED)
    )


def _axes(position: Any, look_at: Any, up: Any, fov: float) -> dict[str, Any]:
    """Return what a camera's rays are made of."""
    basis = camera.camera_basis(Camera(position, look_at, up, fov))
    return {name: np.asarray(getattr(basis, name)) for name in ("forward", "right", "up", "tan_half_fov")}


def _lamp(edge_u: Any, edge_v: Any, color: Any, power: float) -> dict[str, Any]:
    """Return the radiance of a lamp."""
    return {"radiance": np.array(light_radiance(Light((0.0, 0.0, 0.0), edge_u, edge_v, color, power)))}


def _share(zenith: Any, horizon: Any, ground: Any, sun_irradiance: Any) -> dict[str, Any]:
    """Return the sun's share in the light of a sky."""
    sky = Sky(zenith, horizon, ground, sun_irradiance=sun_irradiance)
    return {"share": environment.build(sky, np.float64).sun_share}


KINDS = (
    _layout("camera.axes", _axes),
    _layout("transport.lamp", _lamp),
    _layout("sky.share", _share),
)
"""Kinds of this module that are not functions which executors run; a sky without light has no share."""

# ---- functions --------------------------------------------------------------------------------------------

CAMERA = Camera((0.5, 1.0, 4.0), (0.0, -0.2, 0.0), (0.0, 1.0, 0.0), 41.0)
"""The camera of all camera rays: it looks down and to the left."""

WIDTH, HEIGHT = 97, 64
"""Size of its image in pixels."""

SPHERE_CENTER, SPHERE_RADIUS = (0.25, -0.5, 0.125), 0.75
"""The sphere of all rays."""

QUAD = ((-0.5, 0.25, -0.75), (1.5, 0.0, 0.25), (0.25, 0.0, 2.0))
"""Corner and edges of the parallelogram of all rays."""

CUMULATIVE = (0.125, 0.125, 0.625, 1.0)
"""Running sums of the probabilities of all draws: the second is 0."""


def _ray(given: Numbers, dtype: Any) -> dict[str, Any]:
    """Return origin and direction."""
    basis = camera.camera_basis(CAMERA, dtype)
    x, y, u, v = (given[name] for name in ("x", "y", "u", "v"))
    origin, direction = camera.camera_ray(basis, x, y, u, v, WIDTH, HEIGHT)
    return {"origin": origin, "direction": direction}


def _vector(a: Any, b: Any, c: Any) -> tuple[Any, ...]:
    """Return what vectors are made into."""
    products = vectors.dot(a, b), vectors.cross(a, b), vectors.scale(a, b[..., 0])
    return (
        *products,
        vectors.normalize(a),
        vectors.rotate((a, b, c), c),
        vectors.largest(a),
        vectors.smallest(a),
    )


def _hemisphere(u0: Any, u1: Any) -> tuple[Any, Any]:
    """Return a direction and its density."""
    wi = sampling.sample_cosine_hemisphere(u0, u1)
    return wi, sampling.cosine_hemisphere_pdf(wi[..., 2])


def _cauchy(u0: Any, u1: Any, concentration: Any) -> tuple[Any, Any]:
    """Return a direction and its density."""
    wi = sampling.sample_spherical_cauchy(u0, u1, concentration)
    # 1 - cos is half the squared chord to the axis, which keeps its digits (environment.py).
    x, y, z = wi[..., 0], wi[..., 1], wi[..., 2] - 1.0
    return wi, sampling.spherical_cauchy_pdf(0.5 * (x * x + y * y + z * z), concentration)


def _discrete(given: Numbers, dtype: Any) -> dict[str, Any]:
    """Return the index as a float, and its probability."""
    cumulative = np.asarray(CUMULATIVE, dtype)
    index = sampling.sample_discrete(given["u0"], cumulative)
    return {"index": index.astype(dtype), "probability": sampling.discrete_pdf(index, cumulative)}


def _sphere(given: Numbers, dtype: Any) -> dict[str, Any]:
    """Return the distance of the sphere."""
    row = tuple(np.asarray(part, dtype) for part in Sphere(SPHERE_CENTER, SPHERE_RADIUS, BLACK).row)
    return {"t": Sphere.distance(row, given["origin"], given["direction"])}


def _quad(given: Numbers, dtype: Any) -> dict[str, Any]:
    """Return the distance of the parallelogram."""
    row = tuple(np.asarray(part, dtype) for part in quad_row(Quad(*QUAD, BLACK)))
    return {"t": Quad.distance(row, given["origin"], given["direction"])}


# ---- boxes, rooms and scenes ------------------------------------------------------------------------------

SCENES = {name: scene_module.from_json(json.dumps(scene)) for name, scene in ROWS["scenes"].items()}
"""What the rays of each kind meet; the titles say it too."""

BOX = SCENES["intersection.box"].boxes[0]
"""The box of all slabs."""


def _met(name: str) -> Any:
    """Return the function from rays to distance, normal and number of the surface."""

    def call(given: Numbers, dtype: Any) -> dict[str, Any]:
        geometry = intersection.build(SCENES[name], dtype)
        hit = intersection.closest_hit(geometry, given["origin"], given["direction"])
        surface = intersection.surface_at(geometry, hit, given["origin"], given["direction"])
        return {"t": hit.t, "normal": surface.normal, "surface": hit.surface.astype(dtype)}

    return call


def _slabs(given: Numbers, dtype: Any) -> dict[str, Any]:
    """Return where a ray enters and leaves each slab."""
    half = np.asarray(BOX.half_extent, dtype)
    enter, leave = slabs(np.asarray(BOX.center, dtype), half, given["origin"], inverse(given["direction"]))
    return {"enter": enter, "leave": leave}


def _occluded(given: Numbers, dtype: Any) -> dict[str, Any]:
    """Return 1 where something is nearer than a distance."""
    geometry = intersection.build(SCENES["intersection.occluded"], dtype)
    found = intersection.occluded(geometry, given["origin"], given["direction"], given["distance"])
    one = np.ones_like(given["distance"])
    return {"occluded": np.where(found, one, 0.0 * one)}


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
    direct("vector", _vector),
    function("camera.ray", _ray),
    direct("sampling.concentric_disk", sampling.sample_concentric_disk),
    direct("sampling.cosine_hemisphere", _hemisphere),
    direct("sampling.spherical_cauchy", _cauchy),
    direct(
        "sampling.quad",
        lambda u0, u1, corner, edge_u, edge_v: (
            sampling.sample_quad(u0, u1, corner, edge_u, edge_v),
            sampling.quad_pdf(edge_u, edge_v),
        ),
    ),
    function("sampling.discrete", _discrete),
    direct("sampling.tangent_frame", sampling.tangent_frame),
    direct(
        "sampling.to_world",
        lambda vector, normal: (sampling.to_world(vector, normal), sampling.to_local(vector, normal)),
    ),
    function("intersection.sphere", _sphere),
    function("intersection.quad", _quad),
    function("intersection.slabs", _slabs),
    *(function(name, _met(name)) for name in SCENES if name != "intersection.occluded"),
    function("intersection.occluded", _occluded),
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
