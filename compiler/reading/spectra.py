"""What a text of spectra must compute: the operations whose rounding FOU-5 and FOU-6 bound, one by one.

The bound of sums from spectra is one of a sequence of operations, so the text must have the same: any other
transform, or order of products, is refused. What that sequence computes is what fourier.md says it does, with
the spectra that the certificate's checker has held against the weights [spectra_checker.py].

1. `transform`: the algorithm of FOU-3. It is written here once more, for arrays of anything that has sums,
   differences and products [`Arithmetic`]: of floats, to be tested, and of the shapes of field.py.
2. `sums`: rows and columns of pairs of channels, products by blocks of pairs, and both ways back (FOU-2, 4).
3. `Tiles`: the pixels that a work item's tiles read in all lanes, folded into one number each [terms.py], and
   the places of spectra and bias in the weights, as the certificate says (CER-7).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .field import Words, combined, hashed, literal
from .lanes import Lanes, Unread
from .terms import Fold

Complex = tuple[Any, Any]
"""Real and imaginary parts: two arrays of one shape."""


@dataclass(frozen=True)
class Arithmetic:
    """Sum, difference and product of two arrays of numbers, and the number that a constant is."""

    add: Callable[[Any, Any], Any]
    subtract: Callable[[Any, Any], Any]
    multiply: Callable[[Any, Any], Any]
    number: Callable[[float], Any]

    def plus(self, a: Complex, b: Complex) -> Complex:
        """Return a + b."""
        return self.add(a[0], b[0]), self.add(a[1], b[1])

    def minus(self, a: Complex, b: Complex) -> Complex:
        """Return a - b."""
        return self.subtract(a[0], b[0]), self.subtract(a[1], b[1])

    def turned(self, a: Complex, k: int, n: int) -> Complex:
        """Return a exp(2 pi i k / n), |k| < n / 4: an eighth of a turn takes two products, others four."""
        (x, y), angle = a, 2 * math.pi * k / n
        if k == 0:
            return a
        if 8 * abs(k) == n:
            both = (self.subtract(x, y), self.add(x, y)) if k > 0 else (self.add(x, y), self.subtract(y, x))
            half = self.number(math.sqrt(0.5))
            return self.multiply(both[0], half), self.multiply(both[1], half)
        c, s = self.number(math.cos(angle)), self.number(math.sin(angle))
        real = self.subtract(self.multiply(x, c), self.multiply(y, s))
        return real, self.add(self.multiply(x, s), self.multiply(y, c))


def _of_shapes(name: str, a: Words, b: Words) -> Words:
    """Return the shapes of an operation's results, of shapes that all are of one number or of one lane."""
    return combined(name, ("float32", "float32"), [a, b], name != "subtract")


SHAPES = Arithmetic(
    partial(_of_shapes, "add"),
    partial(_of_shapes, "subtract"),
    partial(_of_shapes, "multiply"),
    lambda value: literal([value], "float32"),
)
"""Of the shapes of field.py; a constant is the nearest float32."""


def transform(of: Arithmetic, points: Sequence[Complex], sign: int) -> list[Complex]:
    """Return sum_j points[j] exp(sign 2 pi i j k / n), n a power of two: FOU-3."""
    n, quarter = len(points), len(points) // 4
    if n < 4:
        return list(points) if n == 1 else [of.plus(*points), of.minus(*points)]
    even = transform(of, points[::2], sign)
    after = transform(of, points[1::4], sign)
    before = transform(of, [points[-1], *points[3:-1:4]], sign)
    found = [even[0]] * n
    for k in range(quarter):
        one, other = of.turned(after[k], sign * k, n), of.turned(before[k], -sign * k, n)
        both, (g, h), (r, s) = of.plus(one, other), of.minus(one, other), even[k + quarter]
        found[k], found[k + 2 * quarter] = of.plus(even[k], both), of.minus(even[k], both)
        # i (g + i h) is -h + i g, which a transform back adds and one forwards takes away.
        ends = (of.subtract(r, h), of.add(s, g)), (of.add(r, h), of.subtract(s, g))
        found[k + quarter], found[k + 3 * quarter] = ends[::sign]
    return found


def along(of: Arithmetic, numbers: Complex, axis: int, sign: int, kept: int) -> Complex:
    """Return the first `kept` results of the transforms of arrays along an axis."""
    lines = [np.moveaxis(part, axis, 0) for part in numbers]
    found = transform(of, list(zip(*lines, strict=True)), sign)[:kept]
    real, imaginary = (np.stack([number[part] for number in found], axis=axis) for part in (0, 1))
    return real, imaginary


def sums(
    of: Arithmetic, patch: Complex, table: NDArray[Any], out: int, block: int, once: bool = False
) -> NDArray[Any]:
    """Return the sums (out, out, tiles, groups, neurons) of tiles.

    `once`: frequencies in columns that are their own mirror images are computed for one half of the rows, and
    one block is added up as several are.

    `patch` (N, N, tiles, pairs): the first and the second channel of each pair; `table` (N / 2 + 1, groups,
    N, pairs, 2, 2, neurons): columns, groups, rows, pairs, channels and parts of spectra, as CER-7 says.
    """
    n, half, lanes = len(patch[0]), len(table), table.shape[-1] // 2
    mirror = -np.arange(n) % n
    real, imaginary = along(of, along(of, patch, 1, -1, n), 0, -1, n)
    a, b = real[:, :half], imaginary[:, :half]
    c, d = (part[mirror][:, mirror[:half]] for part in (real, imaginary))
    images = (of.add(a, c), of.subtract(b, d)), (of.add(b, d), of.subtract(c, a))
    first, second = _split(of, _products(of, images, table, block, once), lanes)
    straight = of.subtract(first[0], second[1]), of.add(first[1], second[0])
    mirrored = of.add(first[0], second[1]), of.subtract(second[0], first[1])
    real, imaginary = (_whole(*parts, once) for parts in zip(straight, mirrored, strict=True))
    back = along(of, (real, imaginary), 0, 1, out)
    return np.concatenate(along(of, back, 1, 1, out), axis=-1)


def _products(of: Arithmetic, images: Any, table: NDArray[Any], block: int, once: bool) -> Complex:
    """Return the spectra (N, N / 2 + 1, tiles, groups, neurons) of neurons, added up as FOU-4 says."""
    # Pairs, channels, parts of rows, columns, tiles, groups and neurons.
    weights = table.transpose(3, 4, 5, 2, 0, 1, 6)[:, :, :, :, :, None]
    size = np.broadcast_shapes(weights.shape[3:], (*images[0][0].shape[:3], 1, 1))
    nothing = np.broadcast_to(of.number(0.0), size)
    whole: Complex = nothing, nothing
    for at in range(0, len(weights), block):
        real, imaginary = nothing, nothing
        for pair in range(at, min(at + block, len(weights))):
            for channel in (0, 1):
                x, y = (part[..., pair, None, None] for part in images[channel])
                g, h = weights[pair, channel]
                real = of.subtract(of.add(real, of.multiply(g, x)), of.multiply(h, y))
                imaginary = of.add(of.add(imaginary, of.multiply(h, x)), of.multiply(g, y))
        added = once or block < len(weights)
        whole = of.plus(whole, (real, imaginary)) if added else (real, imaginary)
    return whole


def _split(of: Arithmetic, numbers: Complex, lanes: int) -> tuple[Complex, Complex]:
    """Return the first and the second half of the neurons of each group."""
    (a, b), (c, d) = ((part[..., :lanes], part[..., lanes:]) for part in numbers)
    return (a, c), (b, d)


def _whole(straight: NDArray[Any], mirrored: NDArray[Any], once: bool) -> NDArray[Any]:
    """Return all columns (N, N, ...) of what those from 0 to N / 2 have and what their mirror images have.

    A column that is its own mirror image has rows 0 to N / 2 from the latter, or if these are computed `once`
    the others and those that are their own mirror images: both parts stay apart (FOU-4).
    """
    n = len(straight)
    turned = mirrored[-np.arange(n) % n]
    own, rows = straight.copy(), np.arange(n)
    from_mirror = (rows == 0) | (rows >= n // 2) if once else rows <= n // 2
    own[from_mirror, :: n // 2] = turned[from_mirror, :: n // 2]
    return np.concatenate([own, turned[:, n // 2 - 1 : 0 : -1]], axis=1)


class Tiles:
    """What a certificate says of a work item's tiles: `held` is its `spectra`, `size` the window's."""

    def __init__(self, held: Any, columns: int, rows: int, size: int, once: bool = False) -> None:
        self.held, self.points, self.once = held, int(held["points"]), once
        self.columns, self.rows, self.out = columns, rows, self.points - size + 1
        if rows != self.out or columns % self.out:
            raise Unread(f"tiles of other pixels than {self.out} x {self.out}")

    @property
    def owned(self) -> NDArray[np.intp]:
        """The places of the spectra in the weights, as they are stored."""
        table = self.held["table"]
        return np.arange(math.prod(table["shape"])).reshape(table["shape"]) + int(table["offset"])

    @property
    def range(self) -> range:
        """The places of all spectra."""
        first = int(self.held["table"]["offset"])
        return range(first, first + self.owned.size)

    @property
    def bias(self) -> NDArray[np.intp] | None:
        """The places (D_out,) of what is added to the sums, neuron by neuron."""
        if self.held["bias"] is None:
            return None
        return int(self.held["bias"]) + np.argsort(self.held["order"])

    def sums(self, channels: Iterator[Words]) -> Words:
        """Return the sums' shapes (1, slots * pixels * D_out) of channels' patches (slots, N, N + beside)."""
        n, order = self.points, np.array(self.held["order"])
        given = list(channels)
        slots, pairs = len(given[0]), -(-len(given) // 2)
        nothing = np.broadcast_to(SHAPES.number(0.0), given[0].shape)
        given += [nothing] * (2 * pairs - len(given))
        tiles = np.stack(
            [np.stack(given)[..., at : at + n] for at in range(0, self.columns, self.out)], axis=-1
        )
        patch = (
            tiles.reshape(2, pairs, slots, n, n, -1).transpose(0, 3, 4, 2, 5, 1).reshape(2, n, n, -1, pairs)
        )
        table = hashed("weight", self.owned)
        found = sums(SHAPES, (patch[0], patch[1]), table, self.out, self.held["block"], self.once)
        places = found.reshape(self.out, self.out, slots, -1, *found.shape[3:]).transpose(2, 0, 3, 1, 4, 5)
        places = places.reshape(slots * self.rows * self.columns, -1)
        return places[:, np.argsort(order)].reshape(1, -1)

    def channels(self, lanes: Lanes, fold: Fold, images: Any, centre: int, border: str) -> Iterator[Words]:
        """Yield the numbers (slots, N, N + beside) that the tiles read of each channel, folded over lanes."""
        across = np.arange(self.points + self.columns - self.out) - centre
        down = np.arange(self.points) - centre
        read = patches(lanes, fold, images, (across, down), border)
        for known, middle in zip(read, self.held["centres"], strict=True):
            middles = literal([middle], "float32")
            yield combined("subtract", ("float32", "float32"), [known, middles], False) if middle else known


def patches(lanes: Lanes, fold: Fold, images: Any, at: Any, border: str) -> Iterator[Words]:
    """Yield the numbers (slots, rows, columns) of each channel at columns and rows, folded over lanes."""
    across, down = at
    width, height = lanes.known[1][:, None], lanes.known[3][:, None]
    column = lanes.x[:, None] + across
    for name, count in images:
        for c in range(count):
            lines = []
            for row in (lanes.y[:, None] + dy for dy in down):
                pixel = np.clip(row, 0, height - 1) * width + np.clip(column, 0, width - 1)
                known = hashed(f"image {name}", pixel * count + c)
                if border == "zero":
                    outside = (column < 0) | (column >= width) | (row < 0) | (row >= height)
                    known = np.where(outside, literal(0.0, "float32"), known)
                lines.append([fold.of(known, slot) for slot in range(fold.slots)])
            yield np.array(lines).transpose(1, 0, 2)
