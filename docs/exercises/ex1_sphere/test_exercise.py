"""Grades exercise 1: the spec's vectors, random rays, and a sphere that is far away."""

from __future__ import annotations

import numpy as np

CENTER, RADIUS = np.array([0.25, -0.5, 0.125]), 0.75
"""The sphere of the vectors."""


def test_the_vectors(student, hold_to_vectors):
    def answer(given):
        t = student.meet_sphere(CENTER, np.float64(RADIUS), given["origin"], given["direction"])
        return {"t": float(t)}

    hold_to_vectors("intersection.sphere", answer)


def test_hits_lie_on_the_sphere_and_nothing_is_nearer(student):
    rng = np.random.default_rng(1)
    origin, direction = rng.uniform(-2, 2, (2000, 3)), rng.normal(size=(2000, 3))
    direction /= np.linalg.norm(direction, axis=-1, keepdims=True)
    t = student.meet_sphere(CENTER, np.float64(RADIUS), origin, direction)
    assert np.shape(t) == (2000,), f"2000 rays need 2000 distances, not an array {np.shape(t)}"
    hit = t < student.MISS
    away = np.linalg.norm(origin + np.where(hit, t, 0.0)[:, None] * direction - CENTER, axis=-1)
    # Some ten operations on numbers below 10, in float64; tangents lose half of the digits.
    assert np.all(np.abs(away - RADIUS)[hit] <= 1e-6), "a hit is not on the sphere"
    assert np.all(t > 0.0), "a distance is not positive"
    before = (
        origin[:, None]
        + np.linspace(0, 0.999, 50)[:, None] * np.where(hit, t, 8.0)[:, None, None] * direction[:, None]
    )
    outside = np.linalg.norm(before - CENTER, axis=-1) > RADIUS
    started_inside = np.linalg.norm(origin - CENTER, axis=-1) < RADIUS
    assert np.all(outside[~started_inside]), (
        "a ray went through the sphere before its hit, or missed a sphere in its way"
    )
    assert np.all(hit[started_inside]), "from inside there is always an exit"


def test_a_small_sphere_far_away_in_single_precision(student):
    """The distance is known to some 16 ulp of itself, 1000 * 16 * 2**-24, times the slant of at most 2.3."""
    one = np.float32(1.0)
    across = np.linspace(0.0, 0.9, 200, dtype=np.float32)
    origin = np.stack([across, 0 * across, np.full_like(across, 1000.0)], axis=-1)
    direction = np.broadcast_to(np.array([0, 0, -1], np.float32), origin.shape)
    t = student.meet_sphere(np.zeros(3, np.float32), one, origin, direction)
    assert t.dtype == np.float32, f"single precision in, {t.dtype} out"
    exact = 1000.0 - np.sqrt(1.0 - across.astype(np.float64) ** 2)
    error = np.abs(t - exact).max()
    bound = 2.3 * 1000 * 16 * 2.0**-24
    assert error <= bound, f"off by {error:.3g} at a distance of 1000; at most {bound:.3g}"
