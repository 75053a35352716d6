"""Grades exercise 7: the spec's vectors of several steps, and what the first step must be."""

from __future__ import annotations

import numpy as np


def test_the_first_step_is_the_learning_rate(student):
    """Whatever the slope: m / (1 - beta_1) is g, and the root of the other one is |g|."""
    theta, _, _ = student.step(np.zeros(3), np.array([1e-3, -1.0, 1e3]), np.zeros(3), np.zeros(3), 1, 0.01)
    # epsilon takes 1e-8 / 1e-3 of the smallest slope's step.
    assert np.abs(theta - [-0.01, 0.01, -0.01]).max() <= 0.01 * 2e-5, f"the first step goes to {theta}"


def test_no_slope_moves_nothing(student):
    theta, m, v = student.step(np.ones(2), np.zeros(2), np.zeros(2), np.zeros(2), 1, 0.01)
    assert np.array_equal([theta, m, v], [[1, 1], [0, 0], [0, 0]])


def test_the_vectors(student, hold_to_vectors):
    def answer(given):
        theta, rows = given["theta"].astype(np.float64), []
        m, v = np.zeros_like(theta), np.zeros_like(theta)
        for t, g in enumerate(given["gradients"], 1):
            theta, m, v = student.step(theta, g, m, v, t, float(given["learning_rate"]))
            rows.append((theta, m, v))
        return dict(zip(("theta", "m", "v"), map(np.array, zip(*rows, strict=True)), strict=True))

    hold_to_vectors("adam.run", answer)
