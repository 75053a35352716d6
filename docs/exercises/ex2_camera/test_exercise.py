"""Grades exercise 2: the spec's vectors, and what a camera is by definition."""

from __future__ import annotations

import numpy as np

from wamnet.refimpl.light.scene import Camera

CAMERA = Camera((0.5, 1.0, 4.0), (0.0, -0.2, 0.0), vertical_fov_deg=41.0)
"""The camera of the vectors; the image is 97 x 64."""


def test_the_middle_of_the_image_looks_at_the_point(student):
    origin, direction = student.camera_ray(CAMERA, 48.0, 31.0, 0.5, 1.0, 97, 64)
    wanted = np.subtract(CAMERA.look_at, CAMERA.position)
    assert np.allclose(origin, CAMERA.position, rtol=0, atol=1e-12), "rays begin at the camera"
    away = np.abs(direction - wanted / np.linalg.norm(wanted)).max()
    assert away <= 1e-12, f"the middle looks beside look_at, by {away:.3g}"


def test_up_is_up_and_right_is_right(student):
    (_, low), (_, high) = (student.camera_ray(CAMERA, 48.0, y, 0.5, 0.5, 97, 64) for y in (63.0, 0.0))
    assert high[1] > low[1], "row 0 is at the top"
    (_, left), (_, right) = (student.camera_ray(CAMERA, x, 32.0, 0.5, 0.5, 97, 64) for x in (0.0, 96.0))
    assert right[0] > left[0], "column 0 is at the left"


def test_the_vectors(student, hold_to_vectors):
    def answer(given):
        origin, direction = student.camera_ray(CAMERA, *(given[name] for name in "xyuv"), 97, 64)
        return {"origin": origin, "direction": direction}

    hold_to_vectors("camera.ray", answer)


def test_arrays_of_rays(student):
    x = np.arange(6.0).reshape(2, 3)
    origin, direction = student.camera_ray(CAMERA, x, x, 0.5, 0.5, 97, 64)
    assert np.shape(direction) == (2, 3, 3), (
        f"(2, 3) pixels need directions (2, 3, 3), not {np.shape(direction)}"
    )
    assert np.broadcast_shapes(np.shape(origin), (2, 3, 3)) == (2, 3, 3)
