"""Adam's step, and training with it.

Running means of the slope and of its square, both corrected for their start at zero, give each number a step
length of its own. Training takes one step after another along the slope where it is by then; the learning
rate falls with half a wave of the cosine. Tutorial: page 6. Clauses: ADM-1, TRN-4; source: Kingma and Ba,
"Adam: A Method for Stochastic Optimization", ICLR 2015, Algorithm 1: epsilon is added outside of the root.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

BETA_1, BETA_2, EPSILON = 0.9, 0.999, 1e-8
"""The source's recommended values."""


def step(theta: Any, g: Any, m: Any, v: Any, t: int, learning_rate: float) -> tuple[Any, Any, Any]:
    """Return theta, m and v (...) after step t, counted from 1, along the slope g (...)."""
    raise NotImplementedError("step")


def rate(learning_rate: float, k: int, steps: int) -> float:
    """Return the learning rate of step k = 0, 1, ..., steps - 1: times (1 + cos(pi k / steps)) / 2."""
    raise NotImplementedError("rate")


def train(theta: Any, gradient: Callable[[Any], Any], steps: int, learning_rate: float) -> Any:
    """Return theta (...) after so many steps; gradient(theta) is the slope (...) there. m and v begin at 0.

    The given theta is not changed.
    """
    raise NotImplementedError("train")
