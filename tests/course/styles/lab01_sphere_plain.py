"""Lab 1 in another style: the discriminant from the cross product, both roots by name."""

import numpy as np

MISS = 1e30


def dot(a, b):
    return (a * b).sum(-1)


def meet_sphere(center, radius, origin, direction):
    to_center = center - origin
    along = dot(to_center, direction)
    across = to_center - along[..., np.newaxis] * direction
    half_squared = radius**2 - dot(across, across)
    half = np.sqrt(np.where(half_squared > 0, half_squared, 0))
    entry, leave = along - half, along + half
    t = np.where(entry > 0, entry, leave)
    bad = (half_squared <= 0) | (leave <= 0)
    return np.where(bad, np.asarray(MISS, t.dtype), t)
