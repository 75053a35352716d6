"""The FFT schedule: sums over the window as products of spectra, tile by tile; then the tiled schedule.

1. A work item computes `tiles` tiles side by side, each of OUT x OUT pixels, OUT = POINTS - WINDOW_SIZE + 1:
   those whose windows lie in POINTS x POINTS pixels of the images (overlap-save: what wraps around is not
   computed). Its patch is gathered row by row, under the border rule [`Fourier.rows_forward`].
2. Two channels are one complex image, and a vector holds such pairs of all tiles: `LANES` transforms at once,
   none of which needs a shuffle. Rows are transformed as they come, columns when they are needed.
3. A column k and its mirror image -k give both channels' spectra; each is multiplied with the spectra of the
   neurons' weights and summed over channels, with all tiles' sums in registers [`Fourier.products`].
4. The sums of neurons j and j + LANES are one complex image again: one inverse transform of the columns, of
   whose rows OUT are kept, and one of each row give both.
5. What a row of all tiles gives goes through the other layers as in the tiled schedule, PIXELS at a time.

The transforms are functions of the kernel, traced from `fourier.transform` [`line`]. Weights are
transformed when they are packed, in float64 [`fourier.spectrum`]. The bound is that of fourier.py.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..core.ir import Node, Program, Type
from ..core.passes import pipeline
from ..core.profiles import SineContract
from ..core.trace import trace
from ..core.weights import Slot
from ..kernel import kernel as tree
from ..kernel.kernel import apply, const, load, name
from ..proof import bounds
from ..proof.bounds import Enclosure
from ..proof.spectra import Spectra
from . import fourier
from .common import (
    HEIGHT,
    WIDTH,
    Nest,
    clamp,
    fused,
    kernel_gather,
    lets,
    loop,
    named,
    readers_of_window,
    weight,
)
from .schedules import ALL, Images, Stored, windows
from .tile import BLOCK, COUNTER, LANES, PIXELS, P, Tile, all_stored

PARTS = 2
"""Values of a complex one: its real and its imaginary part."""

POINTS, OUT, TILES, PAIRS, INPUTS, NEURONS, STRIDE = map(
    name, ("POINTS", "OUT", "TILES", "PAIRS", "INPUTS", "NEURONS", "STRIDE")
)
OF_BLOCK, PIXEL_BLOCK = name("BLOCK"), name("b")
"""Pairs of channels whose products are added up by themselves."""

TILE, TILE_X, TILE_Y, K, F, G, Q, T, APART, LINE = map(
    name, ("tile", "tile_x", "tile_y", "k", "f", "g", "q", "t", "apart", "line")
)
STEP, LEAP = name("step"), name("leap")

REACH = "rows and columns of a tile with what its windows reach"
"""What kernels say of the points of a transform."""

SUMMED = "pairs whose products are added up by themselves"
"""The same of the pairs of a block."""

PRODUCTS = {
    "real": (("+", 0, "a"), ("-", 1, "b"), ("+", 2, "c"), ("-", 3, "d")),
    "imaginary": (("+", 1, "a"), ("+", 0, "b"), ("+", 3, "c"), ("+", 2, "d")),
}
"""What each part adds up: sign, two vectors of weights, and part of a pair's spectra a + i b and c + i d."""


@dataclass(frozen=True)
class Sizes:
    """Channel pairs, vectors that hold all tiles' pairs, pairs of neuron vectors, rows of a tile.

    `block`: pairs of channels whose products are added up by themselves.
    """

    pairs: int
    inputs: int
    neurons: int
    out: int
    block: int


def sizes_of(program: Program, lanes: int, points: int, tiles: int) -> Sizes:
    """Return the sizes of a program's kernel."""
    gather, (layer,) = kernel_gather(program), readers_of_window(program)
    pairs = -(-gather.channels // 2)
    neurons = -(-layer.type.shape[0] // (2 * lanes))
    return Sizes(
        pairs, -(-tiles * pairs // lanes), neurons, points - gather.rows + 1, fourier.block_of(pairs)
    )


# ---- transforms ------------------------------------------------------------------------------------------


def line(
    inputs: Sequence[tuple[tree.Expr, tree.Expr]], kept: int, sign: int
) -> tuple[list[tree.Let], list[tuple[tree.Expr, tree.Expr]]]:
    """Return the statements that transform complex values, and the first `kept` of what they give."""
    given = {f"t{number}": part for number, part in enumerate(chain(*inputs))}

    def transformed(*parts: Any) -> dict[str, Any]:
        found = fourier.transform(list(zip(parts[::2], parts[1::2], strict=True)), sign)[:kept]
        return {f"y{number}": part for number, part in enumerate(chain(*found))}

    program = pipeline.run(trace(transformed, dict.fromkeys(given, Type())), ("eliminate_dead",))
    statements, values = lets(program, lanes=inputs[0][0].type.lanes)
    outputs = [values[f"y{number}"] for number in range(2 * kept)]
    reads = [tree.Let(name, value) for name, value in given.items()]
    made = fused([s for s in statements if isinstance(s, tree.Let)], [each.value for each in outputs])
    return [*reads, *made], list(zip(outputs[::2], outputs[1::2], strict=True))


def codelet(title: str, points: int, kept: int, sign: int, kind: tree.Type) -> tree.Function:
    """Return the function that transforms `points` complex values and keeps the first `kept`."""
    places = [(STEP * (PARTS * k), STEP * (PARTS * k) + 1) for k in range(points)]
    made, found = line(
        [(load("from", a, kind=kind), load("from", b, kind=kind)) for a, b in places], kept, sign
    )
    stores = [
        tree.Store("to", (LEAP * (PARTS * k) + i,), part)
        for k, number in enumerate(found)
        for i, part in enumerate(number)
    ]
    return tree.Function(title, (("from", kind), ("to", kind)), (*made, *stores))


# ---- statements ------------------------------------------------------------------------------------------


def centred(nest: Nest, centres: Sequence[float]) -> list[tree.Expr]:
    """Return the channels of a pixel of all images, each without its centre."""
    values = [nest.pixel(image, c) for image in nest.gather.images for c in range(image.channels)]
    return [value - const(middle) if middle else value for value, middle in zip(values, centres, strict=True)]


COST = 3.0
"""Times that an operation of a transform takes of one of the direct sum: 2.6, as measured on an AMD EPYC with
tiles of 32; most of its operands are loaded and stored."""


class Transformed(Stored):
    """Tiles of `points` x `points` pixels, `tiles` side by side: what all schedules of transforms share."""

    lanes: int
    points: int
    tiles: int

    def begin(self, program: Program, slots: Mapping[str, Slot]) -> None:
        """Take a program, whose weights are in these slots."""
        super().begin(program, slots)
        self.sizes = sizes_of(program, self.lanes, self.points, self.tiles)
        self.centres = fourier.arrangement(program, self.lanes).centres

    def stored(self, program: Program) -> Mapping[str, NDArray[np.float32]]:
        """Return all weights as they are stored, by name: of the matrix that reads the window its spectra.

        Those are columns, groups, rows, pairs, channels, parts and neurons.
        """
        (layer,), lanes, points = readers_of_window(program), self.lanes, self.points
        s = sizes_of(program, lanes, points, self.tiles)
        columns = points // 2 + 1
        matrix = program.parameters[str(layer["weight"])].astype(np.float64)
        spectra = fourier.spectrum(matrix, kernel_gather(program).rows, points)[:, :, :columns]
        spectra = spectra.transpose(2, 1, 3, 0)
        # Frequencies that are their own negatives have real spectra; float64 leaves some 2^-53 there.
        spectra[:: points // 2, :: points // 2] = spectra[:: points // 2, :: points // 2].real
        filled = np.zeros((columns, points, 2 * s.pairs, s.neurons * 2 * lanes), np.complex128)
        filled[:, :, : spectra.shape[2], : spectra.shape[3]] = spectra
        # Channel j of the first half and channel j of the second are a pair.
        split = filled.reshape(columns, points, 2, s.pairs, s.neurons, 2 * lanes).transpose(0, 4, 1, 3, 2, 5)
        both = np.stack([split.real, split.imag], axis=5).astype(np.float32)
        return {**all_stored(program, lanes, 2), str(layer["weight"]): both}

    def held(self, program: Program) -> Program:
        """Return the program whose parameters are what the kernel holds, before transforms."""
        found = fourier.arrangement(program, self.lanes)
        return found.centred(found.moved(program))

    def pack(self, program: Program) -> NDArray[np.float32]:
        """Return the weights (count,) as `layout` places them, the neurons of the first layer in order."""
        return super().pack(self.held(program))

    def coded(self, program: Program, parameters: Mapping[str, NDArray[np.float32]]) -> NDArray[np.float32]:
        """Return other numbers in the places of the weights; 0 for those that the kernel does not hold."""
        found = fourier.arrangement(program, self.lanes)
        own = [found.weight, *([found.bias] if found.bias and any(found.centres) else [])]
        lost = {name: np.zeros_like(parameters[name]) for name in own}
        return super().pack(found.moved(replace(program, parameters={**parameters, **lost})))

    def spectra(self, program: Program) -> Spectra:
        """Return how the sums over the window are computed, for their bound."""
        (layer,), found = readers_of_window(program), fourier.arrangement(program, self.lanes)
        gather, count = kernel_gather(program), layer.type.shape[0]
        held = found.centred(found.moved(program))
        # Columns, groups, rows, pairs, halves, parts and places of neurons.
        stored = self.stored(held)[found.weight].astype(np.float64)
        placed = stored[..., 0, :] + 1j * stored[..., 1, :]
        placed = placed.transpose(1, 5, 2, 0, 4, 3).reshape(
            -1, self.points, self.points // 2 + 1, *placed.shape[3:5]
        )
        placed = placed.reshape(*placed.shape[:3], -1)[:count, ..., : gather.channels]
        table, bias = np.empty_like(placed), np.zeros(count)
        table[found.order] = 2 * self.points * placed
        if found.bias is not None:
            bias[found.order] = held.parameters[found.bias]
        block, centres = fourier.block_of(-(-gather.channels // 2)), np.array(found.centres)
        return Spectra(self.points, gather.rows, found.order, self.lanes, block, centres, table, bias)

    def enclosures(
        self, program: Program, sine: SineContract, images: Images | None = None, rows: slice = ALL
    ) -> list[Enclosure]:
        """Return the enclosure of every node: the sums over the window are those of spectra."""
        gather, of = kernel_gather(program), self.spectra(program)
        if images is None:
            norm = np.array(self.points * np.linalg.norm(fourier.radius(gather, of.centres)))
            return fourier.enclose(program, sine, bounds.window_box(gather), norm, of)
        found = windows(gather, images, rows)
        joined = np.concatenate([images[image.name] for image in gather.images], axis=-1, dtype=np.float64)
        norms = fourier.tile_norms(joined, gather.window, self.points, of.centres)[rows]
        return fourier.enclose(program, sine, (found, found), norms, of)

    def refusal(self, program: Program) -> str:
        """Return why this schedule cannot hold the program, or nothing."""
        gather, readers = kernel_gather(program), readers_of_window(program)
        if gather.whole:
            return "sums from spectra are rounded, those of integers are not"
        if reason := Stored.refusal(self, program):
            return reason
        if len(readers) != 1:
            return f"{len(readers)} affine maps read the window, not one"
        if gather.axes != (0, 1) or gather.rows >= self.points:
            return f"a window of {gather.rows} x {gather.columns} pixels in a tile of {self.points}"
        names = [node["weight"] for node in program.nodes if node.op == "affine"]
        if names.count(readers[0]["weight"]) != 1:
            return "a matrix is applied to the window and to a layer"
        if reason := self.beyond_stack(program):
            return reason
        direct, spectra = self.operations(program)
        if COST * spectra > direct:
            return f"the direct sum takes {direct:.0f} operations on vectors a pixel, spectra {spectra:.0f}"
        return ""

    def operations(self, program: Program) -> tuple[float, float]:
        """Return the operations on vectors, per pixel, of the direct sum over the window and of this one."""
        (layer,), n = readers_of_window(program), self.points
        s = sizes_of(program, self.lanes, n, self.tiles)
        direct = kernel_gather(program).n_inputs * -(-layer.type.shape[0] // self.lanes)
        products = (n // 2 + 1) * n * s.pairs * 16 * self.tiles * s.neurons
        # The split-radix algorithm takes 4 n log2(n) - 6 n + 8 operations.
        one = 4 * n * (n.bit_length() - 1) - 6 * n + 8
        transforms = s.inputs * (2 * n + 2) + self.tiles * s.neurons * (n + s.out)
        return direct, (products + one * transforms) / (self.tiles * s.out**2)


class Fourier(Transformed, Tile):
    """Tiles whose transforms an item computes in its own memory."""

    order = (
        "vectors filled up with zeros; the spectrum of the matrix that reads the window: columns of "
        "frequencies 0 to points / 2, pairs of vectors of neurons, rows of frequencies, pairs of channels, "
        "(real, imaginary) of the first and of the second channel, two vectors of neurons; other "
        "matrices block by block of neurons: blocks x D_in x neurons"
    )

    def constants(self) -> list[tree.Constant]:
        """Return the sizes of tiles and transforms."""
        s = self.sizes
        return self.window() + named(
            POINTS=(self.points, REACH),
            OUT=(POINTS - self.rows + 1, "rows and columns of a tile's pixels"),
            TILES=(self.tiles, "neighbours in a row that a work item computes"),
            PIXELS=(self.pixels, "pixels of a row that go through the layers together"),
            LANES=(self.lanes, "components of a vector"),
            PAIRS=(s.pairs, "of channels"),
            BLOCK=(s.block, SUMMED),
            INPUTS=(s.inputs, "vectors that hold the pairs of all tiles"),
            NEURONS=(s.neurons, "pairs of vectors of neurons"),
            STRIDE=(2 * (POINTS + 1), "vectors from row to row: not a multiple of 4096 bytes"),
        )

    def built(self) -> tree.Kernel:
        """Return the kernel."""
        constants = self.constants()
        body: list[tree.Statement] = [*self.rows_forward(), *self.columns_of_frequencies(), *self.layers()]
        functions = (
            codelet("forward", self.points, self.points, -1, self.vector),
            codelet("backward", self.points, self.sizes.out, 1, self.vector),
        )
        more = {"functions": functions, "step": (TILES * OUT, OUT), "place": ("tile_x", "tile_y")}
        return self.assembled(body, constants, **more, weights=self.vector)

    def rows_forward(self) -> list[tree.Statement]:
        """Return the gathering and transformation of rows."""
        top, left = map(name, ("top", "left"))
        lines: list[tree.Statement] = [
            tree.Let("left", TILE_X + TILE * OUT + name("dx") - self.middle),
            *self.column(top, left),
        ]
        for number, value in enumerate(centred(self, self.centres)):
            part, pair = divmod(number, self.sizes.pairs)
            lane, at = TILE * PAIRS + pair, name("dx") * 2 + part
            place = (lane // LANES * POINTS * 2 + at) * LANES + lane % LANES
            lines.append(tree.Store("gathered", (place,), value))
        start, count = COUNTER * POINTS * 2, INPUTS * POINTS * 2
        to = tree.View("rows", ((COUNTER * POINTS + name("dy")) * STRIDE,))
        call = tree.Call("forward", (tree.View("gathered", (start,)), to))
        gather = loop("tile", TILES, loop("dx", POINTS, *lines))
        return [
            tree.Comment("rows of the images around the tiles, transformed"),
            tree.Array("gathered", self.vector, (count,)),
            tree.Array("rows", self.vector, (INPUTS * POINTS * STRIDE,)),
            loop("i", count, tree.Store("gathered", (COUNTER,), self.zero)),
            loop(
                "dy",
                POINTS,
                tree.Let("top", TILE_Y + name("dy") - self.row),
                tree.Let("row", clamp(top, HEIGHT)),
                gather,
                loop("i", INPUTS, call),
            ),
        ]

    def columns_of_frequencies(self) -> list[tree.Statement]:
        """Return the loop over columns of frequencies: forward, products with the weights, back."""
        vector, opposite = self.vector, name("opposite")
        row, back = COUNTER * POINTS * STRIDE, (TILE * NEURONS + Q) * OUT * STRIDE
        forward, backward = [], []
        for n, k in enumerate((K, opposite)):
            source = tree.View("rows", (row + 2 * k,), POINTS + 1)
            forward.append(tree.Call("forward", (source, tree.View("columns", (const(n), const(0))))))
            into = tree.View("back", (back + 2 * k,), POINTS + 1)
            backward.append(tree.Call("backward", (tree.View("product", (TILE * 2 + n, const(0))), into)))
        a, b = (load("columns", const(0), 2 * F + part, kind=vector) for part in (0, 1))
        c, d = (load("columns", APART, 2 * G + part, kind=vector) for part in (0, 1))
        lets = [tree.Let(n, value) for n, value in zip("abcd", (a, b, c, d), strict=True)]
        a, b, c, d = (name(n, vector) for n in "abcd")
        both = (a + c, b - d, b + d, c - a)
        place = (COUNTER * POINTS + F) * 4
        stores = [tree.Store("spectra", (place + n,), value) for n, value in enumerate(both)]
        unpack = loop("f", POINTS, tree.Let("g", (POINTS - F) % POINTS), *lets, *stores)
        mirrored = apply("not_equal", opposite, K)
        # A column that is its own mirror image is mirrored, not computed twice: both parts of each complex
        # image stay apart to the bit.
        return [
            tree.Comment("columns: transformed, multiplied with the weights' spectra, transformed back"),
            tree.Array("columns", vector, (2, POINTS * 2)),
            tree.Array("spectra", vector, (INPUTS * POINTS * 4,)),
            tree.Array("product", vector, (TILES * 2, POINTS * 2)),
            tree.Array("back", vector, (TILES * NEURONS * OUT * STRIDE,)),
            loop(
                "k",
                POINTS // 2 + 1,
                tree.Let("opposite", (POINTS - K) % POINTS),
                tree.Let("apart", apply("select", mirrored, const(1), const(0))),
                loop("i", INPUTS, forward[0], tree.If(mirrored, (forward[1],)), unpack),
                loop(
                    "q",
                    NEURONS,
                    loop("f", POINTS, *self.products()),
                    loop("tile", TILES, backward[0], tree.If(mirrored, (backward[1],))),
                ),
            ),
        ]

    def products(self) -> list[tree.Statement]:
        """Return the products of a column of frequencies for all tiles."""
        split = self.sizes.block < self.sizes.pairs
        pair = BLOCK * OF_BLOCK + name("pair") if split else name("pair")
        (layer,) = readers_of_window(self.program)
        first = self.offset(layer["weight"]) // self.lanes
        at = first + (((K * NEURONS + Q) * POINTS + F) * PAIRS + pair) * 8
        weights = [tree.Let(f"w{j}", weight(at + j, self.vector)) for j in range(8)]
        lane = T * PAIRS + pair
        place = (lane // LANES * POINTS + F) * 4 * LANES + lane % LANES
        lines: list[tree.Statement] = [
            tree.Let("at", place),
            *(tree.Let(n, load("spectra", name("at") + LANES * k)) for k, n in enumerate("abcd")),
        ]
        for v in range(2):
            for part, terms in PRODUCTS.items():
                for sign, number, value in terms:
                    product = self.product(name(f"w{2 * number + v}", self.vector), name(value, tree.FLOAT))
                    product = product if sign == "+" else apply("negative", product)
                    lines.append(tree.Store(part, (T, const(v)), product, add=True))
        names = ("real", "imaginary")
        sums: list[tree.Statement] = [loop("pair", OF_BLOCK, *weights, self.each_tile(lines))]
        whole = names
        if split:
            whole = ("whole_real", "whole_imaginary")
            adds: list[tree.Statement] = [
                tree.Store(total, (T, const(v)), load(part, T, const(v), kind=self.vector), add=True)
                for total, part in zip(whole, names, strict=True)
                for v in range(2)
            ]
            sums = [loop("block", PAIRS // OF_BLOCK, *self.zeros(names), *sums, self.each_tile(adds))]
        (a, c), (b, d) = ([load(part, T, const(v), kind=self.vector) for v in range(2)] for part in whole)
        ends = (
            (T * 2, 2 * F, a - d),
            (T * 2, 2 * F + 1, b + c),
            (T * 2 + APART, 2 * G, a + d),
            (T * 2 + APART, 2 * G + 1, c - b),
        )
        stores = self.each_tile([tree.Store("product", (image, at), value) for image, at, value in ends])
        return [*self.zeros(whole), *sums, tree.Let("g", (POINTS - F) % POINTS), stores]

    def zeros(self, names: tuple[str, ...]) -> list[tree.Statement]:
        """Return the sums of all tiles, which start with zeros."""
        zeros = [tree.Store(part, (T, const(v)), self.zero) for part in names for v in range(2)]
        arrays = (tree.Array(part, self.vector, (TILES, 2), register=True) for part in names)
        return [*arrays, self.each_tile(zeros)]

    def each_tile(self, lines: Sequence[tree.Statement]) -> tree.For:
        """Return a loop over tiles that keeps each tile's sums in registers of their own."""
        return tree.For("t", TILES, tuple(lines), "unroll")

    def layers(self) -> list[tree.Statement]:
        """Return the rows back, and the other layers for blocks of pixels."""
        of_row = self.tiles * self.sizes.out
        blocks = -(-of_row // self.pixels)
        found: list[tree.Statement] = [
            tree.Comment("rows back, and the other layers"),
            tree.Array("sums", self.vector, (blocks * PIXELS * NEURONS * 2,)),
        ]
        if blocks * self.pixels > of_row:
            # The last block reaches beyond the tiles: its values there are read, and none is written.
            beyond = (blocks * PIXELS - TILES * OUT) * NEURONS * 2
            found.append(
                loop("i", beyond, tree.Store("sums", (TILES * OUT * NEURONS * 2 + COUNTER,), self.zero))
            )
        at = (TILE // NEURONS * OUT * NEURONS + TILE % NEURONS) * 2
        views = tree.View("back", ((TILE * OUT + LINE) * STRIDE,)), tree.View("sums", (at,), NEURONS)
        rows = loop("tile", TILES * NEURONS, tree.Call("backward", views))
        lines: list[tree.Statement] = [
            tree.Let("x", TILE_X + PIXEL_BLOCK * PIXELS),
            tree.Let("last", apply("minimum", TILE_X + TILES * OUT, WIDTH)),
        ]
        lines += [*self.all_groups(), *self.outputs(name("last"))]
        body = (rows, tree.Let("y", TILE_Y + LINE), loop("b", blocks, *lines))
        return [*found, tree.For("line", OUT, body, until=TILE_Y + LINE < HEIGHT)]

    def affine(self, index: int, node: Node) -> list[tree.Statement]:
        """Return the copy of the sums of a block of pixels, or what the tiled schedule does."""
        if self.program.nodes[node.args[0]].op != "input":
            return super().affine(index, node)
        bias, total = node.get("bias"), self.total(index)
        lines = []
        for j in range(total):
            value = load("sums", (PIXEL_BLOCK * PIXELS + P) * NEURONS * 2 + j, kind=self.vector)
            if bias:
                value = value + weight(self.offset(bias) // self.lanes + j, self.vector)
            lines.append(tree.Store(f"v{index}", (P * total + j,), value))
        said = tree.Comment(f"%{index}: the sums, and their bias")
        return [said, self.array(index), loop("p", PIXELS, *lines)]
