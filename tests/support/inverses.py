"""Inverses of the maps of random numbers: what is drawn, back to the numbers (spec/sampling.md)."""

import numpy as np

from wamnet.refimpl import vectors
from wamnet.refimpl.light import sampling
from wamnet.refimpl.light.materials import conductor


def invert_concentric_disk_sample(x, y):
    """Return the u0, u1 (...) that [`sample_concentric_disk`] maps to x, y (...)."""
    # The wedge around the x axis holds |y| < |x|; radius and angle are measured from its signed axis.
    around_x = np.abs(x) > np.abs(y)
    axis, other = np.where(around_x, x, y), np.where(around_x, y, x)
    length = np.sqrt(x * x + y * y)
    radius = np.where(axis < 0.0, -length, length)
    ratio = np.arctan(other / np.where(axis == 0.0, 1e-30, axis)) * (4.0 / np.pi)
    a = np.where(around_x, radius, ratio * radius)
    b = np.where(around_x, ratio * radius, radius)
    return 0.5 * (a + 1.0), 0.5 * (b + 1.0)


def invert_cosine_hemisphere_sample(wi):
    """Return the u0, u1 (...) that [`sample_cosine_hemisphere`] maps to wi (..., 3)."""
    return invert_concentric_disk_sample(wi[..., 0], wi[..., 1])


def invert_quad_sample(p, corner, edge_u, edge_v):
    """Return the u0, u1 (...) that [`sample_quad`] maps to the points p (..., 3) of the parallelogram."""
    # Solve p - corner = u0 edge_u + u1 edge_v by the vectors dual to the edges.
    offset, normal = p - corner, vectors.cross(edge_u, edge_v)
    square = vectors.dot(normal, normal)
    u0 = vectors.dot(vectors.cross(offset, edge_v), normal) / square
    u1 = vectors.dot(vectors.cross(edge_u, offset), normal) / square
    return u0, u1


def invert_discrete_sample(index, cumulative):
    """Return the middle (...) of the uniform numbers that [`sample_discrete`] maps to index (...)."""
    upper = vectors.look_up(cumulative, index)
    return upper - 0.5 * sampling.discrete_pdf(index, cumulative)


def invert_spherical_cauchy_sample(wi, concentration):
    """Return the u0, u1 (...) that [`sample_spherical_cauchy`] maps to wi (..., 3)."""
    versine = 1.0 - wi[..., 2]
    u0 = versine * (1.0 + 2.0 * concentration) / (2.0 * (1.0 + concentration * versine))
    return u0, 0.5 * (np.arctan2(wi[..., 1], wi[..., 0]) / np.pi + 1.0)


def invert_visible_normal_sample(m, wo, alpha):
    """Return the u0, u1 (...) that [`sample_visible_normal`] maps to the normals m (..., 3)."""
    _, tangent, bitangent, share = conductor._stretched(wo, alpha)
    n = vectors.normalize(vectors.vector(m[..., 0] / alpha, m[..., 1] / alpha, m[..., 2]))
    x, y = vectors.dot(n, tangent), vectors.dot(n, bitangent)
    chord = np.sqrt(np.maximum(1.0 - x * x, 0.0))
    return invert_concentric_disk_sample(x, (y - (1.0 - share) * chord) / share)
