"""Rooms of many primitives, the same in every run: they show what the number of primitives costs."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...refimpl import rng
from ...refimpl.light.scene import Box, Camera, Light, Matrix, Quad, Room, Scene, Sphere, Vector


def _uniform(number: int, block: int, low: float, high: float) -> NDArray[np.float64]:
    """Return four numbers in [low, high) of a primitive."""
    words = rng.uniforms(rng.counter(1), rng.counter(number), rng.counter(0), rng.counter(block))
    return low + (high - low) * np.concatenate(words).astype(np.float64)


def _vector(values: ArrayLike) -> Vector:
    """Return the first three of an array's numbers as a scene's vector."""
    x, y, z = (float(value) for value in np.asarray(values)[:3])
    return x, y, z


def _rotation(number: int) -> Matrix:
    """Return a rotation by a random unit quaternion: Shoemake, Graphics Gems III, 1992."""
    u, a, b, _ = _uniform(number, 3, 0.0, 1.0)
    x, y = np.sqrt(1 - u) * np.array([np.sin(2 * np.pi * a), np.cos(2 * np.pi * a)])
    z, w = np.sqrt(u) * np.array([np.sin(2 * np.pi * b), np.cos(2 * np.pi * b)])
    return (
        _vector([1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)]),
        _vector([2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)]),
        _vector([2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]),
    )


def _part(kind: str, number: int, size: float) -> Box | Sphere | Quad:
    """Return a primitive: a box with a rotation that all share or its own, a sphere, or a square."""
    place, color = _vector(_uniform(number, 0, -0.8, 0.8)), _vector(_uniform(number, 1, 0.2, 0.9))
    if kind == "spheres":
        return Sphere(place, 0.5 * size, color)
    if kind == "quads":
        u, v, _ = (size * np.array(row) for row in _rotation(number))
        return Quad(place, _vector(u), _vector(v), color)
    extent = _vector(0.6 * size * _uniform(number, 2, 0.3, 1.0))
    return Box(place, extent, color, _rotation(0 if kind == "shared" else number))


KINDS: Mapping[str, tuple[str, ...]] = {
    **{kind: (kind,) for kind in ("shared", "turned", "spheres", "quads")},
    "mixture": ("shared", "turned", "spheres", "quads"),
}
"""Kinds of primitives that take turns, by the name of the scene."""


def crowd(kind: str, count: int) -> Scene:
    """Return a room with a light and `count` primitives of a kind."""
    size, kinds = 0.6 / count ** (1 / 3), KINDS[kind]
    parts = [_part(kinds[i % len(kinds)], i + 1, size) for i in range(count)]
    return Scene(
        f"{kind} {count}",
        Camera((0.0, 0.0, 0.95), (0.0, 0.0, 0.0), vertical_fov_deg=70.0),
        Room((-1.0,) * 3, (1.0,) * 3, ((0.7,) * 3,) * 6),
        boxes=tuple(part for part in parts if isinstance(part, Box)),
        spheres=tuple(part for part in parts if isinstance(part, Sphere)),
        quads=tuple(part for part in parts if isinstance(part, Quad)),
        lights=(Light((-0.3, 0.99, -0.3), (0.6, 0.0, 0.0), (0.0, 0.0, 0.6), (1.0, 1.0, 1.0), 5.0),),
    )
