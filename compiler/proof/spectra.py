"""How far each sum over a window may be off that is computed from spectra, for the energy of its tile.

Of all neurons of a pixel together: spectra_checker.py. Formulas: spec/fourier.md, FOU-5 to FOU-7. Errors of
errors are below 64 coefficients times u of the whole, which `AGAIN` covers; underflow `TINY`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..core.profiles import UNIT_ROUNDOFF
from .spectra_checker import AGAIN as AGAIN
from .spectra_checker import UNDERFLOW, layers

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

TINY = UNDERFLOW
"""More than underflow adds: fewer than 2^24 operations, each off by 2^-120 of the largest factor."""


@dataclass(frozen=True)
class Spectra:
    """How a schedule computes the sums: tiles of `points` squared, windows of `size` squared numbers.

    `order` (D_out,): the neuron at each place; those at p and p + `lanes` share a complex image, p being in
    the first half of 2 `lanes` places. `block`: pairs of channels whose products are added up by themselves;
    `centres` (C,) are subtracted from the channels. `table` (D_out, N, N / 2 + 1, C): the spectra that the
    kernel holds, times 2 N; `bias` (D_out,): what it adds to the sums.
    """

    points: int
    size: int
    order: NDArray[np.intp]
    lanes: int
    block: int
    centres: Array
    table: Complex
    bias: Array

    @property
    def both(self) -> NDArray[np.intp]:
        """Return the neurons (2, n) that share a complex image."""
        places = np.arange(len(self.order) - self.lanes)
        lower = places[places // self.lanes % 2 == 0]
        return np.stack([self.order[lower], self.order[lower + self.lanes]])


def of_transform(points: int) -> float:
    """Return the coefficient of u of a transform whose numbers have energies of one size."""
    return float(np.sqrt((layers(points) ** 2).mean(axis=1)).sum())


def spectrum(weight: Array, size: int, points: int) -> Complex:
    """Return conj(DFT(w)) / N (N, N, D_out, C) of a matrix (D_out, size * size * C)."""
    taps = weight.reshape(len(weight), size, size, -1)
    found: Complex = np.conj(np.fft.fft2(taps, (points, points), axes=(1, 2)))
    return found.transpose(1, 2, 0, 3) / points


def blocks_of(channels: int, block: int) -> list[list[int]]:
    """Return the channels of each partial sum in the order in which their products are added up."""
    half = -(-channels // 2)
    pairs = [[c for c in (j, j + half) if c < channels] for j in range(half)]
    return [[c for pair in pairs[at : at + block] for c in pair] for at in range(0, half, block)]


def alone(of: Spectra, weight: Array, channels: int) -> Array:
    """Return the error (D_out,) of each neuron's sum by itself, for a tile whose centred norm is 1."""
    n, half = of.points, -(-channels // 2)
    one, low = of_transform(n), math.sqrt(of.size / n)
    most = float(layers(n).max(axis=1).sum())
    # A block of B pairs adds at most 4 B - 1 products to a sum, and the blocks are added up.
    products = math.sqrt(2) + 4 * of.block - 1 + -(-half // of.block) - 1
    centring = of.size / n if np.any(of.centres) else 0.0
    own = np.linalg.norm(weight, axis=1)
    squares = own**2
    squares[of.both] = squares[of.both].sum(axis=0)
    found: Array = (one * (low + 1) + 2 + centring + products) * own
    found = found + (most * (low + 1) + 1) * np.sqrt(squares)
    return UNIT_ROUNDOFF * AGAIN * found


def moved_bias(of: Spectra, weight: Array, bias: Array) -> Array:
    """Return how far (D_out,) the bias that a kernel adds is from that of the centred channels."""
    if not np.any(of.centres):
        return np.abs(of.bias - bias)
    exact = weight @ np.tile(of.centres, weight.shape[1] // len(of.centres)) + bias
    off = len(weight.T) * 2.0**-52 * (np.abs(weight).sum(axis=1) * np.abs(of.centres).max() + np.abs(bias))
    found: Array = np.abs(of.bias - exact) + off
    return found
