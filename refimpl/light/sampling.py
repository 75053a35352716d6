"""Sampling of the distributions that light transport needs, each as two functions.

For a distribution X: `sample_x(u, ...)` maps uniform numbers in [0, 1) to a sample, `x_pdf(...)` is the
density of that sample (Pharr, Jakob and Humphreys, "Physically Based Rendering", 4th edition, appendix A).
Random numbers are arguments.

1. concentric disk: Shirley and Chiu, "A Low Distortion Map Between Disk and Square", 1997.
2. cosine hemisphere: Malley's method, the disk lifted to the hemisphere around +z; density cos(theta) / pi.
3. quad: uniform in area over a parallelogram.
4. discrete: an index with given probabilities.
5. spherical Cauchy: directions around an axis, from all alike to a narrow lobe with a wide skirt; Kato and
   McCullagh, "Some properties of a Cauchy family on the sphere derived from the Moebius transformations",
   Bernoulli 26(4), 2020, in the concentration k = 2 rho / (1 - rho)^2 of their rho.
"""

from __future__ import annotations

import numpy as np

from .. import vectors
from ..vectors import Directions, Floats, Ids, Normals, Points

INV_PI = 1.0 / np.pi
"""1 / pi: the normalisation of the cosine density over the hemisphere, in 1 / sr."""

_TINY = 1e-30
"""Stands in for a zero divisor where the dividend is zero too; any positive normal float32 would do."""


def sample_concentric_disk(u0: Floats, u1: Floats) -> tuple[Floats, Floats]:
    """Map u0, u1 (...) in [0, 1) to x, y (...) in the unit disk; squares around the centre become circles."""
    a, b = 2.0 * u0 - 1.0, 2.0 * u1 - 1.0
    # In the wedge around the x axis a is the radius, else b; the other one gives the angle.
    around_x = np.abs(a) > np.abs(b)
    radius = np.where(around_x, a, b)
    other = np.where(around_x, b, a)
    ratio = other / np.where(radius == 0.0, _TINY, radius)
    phi = np.where(around_x, 0.25 * np.pi * ratio, 0.5 * np.pi - 0.25 * np.pi * ratio)
    return radius * np.cos(phi), radius * np.sin(phi)


def sample_cosine_hemisphere(u0: Floats, u1: Floats) -> Directions:
    """Map u0, u1 (...) to unit directions (..., 3) around +z with density cos(theta) / pi."""
    x, y = sample_concentric_disk(u0, u1)
    return vectors.vector(x, y, np.sqrt(np.maximum(0.0, 1.0 - x * x - y * y)))


def cosine_hemisphere_pdf(cos_theta: Floats) -> Floats:
    """Return the density cos(theta) / pi, in 1 / sr, for cos_theta (...) >= 0; below the horizon it is 0."""
    return np.maximum(cos_theta, 0.0) * INV_PI


def sample_quad(u0: Floats, u1: Floats, corner: Points, edge_u: Directions, edge_v: Directions) -> Points:
    """Map u0, u1 (...) to points (..., 3) corner + u0 edge_u + u1 edge_v, uniform in area."""
    return corner + vectors.scale(edge_u, u0) + vectors.scale(edge_v, u1)


def quad_pdf(edge_u: Directions, edge_v: Directions) -> Floats:
    """Return the density 1 / area (...) over the parallelogram that edge_u, edge_v (..., 3) span."""
    normal = vectors.cross(edge_u, edge_v)
    return 1.0 / np.sqrt(vectors.dot(normal, normal))


def sample_discrete(u: Floats, cumulative: Floats) -> Ids:
    """Map u (...) in [0, 1) to indices (...): how many of the bounds cumulative[:-1] are at most u.

    cumulative (K,) are the running sums of the probabilities, the last one being 1.
    """
    index = np.zeros_like(u, dtype=np.int32)
    for bound in cumulative[:-1]:
        index = index + np.where(u >= bound, np.int32(1), np.int32(0))
    return index


def discrete_pdf(index: Ids, cumulative: Floats) -> Floats:
    """Return the probability (...) of each index (...) under the running sums cumulative (K,)."""
    return vectors.look_up(np.diff(cumulative, prepend=cumulative.dtype.type(0)), index)


def sample_spherical_cauchy(u0: Floats, u1: Floats, concentration: Floats) -> Directions:
    """Map u0, u1 (...) to unit directions (..., 3) around +z, lobed by the concentration k (...) >= 0.

    The share of directions with 1 - cos below v is v (1 + 2 k) / (2 (1 + k v)), which u0 inverts.
    """
    versine = 2.0 * u0 / (1.0 + 2.0 * concentration * (1.0 - u0))
    sine, phi = np.sqrt(np.maximum(versine * (2.0 - versine), 0.0)), (2.0 * u1 - 1.0) * np.pi
    return vectors.vector(sine * np.cos(phi), sine * np.sin(phi), 1.0 - versine)


def spherical_cauchy_pdf(versine: Floats, concentration: Floats) -> Floats:
    """Return the density (...), in 1/sr, where 1 - cos to the axis is versine (...): the lobe's shape."""
    spread = 1.0 + concentration * versine
    return (1.0 + 2.0 * concentration) * (0.25 * INV_PI) / (spread * spread)


def tangent_frame(normal: Normals) -> tuple[Directions, Directions]:
    """Return two unit tangents (..., 3) that form a right-handed frame with the unit normal (..., 3).

    Duff et al., "Building an Orthonormal Basis, Revisited", Journal of Computer Graphics Techniques 6(1),
    2017: no branch, and no loss of accuracy near the pole.
    """
    x, y, z = normal[..., 0], normal[..., 1], normal[..., 2]
    sign = np.where(z < 0.0, -np.ones_like(z), np.ones_like(z))
    a = -1.0 / (sign + z)
    b = x * y * a
    tangent = vectors.vector(1.0 + sign * x * x * a, sign * b, -sign * x)
    bitangent = vectors.vector(b, sign + y * y * a, -y)
    return tangent, bitangent


def to_world(local: Directions, normal: Normals) -> Directions:
    """Turn directions local (..., 3), given around +z, into directions around normal (..., 3)."""
    tangent, bitangent = tangent_frame(normal)
    return (
        vectors.scale(tangent, local[..., 0])
        + vectors.scale(bitangent, local[..., 1])
        + vectors.scale(normal, local[..., 2])
    )


def to_local(world: Directions, normal: Normals) -> Directions:
    """Turn directions world (..., 3) into directions around +z, as [`to_world`] turns them back."""
    tangent, bitangent = tangent_frame(normal)
    return vectors.vector(
        vectors.dot(world, tangent), vectors.dot(world, bitangent), vectors.dot(world, normal)
    )
