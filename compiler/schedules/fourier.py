"""Sums over a window as products of spectra: the transform, the weights' spectra, and the bound of rounding.

A layer that reads the window of each pixel is a correlation. Over a tile of N x N pixels of the images, N a
power of two, it is a product of spectra; of what comes back, the N - K + 1 rows and columns whose windows of
K x K pixels lie in the tile are right (overlap-save: A. Oppenheim and R. Schafer, Discrete-Time Signal
Processing, 3rd edition, 2010, section 8.7.3).

1. Two channels are one complex image p + i q: transform it, rows, then columns.
2. The channels' spectra are P = (Z(f) + conj Z(-f)) / 2 and Q = (Z(f) - conj Z(-f)) / 2i: the halves go into
   the weights.
3. Each neuron's spectrum is the sum over channels of theirs times the weights', conjugate and divided by N^2
   [`spectrum`].
4. Two neurons are one complex image a + i b: transform it back.

`transform` is written once, for numbers, arrays, and the names of a kernel's variables [fft.py]:
the split-radix algorithm with conjugate pairs of twiddle factors (I. Kamar and Y. Elcherif, Conjugate pair
fast Fourier transform, Electronics Letters 25(5), 1989).

Every number on the way is off by as much as the tile's energy lets it be [proof/spectra.py]. To make that
energy small the middle of each channel's range is subtracted from it, and what that changes is in the bias;
products are added up in blocks of channels; and neurons that matter alike share a complex image
[`arrangement`].

`low`, `high` and everything after the layer are as in bounds.py [`enclose`].
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...refimpl.network.window import Window
from ..core.ir import Gather, Program
from ..core.ops import OPS
from ..core.profiles import FLUSH, UNIT_ROUNDOFF, SineContract
from ..proof import bounds, scaled, spectra
from ..proof.bounds import Enclosure
from .common import kernel_gather, reading_window

Array = NDArray[np.float64]

Complex = tuple[Any, Any]
"""Real and imaginary part: numbers, arrays, or whatever has +, - and a product with a number."""


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


def spectrum(matrix: Array, size: int, points: int) -> NDArray[np.complex128]:
    """Return conj(DFT(w)) / 2 N^2 (D_out, N, N, C) of a matrix (D_out, size * size * C)."""
    taps = matrix.reshape(len(matrix), size, size, -1)
    found: NDArray[np.complex128] = np.conj(np.fft.fft2(taps, (points, points), axes=(1, 2)))
    return found / (2 * points**2)


# ---- what a kernel holds ---------------------------------------------------------------------------------


@dataclass(frozen=True)
class Arrangement:
    """What a kernel holds in place of the first layer's numbers.

    `order` (D_out,): the neuron at each place; `centres` (C,) are subtracted from the channels, and their
    sums are in the bias. `weight`, `bias`: names of the layer's parameters;
    `readers`: of the matrices after it.
    """

    order: NDArray[np.intp]
    centres: tuple[float, ...]
    weight: str
    bias: str | None
    readers: tuple[str, ...]

    def moved(self, program: Program) -> Program:
        """Return the program with the neurons in order."""
        held = dict(program.parameters)
        for name in (self.weight, *([self.bias] if self.bias else [])):
            held[name] = held[name][self.order]
        for name in self.readers:
            held[name] = held[name][:, self.order]
        return replace(program, parameters=held)

    def centred(self, program: Program) -> Program:
        """Return the program with the bias of centred channels, in float32."""
        if self.bias is None:
            return program
        weight, bias = (program.parameters[name].astype(np.float64) for name in (self.weight, self.bias))
        taps = np.tile(self.centres, weight.shape[1] // len(self.centres))
        held = {**program.parameters, self.bias: (weight @ taps + bias).astype(np.float32)}
        return replace(program, parameters=held)


def arrangement(program: Program, lanes: int) -> Arrangement:
    """Return the order of the neurons, and the centres, of a program whose first layer reads the window.

    Neurons j and j + lanes share a complex image: those of similar scalings do [scaled.py], because an error
    of one is an error of the other. Where something but sines, rectifiers and matrices reads the layer, or
    its parameters are used twice, the order is that of the program.
    """
    index = reading_window(program)[0]
    node = program.nodes[index]
    weight, bias = str(node["weight"]), node.get("bias")
    uses = [
        str(n[key]) for n in program.nodes if n.op == "affine" for key in ("weight", "bias") if n.get(key)
    ]
    uses += [str(n["name"]) for n in program.nodes if n.op == "parameter"]
    bias = str(bias) if bias is not None else None
    low, high = (end[: kernel_gather(program).channels] for end in bounds.window_box(kernel_gather(program)))
    middles = ((low + high) / 2).astype(np.float32).astype(np.float64)
    centres = middles if bias and uses.count(bias) == 1 else np.zeros_like(low)
    readers = _readers(program, index)
    count = node.type.shape[0]
    order = np.arange(count)
    if readers and all(uses.count(name) == 1 for name in (weight, *readers, *([bias] if bias else []))):
        order = _order(program, weight, readers, np.maximum(high - centres, centres - low), lanes)
    return Arrangement(order, tuple(centres.tolist()), weight, bias, tuple(readers))


def _readers(program: Program, first: int) -> list[str]:
    """Return the matrices that read what is computed of a layer number by number; none if others read it."""
    held, readers = {first}, []
    for index, node in enumerate(program.nodes):
        from_layer = [arg in held for arg in node.args]
        if not any(from_layer):
            continue
        if node.op == "affine":
            readers.append(str(node["weight"]))
            continue
        others = [program.nodes[arg] for arg in node.args if arg not in held]
        if not OPS[node.op].elementwise or any(other.type.shape for other in others):
            return []
        held.add(index)
    return [] if held & {index for _, index in program.outputs} else readers


def _order(program: Program, weight: str, readers: Sequence[str], radius: Array, lanes: int) -> Any:
    """Return the neuron at each place: two whose scalings are next to each other in size share an image."""
    first = program.parameters[weight].astype(np.float64)
    names = [str(node["weight"]) for node in program.nodes if node.op == "affine"]
    later = [program.parameters[name].astype(np.float64) for name in names if name != weight]
    shapes = [first.shape, *(matrix.shape for matrix in later)]
    chain = all(a[0] == b[1] for a, b in pairwise(shapes))
    if len(readers) != 1 or not chain or not scaled.decomposable(later):
        return np.arange(len(first))
    sizes = np.linalg.norm(first * np.tile(radius, first.shape[1] // len(radius)), axis=1)
    ranked = np.argsort(scaled.scalings(later, sizes)[0], kind="stable")
    places = np.arange(len(first)).reshape(-1)
    lower = places[places // lanes % 2 == 0]
    paired = [p for p in lower if p + lanes < len(first)]
    seats = [place for p in paired for place in (p, p + lanes)]
    seats += [p for p in places if p not in seats]
    order = np.empty(len(first), np.intp)
    order[seats] = ranked
    return order


def block_of(pairs: int) -> int:
    """Return how many pairs of channels are added up by themselves: the least divisor above 1, or all."""
    return next((n for n in range(2, pairs) if pairs % n == 0), pairs)


# ---- the bound -------------------------------------------------------------------------------------------


def enclose(
    program: Program, sine: SineContract, x: Any, norm: Array, of: spectra.Spectra
) -> list[Enclosure]:
    """Return the enclosure of every node, the sums over the window being computed from spectra.

    `x`: the windows' box (low, high); `norm` (...): largest norm of the tile, centred, that holds a window.
    """
    index = reading_window(program)[0]
    node = program.nodes[index]
    until = replace(program, nodes=program.nodes[: index + 1], outputs=())
    exact = bounds.enclose(until, {"window": x}, sine)[index]
    matrix = program.parameters[str(node["weight"])].astype(np.float64)
    norm, whole = np.asarray(norm, np.float64)[..., None], float(np.linalg.norm(matrix))
    held = program.parameters.get(str(node.get("bias")), np.zeros(node.type.shape[0])).astype(np.float64)
    error = spectra.alone(of, matrix, len(of.centres)) * norm
    error = error + spectra.moved_bias(of, matrix, held) + spectra.TINY * (1 + whole) * (1 + norm)
    # The bias is added last, and rounded once more.
    largest = exact.largest + error
    error = error + UNIT_ROUNDOFF * largest + 4 * FLUSH
    size = 4 * np.maximum(of.points, whole) * norm * (1 + 2.0**-10) + 2 * largest
    known = bounds.held(exact.low, exact.high, error * (1 + bounds.OUTWARD), size)
    return bounds.enclose(program, {"window": x}, sine, known={index: known})


def radius(gather: Gather, centres: Array) -> Array:
    """Return the largest magnitude (C,) of each channel, centred."""
    low, high = (end[: gather.channels] for end in bounds.window_box(gather))
    found: Array = np.maximum(high - centres, centres - low)
    return found


def tile_norms(image: Array, window: Window, points: int, centres: Any = 0.0) -> Array:
    """Return the norm (H, W) of the tile, centred, that holds each pixel of an image (H, W, C)."""
    middle = np.zeros(image.shape[2]) + centres
    # |x - m|^2 = |m|^2 + (|x - m|^2 - |m|^2), the latter being 0 outside of a zero border.
    whole = float(middle @ middle)
    squares = ((image - middle) ** 2).sum(axis=2) - whole
    more = _over_tiles(_over_tiles(squares, window, points).T, window, points).T
    found: Array = np.sqrt(np.maximum(more, -(points**2) * whole) + points**2 * whole * (1 + 2.0**-40))
    return found


def _over_tiles(squares: Array, window: Window, points: int) -> Array:
    """Return the sums (n, m) over the rows of the tile that holds each row of (n, m)."""
    count, out = len(squares), points - window.size + 1
    first = np.arange(count) // out * out - window.size // 2
    rows = first[:, None] + np.arange(points)
    near = np.clip(rows, 0, count - 1)
    inside = (rows == near) | (window.border != "zero")
    found: Array = (squares[near] * inside[:, :, None]).sum(axis=1)
    return found
