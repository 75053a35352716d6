"""The FFT schedule in passes: a launch each for lines, frequencies and pixels.

    images -> rows -> columns -> products at each frequency -> columns back -> rows back -> layers -> result

1. An item computes one line, one frequency or one pixel of a tile; neighbours compute the same of the tiles
   beside it, so that they read and write neighbours in memory of the device. No function takes an array and
   no item holds a tile: languages need no pointers, devices no large stacks, and programs are short.
2. What is computed, and in which order, is as in the FFT schedule [fft.py] with vectors of `HALF` neurons:
   neurons j and j + HALF share a complex image. The bits are the same, and the bound is that of fourier.py.
3. Frequencies in the columns that are their own mirror images, 0 and POINTS / 2, are computed once for both.
4. Weights of the layers after the first are constants of the source [straight.py]; its spectra are in memory.
5. Tiles are computed in batches: a launch sees `tile_count` of them, from `first_tile` on. Those behind the
   last one are computed like others, and write no pixel: no item needs a branch around its work, which costs
   llvmpipe a check for each item and access.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..core.ir import Node, Program
from ..core.weights import weights
from ..kernel import kernel as tree
from ..kernel.interface import ITEMS
from ..kernel.kernel import BATCH, apply, const, load, name, stack
from ..kernel.sizes import handed_on, of_tile
from .common import HEIGHT, WIDTH, clamp, loop, named, readers_of_window, weight
from .fft import (
    OUT,
    PAIRS,
    POINTS,
    PRODUCTS,
    REACH,
    SUMMED,
    TILE,
    Transformed,
    centred,
    line,
)
from .straight import LARGEST_WEIGHTS, VECTOR, ZERO, Straight, variables

HALF = 16
"""Neurons that share complex images with as many others."""

TILES, IMAGES = 4, 8
"""Tiles, and complex images of two neurons each, whose products an item computes: 32 sums of four numbers."""

COMPLEX = tree.FLOAT.of(2)
"""A complex number in memory of the device."""

Path = tuple[str, tree.Expr, tree.Expr]
"""A line of an array: its name, the first place, and how far places are apart."""

FIRST_TILE, TILE_COUNT = map(name, BATCH)
ACROSS, ITEM, PAIR, K, F = map(name, ("across", "line", "pair", "k", "f"))
FREQUENCIES, MIRRORED, BLOCK = map(name, ("FREQUENCIES", "MIRRORED", "BLOCK"))


def used(kernel: tree.Kernel, launch: tree.Launch) -> list[str]:
    """Return the arrays that a launch reads or writes, those of the kernel first."""
    found = {name for name, _ in tree.accesses(launch.body)}
    arrays = (*(array.name for array in kernel.interface.arrays), *handed_on(kernel))
    return [name for name in arrays if name in found]


class FourierPasses(Transformed, Straight):
    """Tiles of `points` x `points` pixels, one launch after another."""

    idea = "the sums over the window by FFT, in passes: an item is a line, a frequency or a pixel of a tile"
    order = (
        "the spectrum of the matrix that reads the window: columns of frequencies 0 to points / 2, groups "
        "of 32 neurons, rows of frequencies, pairs of channels, (real, imaginary) of the first and of the "
        "second channel, neurons; weights of the layers after it are constants of the source"
    )

    instead = "group:4"
    lanes = HALF
    tiles = 1

    def constants(self) -> list[tree.Constant]:
        """Return the sizes of tiles and transforms."""
        s = self.sizes
        return self.window() + named(
            POINTS=(self.points, REACH),
            OUT=(POINTS - self.rows + 1, "rows and columns of a tile's pixels"),
            PAIRS=(s.pairs, "of channels"),
            BLOCK=(s.block, SUMMED),
            IMAGES=(s.neurons * HALF, "complex ones, of two neurons each"),
            FREQUENCIES=((POINTS // 2 - 1) * POINTS, "in columns that are not their own mirror images"),
            MIRRORED=(POINTS // 2 + 1, "in each of the two columns that are"),
        )

    def built(self) -> tree.Kernel:
        """Return the kernel."""
        constants, images = self.constants(), name("IMAGES")
        spectrum, back = PAIRS * POINTS * POINTS, images * POINTS * POINTS
        arrays = [  # in the order of a manifest's keys, which is that of bindings
            ("back", images * OUT * POINTS), ("columns", spectrum), ("products", back), ("rows", spectrum),
            ("sums", images * OUT * OUT),
        ]  # fmt: skip
        own, kept = (ITEM // POINTS * (lines * POINTS) + ITEM % POINTS for lines in (POINTS, OUT))
        row = ITEM % OUT * OUT * images + ITEM // OUT
        body: list[tree.Statement] = [
            *(tree.Array(key, COMPLEX, (TILE_COUNT * count,), "device") for key, count in arrays),
            tree.Comment("rows of the images around the tiles, transformed"),
            self.launch(POINTS, *self.forward_rows()),
            tree.Comment("columns, transformed"),
            self.launch(PAIRS * POINTS, *self.turned(("rows", own, POINTS), ("columns", own, POINTS), -1)),
            tree.Comment("products with the weights' spectra, at each frequency and at its mirror image"),
            tree.Launch(
                ("tile", "line"),
                (TILE_COUNT // TILES, (FREQUENCIES + 2 * MIRRORED) * (self.sizes.neurons * HALF // IMAGES)),
                tuple(self.products()),
            ),
            tree.Comment("columns, transformed back"),
            self.launch(images * POINTS, *self.turned(("products", own, POINTS), ("back", kept, POINTS), 1)),
            tree.Comment("rows, transformed back"),
            self.launch(
                images * OUT, *self.turned(("back", ITEM * POINTS, const(1)), ("sums", row, images), 1)
            ),
            tree.Comment("the other layers, pixel by pixel"),
            self.launch(OUT * OUT, *self.layers()),
        ]
        across, down = ((size + OUT - 1) // OUT for size in (WIDTH, HEIGHT))
        tiles = (across * down + (TILES - 1)) // TILES * TILES
        more = {"functions": self.functions(), "step": (OUT, OUT), "batch": tiles}
        return self.assembled(body, constants, **more, weights=VECTOR)

    def launch(self, count: tree.Expr, *body: tree.Statement) -> tree.Launch:
        """Return a launch of so many items for each tile."""
        return tree.Launch(("tile", "line"), (TILE_COUNT, count), body)

    def corner(self) -> list[tree.Statement]:
        """Return the first pixel of a tile."""
        return [
            tree.Let("number", FIRST_TILE + TILE),
            tree.Let("across", (WIDTH + OUT - 1) // OUT),
            tree.Let("tile_x", name("number") % ACROSS * OUT),
            tree.Let("tile_y", name("number") // ACROSS * OUT),
        ]

    def put(self, array: str, place: tree.Expr, parts: Sequence[tree.Expr]) -> tree.Store:
        """Return the statement that writes a complex number."""
        return tree.Store(array, (place * TILE_COUNT + TILE,), stack(list(parts)))

    # ---- transforms --------------------------------------------------------------------------------------

    def forward_rows(self) -> list[tree.Statement]:
        """Return the gathering of a row of all channels, and its transformation pair by pair."""
        lines: list[tree.Statement] = [
            tree.Let("left", name("tile_x") + name("dx") - self.middle),
            *self.column(name("top"), name("left")),
        ]
        values = centred(self, self.centres)
        values += [const(0.0)] * (2 * self.sizes.pairs - len(values))
        for channel, value in enumerate(values):
            part, pair = divmod(channel, self.sizes.pairs)
            lines.append(tree.Store("gathered", ((pair * POINTS + name("dx")) * 2 + part,), value))
        places = ((PAIR * POINTS + dx) * 2 for dx in range(self.points))
        inputs = [(load("gathered", at), load("gathered", at + 1)) for at in places]
        lets, found = line(inputs, self.points, -1)
        puts = [self.put("rows", (PAIR * POINTS + ITEM) * POINTS + k, parts) for k, parts in enumerate(found)]
        return [
            *self.corner(),
            tree.Let("top", name("tile_y") + ITEM - self.row),
            tree.Let("row", clamp(name("top"), HEIGHT)),
            tree.Array("gathered", tree.FLOAT, (PAIRS * POINTS * 2,), kept=True),
            loop("dx", POINTS, *lines),
            loop("pair", PAIRS, *lets, *puts),
        ]

    def turned(self, source: Path, result: Path, sign: int) -> list[tree.Statement]:
        """Return the transformation of a line: arrays, first place and step of what is read and written."""
        (array, start, step), (into, to, leap) = source, result
        reads: list[tree.Statement] = [tree.Let("first", start), tree.Let("to", to)]
        parts = []
        for n in range(self.points):
            at = (name("first") + step * n) * TILE_COUNT + TILE
            reads.append(tree.Let(f"z{n}", load(array, at, kind=COMPLEX)))
            parts.append((name(f"z{n}", COMPLEX).lane(0), name(f"z{n}", COMPLEX).lane(1)))
        lets, found = line(parts, self.points if sign < 0 else self.sizes.out, sign)
        return [*reads, *lets, *(self.put(into, name("to") + leap * n, z) for n, z in enumerate(found))]

    # ---- products ----------------------------------------------------------------------------------------

    def products(self) -> list[tree.Statement]:
        """Return the products of one frequency, and of its mirror image: some neurons of some tiles.

        A weight is read once for all tiles, a number of a spectrum once for all neurons.
        """
        number, of = name("number"), self.sizes.neurons * HALF // IMAGES
        own = apply("less", number, FREQUENCIES)
        found: list[tree.Statement] = [
            tree.Let("number", ITEM // of),
            tree.Let("group", ITEM % of),
            tree.Let("rest", apply("maximum", number - FREQUENCIES, const(0))),
            tree.Let(
                "k", apply("select", own, number // POINTS + 1, name("rest") // MIRRORED * (POINTS // 2))
            ),
            tree.Let("f", apply("select", own, number % POINTS, name("rest") % MIRRORED)),
            tree.Let("here", F * POINTS + K),
            tree.Let("there", (POINTS - F) % POINTS * POINTS + (POINTS - K) % POINTS),
        ]
        sums = [f"{part}_{t}_{v}" for part in PRODUCTS for t in range(TILES) for v in range(IMAGES // 2)]
        zero = variables(sums, ZERO)
        lines = [tree.Let("own", BLOCK * name("block") + PAIR), *self.both_spectra()]
        lines += [tree.Block(tuple(self.weighted(v))) for v in range(IMAGES // 2)]
        adds = [tree.Store(f"whole_{each}", (), name(each, VECTOR), add=True) for each in sums]
        found += variables([f"whole_{each}" for each in sums], ZERO)
        found.append(loop("block", PAIRS // BLOCK, *zero, loop("pair", BLOCK, *lines), *adds))
        for t, n in product(range(TILES), range(IMAGES)):
            (a, c), (b, d) = (
                [name(f"whole_{part}_{t}_{v}", VECTOR).lane(n % 4) for v in (n // 4, (n + IMAGES) // 4)]
                for part in PRODUCTS
            )
            image = (name("group") * IMAGES + n) * (POINTS * POINTS)
            for place, pair in {"here": (a - d, b + c), "there": (a + d, c - b)}.items():
                at = (image + name(place)) * TILE_COUNT + self.tile(t)
                found.append(tree.Store("products", (at,), stack(pair)))
        return found

    def tile(self, t: int) -> tree.Expr:
        """Return the tile with this number of an item's: those of neighbouring items are neighbours."""
        return TILE + TILE_COUNT // TILES * t

    def both_spectra(self) -> list[tree.Statement]:
        """Return the spectra of both channels of a pair, of all tiles."""
        found: list[tree.Statement] = []
        for t in range(TILES):
            z = []
            for place in ("here", "there"):
                at = (name("own") * (POINTS * POINTS) + name(place)) * TILE_COUNT + self.tile(t)
                found.append(tree.Let(f"{place}_{t}", load("columns", at, kind=COMPLEX)))
                z.append(name(f"{place}_{t}", COMPLEX))
            (a, b), (c, d) = ([each.lane(0), each.lane(1)] for each in z)
            both = (a + c, b - d, b + d, c - a)
            found += [tree.Let(f"{n}_{t}", value, kept=True) for n, value in zip("abcd", both, strict=True)]
        (layer,) = readers_of_window(self.program)
        first = self.offset(layer["weight"]) // 4
        at = ((K * self.sizes.neurons + name("group") // (HALF // IMAGES)) * POINTS + F) * PAIRS + name("own")
        return [
            *found,
            tree.Let("at", first + at * (2 * HALF) + name("group") % (HALF // IMAGES) * (IMAGES // 4)),
        ]

    def weighted(self, v: int) -> list[tree.Statement]:
        """Return the products of four neurons' weights with each tile's spectra."""
        half, own = divmod(v, IMAGES // 4)
        at = name("at") + (half * (HALF // 4) + own)
        lines: list[tree.Statement] = [
            tree.Let(f"w{j}", weight(at + j * (2 * HALF // 4), VECTOR)) for j in range(4)
        ]
        for t, (part, terms) in product(range(TILES), PRODUCTS.items()):
            for sign, j, value in terms:
                found = self.product(name(f"w{j}", VECTOR), name(f"{value}_{t}", tree.FLOAT))
                found = found if sign == "+" else apply("negative", found)
                lines.append(tree.Store(f"{part}_{t}_{v}", (), found, add=True))
        return lines

    # ---- layers ------------------------------------------------------------------------------------------

    def layers(self) -> list[tree.Statement]:
        """Return the layers after the first one's sums, for one pixel."""
        x, y = name("tile_x") + ITEM % OUT, name("tile_y") + ITEM // OUT
        found: list[tree.Statement] = [*self.corner(), tree.Let("column", x), tree.Let("row", y)]
        write = tuple(self.output(name("row"), name("column")))
        inside = (name("column") < WIDTH) & (name("row") < HEIGHT)
        return [*found, *self.all_groups(), self.output_comment(), tree.If(inside, write)]

    def of_window(self, index: int, node: Node) -> list[tree.Statement]:
        """Return the sums over the window, which are in memory."""
        found: list[tree.Statement] = []
        start = ITEM * name("IMAGES")
        for j in range(self.vectors(index)):
            group, of = divmod(j, 2 * HALF // 4)
            part, vector = divmod(of, HALF // 4)
            numbers = [group * HALF + vector * 4 + n for n in range(4)]
            reads = [load("sums", (start + n) * TILE_COUNT + TILE, kind=COMPLEX).lane(part) for n in numbers]
            found.append(tree.Store(self.variable(f"v{index}", 0, j), (), stack(reads), add=True))
        return found

    def refusal(self, program: Program) -> str:
        """Return why this schedule cannot hold the program, or nothing."""
        if reason := super().refusal(program):
            return reason
        count = sum(a.size for key, a in weights(program).items() if key not in self.stored(program))
        if count > LARGEST_WEIGHTS:
            return f"its layers have {count} weights, of at most {LARGEST_WEIGHTS}"
        return ""

    def build(self, program: Program) -> tree.Kernel:
        """Return the kernel of a program."""
        return super().build(self.held(program))

    def stored(self, program: Program) -> Mapping[str, NDArray[np.float32]]:
        """Return the weights outside the source as they are stored: the first layer's spectra and bias."""
        (layer,) = readers_of_window(program)
        own = [str(layer[key]) for key in ("weight", "bias") if layer.get(key)]
        return {key: array for key, array in super().stored(program).items() if key in own}

    def details(self, program: Program) -> Mapping[str, Any]:
        """Return what is launched, the numbers of each array for a tile, and the items of a group."""
        kernel = self.kernel(program)
        launches = []
        for each in kernel.launches:
            tiles, lines = (of_tile(kernel, count, TILES) for count in each.counts)
            launches.append({"tiles": TILES // tiles, "lines": lines})
        return {
            "launches": launches,
            "entries": [self.dialect.launch_entry(number) for number in range(len(launches))],
            "arrays": [used(kernel, each) for each in kernel.launches],
            "memory": handed_on(kernel),
            "items": ITEMS,
        }
