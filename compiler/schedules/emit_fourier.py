"""The Fourier schedule: sums over the window as products of spectra, tile by tile; then the tiled schedule.

1. A work item computes `tiles` tiles side by side, each of OUT x OUT pixels, OUT = POINTS - WINDOW_SIZE + 1:
   those whose windows lie in POINTS x POINTS pixels of the images (overlap-save: what wraps around is not
   computed). Its patch is gathered row by row, under the border rule [`FourierBody._rows_forward`].
2. Two channels are one complex number, and a vector holds such pairs of all tiles: `LANES` transforms at
   once, none of which needs a shuffle. Rows are transformed as they come, columns when they are needed.
3. A column k and its mirror image -k give both channels' spectra; each is multiplied with the spectra of the
   neurons' weights and summed over channels, with all tiles' sums in registers [`_products`].
4. The sums of neurons j and j + LANES are one complex number again: one inverse transform of the columns, of
   whose rows OUT are kept, and one of each row give both [`_column_back`].
5. What a row of all tiles gives goes through the other layers as in the tiled schedule, PIXELS at a time.

The transforms are functions of the source, written by `fourier.transform` on names [`codelet`]. Weights are
transformed when they are packed, in float64 [`fourier.spectrum`]. The bound is that of fourier.py.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from ..core.ir import Node, Program
from ..core.profiles import SineContract
from ..languages.dialect import Dialect
from ..languages.fourier_dialect import FourierDialect
from ..proof import bounds
from ..proof.bounds import Enclosure
from ..proof.spectra import Spectra
from . import fourier
from .emit import kernel_gather
from .emit_tiled import LARGEST_PRIVATE, Tiled, TiledBody, readers_of_window, refused_by_vectors
from .schedules import ALL, Images, windows

COST = 3.0
"""Times that an operation of a transform takes of one of the direct sum: 2.6, as measured on an AMD EPYC with
tiles of 32; most of its operands are loaded and stored."""

PARTS = 2
"""Numbers of a complex one: its real and its imaginary part."""


PRODUCTS = {
    "real": (("+", 0, "a"), ("-", 1, "b"), ("+", 2, "c"), ("-", 3, "d")),
    "imaginary": (("+", 1, "a"), ("+", 0, "b"), ("+", 3, "c"), ("+", 2, "d")),
}
"""What each part adds up: sign, two vectors of weights, and part of a pair's spectra a + i b and c + i d."""


@dataclass(frozen=True)
class Sizes:
    """Pairs of channels, vectors that hold all tiles' pairs, pairs of vectors of neurons, rows of a tile.

    `block`: pairs of channels whose products are added up by themselves.
    """

    pairs: int
    inputs: int
    neurons: int
    out: int
    block: int


class Fourier(Tiled):
    """Tiles of `points` x `points` pixels, `tiles` side by side."""

    order = (
        "vectors filled up with zeros; the spectrum of the matrix that reads the window: columns of "
        "frequencies 0 to points / 2, pairs of vectors of neurons, rows of frequencies, pairs of channels, "
        "(real, imaginary) of the first and of the second channel, two vectors of neurons; other "
        "matrices block by block of neurons: blocks x D_in x neurons"
    )

    def __init__(
        self, name: str, idea: str, dialect: Dialect, lanes: int, pixels: int, points: int, tiles: int
    ) -> None:
        super().__init__(name, idea, dialect, lanes, pixels, vectors=2)
        self.points, self.tiles, self.instead = points, tiles, f"tile{lanes}"

    def sizes(self, program: Program) -> Sizes:
        """Return the sizes of a program's kernel."""
        gather, (layer,) = kernel_gather(program), readers_of_window(program)
        pairs = -(-gather.channels // 2)
        neurons = -(-layer.type.shape[0] // (2 * self.lanes))
        inputs, out = -(-self.tiles * pairs // self.lanes), self.points - gather.rows + 1
        return Sizes(pairs, inputs, neurons, out, fourier.block_of(pairs))

    def extent(self, program: Program) -> tuple[int, int]:
        """Return the columns and rows of pixels that a work item computes."""
        out = self.sizes(program).out
        return self.tiles * out, out

    def spectra(self, program: Program) -> Spectra:
        """Return how the sums over the window are computed, for their bound."""
        (layer,), found = readers_of_window(program), fourier.arrangement(program, self.lanes)
        gather, count = kernel_gather(program), layer.type.shape[0]
        held = found.centred(found.moved(program))
        # Columns, groups, rows, pairs, halves, parts and places of neurons, as `layout` says.
        stored = self._stored(held, found.weight, self._shape(program, found.weight, ())).astype(np.float64)
        placed = stored[..., 0, :] + 1j * stored[..., 1, :]
        placed = placed.transpose(1, 5, 2, 0, 4, 3).reshape(
            -1, self.points, self.points // 2 + 1, *placed.shape[3:5]
        )
        placed = placed.reshape(*placed.shape[:3], -1)[:count, ..., : gather.channels]
        table, bias = np.empty_like(placed), np.zeros(count)
        table[found.order] = 2 * self.points * placed
        if found.bias is not None:
            bias[found.order] = held.parameters[found.bias]
        block, centres = self.sizes(program).block, np.array(found.centres)
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
        if reason := refused_by_vectors(program, self.dialect):
            return reason
        if len(readers) != 1:
            return f"{len(readers)} affine maps read the window, not one"
        if gather.axes != (0, 1) or gather.rows >= self.points:
            return f"a window of {gather.rows} x {gather.columns} pixels in a tile of {self.points}"
        names = [node["weight"] for node in program.nodes if node.op == "affine"]
        if names.count(readers[0]["weight"]) != 1:
            return "a matrix is applied to the window and to a layer"
        if (found := self.private_bytes(program)) > LARGEST_PRIVATE:
            return f"its arrays take {found} bytes a work item, of at most {LARGEST_PRIVATE}"
        direct, spectra = self.operations(program)
        if COST * spectra > direct:
            return f"the direct sum takes {direct:.0f} operations on vectors a pixel, spectra {spectra:.0f}"
        return ""

    def operations(self, program: Program) -> tuple[float, float]:
        """Return the operations on vectors, a pixel, of the direct sum over the window and of this one."""
        (layer,), s, n = readers_of_window(program), self.sizes(program), self.points
        direct = kernel_gather(program).n_inputs * -(-layer.type.shape[0] // self.lanes)
        products = (n // 2 + 1) * n * s.pairs * 16 * self.tiles * s.neurons
        # The split-radix algorithm takes 4 n log2(n) - 6 n + 8 operations.
        one = 4 * n * (n.bit_length() - 1) - 6 * n + 8
        transforms = s.inputs * (2 * n + 2) + self.tiles * s.neurons * (n + s.out)
        return direct, (products + one * transforms) / (self.tiles * s.out**2)

    def private_bytes(self, program: Program) -> int:
        """Return the bytes of the arrays of a work item."""
        s, n = self.sizes(program), self.points
        body = self._body(program)
        shapes = [program.nodes[index].type.shape for index in body.group_of if body.declares(index)]
        hidden = sum(self.blocks(shape[0]).total * self.pixels for shape in shapes)
        blocks = -(-self.tiles * s.out // self.pixels)
        vectors = {
            "row": s.inputs * n * PARTS,
            "rows": s.inputs * n * (n + 1) * PARTS,
            "columns": 2 * n * PARTS,
            "spectra": s.inputs * n * 2 * PARTS,
            "products": 2 * self.tiles * n * PARTS,
            "back": self.tiles * s.neurons * s.out * (n + 1) * PARTS,
            "sums": blocks * self.pixels * s.neurons * PARTS,
        }
        return 4 * self.lanes * (sum(vectors.values()) + hidden)

    def pack(self, program: Program) -> NDArray[np.float32]:
        """Return the weights (count,) as `layout` places them, the neurons of the first layer in order."""
        return super().pack(self._held(program))

    def _held(self, program: Program) -> Program:
        """Return the program whose parameters are what the kernel holds, before transforms."""
        found = fourier.arrangement(program, self.lanes)
        return found.centred(found.moved(program))

    def coded(self, program: Program, parameters: Mapping[str, NDArray[np.float32]]) -> NDArray[np.float32]:
        """Return other numbers in the places of the weights; 0 for those that the kernel does not hold."""
        found = fourier.arrangement(program, self.lanes)
        own = [found.weight, *([found.bias] if found.bias and any(found.centres) else [])]
        lost = {name: np.zeros_like(parameters[name]) for name in own}
        return super().pack(found.moved(replace(program, parameters={**parameters, **lost})))

    def _shape(self, program: Program, name: str, shape: tuple[int, ...]) -> tuple[int, ...]:
        """Return the shape of a stored parameter of a given shape."""
        (layer,), s = readers_of_window(program), self.sizes(program)
        if name != layer["weight"]:
            return super()._shape(program, name, shape)
        return (self.points // 2 + 1, s.neurons, self.points, s.pairs, 2, PARTS, 2 * self.lanes)

    def _stored(self, program: Program, name: str, shape: tuple[int, ...]) -> NDArray[np.float32]:
        """Return a parameter in its stored shape."""
        (layer,) = readers_of_window(program)
        if name != layer["weight"]:
            return super()._stored(program, name, shape)
        return self._spectra(program, name, kernel_gather(program).rows, shape)

    def _spectra(self, program: Program, name: str, size: int, shape: tuple[int, ...]) -> NDArray[np.float32]:
        """Return the spectra of the windowed matrix, in float32, as `layout` says."""
        columns, groups, n, pairs = shape[:4]
        matrix = program.parameters[name].astype(np.float64)
        spectra = fourier.spectrum(matrix, size, n).transpose(2, 1, 3, 0)[:columns]
        # Frequencies that are their own negatives have real spectra; float64 leaves some 2^-53 there.
        spectra[:: n // 2, :: n // 2] = spectra[:: n // 2, :: n // 2].real
        filled = np.zeros((columns, n, 2 * pairs, groups * 2 * self.lanes), np.complex128)
        filled[:, :, : spectra.shape[2], : spectra.shape[3]] = spectra
        # Channel j of the first half and channel j of the second are a pair.
        split = filled.reshape(columns, n, 2, pairs, groups, 2 * self.lanes).transpose(0, 4, 1, 3, 2, 5)
        both = np.stack([split.real, split.imag], axis=5)
        return both.astype(np.float32).reshape(shape)

    def _body(self, program: Program) -> FourierBody:
        """Return the writer of the kernel's statements."""
        return FourierBody(program, self.dialect, kernel_gather(program), tile=self)


class Statements:
    """Assignments in the order in which they are made, each to a new name."""

    def __init__(self, dialect: FourierDialect) -> None:
        self.dialect = dialect
        self.made: list[tuple[str, tuple[str, ...]]] = []

    def assign(self, template: str, *operands: Named) -> Named:
        """Return a new name for an expression of names."""
        self.made.append((template, tuple(operand.name for operand in operands)))
        return Named(f"t{len(self.made) - 1}", self)

    def needed(self, outputs: list[str]) -> list[str]:
        """Return the assignments on which outputs depend; a sum contains the products that only it reads."""
        wanted, kept, readers = set(outputs), [], Counter(outputs)
        for number, (_, operands) in reversed(list(enumerate(self.made))):
            if f"t{number}" in wanted:
                wanted.update(operands)
                readers.update(operands)
                kept.append(number)
        texts: dict[str, str] = {}
        lines = []
        for number in kept[::-1]:
            (template, operands), name = self.made[number], f"t{number}"
            text = template.format(*(texts.get(operand, operand) for operand in operands))
            if "*" in template and readers[name] == 1 and name not in outputs and "[" not in template:
                texts[name] = text
            else:
                lines.append(self.dialect.vector(name, text))
        return lines


@dataclass(frozen=True)
class Named:
    """A number that a statement computes."""

    name: str
    statements: Statements

    def __add__(self, other: Named) -> Named:
        return self.statements.assign("{0} + {1}", self, other)

    def __sub__(self, other: Named) -> Named:
        return self.statements.assign("{0} - {1}", self, other)

    def __mul__(self, factor: float) -> Named:
        return self.statements.assign(f"{{0}} * {self.statements.dialect.literal(factor)}", self)


def codelet(dialect: FourierDialect, name: str, points: int, kept: int, sign: int) -> list[str]:
    """Return the function that transforms `points` numbers and keeps the first `kept`."""
    statements = Statements(dialect)
    places = [(f"from[{PARTS * k} * step]", f"from[{PARTS * k} * step + 1]") for k in range(points)]
    inputs = [(statements.assign(real), statements.assign(imaginary)) for real, imaginary in places]
    found = fourier.transform(inputs, sign)[:kept]
    lines = statements.needed([part.name for number in found for part in number])
    for k, number in enumerate(found):
        for i, part in enumerate(number):
            lines.append(f"to[{PARTS * k} * leap{' + 1' * i}] = {part.name};")
    return [dialect.function(name), "{", *(f"    {line}" for line in lines), "}"]


@dataclass
class FourierBody(TiledBody):
    """The statements of a kernel with Fourier transforms."""

    tile: Fourier = field(kw_only=True)

    def __post_init__(self) -> None:
        super().__post_init__()
        assert isinstance(self.dialect, FourierDialect), (
            f"{self.dialect.language} has no words for transforms"
        )
        self.vectors = self.dialect
        self.sizes = self.tile.sizes(self.program)
        self.centres = fourier.arrangement(self.program, self.tile.lanes).centres

    def defines(self) -> list[str]:
        """Return the sizes, and the functions that transform rows and columns."""
        tile, s = self.tile, self.sizes
        return [
            f"#define POINTS {tile.points} /* rows and columns of a tile with what its windows reach */",
            "#define OUT (POINTS - WINDOW_SIZE + 1) /* rows and columns of a tile's pixels */",
            f"#define TILES {tile.tiles} /* neighbours in a row that a work item computes */",
            f"#define PIXELS {tile.pixels} /* pixels of a row that go through the layers together */",
            f"#define LANES {tile.lanes} /* numbers in a vector */",
            f"#define PAIRS {s.pairs} /* of channels */",
            f"#define BLOCK {s.block} /* pairs whose products are added up by themselves */",
            f"#define INPUTS {s.inputs} /* vectors that hold the pairs of all tiles */",
            f"#define NEURONS {s.neurons} /* pairs of vectors of neurons */",
            "#define STRIDE (2 * (POINTS + 1)) /* vectors from row to row: not a multiple of 4096 bytes */",
            *codelet(self.vectors, "forward", tile.points, tile.points, -1),
            *codelet(self.vectors, "backward", tile.points, s.out, 1),
        ]

    def _prepare(self) -> None:
        """Write everything up to the loop over rows and blocks of pixels."""
        self._rows_forward()
        self._columns()
        self._comment("rows back, and the other layers")
        blocks, words = -(-self.tile.tiles * self.sizes.out // self.tile.pixels), self.vectors
        self._line(words.vectors("sums", f"{blocks} * PIXELS * NEURONS * 2"))
        if blocks * self.tile.pixels > self.tile.tiles * self.sizes.out:
            # The last block reaches beyond the tiles: its numbers there are read, and none is written.
            self._line("/* beyond the tiles */")
            beyond = f"({blocks} * PIXELS - TILES * OUT) * NEURONS * 2"
            place = "TILES * OUT * NEURONS * 2 + i"
            self._nest([words.loop("i", beyond)], [f"sums[{place}] = {words.zeros};"])
        self._open(words.loop_while("line", "OUT", "tile_y + line < height"))
        self._open(words.loop("tile", "TILES * NEURONS"))
        self._line(words.index("at", "(tile / NEURONS * OUT * NEURONS + tile % NEURONS) * 2"))
        self._line(words.call("backward", "back + (tile * OUT + line) * STRIDE", "1", "sums + at", "NEURONS"))
        self._close()
        self._line(words.index("y", "tile_y + line"))
        self._open(words.loop("block", blocks))
        self._line(words.index("x", "tile_x + block * PIXELS"))
        self._line(words.index("last", words.least("tile_x + TILES * OUT", "width")))

    def _rows_forward(self) -> None:
        """Write the gathering and transformation of rows."""
        words = self.vectors
        self._comment("rows of the images around the tiles, transformed")
        self._line(words.numbered("row", "INPUTS * POINTS * 2"))
        self._line(words.vectors("rows", "INPUTS * POINTS * STRIDE"))
        self._nest([words.loop("i", "INPUTS * POINTS * 2")], [f"row.all[i] = {words.zeros};"])
        self._open(words.loop("dy", "POINTS"))
        self._line(words.index("top", "tile_y + dy - WINDOW_CENTRE"))
        self._line(words.index("row_y", f"{words.clamp}(top, 0, height - 1)"))
        self._open(words.loop("tile", "TILES"))
        self._open(words.loop("dx", "POINTS"))
        self._line(words.index("left", "tile_x + tile * OUT + dx - WINDOW_CENTRE"))
        self._line(words.index("column", f"{words.clamp}(left, 0, width - 1)"))
        if self.gather.window.border == "zero":
            self._line(words.flag("inside", "row_y == top && column == left"))
        first = 0
        for image in self.gather.images:
            for c in range(image.channels):
                part, pair = divmod(first + c, self.sizes.pairs)
                value = f"image_{image.name}[(row_y * width + column) * {image.channels} + {c}]"
                value = self._bordered(value)
                if centre := self.centres[first + c]:
                    value = f"({value}) - {words.literal(centre)}"
                self._line(f"row.number[PLACE(tile * PAIRS + {pair}, dx * 2 + {part})] = {value};")
            first += image.channels
        self._close(2)
        row, column = "row.all + i * POINTS * 2", "rows + (i * POINTS + dy) * STRIDE"
        self._nest([words.loop("i", "INPUTS")], [words.call("forward", row, "1", column, "1")])
        self._close()

    def _columns(self) -> None:
        """Write the loop over columns of frequencies: forward, products with the weights, back."""
        words = self.vectors
        self._comment("columns: transformed, multiplied with the weights' spectra, transformed back")
        slot = self.slots[str(readers_of_window(self.program)[0]["weight"])]
        self._line(words.vectors("column", "POINTS * 2"))
        self._line(words.vectors("mirror", "POINTS * 2"))
        self._line(words.numbered("spectra", "INPUTS * POINTS * 4"))
        self._line(words.vectors("product", "TILES * 2", "POINTS * 2"))
        self._line(words.vectors("back", "TILES * NEURONS * OUT * STRIDE"))
        self._line(words.walk(words.spectrum, slot.offset))
        self._open("for (int k = 0; k <= POINTS / 2; ++k) {")
        self._line(words.index("opposite", "(POINTS - k) % POINTS"))
        # A column that is its own mirror image is mirrored, not computed twice: both parts of each complex
        # image stay apart to the bit.
        self._line(words.index("apart", "opposite != k"))
        self._open(words.loop("i", "INPUTS"))
        row = "rows + i * POINTS * STRIDE + 2 *"
        self._line(words.call("forward", f"{row} k", "POINTS + 1", "column", "1"))
        self._open(words.when("opposite != k"))
        self._line(words.call("forward", f"{row} opposite", "POINTS + 1", "mirror", "1"))
        self._close()
        self._line(words.pointer("other", "opposite != k ? mirror : column", written=False))
        self._open(words.loop("f", "POINTS"))
        self._line(words.index("g", "(POINTS - f) % POINTS"))
        self._line(f"{words.kind} a = column[2 * f], b = column[2 * f + 1];")
        self._line(f"{words.kind} c = other[2 * g], d = other[2 * g + 1];")
        self._line(words.pointer("to", "spectra.all + (i * POINTS + f) * 4"))
        for number, value in enumerate(("a + c", "b - d", "b + d", "c - a")):
            self._line(f"to[{number}] = {value};")
        self._close(2)
        self._open(words.loop("q", "NEURONS"))
        self._products()
        self._open(words.loop("tile", "TILES"))
        self._line(words.pointer("to", "back + (tile * NEURONS + q) * OUT * STRIDE"))
        self._line(words.call("backward", "product[tile * 2]", "1", "to + 2 * k", "POINTS + 1"))
        self._open(words.when("opposite != k"))
        self._line(words.call("backward", "product[tile * 2 + 1]", "1", "to + 2 * opposite", "POINTS + 1"))
        self._close(4)

    def _products(self) -> None:
        """Write the products of a column of frequencies for all tiles."""
        words = self.vectors
        self._open(words.loop("f", "POINTS"))
        split = self.sizes.block < self.sizes.pairs
        names = ["real", "imaginary"]
        self._sums(["whole_real", "whole_imaginary"] if split else names)
        if split:
            self._open(words.loop("block", "PAIRS / BLOCK"))
            self._sums(names)
        self._open(words.loop("pair", "BLOCK"))
        for j in range(8):
            for line in words.walked(f"w{j}", words.spectrum, j):
                self._line(line)
        self._line(words.advance(words.spectrum, 8))
        pair = "block * BLOCK + pair" if split else "pair"
        lines = [
            words.row("x", f"spectra.number + SPECTRUM(t * PAIRS + {pair}, f)"),
            "float a = x[0], b = x[LANES], c = x[2 * LANES], d = x[3 * LANES];",
        ]
        for v in range(2):
            for part, terms in PRODUCTS.items():
                for sign, weight, value in terms:
                    lines.append(f"{part}[t][{v}] {sign}= w{2 * weight + v} * {value};")
        self._tiles(lines)
        self._close()
        if split:
            self._tiles([f"whole_{name}[t][{v}] += {name}[t][{v}];" for name in names for v in range(2)])
            self._close()
        self._line(words.index("g", "(POINTS - f) % POINTS"))
        of = "whole_" if split else ""
        self._tiles(
            [
                f"product[t * 2][2 * f] = {of}real[t][0] - {of}imaginary[t][1];",
                f"product[t * 2][2 * f + 1] = {of}imaginary[t][0] + {of}real[t][1];",
                f"product[t * 2 + apart][2 * g] = {of}real[t][0] + {of}imaginary[t][1];",
                f"product[t * 2 + apart][2 * g + 1] = {of}real[t][1] - {of}imaginary[t][0];",
            ]
        )
        self._close()

    def _sums(self, names: list[str]) -> None:
        """Write the declaration of all tiles' sums, which begin with zeros."""
        for name in names:
            self._line(self.vectors.vectors(name, "TILES", "2"))
        self._tiles([f"{name}[t][{v}] = {self.vectors.zeros};" for name in names for v in range(2)])

    def _tiles(self, lines: list[str]) -> None:
        """Write a loop over tiles that keeps each tile's sums in registers of their own."""
        self._line(self.vectors.unroll)
        self._nest([self.vectors.loop("t", "TILES")], lines)

    def _affine(self, index: int, node: Node) -> None:
        """Write the copy of the sums of a block of pixels, or what the tiled schedule does."""
        if self.program.nodes[node.args[0]].op != "input":
            super()._affine(index, node)
            return
        blocks, bias, words = self.tile.blocks(node.type.shape[0]), node.get("bias"), self.vectors
        self._declare(index, f"%{index}: the sums, and their bias")
        lines = []
        for j in range(blocks.total):
            add = f" + {words.weights_at(self.slots[str(bias)].offset, str(j))}" if bias else ""
            total = f"from[p * NEURONS * 2 + {j}]{add}"
            lines.append(words.hold(f"v{index}", f"p * {blocks.total} + {j}", total))
        self._line(words.pointer("from", "sums + block * PIXELS * NEURONS * 2", written=False))
        self._nest([words.loop("p", "PIXELS")], lines)

    def _outputs(self) -> None:
        """Write the output of each pixel of the block that lies in the tiles and in the image."""
        name, index = self.program.outputs[0]
        channels, words = self.program.nodes[index].type.shape[0], self.vectors
        held = self.tile.blocks(channels).total
        self._comment(f"output {name}")
        value = words.at(f"v{index}", f"p * {held} * LANES + i")
        line = words.store.format(channels=channels, i="i", value=value)
        loops = [words.loop_while("p", "PIXELS", "x + p < last"), words.loop("i", channels)]
        self._nest(loops, [line])
        self._close(2)


IDEA = "products of spectra in place of sums over the window, in tiles of {points} x {points} pixels"
"""What a schedule says of itself."""


def fourier_ladder(of_lanes: Callable[[int], FourierDialect]) -> tuple[Fourier, ...]:
    """Return a language's schedules, for processors with 16, 8 and 4 floats in a register.

    Two tiles of 32 points side by side are as fast as four and take half the memory; one takes a third more
    time: the weights pass by twice as often. The other layers have the register tiles of the tiled schedules.
    """
    idea = IDEA.format(points=32)
    return (
        Fourier("fft32", idea, of_lanes(16), 16, 14, 32, 2),
        *(
            Fourier(f"fft32x{lanes}", f"{idea}, by vectors of {lanes}", of_lanes(lanes), lanes, 6, 32, 2)
            for lanes in (8, 4)
        ),
    )
