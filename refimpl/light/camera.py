"""The pinhole camera: from a point of the image to a ray.

1. [`camera_basis`] turns position, look_at and up into three axes: right, up, forward.
2. [`camera_ray`] sends a ray through the point (x + u, y + v) of the image, whose row 0 is at the top.

Pixels are square; the vertical field of view spans the image's height (pbrt's and most engines' convention).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import DTypeLike

from .. import vectors
from ..vectors import Directions, Floats, Points
from .scene import Camera


@dataclass(frozen=True)
class CameraBasis:
    """Constants in one float type: position (3,), axes (3,), tan of half the vertical field of view."""

    position: Points
    right: Directions
    up: Directions
    forward: Directions
    tan_half_fov: Floats


def camera_basis(camera: Camera, dtype: DTypeLike = np.float64) -> CameraBasis:
    """Return the camera's axes; they are computed in float64 and then rounded to dtype."""
    position: Points = np.array(camera.position, np.float64)
    forward = vectors.normalize(np.array(camera.look_at, np.float64) - position)
    right = vectors.normalize(vectors.cross(forward, np.array(camera.up, np.float64)))
    up = vectors.cross(right, forward)
    tan_half_fov = np.float64(math.tan(math.radians(camera.vertical_fov_deg) / 2.0))
    return CameraBasis(*(np.asarray(part, dtype) for part in (position, right, up, forward, tan_half_fov)))


def camera_ray(
    basis: CameraBasis,
    x: Floats,
    y: Floats,
    u: Floats,
    v: Floats,
    width: Floats | float,
    height: Floats | float,
) -> tuple[Points, Directions]:
    """Return origin, unit direction (..., 3) of rays through pixels x, y (...) at u, v (...) in [0, 1)."""
    # Map the image to [-1, 1] in height, with y up, and keep the pixels square in width.
    image_x = (2.0 * (x + u) - width) / height * basis.tan_half_fov
    image_y = (height - 2.0 * (y + v)) / height * basis.tan_half_fov
    towards = basis.forward + image_x[..., np.newaxis] * basis.right + image_y[..., np.newaxis] * basis.up
    direction = vectors.normalize(towards)
    return basis.position + 0.0 * direction, direction
