"""Adam: gradient descent with a step length of its own for every parameter.

1. Start with moments of zero [`init`].
2. Each step, follow the gradient by the bias-corrected first moment over the root of the second [`step`].
   What happens to one number is a function of numbers [`update`], which the compiler traces.

Source: Kingma, Ba, "Adam: A Method for Stochastic Optimization", ICLR 2015, Algorithm 1, in the order of its
lines and with epsilon outside the root. Parameters are a tuple of arrays of any shapes; nothing is changed in
place.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.floating[Any]]

BETA_1 = 0.9
"""Decay rate of the mean of gradients a step, the source's recommended value."""

BETA_2 = 0.999
"""Decay rate of the mean of squared gradients a step, the source's recommended value."""

EPSILON = 1e-8
"""Added to the root of the second moment, in units of the gradient, the source's recommended value."""


@dataclass(frozen=True)
class AdamState:
    """Means of gradients, `m`, and of their squares, `v`, shaped as the parameters; `t` steps are done."""

    m: tuple[Array, ...]
    v: tuple[Array, ...]
    t: int


def init(parameters: tuple[Array, ...]) -> AdamState:
    """Return the state before the first step: zero moments."""
    zeros = tuple(np.zeros_like(theta) for theta in parameters)
    return AdamState(zeros, zeros, 0)


def step(
    parameters: tuple[Array, ...],
    gradients: tuple[Array, ...],
    state: AdamState,
    learning_rate: float,
    beta_1: float = BETA_1,
    beta_2: float = BETA_2,
    epsilon: float = EPSILON,
) -> tuple[tuple[Array, ...], AdamState]:
    """Return the parameters and the state after one step along `gradients`, each shaped as its parameter."""
    t = state.t + 1
    grown = growth(t, beta_1, beta_2)
    found = [
        update(theta, g, m, v, learning_rate, grown, beta_1, beta_2, epsilon)
        for theta, g, m, v in zip(parameters, gradients, state.m, state.v, strict=True)
    ]
    moved, m, v = (tuple(arrays) for arrays in zip(*found, strict=True))
    return moved, AdamState(m, v, t)


def growth(t: int, beta_1: float = BETA_1, beta_2: float = BETA_2) -> tuple[float, float]:
    """Return by what factor either mean, which began at zero, is still too small at step t."""
    return 1.0 - beta_1**t, 1.0 - beta_2**t


def update(
    theta: Any,
    g: Any,
    m: Any,
    v: Any,
    learning_rate: Any,
    grown: tuple[Any, Any],
    beta_1: float = BETA_1,
    beta_2: float = BETA_2,
    epsilon: float = EPSILON,
) -> tuple[Any, Any, Any]:
    """Return parameter, m and v (...) after one step along gradient g (...); all may be tracing values."""
    m = beta_1 * m + (1.0 - beta_1) * g
    v = beta_2 * v + (1.0 - beta_2) * (g * g)
    m_hat, v_hat = m / grown[0], v / grown[1]
    return theta - learning_rate * m_hat / (np.sqrt(v_hat) + epsilon), m, v
