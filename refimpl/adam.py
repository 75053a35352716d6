"""Adam: gradient descent with a step length of its own for every parameter.

1. Start with moments of zero [`init`].
2. Each step, follow the gradient by the bias-corrected first moment over the root of the second [`step`].

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
    m = tuple(beta_1 * m_i + (1.0 - beta_1) * g for m_i, g in zip(state.m, gradients, strict=True))
    v = tuple(beta_2 * v_i + (1.0 - beta_2) * (g * g) for v_i, g in zip(state.v, gradients, strict=True))
    # Both means began at zero and are too small by this factor.
    m_hat = tuple(m_i / (1.0 - beta_1**t) for m_i in m)
    v_hat = tuple(v_i / (1.0 - beta_2**t) for v_i in v)
    moved = tuple(
        theta - learning_rate * m_hat_i / (np.sqrt(v_hat_i) + epsilon)
        for theta, m_hat_i, v_hat_i in zip(parameters, m_hat, v_hat, strict=True)
    )
    return moved, AdamState(m, v, t)
