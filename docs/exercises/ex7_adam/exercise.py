"""Adam's step.

Running means of the slope and of its square, both corrected for their start at zero, give each number a step
length of its own. Tutorial: page 6. Clause: ADM-1; source: Kingma and Ba, "Adam: A Method for Stochastic
Optimization", ICLR 2015, Algorithm 1: epsilon is added outside of the root.
"""

from __future__ import annotations

from typing import Any

BETA_1, BETA_2, EPSILON = 0.9, 0.999, 1e-8
"""The source's recommended values."""


def step(theta: Any, g: Any, m: Any, v: Any, t: int, learning_rate: float) -> tuple[Any, Any, Any]:
    """Return theta, m and v (...) after step t, counted from 1, along the slope g (...)."""
    raise NotImplementedError("step")
