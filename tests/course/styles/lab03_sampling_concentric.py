"""Lab 3 in another style: the spec's concentric map, and words changed in place."""

import numpy as np

from wamnet.refimpl.light import sampling


def mix(v0, v1, v2, v3):
    v = [np.array(w, np.uint32) for w in (v0, v1, v2, v3)]
    for w in v:
        w *= np.uint32(1664525)
        w += np.uint32(1013904223)
    for turn in range(2):
        if turn:
            for w in v:
                w ^= w >> np.uint32(16)
        for i, j, k in ((0, 1, 3), (1, 2, 0), (2, 0, 1), (3, 1, 2)):
            v[i] += v[j] * v[k]
    return v


def uniform(words):
    return np.floor(words / 256.0) * 2.0**-24


def sample_hemisphere(u0, u1):
    return sampling.sample_cosine_hemisphere(u0, u1)


def hemisphere_pdf(direction):
    z = direction[..., 2]
    return np.where(z > 0, z / np.pi, 0.0)


def invert_hemisphere_sample(direction):
    x, y, radius = (
        direction[..., 0],
        direction[..., 1],
        np.sqrt(direction[..., 0] ** 2 + direction[..., 1] ** 2),
    )
    wide = np.abs(x) > np.abs(y)
    axis, other = np.where(wide, x, y), np.where(wide, y, x)
    r = np.where(axis < 0.0, -radius, radius)
    turned = r * np.arctan(other / np.where(axis == 0.0, 1e-30, axis)) * (4.0 / np.pi)
    return 0.5 * (np.where(wide, r, turned) + 1.0), 0.5 * (np.where(wide, turned, r) + 1.0)
