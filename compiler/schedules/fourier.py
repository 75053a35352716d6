"""Sums over a window as products of spectra: the transform, the weights' spectra, and the bound of rounding.

A layer that reads the window of each pixel is a correlation. Over a tile of N x N pixels of the images, N a
power of two, it is a product of spectra; of what comes back, the N - K + 1 rows and columns whose windows of
K x K pixels lie in the tile are right (overlap-save: A. Oppenheim and R. Schafer, Discrete-Time Signal
Processing, 3rd edition, 2010, section 8.7.3).

1. Two channels are one complex image p + i q: transform it, rows, then columns [`both_ways`].
2. The channels' spectra are P = (Z(f) + conj Z(-f)) / 2 and Q = (Z(f) - conj Z(-f)) / 2i: the halves go into
   the weights [`unpack`].
3. Each neuron's spectrum is the sum over channels of theirs times the weights', conjugate and divided by N^2
   [`spectrum`].
4. Two neurons are one complex image a + i b: transform it back [`sums`].

`transform` is written once, for numbers, arrays, and the names of a kernel's variables [emit_fourier.py]:
the split-radix algorithm with conjugate pairs of twiddle factors (I. Kamar and Y. Elcherif, Conjugate pair
fast Fourier transform, Electronics Letters 25(5), 1989).

The bound [`deviation`] is one of norms. As in N. Higham, Accuracy and Stability of Numerical Algorithms,
2nd edition, 2002, section 24.1: all steps of a transform but rounding are multiples of unitary maps, so the
errors of its steps pass through it with the norm that the numbers themselves have. The sum over frequencies
and channels is bounded by the inequality of Cauchy and Schwarz:

    |computed - exact| <= constant u |x| |w|,  |x| the norm of the tile's numbers, |w| that of the weights.

`low`, `high` and everything after the layer are as in bounds.py [`enclose`].
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...refimpl.network import dataset
from ..core.ir import Gather, Program
from ..core.profiles import FLUSH, UNIT_ROUNDOFF, SineContract
from ..core.sums import gamma
from ..proof import bounds
from ..proof.bounds import Enclosure
from .emit import kernel_gather

Array = NDArray[np.float64]

Complex = tuple[Any, Any]
"""Real and imaginary part: numbers, arrays, or whatever has +, - and a product with a number."""

TWIDDLE = UNIT_ROUNDOFF * (1 + 2.0**-20)
"""Largest error of a twiddle factor, or relative one of a spectrum: rounded once, after float64."""

COMPLEX_SUM_FLUSH = 6 * FLUSH
"""Underflow of a complex sum: two operands and a result in each part, 3 sqrt(2) FLUSH, and their rounding."""

COMPLEX_PRODUCT_FLUSH = 12 * FLUSH
"""The same of a product with a twiddle factor: four operands, two products and a sum for each part."""


# ---- the algorithm ---------------------------------------------------------------------------------------


def transform(points: Sequence[Complex], sign: int) -> list[Complex]:
    """Return sum_j points[j] exp(sign 2 pi i j k / n) for k from 0 to n - 1, n a power of two."""
    n = len(points)
    if n == 1:
        return list(points)
    if n == 2:
        (a, b), (c, d) = points
        return [(a + c, b + d), (a - c, b - d)]
    even = transform(points[0::2], sign)
    after = transform(points[1::4], sign)  # points 4 j + 1
    before = transform([points[4 * j - 1] for j in range(n // 4)], sign)
    found: list[Complex] = [(0.0, 0.0)] * n
    for k in range(n // 4):
        (a, b), (c, d) = _turned(after[k], sign * k, n), _turned(before[k], -sign * k, n)
        (p, q), (r, s) = even[k], even[k + n // 4]
        e, f, g, h = a + c, b + d, a - c, b - d
        found[k], found[k + n // 2] = (p + e, q + f), (p - e, q - f)
        # i (g + i h) = -h + i g.
        left, right = (r - h, s + g), (r + h, s - g)
        found[k + n // 4], found[k + 3 * n // 4] = (left, right) if sign > 0 else (right, left)
    return found


def _turned(z: Complex, k: int, n: int) -> Complex:
    """Return z exp(2 pi i k / n), |k| < n / 4."""
    a, b = z
    if k == 0:
        return z
    if 8 * abs(k) == n:
        half = math.sqrt(0.5)
        return ((a - b) * half, (a + b) * half) if k > 0 else ((a + b) * half, (b - a) * half)
    c, s = math.cos(2 * math.pi * k / n), math.sin(2 * math.pi * k / n)
    return (a * c - b * s, a * s + b * c)


def both_ways(image: Complex, sign: int) -> Complex:
    """Return the transform (N, N) of an image (N, N) along rows, then along columns."""
    real, imaginary = image
    for _ in range(2):  # along the second axis, which then becomes the first
        columns = transform(list(zip(real.T, imaginary.T, strict=True)), sign)
        real, imaginary = (np.stack([number[part] for number in columns]) for part in (0, 1))
    return real, imaginary


def unpack(z: Complex) -> tuple[Complex, Complex]:
    """Return twice the spectra (N, N) of p and of q from that of p + i q."""
    (a, b), (c, d) = z, (_mirrored(part) for part in z)
    return (a + c, b - d), (b + d, c - a)


def _mirrored(spectrum: NDArray[Any]) -> NDArray[Any]:
    """Return spectrum(-f)."""
    found: NDArray[Any] = np.roll(spectrum[::-1, ::-1], 1, axis=(0, 1))
    return found


def spectrum(matrix: Array, size: int, points: int) -> NDArray[np.complex128]:
    """Return conj(DFT(w)) / 2 N^2 (D_out, N, N, C) of a matrix (D_out, size * size * C)."""
    taps = matrix.reshape(len(matrix), size, size, -1)
    found: NDArray[np.complex128] = np.conj(np.fft.fft2(taps, (points, points), axes=(1, 2)))
    return found / (2 * points**2)


def sums(tile: NDArray[Any], matrix: Array, size: int) -> NDArray[Any]:
    """Return W x (out, out, D_out) for the windows of a tile (N, N, C), in the tile's arithmetic."""
    points, dtype = len(tile), tile.dtype
    weights = spectrum(matrix, size, points)
    tile = np.concatenate([tile, np.zeros((points, points, tile.shape[2] % 2), dtype)], axis=2)
    half = tile.shape[2] // 2
    pairs = [unpack(both_ways((tile[..., j], tile[..., j + half]), -1)) for j in range(half)]
    channels = [first for first, _ in pairs] + [second for _, second in pairs]
    neurons = []
    for n in range(len(matrix)):
        real = imaginary = np.zeros((points, points), dtype)
        for channel in range(weights.shape[3]):
            (a, b), w = channels[channel], weights[n, :, :, channel]
            g, h = w.real.astype(dtype), w.imag.astype(dtype)
            real, imaginary = real + a * g - b * h, imaginary + a * h + b * g
        neurons.append((real, imaginary))
    out, found = points - size + 1, np.zeros((points, points, 2 * len(matrix)), dtype)
    gap = -(-len(matrix) // 2)
    neurons += [(np.zeros_like(neurons[0][0]),) * 2] * gap
    for n in range(gap):
        (a, b), (c, d) = neurons[n], neurons[n + gap]
        found[..., n], found[..., n + gap] = both_ways((a - d, b + c), 1)
    return found[:out, :out, : len(matrix)]


# ---- the bound -------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Deviation:
    """|computed - exact| <= relative |exact| + absolute, in the Euclidean norm of all numbers."""

    relative: float
    absolute: float


@cache
def of_transform(n: int) -> Deviation:
    """Return the deviation of `transform` of n numbers.

    A step is a product with numbers of magnitude 1, which adds `turned` of the norm, and sums of pairs, which
    multiply the norm by sqrt(2) and add u of it. Parts with deviations r1 and r2 have max(r1, r2) together.
    """
    u, root = UNIT_ROUNDOFF, math.sqrt(2.0)
    if n == 1:
        return Deviation(0.0, 0.0)
    if n == 2:
        return Deviation(u, root * COMPLEX_SUM_FLUSH)
    even, odd = of_transform(n // 2), of_transform(n // 4)
    # Higham, lemma 3.5: a complex product is off by sqrt(2) gamma(2) of its magnitude.
    turned = TWIDDLE + root * gamma(2) * (1 + TWIDDLE)
    relative = (1 + u) * (odd.relative * (1 + turned) + turned) + u
    absolute = root * odd.absolute * (1 + turned) + math.sqrt(n / 2) * COMPLEX_PRODUCT_FLUSH
    absolute = root * (1 + u) * absolute + math.sqrt(n / 2) * COMPLEX_SUM_FLUSH
    relative = (1 + u) * max(even.relative, relative) + u
    absolute = root * (1 + u) * math.hypot(even.absolute, absolute) + math.sqrt(n) * COMPLEX_SUM_FLUSH
    return Deviation(relative, absolute)


def of_both_ways(n: int) -> Deviation:
    """Return the deviation of `both_ways`: n transforms, and n of what they give."""
    one = of_transform(n)
    whole, stretch = math.sqrt(n) * one.absolute, math.sqrt(n) * (1 + one.relative)
    return Deviation((1 + one.relative) ** 2 - 1, whole * (1 + stretch))


@dataclass(frozen=True)
class Layer:
    """What the bound needs of a matrix: by neuron (D_out,), with the neuron whose transform it shares.

    `norms`: sum of both neurons' |w|; `gains`: no tile's sums have a norm larger than this times the tile's.
    """

    points: int
    channels: int
    norms: Array
    gains: Array


def layer(matrix: Array, size: int, points: int, lanes: int) -> Layer:
    """Return the numbers of a matrix (D_out, size * size * C) whose neurons j and j + lanes are a pair."""
    spectra = 2 * points**2 * np.abs(spectrum(matrix, size, points))
    gain = np.sqrt((spectra**2).sum(axis=3)).max(axis=(1, 2))
    norm = np.sqrt((matrix**2).sum(axis=1))
    filled = [np.pad(a, (0, -len(a) % (2 * lanes))).reshape(-1, 2, lanes) for a in (norm, gain)]
    norms = np.repeat(filled[0].sum(axis=1, keepdims=True), 2, axis=1)
    gains = np.repeat(np.sqrt((filled[1] ** 2).sum(axis=1, keepdims=True)), 2, axis=1)
    widened = (a.reshape(-1)[: len(matrix)] * (1 + 2.0**-40) for a in (norms, gains))
    return Layer(points, matrix.shape[1] // size**2, *widened)


def deviation(of: Layer, norm: Array) -> tuple[Array, Array]:
    """Return (largest error, largest number on the way) (..., D_out) of the sums of tiles of this norm (...).

    The error is that of the complex number whose parts are two neurons' sums.
    """
    n, u, pairs = of.points, UNIT_ROUNDOFF, -(-of.channels // 2)
    ways, norm = of_both_ways(n), np.asarray(norm, np.float64)[..., None]
    # The channels' spectra: their norm is 2 n |x|.
    relative = (1 + u) * ways.relative + u
    absolute = math.sqrt(2) * n**2 * FLUSH * (1 + ways.relative) + ways.absolute
    absolute = math.sqrt(pairs) * (2 * (1 + u) * absolute + 2 * n * COMPLEX_SUM_FLUSH)
    # Products: 4 numbers a pair of channels in each sum; the weights' norm is |w| / 2 n.
    own = math.sqrt(2) * gamma(4 * pairs) * (1 + relative) * (1 + TWIDDLE)
    of_products = (relative * (1 + TWIDDLE) + TWIDDLE + own) * norm * of.norms
    of_products = of_products + absolute * of.norms / n
    reach = 2 * n * norm + absolute
    of_products += 16 * FLUSH * (n * math.sqrt(2 * pairs) * (reach + of.norms) + 16 * n**2 * pairs)
    # Back: the norm of both neurons' images, and what the products add to it.
    image = of.gains * norm + n * of_products
    back = (ways.relative * (1 + u) + u) * image + ways.absolute + n**2 * COMPLEX_SUM_FLUSH
    return of_products + back, 4 * np.maximum(n * norm, image)


def enclose(
    program: Program, sine: SineContract, x: Any, norm: Array, plan: tuple[int, int]
) -> list[Enclosure]:
    """Return the enclosure of every node, the sums over the window being computed from spectra.

    `x`: the windows' box (low, high); `norm`: largest norm of the tile that holds a window; `plan`: points
    and lanes.
    """
    index = next(i for i, node in enumerate(program.nodes) if _reads_window(program, i))
    node = program.nodes[index]
    until = replace(program, nodes=program.nodes[: index + 1], outputs=())
    exact = bounds.enclose(until, {"window": x}, sine)[index]
    matrix = program.parameters[str(node["weight"])].astype(np.float64)
    error, size = deviation(layer(matrix, kernel_gather(program).rows, *plan), norm)
    # The bias is added last, and rounded once more.
    whole = exact.largest + error
    error = error + UNIT_ROUNDOFF * whole + 4 * FLUSH
    known = bounds.held(exact.low, exact.high, error * (1 + bounds.OUTWARD), size + 2 * whole)
    return bounds.enclose(program, {"window": x}, sine, known={index: known})


def _reads_window(program: Program, index: int) -> bool:
    """Return whether a node is an affine map of the window."""
    node = program.nodes[index]
    return node.op == "affine" and program.nodes[node.args[0]].op == "input"


def largest_norm(gather: Gather, points: int) -> Array:
    """Return the largest norm () of a tile of images in their ranges."""
    low, high = (end[: gather.channels] for end in bounds.window_box(gather))
    found: Array = points * np.sqrt(np.sum(np.maximum(np.abs(low), np.abs(high)) ** 2))
    return found


def tile_norms(image: Array, window: dataset.Window, points: int) -> Array:
    """Return the norm (H, W) of the tile that holds each pixel of an image (H, W, C)."""
    squares = (image**2).sum(axis=2)
    found: Array = np.sqrt(_over_tiles(_over_tiles(squares, window, points).T, window, points).T)
    return found


def _over_tiles(squares: Array, window: dataset.Window, points: int) -> Array:
    """Return the sums (n, m) over the rows of the tile that holds each row of (n, m)."""
    count, out = len(squares), points - window.size + 1
    first = np.arange(count) // out * out - window.size // 2
    rows = first[:, None] + np.arange(points)
    near = np.clip(rows, 0, count - 1)
    inside = (rows == near) | (window.border != "zero")
    found: Array = (squares[near] * inside[:, :, None]).sum(axis=1)
    return found
