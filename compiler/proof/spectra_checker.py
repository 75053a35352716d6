"""Check what a certificate says of sums over a window from spectra: derive every number again.

The formulas are those of spec/fourier.md, FOU-5 to FOU-7, and spec/certificate.md, CER-7.

1. The kernel's spectra and bias are read from its weights and held against W, b and the centres [`Tables`].
2. The coefficients of u of a transform, layer by layer [`layers`].
3. What the transforms, spectra and products add, for a certificate's scalings [`Tables.steps`].

One error of rounding is at most u times a number on the way. What it does to the sums of a pixel is a linear
map of what follows, so errors of one step reach them as at most a norm times the norm of the step's numbers,
and that norm is known of any tile: its energy, by Parseval's equation. Sums over disjoint frequencies F are
at most M |x|, M^2 the sum of all |W(f)|^2. Neurons that share a complex image count with the larger scaling.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from .evidence import Refused, same

U, TINY = 2.0**-24, 2.0**-126
"""float32's rounding and smallest normal number."""

AGAIN, UNDERFLOW = 1 + 2.0**-16, 2.0**-90
"""A factor for errors of errors, and what underflow adds less than."""


def layers(n: int) -> Any:
    """Return the coefficients of u (L, n) of a transform: of each number's operations, the largest first."""

    def operations(index: int, n: int) -> list[float]:
        if n <= 2:
            return [1.0] * (n - 1)
        if index % 2 == 0:
            return [*operations(index // 2, n // 2), 1.0]
        factor = {4: [], 8: [2.3]}.get(n, [2.8])
        return [*operations((index + 1) // 4 % (n // 4), n // 4), *factor, 1.0, 1.0]

    found = [sorted(operations(index, n), reverse=True) for index in range(n)]
    depth = max(map(len, found))
    return np.array([line + [0.0] * (depth - len(line)) for line in found]).T


def norms(matrices: Any) -> Any:
    """Return squares of what is above the norms of matrices (..., m, n): the trace of (A* A)^64, its root."""
    if matrices.shape[-2] < matrices.shape[-1]:
        matrices = np.swapaxes(matrices, -1, -2)
    power = np.einsum("...ji,...jk->...ik", matrices.conj(), matrices, optimize=True)
    logarithm, share = 0.0, 1.0
    for _ in range(6):
        trace = np.maximum(np.einsum("...ii->...", power).real, 1e-290)
        logarithm, share = logarithm + share * np.log(trace), share / 2
        power = power / trace[..., None, None]
        power = np.matmul(power, power)
    return np.exp(logarithm + share * np.log(np.maximum(np.einsum("...ii->...", power).real, 1e-290)))


class Tables:
    """What a kernel holds of a layer W x + b, and of its windows in [low, high].

    `raw`: its weights, or the spectra (N, N / 2 + 1, D_out, C) and the bias (D_out,) that they hold.
    """

    def __init__(self, held: Any, weight: Any, bias: Any, raw: Any, low: Any, high: Any) -> None:
        self.n, self.lanes, self.block = (held[name] for name in ("points", "lanes", "block"))
        self.centres, self.order = np.array(held["centres"], np.float64), np.array(held["order"], np.intp)
        channels = len(self.centres)
        self.size = int(np.sqrt(weight.shape[1] // channels))
        self.weight, self.taps = weight, np.tile(self.centres, self.size**2)
        same("spectra: points", self.n in (4, 8, 16, 32) and self.n > self.size, True)
        same("spectra: window and channels", self.size**2 * channels, weight.shape[1])
        same("spectra: order", sorted(held["order"]), list(range(len(weight))))
        same("spectra: centres in float32", np.float32(self.centres).tolist(), held["centres"])
        whole = [type(value) is int and value > 0 for value in (self.lanes, self.block)]
        same("spectra: lanes and block are counts", whole, [True, True])
        self.radius = np.maximum(high[:channels] - self.centres, self.centres - low[:channels])
        self.largest = float(np.linalg.norm(np.maximum(high, -low)[:channels] + np.abs(self.centres)))
        first = np.arange(max(len(weight) - self.lanes, 0))
        first = first[first // self.lanes % 2 == 0]
        self.both = self.order[np.stack([first, first + self.lanes])]
        taps = weight.reshape(len(weight), self.size, self.size, channels)
        wave = np.exp(2j * np.pi / self.n * (np.outer(np.arange(self.n), np.arange(self.size)) % self.n))
        self.columns = np.einsum("kx,jyxc->jykc", wave, taps, optimize=True) / np.sqrt(self.n)
        half = self.columns[:, :, : self.n // 2 + 1]
        self.exact = np.einsum("fy,jykc->fkjc", wave, half, optimize=True) / np.sqrt(self.n)
        table, added = raw if isinstance(raw, tuple) else self._read(held, bias, raw)
        self.moved = np.abs(table - self.exact)
        sizes = np.abs(weight).sum(axis=1) * np.abs(self.taps).max() + np.abs(bias)
        off = len(self.taps) * 2.0**-52 * sizes if self.taps.any() else 0.0
        self.shift = np.abs(added - (weight @ self.taps + bias)) + off

    def _read(self, held: Any, bias: Any, raw: Any) -> tuple[Any, Any]:
        """Return the kernel's spectra (N, N / 2 + 1, D_out, C), those of W, and what it adds to the sums."""
        place, added = held["table"], np.zeros(len(bias))
        n, (count, channels) = self.n, (len(self.weight), len(self.centres))
        groups, pairs = -(-count // (2 * self.lanes)), -(-channels // 2)
        shape = [n // 2 + 1, groups, n, pairs, 2, 2, 2 * self.lanes]
        same("spectra: shape", place["shape"], shape)
        end = place["offset"] + int(np.prod(shape))
        same("spectra: place in the weights", 0 <= place["offset"] < end <= len(raw), True)
        stored = raw[place["offset"] : end].reshape(shape).astype(np.float64)
        stored = (stored[..., 0, :] + 1j * stored[..., 1, :]) * 2 * n
        found = np.empty_like(self.exact)
        for at, neuron in enumerate(self.order):
            group, lane = divmod(at, 2 * self.lanes)
            one = stored[:, group, :, :, :, lane].transpose(1, 0, 3, 2).reshape(n, n // 2 + 1, -1)
            found[:, :, neuron] = one[..., :channels]
        same("spectra: real at 0 and N / 2", bool(found[:: n // 2, :: n // 2].imag.any()), False)
        if (at := held["bias"]) is None:
            same("spectra: centres without a bias", bool(self.centres.any() or bias.any()), False)
        else:
            same("spectra: place of the bias", 0 <= at <= len(raw) - len(bias), True)
            added[self.order] = raw[at:][: len(bias)]
        return found, added

    def steps(self, before: Any, after: Any) -> list[float]:
        """Return what transforms forwards, spectra, products and transforms back add to |s e|."""
        n, channels, low = self.n, len(self.centres), np.sqrt(self.size / self.n)
        pairs, half = -(-channels // 2), n // 2
        same("spectra: number of scalings", [before.shape, after.shape], [(pairs,), (len(self.weight),)])
        if not all(np.isfinite(scale).all() and (scale > 0).all() for scale in (before, after)):
            raise Refused("spectra: scalings must be positive numbers")
        scale, squared = before[np.arange(channels) % pairs], layers(n) ** 2
        sizes = n * self.radius * scale
        energy, one = np.linalg.norm(sizes), np.sqrt(squared.mean(axis=1)).sum()
        mirrored = np.where(np.arange(half + 1) % half == 0, 1.0, 2.0)
        bent = after[:, None] * self.exact / scale
        taps = after[:, None] * self.weight / np.tile(scale, self.size**2)

        def partial(chosen: list[int]) -> float:
            largest = np.sqrt((norms(bent[..., chosen]) * mirrored).sum())
            return float(largest * np.linalg.norm(sizes[chosen]))

        centring = self.size / n if self.centres.any() else 0.0
        forwards = U * AGAIN * np.sqrt(norms(taps)) * energy * (one * (low + 1) + 1 + centring)
        forwards += UNDERFLOW * (1 + np.linalg.norm(taps)) * (1 + energy) * (1 + after.max())
        table = AGAIN * np.sqrt(2 * ((after[:, None] * self.moved / scale) ** 2).sum()) * energy
        products = np.sqrt(2 * (norms(np.abs(bent)) * mirrored).sum()) * energy
        done: list[int] = []
        for first in range(0, pairs, self.block):
            images = range(first, min(first + self.block, pairs))
            chosen = [c for j in images for c in (j, j + pairs) if c < channels]
            products += sum(partial(chosen[: k + 1]) * (2 if k else 1) for k in range(len(chosen)))
            products += partial(done + chosen) if done else 0.0
            done += chosen
        joint = after.copy()
        joint[self.both] = after[self.both].max(axis=0)
        squares = norms(joint[:, None] * self.exact / scale) * mirrored
        rows = (joint[:, None, None, None] * self.columns / scale).transpose(2, 0, 1, 3)
        along = norms(rows.reshape(n, len(joint), -1))
        back = np.sqrt(squares.sum()) + np.sqrt(squared @ squares.sum(axis=1)).sum()
        back += low * np.sqrt(squared @ along).sum()
        return [float(step) for step in (forwards, table, U * AGAIN * products, U * AGAIN * back * energy)]

    def last(self, sizes: Any, more: Any) -> Any:
        """Return what adding the bias adds (D_out,) to sums of magnitudes `sizes` that are off by `more`."""
        return self.shift + U * (sizes + more + self.shift) + 4 * TINY

    def most(self) -> float:
        """Return what no number of the transforms is above."""
        return float(4 * max(self.n, np.linalg.norm(self.weight)) * self.n * self.largest)
