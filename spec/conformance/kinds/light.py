"""Kinds of light transport: camera rays, sampling with densities, intersections."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from ....refimpl import vectors
from ....refimpl.light import camera, environment, sampling
from ....refimpl.light.scene import Camera, Light, Quad, Sky, Sphere
from ....refimpl.light.shapes.quad import light_radiance, quad_row
from ....refimpl.light.shapes.shape import BLACK
from ..case import Kind, within
from ..functions import Numbers
from .tables import direct, function, kind

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
)
"""The functions of this module."""
