"""Grades exercise 4: a furnace, the weights, and three lights whose answer is known."""

from __future__ import annotations

import numpy as np
from statistical import assert_all_plausible, z_p

from wamnet.refimpl import rng

COUNT = 20_000
"""Samples of each estimate."""


def uniforms(block):
    counters = (rng.counter(c) for c in (9, np.arange(COUNT), 0, block))
    return rng.uniforms(*counters, dtype=np.float64)[:2]


def test_a_furnace_gives_back_its_closed_form(student):
    """Walls that reflect a and emit 1, all around: radiance is 1 + a + a^2 + ... = 1 / (1 - a), and each path
    has it without noise, for f cos / pdf is a number."""
    a, beta, radiance = 0.5, np.ones(COUNT), np.ones(COUNT)
    for depth in range(40):
        beta = beta * student.bounce(a, *uniforms(depth))[1]
        radiance = radiance + beta
    # What is left after 40 bounces is 2**-40; sums of numbers below 2 lose less.
    assert np.abs(radiance - 2.0).max() <= 1e-11, f"radiance {radiance.mean():.6g} in a furnace of 2"


def test_the_density_is_that_of_the_directions(student):
    wi, _, pdf = student.bounce(0.5, *uniforms(0))
    assert np.abs(pdf - wi[:, 2] / np.pi).max() <= 1e-12, "the density is not cos / pi"


def test_weights(student, hold_to_vectors):
    hold_to_vectors(
        "transport.mis_weight",
        lambda given: {"power": student.power_weight(given["pdf"], given["other"])},
        ("power",),
    )
    with np.errstate(all="ignore"):
        large = student.power_weight(np.float32(1e30), np.float32(1e30))
    assert large == 0.5, f"two densities of 1e30 in float32 are alike: 0.5, not {large}; square their ratio"


def exact(half, height):
    """Howell's configuration factor of a parallel rectangle, four quarters."""
    a = half / height
    root = np.sqrt(1.0 + a * a)
    return 4.0 / np.pi * a / root * np.arctan(a / root)


def test_both_ways_and_their_sum_are_right(student):
    """z-tests of nine means, significance 1 % for all together."""
    p_values = []
    for half, height in ((1.0, 0.3), (1.0, 1.0), (1.0, 4.0)):
        wanted = 0.8 * exact(half, height)
        wi, weight, pdf = student.bounce(0.8, *uniforms(0))
        on_light = np.all(np.abs(wi[:, :2]) * height <= half * wi[:, 2:], axis=-1)
        found = np.where(on_light, weight, 0.0)
        distance = height / np.maximum(wi[:, 2], 1e-9)
        other = distance**2 / (4 * half**2 * np.maximum(wi[:, 2], 1e-9))
        value, pdf_light, pdf_bounce = student.by_light(0.8, half, height, *uniforms(1))
        both = found * student.power_weight(pdf, other) + value * student.power_weight(pdf_light, pdf_bounce)
        estimates = [found, value, both]
        errors = [np.std(e) / np.sqrt(COUNT) for e in estimates]
        p_values += [
            z_p(np.array([e.mean() - wanted]), np.array([s]))[0]
            for e, s in zip(estimates, errors, strict=True)
        ]
        assert errors[2] <= max(errors[:2]), f"weighed, the noise at height {height} is above both ways'"
    assert_all_plausible(np.array(p_values))
