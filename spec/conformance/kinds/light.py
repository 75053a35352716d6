"""Kinds of light transport: camera rays, sampling with densities, rays against shapes, materials, the sky."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from functools import cache
from typing import Any

import numpy as np

from ....refimpl import vectors
from ....refimpl.light import camera, environment, intersection, sampling, transport
from ....refimpl.light import scene as scene_module
from ....refimpl.light.intersection import reflecting
from ....refimpl.light.materials import Conductor, Dielectric, Lambertian, Mirror
from ....refimpl.light.materials.conductor import distribution, sample_visible_normal, schlick
from ....refimpl.light.materials.dielectric import fresnel, refract
from ....refimpl.light.materials.material import Site
from ....refimpl.light.scene import Camera, Light, Quad, Sky, Sphere
from ....refimpl.light.shapes.box import slabs
from ....refimpl.light.shapes.quad import light_radiance, quad_row
from ....refimpl.light.shapes.shape import BLACK, inverse
from ....refimpl.vectors import dot
from ..case import FOLDER, Kind, within
from .tables import ROWS, function, kind

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

SPHERE = Sphere((0.25, -0.5, 0.125), 0.75, BLACK)
"""The sphere of all rays."""

QUAD = Quad((-0.5, 0.25, -0.75), (1.5, 0.0, 0.25), (0.25, 0.0, 2.0), BLACK)
"""The parallelogram of all rays."""

CUMULATIVE = (0.125, 0.125, 0.625, 1.0)
"""Running sums of the probabilities of all draws: the second is 0."""

SCENES = {name: scene_module.from_json(json.dumps(scene)) for name, scene in ROWS["scenes"].items()}
"""What the rays of each kind meet; the titles say it too."""

BOX = SCENES["intersection.box"].boxes[0]
"""The box of all slabs."""

SKY = Sky((0.16, 0.30, 0.62), (0.62, 0.70, 0.80), (0.18, 0.16, 0.14), (0.6, 0.8, 0.0), (2.6, 2.2, 1.6), 64.0)
"""The sky of all directions."""


def _vector(a: Any, b: Any, c: Any) -> tuple[Any, ...]:
    """Return what vectors are made into."""
    products = vectors.dot(a, b), vectors.cross(a, b), vectors.scale(a, b[..., 0])
    rotated = vectors.rotate((a, b, c), c)
    return *products, vectors.normalize(a), rotated, vectors.largest(a), vectors.smallest(a)


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


def _discrete(dtype: Any, u0: Any) -> tuple[Any, Any]:
    """Return the index as a float, and its probability."""
    cumulative = np.asarray(CUMULATIVE, dtype)
    index = sampling.sample_discrete(u0, cumulative)
    return index.astype(dtype), sampling.discrete_pdf(index, cumulative)


def _met(name: str) -> Any:
    """Return the function from rays to distance, normal and perhaps number of the surface."""

    def call(dtype: Any, origin: Any, direction: Any) -> tuple[Any, ...]:
        geometry = intersection.build(SCENES[name], dtype)
        hit = intersection.closest_hit(geometry, origin, direction)
        surface = intersection.surface_at(geometry, hit, origin, direction)
        found = hit.t, surface.normal, hit.surface.astype(dtype)
        return found[: len(ROWS["functions"][name]["outputs"])]

    return call


def _slabs(dtype: Any, origin: Any, direction: Any) -> Any:
    """Return where a ray enters and leaves each slab."""
    half = np.asarray(BOX.half_extent, dtype)
    return slabs(np.asarray(BOX.center, dtype), half, origin, inverse(direction))


def _occluded(dtype: Any, origin: Any, direction: Any, distance: Any) -> Any:
    """Return 1 where something is nearer than a distance."""
    geometry, one = intersection.build(SCENES["intersection.occluded"], dtype), np.ones_like(distance)
    return np.where(intersection.occluded(geometry, origin, direction, distance), one, 0.0 * one)


def _site(wo: Any, normal: Any, reflectance: Any, parameter: Any = None, outside: Any = None) -> Site:
    """Return the vertex with a throughput of 1."""
    one = np.ones_like(reflectance)
    return Site(wo, normal, outside, reflectance, one, one * reflectance, parameter)


def _sampled(material: Any) -> Any:
    """Return the function from a vertex and random numbers to how a path continues."""

    def call(wo: Any, normal: Any, reflectance: Any, u0: Any, u1: Any, u_choice: Any, *more: Any) -> Any:
        parameter, outside = (*more, None, None)[:2]
        site = _site(wo, normal, reflectance, parameter, None if outside is None else outside > 0.5)
        found = material.sample(site, u0, u1, u_choice)
        return found.direction, found.beta, found.pdf

    return call


def _valued(wo: Any, normal: Any, reflectance: Any, wi: Any, roughness: Any) -> tuple[Any, Any]:
    """Return value and density."""
    site, cosine = _site(wo, normal, reflectance, roughness), np.maximum(dot(normal, wi), 0.0)
    color, factor = Conductor.value(site, wi, cosine)
    return color * factor[..., np.newaxis], Conductor.pdf(site, wi, cosine)


def _refracted(wo: Any, normal: Any, ratio: Any) -> tuple[Any, Any]:
    """Return the direction behind a surface, and its cosine."""
    nothing = np.zeros_like(wo)
    site = Site(wo, normal, None, nothing, nothing, nothing, None)
    return refract(site, np.minimum(np.maximum(dot(wo, normal), 0.0), 1.0), ratio)


@cache
def _world(dtype: Any) -> transport.World:
    """Return the scene whose lights are sampled."""
    terrace = scene_module.from_json((FOLDER / "scenes/terrace.json").read_text(encoding="utf-8"))
    return transport.build(terrace, transport.Settings(), dtype)


def _light_pdf(dtype: Any, square: Any, cosine: Any) -> tuple[Any, Any]:
    """Return the densities of both lights of the terrace."""
    lights, index = _world(dtype).lights, np.zeros_like(square, np.int32)
    assert lights is not None
    first, second = (transport.light_pdf(lights, index + np.int32(k), square, cosine) for k in (0, 1))
    return first, second


def _sky(dtype: Any, direction: Any) -> tuple[Any, Any]:
    """Return radiance and density."""
    sky = environment.build(SKY, dtype)
    return environment.radiance(sky, direction), environment.pdf(sky, direction)


TYPED: Mapping[str, Callable[..., Any]] = {
    "camera.ray": lambda dtype, x, y, u, v: camera.camera_ray(
        camera.camera_basis(CAMERA, dtype), x, y, u, v, WIDTH, HEIGHT
    ),
    "sampling.discrete": _discrete,
    "intersection.sphere": lambda dtype, origin, direction: Sphere.distance(
        tuple(np.asarray(part, dtype) for part in SPHERE.row), origin, direction
    ),
    "intersection.quad": lambda dtype, origin, direction: Quad.distance(
        tuple(np.asarray(part, dtype) for part in quad_row(QUAD)), origin, direction
    ),
    "intersection.slabs": _slabs,
    **{name: _met(name) for name in SCENES if name != "intersection.occluded"},
    "intersection.occluded": _occluded,
    "transport.light_pdf": _light_pdf,
    "transport.unshadowed": lambda dtype, *surface: transport.unshadowed(_world(dtype), reflecting(*surface)),
    "sky.radiance": _sky,
    "sky.sample": lambda dtype, u0, u1, u_choice: environment.sample(
        environment.build(SKY, dtype), u_choice, u0, u1
    ),
}
"""Functions with constants of a float type, by name."""

UNTYPED: Mapping[str, Callable[..., Any]] = {
    "vector": _vector,
    "sampling.concentric_disk": sampling.sample_concentric_disk,
    "sampling.cosine_hemisphere": _hemisphere,
    "sampling.spherical_cauchy": _cauchy,
    "sampling.quad": lambda u0, u1, corner, edge_u, edge_v: (
        sampling.sample_quad(u0, u1, corner, edge_u, edge_v),
        sampling.quad_pdf(edge_u, edge_v),
    ),
    "sampling.tangent_frame": sampling.tangent_frame,
    "sampling.to_world": lambda vector, normal: (
        sampling.to_world(vector, normal),
        sampling.to_local(vector, normal),
    ),
    "material.ggx": distribution,
    "material.schlick": schlick,
    "material.visible_normal": sample_visible_normal,
    "material.refracted": _refracted,
    "material.fresnel": fresnel,
    "material.lambertian": _sampled(Lambertian),
    "material.mirror": _sampled(Mirror),
    "material.conductor": _sampled(Conductor),
    "material.conductor_value": _valued,
    "material.dielectric": _sampled(Dielectric),
    "transport.mis_weight": lambda pdf, other: tuple(
        transport.mis_weight(transport.Settings(heuristic=name), pdf, other) for name in ("balance", "power")
    ),
}
"""All others."""

FUNCTIONS = tuple(
    function(name, TYPED.get(name) or UNTYPED[name], name in TYPED)
    for name in ROWS["functions"]
    if name in TYPED or name in UNTYPED
)
"""The functions of this module, in the order of the table."""
