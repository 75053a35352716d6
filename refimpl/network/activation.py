"""Activations: what a network does between two affine maps, one row each.

1. A row holds the function and its derivative [`Activation`]; the function uses only operations that the
   compiler traces, so that kernels and the compiled trainer need no word about it.
2. It states the range of the values and how much an error of the argument can grow; tests compare both
   statements with the compiler's own analysis.
3. It says how the parameters of a network that has it begin.

A model names its activation. A new one is one function of each kind and one line in [`ACTIVATIONS`].

Sources: Sitzmann, Martel, Bergman, Lindell, Wetzstein, "Implicit Neural Representations with Periodic
Activation Functions", NeurIPS 2020, section 3.2 (sine); He, Zhang, Ren, Sun, "Delving Deep into Rectifiers:
Surpassing Human-Level Performance on ImageNet Classification", ICCV 2015, section 2.2 (relu).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError, choice

Array = NDArray[np.floating[Any]]

SINE, RELU = "sine", "relu"
"""Names of the rows."""


@dataclass(frozen=True)
class Activation:
    """y (...) = forward(a) and dy/da (...) = derivative(a) for arguments a (...); `forward` may be traced.

    All y lie in `values`, all |dy/da| in [0, `slope`]. The first weights of layer `l` with D_in inputs are
    uniform up to weight_bound(l, D_in, omega_0 of the layer), its biases are biases(u, D_in) of u in [-1, 1).
    `omegas`: omega_0 of the first layer and of the others in a new recipe, None for the preset's own.
    """

    name: str
    forward: Callable[[Any], Any]
    derivative: Callable[[Array], Array]
    values: tuple[float, float]
    slope: float
    weight_bound: Callable[[int, int, float], float]
    biases: Callable[[Array, int], Array]
    omegas: tuple[float, float] | None = None


ACTIVATIONS: Mapping[str, Activation] = {
    row.name: row
    for row in (
        Activation(
            SINE,
            forward=np.sin,
            derivative=np.cos,
            values=(-1.0, 1.0),
            slope=1.0,
            # The ranges of the source.
            weight_bound=lambda layer, n_in, omega: (
                1.0 / n_in if layer == 0 else math.sqrt(6.0 / n_in) / omega
            ),
            biases=lambda u, n_in: u / math.sqrt(n_in),
        ),
        Activation(
            RELU,
            forward=lambda a: np.maximum(a, 0.0),
            # At 0, where there is no derivative, 0.
            derivative=lambda a: (a > 0.0).astype(a.dtype),
            values=(0.0, math.inf),
            slope=1.0,
            # Uniform numbers with the source's variance 2 / D_in.
            weight_bound=lambda layer, n_in, omega: math.sqrt(6.0 / n_in) / omega,
            biases=lambda u, n_in: np.zeros_like(u),
            omegas=(1.0, 1.0),
        ),
    )
}
"""All activations, by the name that models and recipes use."""


def activation_named(name: str) -> Activation:
    """Return the activation, or say which ones there are."""
    if name not in ACTIVATIONS:
        raise InputError("activation", name, "unknown", choice(name, ACTIVATIONS))
    return ACTIVATIONS[name]
