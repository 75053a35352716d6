"""Good scalings for sums from spectra: of the channels and of each layer's neurons, by descent.

Any scalings are sound [spectra.py, scaled.py]; these make the bound small. What is made small is the product

    |s_0 x| (F N_1 + B M_1) N_2 ... N_L,   N_1 = |S_1 W S_0^-1|, M_1^2 = sum of all |S_1 W(f) S_0^-1|^2,

F and B being the coefficients of both ways. Frequencies are those of as many points as the window has: their
sum of squares is near that of a tile's. Neurons that share a complex image count with the larger of both.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import scaled, spectra

Array = NDArray[np.float64]

WORK = 2**28
"""Multiplications that all steps may take, about."""


def scalings(
    of: spectra.Spectra, weight: Array, radius: Array, matrices: Sequence[Array]
) -> tuple[Array, list[Array]]:
    """Return t (pairs,) of the channels, and s_1 ... s_(L-1), for omega_0 W and A_2 ... A_L."""
    products, both = spectra.blocks_of(len(radius), of.block), tuple(map(tuple, of.both.tolist()))
    one, low = spectra.of_transform(of.points), math.sqrt(of.size / of.points)
    ways = one * (low + 1) + 1, one * (low + 1) + 3 + 2 * len(products[0]) + len(products) / 2
    held = tuple(scaled.Held(array) for array in (weight, radius, *matrices))
    before, *after = _scalings(held, of.size, both, ways)
    return np.array(before), [np.array(scale) for scale in after]


@lru_cache(maxsize=16)
def _scalings(held: tuple[Any, ...], size: int, both: Any, ways: tuple[float, float]) -> list[Array]:
    """Return t and the scalings of all layers."""
    weight, radius, *matrices = (each.array for each in held)
    first = _First(weight, radius, size, np.array(both, np.intp).reshape(2, -1), ways)
    start = [np.zeros(len(first.energies)), *(np.zeros(matrix.shape[1]) for matrix in matrices)]
    work = first.spectra.size * len(radius) + sum(m.size * min(m.shape) for m in matrices)
    best, least = start.copy(), math.inf

    def gradients(logs: list[Array], power: float) -> list[Array]:
        """Return the derivatives of the product's logarithm, and keep what is best so far."""
        nonlocal best, least
        value, (before, after) = first.gradient(logs[0], logs[1], power)
        later, of_chain = scaled.chain(matrices, logs[1:], power)
        if value + later < least:
            least, best = value + later, logs.copy()
        return [before, after + of_chain[0], *of_chain[1:]]

    scaled.descended(start, gradients, min(scaled.STEPS, WORK // max(work, 1)))
    return [scaled.short(np.exp(log - log.mean())) for log in best]


class _First:
    """The first layer's factor of the product, and its derivatives."""

    def __init__(self, weight: Array, radius: Array, size: int, both: Any, ways: tuple[float, float]) -> None:
        # The complex image that holds each channel.
        self.image = np.arange(len(radius)) % -(-len(radius) // 2)
        self.both, self.ways = both, ways
        found = spectra.spectrum(weight, size, size)[:, : size // 2 + 1]
        # Frequencies that have a mirror image stand for it too.
        weights = np.where(np.arange(size // 2 + 1) * 2 % size == 0, 1.0, 2.0)
        self.spectra = found * np.sqrt(weights)[:, None, None]
        self.energies = np.bincount(self.image, radius**2)
        taps = [weight[:, np.tile(self.image == i, size**2)] for i in range(len(self.energies))]
        self.grams = np.stack([part @ part.T for part in taps])

    def gradient(self, before: Array, after: Array, power: float) -> tuple[float, list[Array]]:
        """Return the factor's logarithm, and its derivatives by the logarithms of t and s."""
        joined = after.copy()
        joined[self.both] = after[self.both].max(axis=0)
        owner = np.arange(len(after))
        owner[self.both] = np.take_along_axis(self.both, after[self.both].argmax(axis=0)[None], axis=0)
        norm, by_before, by_after = self._norm(before, after, power)
        large, more_before, more_after = self._sum(before, joined, power)
        total = self.ways[0] * norm + self.ways[1] * large
        shares = self.ways[0] * norm / total, self.ways[1] * large / total
        energy = np.exp(2 * before) * self.energies
        found = energy / energy.sum() - shares[0] * by_before - shares[1] * more_before
        given = shares[0] * by_after + shares[1] * np.bincount(owner, more_after, len(after))
        return math.log(total) + 0.5 * math.log(float(energy.sum())), [found, given]

    def _norm(self, before: Array, after: Array, power: float) -> tuple[float, Array, Array]:
        """Return the norm of the scaled matrix, and the shares of its channels' images and neurons."""
        scale = np.exp(after)
        parts = scale[:, None] * self.grams * scale / np.exp(2 * before)[:, None, None]
        values, vectors = np.linalg.eigh(parts.sum(axis=0))
        values = np.maximum(values, 1e-300)
        shares = (values / values[-1]) ** (power / 2)
        shares = shares / shares.sum()
        images = np.sum((vectors * (parts @ vectors)) @ (shares / values), axis=1)
        return math.sqrt(float(values[-1])), images, vectors**2 @ shares

    def _sum(self, before: Array, after: Array, power: float) -> tuple[float, Array, Array]:
        """Return the root of the sum of all frequencies' squared norms, and the shares of both sides."""
        bent = np.exp(after)[:, None] * self.spectra / np.exp(before)[self.image]
        values, vectors = np.linalg.eigh(np.swapaxes(bent.conj(), -1, -2) @ bent)
        values = np.maximum(values, 1e-300)
        shares = (values / values[..., -1:]) ** (power / 2)
        shares = shares / shares.sum(axis=-1, keepdims=True)
        total = float(values[..., -1].sum())
        shares = shares * (values[..., -1:] / total)
        channels = np.sum(shares[..., None, :] * np.abs(vectors) ** 2, axis=(0, 1, 3))
        left = np.abs(bent @ vectors) ** 2
        neurons = np.sum((shares / values)[..., None, :] * left, axis=(0, 1, 3))
        images: Array = np.bincount(self.image, channels).astype(np.float64)
        return math.sqrt(total), images, neurons
