"""The network: a multi-layer perceptron with sine activations, forwards and backwards by hand.

1. Draw the parameters [`init`]: uniform, weights in the ranges of the source (biases: SIR-4), from counters.
2. Map a vector of `D_in` numbers to `D_out` numbers [`forward`]: all layers but the last are
   ``sin(omega_0 * (W x + b))``, the last is affine. This function is the one that the compiler traces. Other
   activations than the sine are rows of activation.py.
3. For training, do the same and keep what the derivative needs [`forward_cached`], then apply the chain rule
   from the last layer to the first [`backward`].

Source: Sitzmann, Martel, Bergman, Lindell, Wetzstein, "Implicit Neural Representations with Periodic
Activation Functions", NeurIPS 2020, section 3.2. Its text and its published program place omega_0
differently; here it multiplies the bias too, as in the program. omega_0 is a parameter, one for the first
layer and one for the other sine layers, because the large value that suits coordinates memorises noise.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from ..errors import InputError
from ..rng import counter, random_block, uniform_floats
from .activation import SINE, activation_named

Array = NDArray[np.floating[Any]]

WEIGHT_TAG = 0x57454947
"""Counter `block` of the words that become weights ("WEIG" in ASCII); light paths use small numbers."""

BIAS_TAG = 0x42494153
"""Counter `block` of the words that become biases ("BIAS" in ASCII)."""


LARGEST_PARAMETER = 1e12
"""Largest magnitude of a weight, a bias or an omega_0: sums of 65,536 such products fit float32 by far."""


@dataclass(frozen=True)
class Siren:
    """Parameters: layer l has weights (D_out, D_in) and biases (D_out,); D_in is the D_out of layer l - 1."""

    weights: tuple[Array, ...]
    biases: tuple[Array, ...]
    omega_0_first: float
    omega_0_hidden: float
    activation: str = SINE

    @property
    def widths(self) -> tuple[int, ...]:
        """Return (D_in of the first layer, D_out of each layer ...)."""
        return (self.weights[0].shape[1], *(weight.shape[0] for weight in self.weights))

    @property
    def dtype(self) -> np.dtype[Any]:
        """Return the float type of the parameters."""
        return self.weights[0].dtype


@dataclass(frozen=True)
class Cache:
    """What [`backward`] needs of layer l: `inputs[l]` (N, D_in), `angles[l]` (N, D_out) of its activation."""

    inputs: tuple[Array, ...]
    angles: tuple[Array, ...]


@dataclass(frozen=True)
class Gradients:
    """Derivatives of a scalar loss: as `weights`, as `biases`, and by the input (N, D_in) unless left out."""

    dweights: tuple[Array, ...]
    dbiases: tuple[Array, ...]
    dx: Array | None


def init(
    widths: Sequence[int],
    omega_0_first: float,
    omega_0_hidden: float,
    seed: int,
    dtype: DTypeLike = np.float32,
    activation: str = SINE,
) -> Siren:
    """Draw the parameters of layers with `widths` (D_in, D_1, ..., D_out); the same bits on every machine."""
    check_shape(widths, omega_0_first, omega_0_hidden)
    row = activation_named(activation)
    weights, biases = [], []
    for layer, (n_in, n_out) in enumerate(pairwise(widths)):
        bound = row.weight_bound(layer, n_in, omega_0_hidden if layer else omega_0_first)
        weight = bound * _signed_uniforms(seed, layer, WEIGHT_TAG, n_out * n_in).reshape(n_out, n_in)
        bias = row.biases(_signed_uniforms(seed, layer, BIAS_TAG, n_out), n_in)
        weights.append(weight.astype(dtype))
        biases.append(bias.astype(dtype))
    return Siren(tuple(weights), tuple(biases), float(omega_0_first), float(omega_0_hidden), activation)


def check_shape(widths: Sequence[int], omega_0_first: float, omega_0_hidden: float) -> None:
    """Refuse widths and omegas that name no network."""
    if len(widths) < 2 or any(not isinstance(width, int) or width < 1 for width in widths):
        raise InputError(
            "widths", tuple(widths), "must be two or more positive integers", "give D_in, ..., D_out"
        )
    for name, omega_0 in (("omega_0_first", omega_0_first), ("omega_0_hidden", omega_0_hidden)):
        if not 0 < omega_0 <= LARGEST_PARAMETER:
            rule = f"must be positive and at most {LARGEST_PARAMETER:g}"
            raise InputError(name, omega_0, rule, "use 1 to 30; small values smooth more")


def _signed_uniforms(seed: int, layer: int, tag: int, count: int) -> Array:
    """Return (count,) float64 numbers in [-1, 1): number i is word i % 4 of the block of pixel i // 4."""
    blocks = counter(np.arange((count + 3) // 4))
    words = np.stack(random_block(counter(seed), blocks, counter(layer), counter(tag)), axis=-1)
    numbers: Array = 2.0 * uniform_floats(words.reshape(-1)[:count], np.float64) - 1.0
    return numbers


def forward(siren: Siren, x: Any) -> Any:
    """Map x (..., D_in) to y (..., D_out); `x` may be a tracing value."""
    activate, last = activation_named(siren.activation).forward, len(siren.weights) - 1
    for layer, (weight, bias) in enumerate(zip(siren.weights, siren.biases, strict=True)):
        x = np.matmul(x, weight.T) + bias
        if layer < last:
            x = activate(_omega_0(siren, layer) * x)
    return x


def forward_cached(siren: Siren, x: Array) -> tuple[Array, Cache]:
    """Map x (N, D_in) to y (N, D_out) with the operations of [`forward`], and keep inputs and angles."""
    activate, last = activation_named(siren.activation).forward, len(siren.weights) - 1
    inputs, angles = [], []
    for layer, (weight, bias) in enumerate(zip(siren.weights, siren.biases, strict=True)):
        inputs.append(x)
        x = np.matmul(x, weight.T) + bias
        if layer < last:
            angles.append(_omega_0(siren, layer) * x)
            x = activate(angles[layer])
    return x, Cache(tuple(inputs), tuple(angles))


def backward(siren: Siren, cache: Cache, dy: Array, with_dx: bool = True) -> Gradients:
    """Turn dy (N, D_out), the loss's derivative by y, into the derivatives by every parameter and by x."""
    derivative, last = activation_named(siren.activation).derivative, len(siren.weights) - 1
    dweights, dbiases = [], []
    dx = None
    for layer in range(last, -1, -1):
        # y = f(a), a = omega_0 z: dz = dy f'(a) omega_0, with f' = cos of a sine. The last layer has y = z.
        dz = dy
        if layer < last:
            dz = dy * derivative(cache.angles[layer]) * _omega_0(siren, layer)
        # z = x W^T + b, summed over the N rows.
        dweights.append(np.matmul(dz.T, cache.inputs[layer]))
        dbiases.append(np.sum(dz, axis=0))
        # The input of the first layer is data: training has no use for its derivative, which costs a third.
        if layer > 0 or with_dx:
            dx = np.matmul(dz, siren.weights[layer])
            dy = dx  # this layer's input is the output of the one before it
    return Gradients(tuple(dweights[::-1]), tuple(dbiases[::-1]), dx if with_dx else None)


def _omega_0(siren: Siren, layer: int) -> float:
    """Return the factor of the argument of the layer's activation."""
    return siren.omega_0_first if layer == 0 else siren.omega_0_hidden
