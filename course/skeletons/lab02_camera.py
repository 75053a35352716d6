"""A ray through a pixel.

Row 0 of the image is at its top; pixels are square; the vertical field of view spans the image's height.
Right, up and forward form the camera's axes: forward goes from `position` to `look_at`, right is forward x
up of the world, made a unit vector. Tutorial: page 1. Clauses: CAM-1 and the following.
"""

from __future__ import annotations

from typing import Any


def camera_ray(camera: Any, x: Any, y: Any, u: Any, v: Any, width: int, height: int) -> tuple[Any, Any]:
    """Return origin and unit direction (..., 3) of rays through the points (x + u, y + v) (...) of the image.

    All is in float64; one origin (3,) may stand for all rays. camera has `position`, `look_at`, `up` (three
    numbers each) and `vertical_fov_deg`.
    """
    raise NotImplementedError("camera_ray")
