"""Kinds of light transport: camera rays, sampling with densities, intersections."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from ....refimpl import vectors
from ....refimpl.light import camera, environment, sampling
from ....refimpl.light.scene import Camera, Light, Quad, Sky, Sphere
from ....refimpl.light.shapes.quad import light_radiance, quad_row
from ....refimpl.light.shapes.shape import BLACK, MISS
from ..case import Case, Kind, Output
from ..functions import Field, Function, Numbers

ROUNDED = "float64, rounded once to float32"
"""Where bounds of numbers come from that are computed once for a scene: with a margin, one ulp."""


def layout_kind(
    name: str,
    title: str,
    clause: str,
    inputs: Mapping[str, str],
    outputs: Mapping[str, str],
    call: Callable[[Mapping[str, Any]], dict[str, Any]],
    rows: Sequence[tuple[Any, ...]],
) -> Kind:
    """Return a kind of numbers that are computed once for a scene, in float64; each row has all inputs."""

    def cases() -> list[Case]:
        found = []
        for index, row in enumerate(rows):
            given = {key: np.asarray(value, np.float64) for key, value in zip(inputs, row, strict=True)}
            ulps = {key: np.maximum(2.0**-23 * np.abs(value), 2.0**-26) for key, value in call(given).items()}
            expected = {key: Output(value, ulps[key], ROUNDED) for key, value in call(given).items()}
            found.append(Case(f"{name}/{index}", clause, given, expected))
        return found

    return Kind(name, title, inputs, outputs, cases, call)


def _axes(given: Mapping[str, Any]) -> dict[str, Any]:
    """Return what a camera's rays are made of."""
    place, at, up = (tuple(map(float, given[name])) for name in ("position", "look_at", "up"))
    basis = camera.camera_basis(Camera(place, at, up, float(given["vertical_fov_deg"])))  # type: ignore[arg-type]
    return {name: np.asarray(getattr(basis, name)) for name in ("forward", "right", "up", "tan_half_fov")}


AXES = layout_kind(
    "camera.axes",
    "The axes of a camera",
    "CAM-1",
    {**dict.fromkeys(("position", "look_at", "up"), "float[3]"), "vertical_fov_deg": "float, degrees"},
    {**dict.fromkeys(("forward", "right", "up"), "float[3], unit"), "tan_half_fov": "float, tan(fov/2)"},
    _axes,
    (
        ((0.0, 0.0, 0.0), (0.0, 0.0, -2.0), (0.0, 1.0, 0.0), 90.0),
        ((0.5, 1.0, 4.0), (0.0, -0.25, 0.0), (0.25, 1.0, 0.5), 40.0),
        ((3.0, -2.0, 1.0), (-1.0, 0.5, 2.0), (0.0, 0.0, 3.0), 100.0),
    ),
)
"""Cameras."""


def _lamp(given: Mapping[str, Any]) -> dict[str, Any]:
    """Return the radiance of a lamp."""
    u, v, color = (tuple(map(float, given[name])) for name in ("edge_u", "edge_v", "color"))
    lamp = Light((0.0, 0.0, 0.0), u, v, color, float(given["power"]))  # type: ignore[arg-type]
    return {"radiance": np.array(light_radiance(lamp))}


LAMP = layout_kind(
    "transport.lamp",
    "The radiance of a lamp",
    "SCN-5",
    {**dict.fromkeys(("edge_u", "edge_v", "color"), "float[3]"), "power": "float, W"},
    {"radiance": "float[3], W/(sr m^2)"},
    _lamp,
    (
        ((1.0, 0.0, 0.0), (0.0, 0.0, 1.0), (1.0, 1.0, 1.0), 1.0),
        ((2.0, 0.0, 0.5), (0.25, -1.5, 0.0), (1.0, 0.75, 0.25), 12.0),
        ((0.5, 0.25, 0.0), (1.0, -0.25, 3.0), (0.0, 0.5, 2.0), 3.5),
    ),
)
"""Lamps."""


def _share(given: Mapping[str, Any]) -> dict[str, Any]:
    """Return the sun's share in the light of a sky."""
    parts = {name: tuple(map(float, value)) for name, value in given.items()}
    return {"share": environment.build(Sky(**parts), np.float64).sun_share}  # type: ignore[arg-type]


SHARE = layout_kind(
    "sky.share",
    "The share of the sun in the light of a sky",
    "ENV-2",
    dict.fromkeys(("zenith", "horizon", "ground", "sun_irradiance"), "float[3], linear RGB"),
    {"share": "float, q"},
    _share,
    (
        ((0.5, 0.25, 1.0), (0.125, 0.5, 0.25), (0.25, 0.75, 0.0625), (3.0, 2.0, 1.0)),
        ((0.125, 0.0, 0.0), (0.0, 0.0625, 0.0), (0.0, 0.0, 0.03125), (0.0, 0.125, 0.25)),
        ((1.0, 1.0, 1.0), (1.0, 1.0, 1.0), (1.0, 1.0, 1.0), (0.0, 0.0, 0.0)),
        ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)),
    ),
)
"""Skies; without light there is no share."""

KINDS = (AXES, LAMP, SHARE)
"""Kinds of this module that are not functions which executors run."""

CAMERA = Camera((0.5, 1.0, 4.0), (0.0, -0.2, 0.0), (0.0, 1.0, 0.0), 41.0)
"""The camera of all camera rays: it looks down and to the left."""

WIDTH, HEIGHT = 97, 64
"""Size of its image in pixels."""


def _ray(given: Numbers, dtype: Any) -> dict[str, Any]:
    """Return origin and direction."""
    basis = camera.camera_basis(CAMERA, dtype)
    x, y, u, v = (given[name] for name in ("x", "y", "u", "v"))
    origin, direction = camera.camera_ray(basis, x, y, u, v, WIDTH, HEIGHT)
    return {"origin": origin, "direction": direction}


def _vector(given: Numbers, dtype: Any) -> dict[str, Any]:
    """Return what vectors are made into."""
    a, b, c = (given[name] for name in "abc")
    return {
        "inner": vectors.dot(a, b),
        "outer": vectors.cross(a, b),
        "scaled": vectors.scale(a, b[..., 0]),
        "unit": vectors.normalize(a),
        "rotated": vectors.rotate((a, b, c), c),
        "largest": vectors.largest(a),
        "smallest": vectors.smallest(a),
    }


THREE = {name: Field(f"a vector, and a row of a matrix: {name}", 3, -4.0, 4.0) for name in "abc"}
"""Three vectors."""

VECTOR = Function(
    "vector",
    "Vectors: products, length, a matrix of the rows a, b, c times c",
    "VEC-7",
    THREE,
    {
        "inner": Field("a . b", clause="VEC-2"),
        "outer": Field("a x b", 3),
        "scaled": Field("a times the x of b", 3),
        "unit": Field("a, of length 1", 3, clause="VEC-3"),
        "rotated": Field("the matrix times c", 3, clause="VEC-4"),
        "largest": Field("the largest component of a"),
        "smallest": Field("the least component of a"),
    },
    _vector,
    [
        (
            "eighths of nine primes",
            {"a": (0.25, 0.375, 0.625), "b": (0.875, 1.375, 1.625), "c": (2.125, 2.375, 2.875)},
        ),
        ("axes", {"a": (1.0, 0.0, 0.0), "b": (0.0, 1.0, 0.0), "c": (0.0, 0.0, 1.0)}),
        ("the largest is the last one", {"a": (-3.0, 1.0, 2.0), "b": (2.0, -1.0, 0.5), "c": (1.0, 2.0, 3.0)}),
        (
            "the largest is in the middle",
            {"a": (1.0, 3.0, -2.0), "b": (0.25, 4.0, 1.0), "c": (3.0, -2.0, 1.0)},
        ),
    ],
    lambda u: {name: 4.0 * u[3 * i : 3 * i + 3] - 2.0 for i, name in enumerate("abc")},
    draws=5,
)
"""Vectors."""

RAY = Function(
    "camera.ray",
    f"Rays of a camera at {CAMERA.position} that looks at {CAMERA.look_at}, with {CAMERA.up} up, "
    f"{CAMERA.vertical_fov_deg:g} degrees high, image {WIDTH} x {HEIGHT}",
    "CAM-2",
    {
        "x": Field("column", high=WIDTH),
        "y": Field("row", high=HEIGHT),
        "u": Field("place in the pixel"),
        "v": Field("place in the pixel"),
    },
    {"origin": Field("where the ray starts", 3), "direction": Field("unit direction", 3)},
    _ray,
    [
        ("upper left corner of the image", {"x": 0, "y": 0, "u": 0.0, "v": 0.0}),
        ("lower right corner", {"x": WIDTH - 1, "y": HEIGHT - 1, "u": 1 - 2.0**-24, "v": 1 - 2.0**-24}),
        ("middle of the image", {"x": WIDTH // 2, "y": HEIGHT // 2, "u": 0.5, "v": 0.0}),
    ],
    lambda u: {"x": int(WIDTH * u[0]), "y": int(HEIGHT * u[1]), "u": u[2], "v": u[3]},
)
"""Camera rays."""

UNIFORM = {"u0": Field("uniform number in [0, 1)"), "u1": Field("uniform number in [0, 1)")}
"""What samplers are given."""

CORNERS = [
    ("both 0", {"u0": 0.0, "u1": 0.0}),
    ("both just below 1", {"u0": 1 - 2.0**-24, "u1": 1 - 2.0**-24}),
    ("the middle: 0 / 0 counts as 0", {"u0": 0.5, "u1": 0.5}),
    ("on a diagonal, between two wedges", {"u0": 0.25, "u1": 0.75}),
    ("just beside the diagonal", {"u0": 0.25, "u1": 0.75 + 2.0**-20}),
]
"""Uniform numbers at the edges of the maps."""


def _pair(u: np.ndarray) -> dict[str, float]:
    """Return two uniform numbers."""
    return {"u0": u[0], "u1": u[1]}


def _disk(given: Numbers, dtype: Any) -> dict[str, Any]:
    """Return a point of the disk."""
    x, y = sampling.sample_concentric_disk(given["u0"], given["u1"])
    return {"x": x, "y": y}


def _hemisphere(given: Numbers, dtype: Any) -> dict[str, Any]:
    """Return a direction and its density."""
    wi = sampling.sample_cosine_hemisphere(given["u0"], given["u1"])
    return {"direction": wi, "pdf": sampling.cosine_hemisphere_pdf(wi[..., 2])}


DISK = Function(
    "sampling.concentric_disk",
    "The square to the disk",
    "SMP-1",
    UNIFORM,
    {"x": Field("place in the unit disk"), "y": Field("place in the unit disk")},
    _disk,
    CORNERS,
    _pair,
)
"""Shirley and Chiu's map."""

HEMISPHERE = Function(
    "sampling.cosine_hemisphere",
    "Cosine-weighted directions around +z, with their density",
    "SMP-2",
    UNIFORM,
    {"direction": Field("unit direction", 3), "pdf": Field("density, 1/sr")},
    _hemisphere,
    CORNERS,
    _pair,
)
"""Malley's method."""

FRAME = Function(
    "sampling.tangent_frame",
    "Two tangents of a unit normal",
    "SMP-5",
    {"normal": Field("unit normal", 3, -1.0)},
    {"tangent": Field("unit tangent", 3), "bitangent": Field("the other one, right-handed", 3)},
    lambda given, dtype: dict(
        zip(("tangent", "bitangent"), sampling.tangent_frame(given["normal"]), strict=True)
    ),
    [
        ("up", {"normal": (0.0, 0.0, 1.0)}),
        ("down: the pole of other constructions", {"normal": (0.0, 0.0, -1.0)}),
        ("z is the other zero", {"normal": (1.0, 0.0, -0.0)}),
        ("nearly down", {"normal": (1e-4, 0.0, -1.0)}),
    ],
    lambda u: {"normal": _unit(u)},
)
"""Duff's frame."""


def _unit(u: np.ndarray) -> np.ndarray:
    """Return a unit vector from uniform numbers, rounded like a renderer's."""
    v = 2.0 * u[:3] - 1.0
    return np.asarray(v / np.sqrt(v @ v), np.float32)


TURNED = Function(
    "sampling.to_world",
    "Directions from local to world terms, and back",
    "SMP-6",
    {"vector": Field("a vector", 3, -2.0, 2.0), "normal": Field("unit normal", 3, -1.0)},
    {
        "world": Field("the vector, taken for a local one, in world terms", 3),
        "local": Field("the vector, taken for one of the world, in local terms", 3),
    },
    lambda given, dtype: {
        "world": sampling.to_world(given["vector"], given["normal"]),
        "local": sampling.to_local(given["vector"], given["normal"]),
    },
    [
        ("up", {"vector": (2.0, 0.75, 0.5), "normal": (0.0, 0.0, 1.0)}),
        ("along x", {"vector": (2.0, 0.75, 0.5), "normal": (1.0, 0.0, 0.0)}),
    ],
    lambda u: {"vector": 2.0 * u[3:6] - 1.0, "normal": _unit(u)},
    draws=4,
)
"""The frame of a normal."""

RAY_FIELDS = {
    "origin": Field("where the ray starts", 3, -5_000.0, 5_000.0),
    "direction": Field("unit direction", 3, -1.0),
}
"""What intersections are given."""

T = {"t": Field(f"distance along the ray; {MISS:g} where nothing is hit")}
"""What they answer."""

SPHERE_CENTER, SPHERE_RADIUS = (0.25, -0.5, 0.125), 0.75
"""The sphere of all rays."""


def _sphere(given: Numbers, dtype: Any) -> dict[str, Any]:
    """Return the distance of the sphere."""
    row = Sphere(SPHERE_CENTER, SPHERE_RADIUS, BLACK).row
    rounded = tuple(np.asarray(part, dtype) for part in row)
    return {"t": Sphere.distance(rounded, given["origin"], given["direction"])}


def _aimed(u: np.ndarray) -> dict[str, Any]:
    """Return a ray from outside towards something near the sphere's centre."""
    origin = np.asarray(4.0 * _unit(u), np.float32)
    target = np.array(SPHERE_CENTER) + 1.6 * (u[4:7] - 0.5)
    direction = target - origin
    return {"origin": origin, "direction": direction / np.sqrt(direction @ direction)}


SPHERE = Function(
    "intersection.sphere",
    f"The sphere of radius {SPHERE_RADIUS} around {SPHERE_CENTER}",
    "ISC-6",
    RAY_FIELDS,
    T,
    _sphere,
    [
        ("from inside, out", {"origin": SPHERE_CENTER, "direction": (0.0, 0.0, 1.0)}),
        ("away from it", {"origin": (0.25, -0.5, 4.0), "direction": (0.0, 0.0, 1.0)}),
        ("through its middle", {"origin": (0.25, -0.5, 4.0), "direction": (0.0, 0.0, -1.0)}),
        ("past it", {"origin": (2.0, 2.0, 4.0), "direction": (0.0, 0.0, -1.0)}),
        ("from far away", {"origin": (0.25, -0.25, 4096.0), "direction": (0.0, 0.0, -1.0)}),
        ("along its side", {"origin": (1.0, -0.5, 4.0), "direction": (0.0, 0.0, -1.0)}),
        ("on it, leaving", {"origin": (1.0, -0.5, 0.125), "direction": (1.0, 0.0, 0.0)}),
        ("on it, entering", {"origin": (1.0, -0.5, 0.125), "direction": (-1.0, 0.0, 0.0)}),
    ],
    _aimed,
)
"""Rays and a sphere."""

QUAD = ((-0.5, 0.25, -0.75), (1.5, 0.0, 0.25), (0.25, 0.0, 2.0))
"""Corner and edges of the parallelogram of all rays."""


def _quad(given: Numbers, dtype: Any) -> dict[str, Any]:
    """Return the distance of the parallelogram."""
    row = tuple(np.asarray(part, dtype) for part in quad_row(Quad(*QUAD, BLACK)))
    return {"t": Quad.distance(row, given["origin"], given["direction"])}


def _on_quad(a: float, b: float, y: float) -> tuple[float, float, float]:
    """Return the point above the place a, b of the parallelogram."""
    (x, _, z), (u_x, _, u_z), (v_x, _, v_z) = QUAD
    return x + a * u_x + b * v_x, y, z + a * u_z + b * v_z


EDGES = (
    *((end, 0.5) for end in (1.0005, 0.9995, -0.0005, 0.0005)),
    *((0.5, end) for end in (1.0005, 0.9995, -0.0005, 0.0005)),
)
"""Places on both sides of the parallelogram's edges."""

PLANE = Function(
    "intersection.quad",
    f"The parallelogram with the corner {QUAD[0]} and the edges {QUAD[1]} and {QUAD[2]}",
    "ISC-7",
    RAY_FIELDS,
    T,
    _quad,
    [
        ("from above, into its middle", {"origin": (0.375, 2.0, 0.375), "direction": (0.0, -1.0, 0.0)}),
        ("from below", {"origin": (0.375, -2.0, 0.375), "direction": (0.0, 1.0, 0.0)}),
        ("into its far corner", {"origin": (1.125, 2.0, 1.375), "direction": (0.0, -1.0, 0.0)}),
        ("in its plane", {"origin": (-4.0, 0.25, 0.375), "direction": (1.0, 0.0, 0.0)}, "ISC-5"),
        ("parallel to it, above", {"origin": (-4.0, 0.5, 0.375), "direction": (1.0, 0.0, 0.0)}, "ISC-5"),
        ("through a corner", {"origin": (-0.5, 2.0, -0.75), "direction": (0.0, -1.0, 0.0)}),
        ("behind the ray", {"origin": (0.375, 2.0, 0.375), "direction": (0.0, 1.0, 0.0)}),
        *(
            (f"at a = {a}, b = {b}", {"origin": _on_quad(a, b, 2.0), "direction": (0.0, -1.0, 0.0)})
            for a, b in EDGES
        ),
        ("on it, leaving", {"origin": _on_quad(0.5, 0.5, 0.25), "direction": (0.0, 1.0, 0.0)}),
    ],
    _aimed,
)
"""Rays and a parallelogram."""

CAUCHY = Function(
    "sampling.spherical_cauchy",
    "Directions around +z, lobed by a concentration, with their density",
    "SMP-7",
    {**UNIFORM, "concentration": Field("concentration of the lobe", 0, 0.0, 1e6)},
    {"direction": Field("unit direction", 3), "pdf": Field("density, 1/sr")},
    lambda given, dtype: _cauchy(given),
    [
        ("no lobe: the whole sphere", {"u0": 0.5, "u1": 0.25, "concentration": 0.0}),
        ("the axis", {"u0": 0.0, "u1": 0.5, "concentration": 400.0}),
        ("the far end of the skirt", {"u0": 1 - 2.0**-24, "u1": 0.5, "concentration": 400.0}),
        ("the narrowest lobe", {"u0": 0.5, "u1": 0.75, "concentration": 1e6}),
    ],
    lambda u: {**_pair(u), "concentration": 1000.0 * u[2] * u[2]},
)
"""The sky's lobe."""


def _cauchy(given: Numbers) -> dict[str, Any]:
    """Return a direction and its density."""
    wi = sampling.sample_spherical_cauchy(given["u0"], given["u1"], given["concentration"])
    # 1 - cos is half the squared chord to the axis, which keeps its digits (environment.py).
    x, y, z = wi[..., 0], wi[..., 1], wi[..., 2] - 1.0
    versine = 0.5 * (x * x + y * y + z * z)
    return {"direction": wi, "pdf": sampling.spherical_cauchy_pdf(versine, given["concentration"])}


SAMPLE_QUAD = Function(
    "sampling.quad",
    "Points of a parallelogram",
    "SMP-3",
    {
        **UNIFORM,
        "corner": Field("corner", 3, -10.0, 10.0),
        "edge_u": Field("edge", 3, -10.0, 10.0),
        "edge_v": Field("other edge", 3, -10.0, 10.0),
    },
    {"point": Field("point of the parallelogram", 3), "pdf": Field("density, 1/area")},
    lambda given, dtype: {
        "point": sampling.sample_quad(*(given[name] for name in ("u0", "u1", "corner", "edge_u", "edge_v"))),
        "pdf": sampling.quad_pdf(given["edge_u"], given["edge_v"]),
    },
    [
        (
            "its corner",
            {"u0": 0.0, "u1": 0.0, "corner": (1, 2, 3), "edge_u": (1, 0, 0), "edge_v": (0, 0, 1)},
        ),
        (
            "edges that are not at right angles",
            {"u0": 0.5, "u1": 0.75, "corner": (0, 0, 0), "edge_u": (2, 0, 0), "edge_v": (1, 1, 0)},
        ),
    ],
    lambda u: {**_pair(u), "corner": 4.0 * u[2:5] - 2.0, "edge_u": u[5:8] + 0.5, "edge_v": _unit(u[8:11])},
    draws=4,
)
"""Light sampling's points."""

CUMULATIVE = (0.125, 0.125, 0.625, 1.0)
"""Running sums of the probabilities of all draws: the second is 0."""

DISCRETE = Function(
    "sampling.discrete",
    f"An index by the running sums {', '.join(map(str, CUMULATIVE))}",
    "SMP-4",
    {"u0": UNIFORM["u0"]},
    {"index": Field("index, from 0"), "probability": Field("its probability")},
    lambda given, dtype: _discrete(given["u0"], dtype),
    [
        ("the first", {"u0": 0.0}),
        ("just below a running sum", {"u0": 0.125 - 2.0**-24}),
        ("on a running sum: the next one that is not impossible", {"u0": 0.125}),
        ("the last", {"u0": 1 - 2.0**-24}),
    ],
    lambda u: {"u0": u[0]},
    draws=4,
)
"""Which light is sampled."""


def _discrete(u: Any, dtype: Any) -> dict[str, Any]:
    """Return the index as a float, and its probability."""
    cumulative = np.asarray(CUMULATIVE, dtype)
    index = sampling.sample_discrete(u, cumulative)
    return {"index": index.astype(dtype), "probability": sampling.discrete_pdf(index, cumulative)}


FUNCTIONS = (VECTOR, RAY, DISK, HEMISPHERE, CAUCHY, SAMPLE_QUAD, DISCRETE, FRAME, TURNED, SPHERE, PLANE)
"""The functions of this module."""
