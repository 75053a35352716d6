"""Vertices for tests of materials: one material, many directions, around one normal."""

import numpy as np

from wamnet.refimpl import rng
from wamnet.refimpl.light import sampling
from wamnet.refimpl.light.materials import Site

NORMAL = np.array([2.0, -1.0, 2.0]) / 3.0
"""A normal that is parallel to no axis."""


def uniforms(count, seed=11, dtype=np.float64):
    """Return four arrays (count,) of uniform numbers."""
    return rng.uniforms(
        rng.counter(seed), rng.counter(np.arange(count)), rng.counter(0), rng.counter(0), dtype
    )


def local_direction(cosine, phi=0.4):
    """Return unit directions (..., 3) around +z."""
    cosine = np.asarray(cosine, np.float64)
    sine = np.sqrt((1.0 - cosine) * (1.0 + cosine))
    return np.stack(np.broadcast_arrays(sine * np.cos(phi), sine * np.sin(phi), cosine), axis=-1)


def site(wo, material=None, reflectance=(1.0, 1.0, 1.0), outside=True, dtype=np.float64):
    """Return vertices for local directions wo (P, 3), with a throughput of 1."""
    wo = np.asarray(wo, np.float64)
    normal = np.broadcast_to(NORMAL, wo.shape).astype(dtype)
    tint = np.broadcast_to(np.asarray(reflectance), wo.shape).astype(dtype)
    world = sampling.to_world(wo, np.broadcast_to(NORMAL, wo.shape)).astype(dtype)
    number = None if material is None or material.parameter is None else material.parameter
    parameter = None if number is None else np.full(wo.shape[:-1], number, dtype)
    return Site(world, normal, np.full(wo.shape[:-1], outside), tint, np.ones_like(tint), tint, parameter)


def local(direction):
    """Return world directions (..., 3) around the vertices' normal."""
    return sampling.to_local(direction, np.broadcast_to(NORMAL, direction.shape))


def world(direction):
    """Return local directions (..., 3) in the world."""
    return sampling.to_world(direction, np.broadcast_to(NORMAL, direction.shape))
