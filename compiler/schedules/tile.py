"""The tiled schedule: a work item computes a row of pixels, and keeps their sums in vector registers.

1. The images around the pixels are copied to a patch that belongs to the work item; the border rule is
   applied there, and the loops that follow know no border [`Tile.patches`].
2. The neurons of a layer stand side by side in vectors of `lanes`, the last one filled up with neurons whose
   weights are 0: nothing reads them.
3. An affine map works on blocks of `vectors` vectors: all pixels' sums of a block are in registers while the
   inputs pass by, each weight is loaded once for all pixels, each input is one value for all lanes. With
   14 pixels and 2 vectors there are 28 independent sums for 3 loads a step and input: arithmetic units, not
   loads, set the pace (the register tile of K. Goto and R. van de Geijn, Anatomy of High-Performance Matrix
   Multiplication, 2008, section 4).
4. Weights are stored in the order in which the loops need them [`all_stored`].
5. Elementwise operations run on vectors, or on components where a language has no arithmetic on vectors.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..core import weights
from ..core.ir import Image, Node, Program
from ..core.sums import is_split
from ..core.weights import Slot
from ..kernel import kernel as tree
from ..kernel.interface import IMAGE, RESULT
from ..kernel.kernel import apply, const, load, name, splat
from .common import (
    HEIGHT,
    WIDTH,
    Read,
    X,
    Y,
    clamp,
    fused,
    kernel_gather,
    loop,
    named,
    output_channels,
    readers_of_window,
    weight,
)
from .schedules import Stored

PIXELS, LANES, PATCH_WIDTH = map(name, ("PIXELS", "LANES", "PATCH_WIDTH"))
COUNTER, J, P, DX, DY, LEFT, TOP, BLOCK = map(name, ("i", "j", "p", "dx", "dy", "left", "top", "block"))


@dataclass(frozen=True)
class Blocks:
    """How n neurons fill vectors: `count` blocks of `vectors` vectors."""

    vectors: int
    count: int

    @property
    def total(self) -> int:
        """Return the number of vectors."""
        return self.vectors * self.count


def blocks_of(neurons: int, lanes: int, vectors: int) -> Blocks:
    """Return how so many neurons fill blocks of at most `vectors` vectors of `lanes`."""
    count = -(-neurons // lanes)
    most = min(vectors, count)
    return Blocks(most, -(-count // most))


# ---- weights ---------------------------------------------------------------------------------------------


def matrices(nodes: Iterable[Node]) -> set[str]:
    """Return the names of the matrices that affine maps among these nodes apply."""
    return {str(node["weight"]) for node in nodes if node.op == "affine"}


def shared_matrix(program: Program) -> str:
    """Return a refusal where one matrix is needed in two orders."""
    used = readers_of_window(program)
    if matrices(used) & matrices(node for node in program.nodes if node not in used):
        return "a matrix is applied to the window and to a layer, which need it in two orders"
    return ""


def stored(program: Program, parameter: str, lanes: int, vectors: int) -> NDArray[np.float32]:
    """Return a parameter as it is stored: blocks x inputs x neurons of a block, or all neurons."""
    rows = np.atleast_2d(program.parameters[parameter].T)  # (D_in, D_out), or (1, D_out)
    if parameter in matrices(readers_of_window(program)):
        rows = rows[np.asarray(kernel_gather(program).by_image, np.intp)]
    blocks = blocks_of(rows.shape[1], lanes, vectors)
    filled = np.zeros((len(rows), blocks.total * lanes), np.float32)
    filled[:, : rows.shape[1]] = rows
    if program.parameters[parameter].ndim == 1:
        return filled.ravel()
    ordered = filled.reshape(len(rows), blocks.count, -1).transpose(1, 0, 2)
    found: NDArray[np.float32] = np.ascontiguousarray(ordered)
    return found


def all_stored(program: Program, lanes: int, vectors: int) -> dict[str, NDArray[np.float32]]:
    """Return all weights as they are stored, by name."""
    return {key: stored(program, key, lanes, vectors) for key in weights.weights(program)}


# ---- statements ------------------------------------------------------------------------------------------


class Tile(Stored):
    """A tile of `pixels` x `vectors` vectors of `lanes` neurons.

    `part`: what partial sums are called, where there are some; `weights`: the type of weights, and of sums.
    """

    order = (
        "vectors filled up with zeros; matrices block by block of neurons: blocks x D_in x neurons; the rows "
        "of one that reads the window go image by image, then tap by tap in rows, then channel by channel"
    )

    lanes: int
    pixels: int
    vectors = 2

    def begin(self, program: Program, slots: Mapping[str, Slot]) -> None:
        """Take a program, whose weights are in these slots."""
        super().begin(program, slots)
        self.vector = self.weights = tree.FLOAT.of(self.lanes)
        self.element = self.vector if self.wide else tree.FLOAT
        self.part = "part" if is_split(self.gather) else ""

    def blocks(self, neurons: int) -> Blocks:
        """Return how neurons fill blocks."""
        return blocks_of(neurons, self.lanes, self.vectors)

    def total(self, index: int) -> int:
        """Return the vectors of a value."""
        return self.blocks(self.program.nodes[index].type.shape[0]).total

    def constants(self) -> list[tree.Constant]:
        """Return the sizes of the window, the tile and the patch."""
        return self.window() + named(
            PIXELS=(self.pixels, "neighbours in a row that a work item computes"),
            LANES=(self.lanes, "components of a vector"),
            PATCH_WIDTH=(self.columns + PIXELS - 1, "columns that all windows touch"),
        )

    def built(self) -> tree.Kernel:
        """Return the kernel."""
        constants = self.constants()
        body = [*self.patches(), *self.all_groups(), *self.outputs()]
        return self.assembled(body, constants, step=(PIXELS, const(1)), weights=self.weights)

    # ---- the images around the pixels --------------------------------------------------------------------

    def patches(self) -> list[tree.Statement]:
        """Return the copies of the images around the pixels, under the border rule."""
        images = self.gather.images
        size = self.rows * PATCH_WIDTH
        arrays = [self.patch(image, size * image.channels) for image in images]
        within = apply("less_equal", const(0), LEFT) & (LEFT + PATCH_WIDTH <= WIDTH)
        within = within & apply("less_equal", const(0), TOP) & (TOP + self.rows <= HEIGHT)
        row = tree.Let("row", clamp(TOP + DY, HEIGHT))
        return [
            tree.Comment("the images around the pixels: what lies beyond the border is filled in here"),
            *arrays,
            tree.Let("left", X - self.middle),
            tree.Let("top", Y - self.row),
            tree.Let("within", within),
            loop("dy", self.rows, row, *map(self.copy, images)),
        ]

    def patch(self, image: Image, size: tree.Expr) -> tree.Array:
        """Return the declaration of an image's patch."""
        return tree.Array(f"patch_{image.name}", tree.FLOAT, (size,))

    def copied(self, value: tree.Expr) -> tree.Expr:
        """Return a value of an image as a patch holds it."""
        return value

    def copy(self, image: Image) -> tree.Statement:
        """Return the copy of a row of the patch: at once inside the image, else pixel by pixel."""
        patch, channels, row = f"patch_{image.name}", image.channels, name("row")
        first = DY * PATCH_WIDTH * channels
        at_once = load(f"{IMAGE}{image.name}", row, LEFT * channels + COUNTER)
        fast = loop("i", PATCH_WIDTH * channels, tree.Store(patch, (first + COUNTER,), self.copied(at_once)))
        column = self.column(TOP + DY, LEFT + DX)
        c = name("c")
        put = tree.Store(patch, (first + DX * channels + c,), self.copied(self.pixel(image, c)))
        slow = loop("dx", PATCH_WIDTH, *column, loop("c", channels, put))
        return tree.If(name("within", tree.Type("bool")), (fast,), (slow,))

    # ---- groups ------------------------------------------------------------------------------------------

    def elementwise(self, group: tuple[int, ...]) -> list[tree.Statement]:
        """Return the loop of a group over all pixels' vectors, or their components."""
        count = PIXELS * self.total(group[0])
        return self.of_elements(group, count if self.wide else count * LANES, self.read, self.element.lanes)

    def array(self, index: int) -> tree.Array:
        """Return the declaration of a value's array: vectors of all pixels."""
        return tree.Array(f"v{index}", self.vector, (PIXELS * self.total(index),))

    def read(self, index: int) -> tree.Expr:
        """Return element `i` of another group's value."""
        node = self.program.nodes[index]
        if node.op != "parameter":
            return load(f"v{index}", COUNTER, kind=self.element)
        total, offset = self.blocks(node.type.shape[0]).total, self.offset(node["name"])
        if self.wide:
            return weight(offset // self.lanes + COUNTER % total, self.vector)
        return weight(offset + COUNTER % (total * LANES))

    def statements(self, group: Sequence[int], read: Read, lanes: int) -> list[tree.Let]:
        """Return a statement for each node of an elementwise group, but for products that a sum contains."""
        kept = [f"t{index}" for index in group if self.is_array(index)]
        return fused(super().statements(group, read, lanes), kept)

    # ---- affine maps -------------------------------------------------------------------------------------

    def affine(self, index: int, node: Node) -> list[tree.Statement]:
        """Return v = W x + b for all pixels, block by block."""
        source, blocks = self.program.nodes[node.args[0]], self.blocks(node.type.shape[0])
        block = BLOCK if blocks.count > 1 else const(0)
        at, n_in = block * blocks.vectors, source.type.shape[0]
        first = self.offset(node["weight"]) // self.lanes + block * (self.inputs(node) * blocks.vectors)
        each = range(blocks.vectors)
        starts = [tree.Store("sum", (P, const(j)), self.start(node, at + j)) for j in each]
        if source.op == "input":
            products = self.windowed(blocks, first)
        else:
            products = self.layer(blocks, first, node.args[0], n_in)
        totals = [self.ended(load("sum", P, const(j), kind=self.weights)) for j in each]
        ends = [tree.Store(f"v{index}", (P * blocks.total + at + j,), totals[j]) for j in each]
        body = (self.sums("sum", blocks), self.each_pixel(*starts), *products, self.each_pixel(*ends))
        nest = loop("block", blocks.count, *body) if blocks.count > 1 else tree.Block(body)
        return [self.mapped(index, node), self.array(index), nest]

    def sums(self, title: str, blocks: Blocks) -> tree.Array:
        """Return the declaration of sums that stay in registers."""
        return tree.Array(title, self.weights, (PIXELS, blocks.vectors), kept=True, register=True)

    def inputs(self, node: Node) -> int:
        """Return the rows of weights of an affine map."""
        return int(self.program.parameters[str(node["weight"])].shape[1])

    def layer(self, blocks: Blocks, first: tree.Expr, source: int, count: int) -> list[tree.Statement]:
        """Return the products of a layer's values."""
        place = P * self.total(source) * LANES
        return [self.multiplied(blocks, const(count), first, "sum", f"v{source}", place)]

    @property
    def zero(self) -> tree.Expr:
        """Return what a partial sum starts with."""
        return splat(const(0.0), self.lanes)

    def start(self, node: Node, vector: tree.Expr) -> tree.Expr:
        """Return what a sum starts with."""
        bias = node.get("bias")
        return weight(self.offset(bias) // self.lanes + vector, self.vector) if bias else self.zero

    def ended(self, total: tree.Expr) -> tree.Expr:
        """Return a sum as a value of the layer."""
        return total

    def windowed(self, blocks: Blocks, first: tree.Expr) -> list[tree.Statement]:
        """Return the sums over the window, row by row of an image's taps."""
        found: list[tree.Statement] = []
        rows = 0
        for image in self.gather.images:
            count, steps = self.steps(image.channels)
            at = first + (DY * count + rows) * blocks.vectors
            place = (DY * PATCH_WIDTH + P) * image.channels
            sums = self.part or "sum"
            row = self.multiplied(blocks, steps, at, sums, f"patch_{image.name}", place)
            found.append(loop("dy", self.rows, *(self.summed(blocks, row) if self.part else [row])))
            rows += self.gather.rows * count
        return found

    def steps(self, channels: int) -> tuple[int, tree.Expr]:
        """Return the rows of weights of a row of an image's taps, and the same in names of the kernel."""
        return self.gather.columns * channels, self.columns * channels

    def summed(self, blocks: Blocks, row: tree.Statement) -> list[tree.Statement]:
        """Return additions to partial sums, which start with 0 and are added to the sums."""
        each = range(blocks.vectors)
        zero = [tree.Store(self.part, (P, const(j)), self.zero) for j in each]
        part = [load(self.part, P, const(j), kind=self.vector) for j in each]
        add = [tree.Store("sum", (P, const(j)), part[j], add=True) for j in each]
        return [self.sums(self.part, blocks), self.each_pixel(*zero), row, self.each_pixel(*add)]

    def multiplied(
        self, blocks: Blocks, inputs: tree.Expr, first: tree.Expr, sums: str, array: str, place: tree.Expr
    ) -> tree.Statement:
        """Return the loop over inputs: the row of weights of each, times its value at each pixel."""
        each = range(blocks.vectors)
        row = [tree.Let(f"w{j}", weight(first + COUNTER * blocks.vectors + j, self.weights)) for j in each]
        lets, factor = self.factor(array, place)
        products = [
            tree.Store(sums, (P, const(j)), self.product(name(f"w{j}", self.weights), factor), add=True)
            for j in each
        ]
        return loop("i", inputs, *row, self.each_pixel(*lets, *products))

    def factor(self, array: str, place: tree.Expr) -> tuple[list[tree.Let], tree.Expr]:
        """Return the value of input `i` at a pixel, and what makes it."""
        return [tree.Let("value", load(array, place + COUNTER))], name("value", tree.FLOAT)

    def product(self, weights: tree.Expr, factor: tree.Expr) -> tree.Expr:
        """Return what a vector of weights adds to a sum."""
        return apply("multiply", weights, splat(factor, self.lanes))

    def each_pixel(self, *body: tree.Statement) -> tree.For:
        """Return a loop over pixels that keeps each pixel's sums in registers of their own."""
        return tree.For("p", PIXELS, body, "unroll")

    def outputs(self, end: tree.Expr = WIDTH) -> tree.Body:
        """Return the statements that write the output of each pixel before the end of the row."""
        index = self.program.outputs[0][1]
        value = load(f"v{index}", P * self.total(index) * LANES + COUNTER)
        write = loop("i", output_channels(self.program), tree.Store(RESULT, (Y, X + P, COUNTER), value))
        return self.output_comment(), tree.For("p", PIXELS, (write,), until=end > X + P)

    def refusal(self, program: Program) -> str:
        """Return why this schedule cannot hold the program, or nothing."""
        single = self.dialect.one_type and any(node.op == "parameter" for node in program.nodes)
        reason = "it reads a layer's numbers one by one, and weights are vectors in this language"
        usual = super().refusal(program) or shared_matrix(program) or self.beyond_stack(program)
        return usual or (reason if single else "")

    def stored(self, program: Program) -> Mapping[str, NDArray[np.float32]]:
        """Return all weights as they are stored, by name."""
        return all_stored(program, self.lanes, self.vectors)
