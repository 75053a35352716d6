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
from ..case import Case, Kind, Output
from ..functions import Numbers
from .tables import WORDS, direct, function, kind

ROUNDED = "float64, rounded once to float32"
"""Where bounds of numbers come from that are computed once for a scene: with a margin, one ulp."""

# ---- numbers of a scene -----------------------------------------------------------------------------------


def _layout(name: str, clause: str, call: Callable[..., Any]) -> Kind:
    """Return a kind of numbers that are computed once for a scene, in float64; each row has all inputs."""

    def answer(given: Mapping[str, Any]) -> dict[str, Any]:
        return dict(call(*(np.asarray(value, np.float64).tolist() for value in given.values())))

    def cases() -> list[Case]:
        found = []
        for row in WORDS[name]["given"]:
            inputs = zip(WORDS[name]["inputs"], row, strict=True)
            given = {key: np.asarray(value, np.float64) for key, value in inputs}
            expected = {
                key: Output(value, np.maximum(2.0**-23 * np.abs(value), 2.0**-26), ROUNDED)
                for key, value in answer(given).items()
            }
            found.append(Case(clause, given, expected))
        return found

    return kind(name, cases, answer)


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
    _layout("camera.axes", "CAM-1", _axes),
    _layout("transport.lamp", "SCN-5", _lamp),
    _layout("sky.share", "ENV-2", _share),
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


def pair(u: np.ndarray) -> dict[str, float]:
    """Return two uniform numbers."""
    return {"u0": u[0], "u1": u[1]}


def unit(u: np.ndarray) -> np.ndarray:
    """Return a unit vector from uniform numbers, rounded like a renderer's."""
    v = 2.0 * u[:3] - 1.0
    return np.asarray(v / np.sqrt(v @ v), np.float32)


def aimed(u: np.ndarray) -> dict[str, Any]:
    """Return a ray from outside towards something near the sphere's centre."""
    origin = np.asarray(4.0 * unit(u), np.float32)
    target = np.array(SPHERE_CENTER) + 1.6 * (u[4:7] - 0.5)
    direction = target - origin
    return {"origin": origin, "direction": direction / np.sqrt(direction @ direction)}


FUNCTIONS = (
    direct(
        "vector",
        _vector,
        lambda u: {name: 4.0 * u[3 * i : 3 * i + 3] - 2.0 for i, name in enumerate("abc")},
        draws=5,
    ),
    function(
        "camera.ray",
        _ray,
        lambda u: {"x": int(WIDTH * u[0]), "y": int(HEIGHT * u[1]), "u": u[2], "v": u[3]},
    ),
    direct("sampling.concentric_disk", sampling.sample_concentric_disk, pair),
    direct("sampling.cosine_hemisphere", _hemisphere, pair),
    direct(
        "sampling.spherical_cauchy", _cauchy, lambda u: {**pair(u), "concentration": 1000.0 * u[2] * u[2]}
    ),
    direct(
        "sampling.quad",
        lambda u0, u1, corner, edge_u, edge_v: (
            sampling.sample_quad(u0, u1, corner, edge_u, edge_v),
            sampling.quad_pdf(edge_u, edge_v),
        ),
        lambda u: {
            **pair(u),
            "corner": 4.0 * u[2:5] - 2.0,
            "edge_u": u[5:8] + 0.5,
            "edge_v": unit(u[8:11]),
        },
        draws=4,
    ),
    function("sampling.discrete", _discrete, lambda u: {"u0": u[0]}, draws=4),
    direct("sampling.tangent_frame", sampling.tangent_frame, lambda u: {"normal": unit(u)}),
    direct(
        "sampling.to_world",
        lambda vector, normal: (sampling.to_world(vector, normal), sampling.to_local(vector, normal)),
        lambda u: {"vector": 2.0 * u[3:6] - 1.0, "normal": unit(u)},
        draws=4,
    ),
    function("intersection.sphere", _sphere, aimed),
    function("intersection.quad", _quad, aimed),
)
"""The functions of this module."""
