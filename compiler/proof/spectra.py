"""How far sums over a window that are computed from spectra may be off: all neurons of a pixel together.

One error of rounding is at most u times a number on the way. What it does to the sums of a pixel is a linear
map of what follows, so errors of one step reach them as at most a norm times the norm of the step's numbers,
and that norm is known of any tile: its energy, by Parseval's equation. In detail (spec/fourier.md, FOU-5, 6):

1. Each number that goes into a transform of N numbers is in 5 sums (N = 32) and up to two products with
   factors. Coefficients of u, sorted, make `layers` of the transform, (L, N); what a layer's errors do is
   bounded by the root of the mean square of its coefficients [`layers`].
2. Forwards: the norm of the matrix W between scaled numbers times the tile's energy. Only the rows of the
   window matter to the transforms of rows.
3. Products and back: a number there is a sum over some frequencies F of W's spectrum times the tile's. With
   W(f) the matrix of a frequency, sums over disjoint F are at most M |x|, M^2 the sum of all |W(f)|^2.
4. Scalings: t of the channels (of both of a complex image the same), s of the neurons. Any are sound
   [`scalings` finds good ones]. Neurons that share a complex image count with the larger of both s.

Errors of errors are below 64 coefficients times u of the whole, which `AGAIN` covers; underflow `TINY`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from ..core.profiles import FLUSH, UNIT_ROUNDOFF

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

TURN, HALF_TURN = 2.8, 2.3
"""Coefficients of u of a product with a factor exp(i a), rounded from float64: a c - b s and a s + b c round
two products and a sum, 1 + sqrt(1 + |sin 2 a|) at most, and the factor's own error; of an eighth of a turn,
(a - b) h, two operations and the error of h. Up to 32 points."""

AGAIN = 1 + 2.0**-16
"""Factor of errors of errors: the sum of all coefficients is below 2^7."""

TINY = 2.0**-90
"""More than underflow adds: fewer than 2^24 operations, each off by 2^-120 of the largest factor."""

SQUARINGS = 6
"""Squarings with which the largest eigenvalue of a matrix is bounded [`largest`]."""

STEPS = 40
"""Steps of the search for scalings."""


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


@cache
def _paths(points: int) -> tuple[tuple[float, ...], ...]:
    """Return for each number that a transform is given the coefficients of the operations that it is in."""
    if points < 4:
        return (((1.0,),) * 2) if points == 2 else ((),)
    turned = {4: (), 8: (HALF_TURN,)}.get(points, (TURN,))
    even, odd = _paths(points // 2), _paths(points // 4)
    found: list[tuple[float, ...]] = [()] * points
    for j, path in enumerate(even):
        found[2 * j] = (*path, 1.0)
    for j, path in enumerate(odd):
        found[4 * j + 1] = found[4 * j - 1] = (*path, *turned, 1.0, 1.0)
    return tuple(found)


@cache
def layers(points: int) -> Array:
    """Return the coefficients of u (L, N) of a transform of N numbers, each number's largest one first."""
    paths = [sorted(path, reverse=True) for path in _paths(points)]
    depth = max(map(len, paths))
    return np.array([[*path, *[0.0] * (depth - len(path))] for path in paths]).reshape(points, depth).T


def of_transform(points: int) -> float:
    """Return the coefficient of u of a transform whose numbers have energies of one size."""
    return float(np.sqrt((layers(points) ** 2).mean(axis=1)).sum())


def largest(grams: NDArray[np.inexact]) -> Array:
    """Return numbers (...,) above the largest eigenvalues of matrices (..., n, n) without negative ones.

    The trace of G^64 is the sum of all eigenvalues to the 64th: at most n times the largest one's.
    """
    found, root = np.ones(grams.shape[:-2]), 1.0
    for _ in range(SQUARINGS):
        trace = np.trace(grams, axis1=-2, axis2=-1).real
        grams = grams / np.where(trace > 0, trace, 1.0)[..., None, None]
        found, root, grams = found * trace**root, root / 2, grams @ grams
    last: Array = found * np.trace(grams, axis1=-2, axis2=-1).real ** root
    return last


def norms(matrices: NDArray[np.inexact]) -> Array:
    """Return numbers (...,) above the squares of the norms of matrices (..., m, n)."""
    held = np.ascontiguousarray(matrices)
    adjoint = np.ascontiguousarray(np.swapaxes(held.conj(), -1, -2))
    return largest(held @ adjoint if held.shape[-2] < held.shape[-1] else adjoint @ held)


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


def pair_of(channels: int) -> NDArray[np.intp]:
    """Return the complex image (C,) that holds each channel."""
    return np.arange(channels) % -(-channels // 2)


def joined(of: Spectra, neurons: Array) -> Array:
    """Return for each neuron the larger of its own number and that of the one that shares its image."""
    found = neurons.copy()
    found[of.both] = neurons[of.both].max(axis=0)
    return found


def reach(of: Spectra, weight: Array, radius: Array, before: Array, after: Array) -> tuple[float, ...]:
    """Return what each step adds to |s e|, e the sums' errors: forwards, table, products, back.

    `weight` (D_out, n); `radius` (C,): the largest magnitude of each channel, centred; `before` (pairs,): t;
    `after` (D_out,): s.
    """
    n, channels, u = of.points, len(radius), UNIT_ROUNDOFF * AGAIN
    scale = before[pair_of(channels)]
    sizes = n * radius * scale
    energy = float(np.linalg.norm(sizes))
    taps = after[:, None] * weight / np.tile(scale, weight.shape[1] // channels)
    spectra = spectrum(weight, of.size, n)
    bent = after[:, None] * spectra / scale
    low, one = math.sqrt(of.size / n), of_transform(n)
    centring = of.size / n if np.any(of.centres) else 0.0
    forwards = u * math.sqrt(float(norms(taps))) * energy * (one * (low + 1) + 1 + centring)
    moved = (of.table - spectra.transpose(2, 0, 1, 3)[:, :, : n // 2 + 1]) / scale
    table = AGAIN * math.sqrt(2 * float(np.sum(np.abs(after[:, None, None, None] * moved) ** 2))) * energy
    products = u * _products(of, bent, sizes)
    shared = joined(of, after)[:, None] * spectra / scale
    # Of the numbers that are transformed last those of one row matter: sums of the window's rows.
    along = np.fft.fft(weight.reshape(len(weight), of.size, of.size, channels), n, axis=2) / math.sqrt(n)
    rows = joined(of, after)[:, None, None] * along.transpose(2, 0, 1, 3) / scale
    back = u * energy * _back(norms(shared), norms(rows.reshape(n, len(weight), -1)), low)
    underflow = TINY * (1 + float(np.linalg.norm(taps))) * (1 + energy) * (1 + float(after.max()))
    return forwards + underflow, table, products, back


def _products(of: Spectra, bent: Complex, sizes: Array) -> float:
    """Return the coefficient of u of the sums of products over channels, from spectra (N, N, D_out, C)."""

    def partial(channels: Sequence[int]) -> float:
        return math.sqrt(float(norms(bent[..., channels]).sum())) * float(np.linalg.norm(sizes[channels]))

    total = math.sqrt(2 * float(norms(np.abs(bent)).sum())) * float(np.linalg.norm(sizes))
    blocks = blocks_of(len(sizes), of.block)
    for number, block in enumerate(blocks):
        # Each channel is two products in each sum; the first one of a block is added to nothing.
        total += sum((2 if k else 1) * partial(block[: k + 1]) for k in range(len(block)))
        total += partial([c for b in blocks[: number + 1] for c in b]) if number else 0.0
    return total


def _back(squares: Array, rows: Array, low: float) -> float:
    """Return the coefficient of u of the way back, from the squares of the norms of frequencies.

    `squares` (N, N): of each one; `rows` (N,): of those along rows, for the window's rows together.
    """
    total = math.sqrt(float(squares.sum()))
    for layer in layers(len(rows)) ** 2:
        total += math.sqrt(float(layer @ squares.sum(axis=1))) + low * math.sqrt(float(layer @ rows))
    return total


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


def last_sum(of: Spectra, weight: Array, bias: Array, sizes: Array, more: Array) -> Array:
    """Return what the bias adds (D_out,) to the sums' errors: its own, and that of adding it to the sums.

    `sizes`: the magnitudes of the exact sums with their bias; `more`: how far the sums are off.
    """
    moved = moved_bias(of, weight, bias)
    found: Array = moved + UNIT_ROUNDOFF * (sizes + more + moved) + 4 * FLUSH
    return found


def sizes(of: Spectra, weight: Array, largest: Array) -> float:
    """Return a number that no number of the transforms is above, for windows of magnitudes `largest` (n,)."""
    channels = len(of.centres)
    norm = of.points * float(np.linalg.norm(largest[:channels] + np.abs(of.centres)))
    return 4 * max(float(of.points), float(np.linalg.norm(weight))) * norm
