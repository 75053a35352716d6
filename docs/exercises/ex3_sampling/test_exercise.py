"""Grades exercise 3: a chi-square test of the directions, the density's integral, and the round trip."""

from __future__ import annotations

import numpy as np
from statistical import SIGNIFICANCE, chi_square_p

from wamnet.refimpl import rng

COUNT = 50_000
"""Directions that are drawn: some 400 in each of the 128 cells."""


def uniforms():
    counters = (rng.counter(c) for c in (5, np.arange(COUNT), 0, 0))
    return rng.uniforms(*counters, dtype=np.float64)[:2]


def test_directions_are_unit_and_above_the_horizon(student):
    wi = student.sample_hemisphere(*uniforms())
    assert np.shape(wi) == (COUNT, 3), f"{COUNT} pairs need directions ({COUNT}, 3), not {np.shape(wi)}"
    # Squares, sums and a root: a few roundings of float64.
    assert np.abs(np.sum(wi * wi, axis=-1) - 1.0).max() <= 1e-12, "a direction is not of length 1"
    assert np.all(wi[:, 2] >= 0.0), "a direction is below the horizon"


def test_directions_are_where_the_density_says(student):
    """Eight rings of equal probability under cos / pi, by 16 sectors; significance 1 %."""
    wi = student.sample_hemisphere(*uniforms())
    ring = np.minimum((8 * (1.0 - wi[:, 2] ** 2)).astype(int), 7)
    sector = np.minimum((16 * (np.arctan2(wi[:, 1], wi[:, 0]) / (2 * np.pi) + 0.5)).astype(int), 15)
    seen = np.bincount(16 * ring + sector, minlength=128)
    p = chi_square_p(seen, np.full(128, COUNT / 128))
    assert p >= SIGNIFICANCE, f"chi-square test: p = {p:.2g}; the directions have another density"


def test_the_density(student):
    """Its integral over the hemisphere, on a grid of midpoints in z and azimuth, is 1; cos is linear in z."""
    z = (np.arange(200) + 0.5) / 200
    directions = np.stack([np.sqrt(1 - z * z), 0 * z, z], axis=-1)
    total = 2 * np.pi * np.mean(student.hemisphere_pdf(directions))
    assert abs(total - 1.0) <= 1e-12, f"the density's integral is {total:.6g}, not 1"
    assert student.hemisphere_pdf(np.array([[0.6, 0.0, -0.8]]))[0] == 0.0, "below the horizon it is 0"


def test_the_way_back(student):
    u = uniforms()
    found = student.invert_hemisphere_sample(student.sample_hemisphere(*u))
    # At the horizon z is a root of a difference; it is not needed for the way back along the disk.
    error = max(np.abs(a - b).max() for a, b in zip(found, u, strict=True))
    assert error <= 1e-7, f"the way back is off by {error:.3g}"
