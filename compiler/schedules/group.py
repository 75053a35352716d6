"""The grouped schedule, for graphics processors: a work group shares a tile of the image, an item its pixels.

1. The image is cut into tiles: a group of `width` x `height` items computes as many pixels, times `pixels`
   along the row. An item's pixels are `width` columns apart, so that neighbours in a group read and write
   neighbours in memory at every step.
2. All that the group's windows touch, one image at a time, is loaded once into memory that the group shares,
   channel by channel, under the border rule [`Group.staged`]; the loops over taps know no border.
3. Layers are straight code [straight.py]; only the loops over taps are loops.
4. A weight is read once by an item for all its pixels, four neurons at a time, and all items of a group read
   the same one at the same time: it is broadcast.

No item ends before the others: those beyond the image's edge load, wait, compute, and store nothing.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import accumulate

from ..core.ir import Gather, Node, Program
from ..kernel import kernel as tree
from ..kernel.kernel import const, load, name
from .common import HEIGHT, WIDTH, X, Y, clamp, kernel_gather, loop, weight
from .straight import VECTOR, ZERO, Straight, variables

MOST_CHANNELS = 4
"""Most channels of a tile: one of 64 x 8 pixels for windows of 12 x 12 then takes 23 KB, of the 32 KB that
OpenCL 1.2 (CL_DEVICE_LOCAL_MEM_SIZE) and OpenGL 4.3 (MAX_COMPUTE_SHARED_MEMORY_SIZE) promise."""

LARGEST_NUMBERS = 1024
"""Most values of a layer and the one before it, over an item's pixels: four times the registers that an item
has on graphics processors; beyond, a compiler spills more than it keeps."""

LARGEST_STATEMENTS = 2**15
"""Most products of four in straight code: more take drivers minutes to compile."""

GROUP_WIDTH, GROUP_HEIGHT, PIXELS = map(name, ("GROUP_WIDTH", "GROUP_HEIGHT", "PIXELS"))
TILE_WIDTH, TILE_HEIGHT, PLANE, TILE_NUMBERS = map(
    name, ("TILE_WIDTH", "TILE_HEIGHT", "PLANE", "TILE_NUMBERS")
)
COUNTER, DX, DY, AT, LOCAL_X, LOCAL_Y = map(name, ("i", "dx", "dy", "at", "local_x", "local_y"))
TILE, FIRST = "tile", name("first")


def refused_by_group(program: Program, pixels: int) -> str:
    """Return why registers and straight code cannot hold the layers of a program, or nothing."""
    affine = [node for node in program.nodes if node.op == "affine"]
    sources = [program.nodes[node.args[0]] for node in affine]
    held = [0 if s.op == "input" else s.type.shape[0] for s in sources]
    numbers = pixels * max((a.type.shape[0] + n for a, n in zip(affine, held, strict=True)), default=0)
    if numbers > LARGEST_NUMBERS:
        return (
            f"two layers of {pixels} pixels are {numbers} numbers, of at most {LARGEST_NUMBERS}: "
            "no registers hold them"
        )
    return ""


def refused_by_statements(program: Program, pixels: int, rows: Sequence[int]) -> str:
    """Return why straight code of so many rows of weights in each affine map is too long, or nothing."""
    affine = [node for node in program.nodes if node.op == "affine"]
    count = sum(pixels * n * -(-a.type.shape[0] // 4) for a, n in zip(affine, rows, strict=True))
    if count > LARGEST_STATEMENTS:
        return f"it unrolls to {count} products, of at most {LARGEST_STATEMENTS}: drivers take minutes"
    return ""


def rows_at_once(program: Program) -> list[int]:
    """Return the rows of weights of each affine map that are in straight code."""
    widest = max(image.channels for image in kernel_gather(program).images)
    sources = [program.nodes[node.args[0]] for node in program.nodes if node.op == "affine"]
    return [widest if source.op == "input" else source.type.shape[0] for source in sources]


def beyond_tile(gather: Gather) -> str:
    """Return why a tile cannot hold the images, or nothing."""
    if gather.joined or any(image.channels > MOST_CHANNELS for image in gather.images):
        return f"a tile holds {MOST_CHANNELS} channels at once, and one row of taps is one partial sum"
    return ""


class Group(Straight):
    """Builds the grouped kernel of groups of `group` (x, y) items."""

    group: tuple[int, int]
    pixel_names = True
    element = tree.FLOAT
    is_filled = False

    def planes(self) -> int:
        """Return the most values of a pixel that are in the tile at once."""
        return max(image.channels for image in self.gather.images)

    def constants(self) -> list[tree.Constant]:
        """Return the sizes of window, group and tile."""
        window = self.window()
        across = GROUP_WIDTH * PIXELS + self.columns - 1
        return [
            *window,
            tree.Constant("GROUP_WIDTH", const(self.group[0]), "items of a group along a row"),
            tree.Constant("GROUP_HEIGHT", const(self.group[1])),
            tree.Constant("PIXELS", const(self.pixels), "pixels of an item, GROUP_WIDTH columns apart"),
            tree.Constant("TILE_WIDTH", across, "all that windows touch"),
            tree.Constant("TILE_HEIGHT", GROUP_HEIGHT + self.rows - 1),
            tree.Constant("PLANE", TILE_WIDTH * TILE_HEIGHT, "values of a channel"),
            tree.Constant("TILE_NUMBERS", PLANE * self.planes()),
        ]

    def built(self) -> tree.Kernel:
        """Return the kernel."""
        constants = self.constants()
        body: list[tree.Statement] = [
            tree.Array(TILE, self.element, (TILE_NUMBERS,), "group"),
            tree.Let("left", X - LOCAL_X - self.column),
            tree.Let("top", Y - LOCAL_Y - self.row),
        ]
        body += [*self.all_groups(), self.output_comment()]
        for p in range(self.pixels):
            column = X + const(p) * GROUP_WIDTH
            inside = (column < WIDTH) & (Y < HEIGHT)
            body.append(tree.If(inside, (self.written(Y, column, p),)))
        functions = tuple(self.functions())
        step = (PIXELS, const(1))
        more = {"functions": functions, "step": step, "group": self.group, "weights": self.weights}
        return self.kernel(body, constants, **more)

    weights = VECTOR

    def parameter(self, node: Node, vector: int) -> tree.Expr:
        """Return four values of a parameter that is a vector."""
        return weight(self.offset(node["name"]) // 4 + vector, VECTOR)

    # ---- affine maps -------------------------------------------------------------------------------------

    def affine(self, index: int, node: Node) -> list[tree.Statement]:
        """Return v = W x + b for all pixels."""
        source, bias = self.program.nodes[node.args[0]], node.get("bias")
        found: list[tree.Statement] = [self.mapped(index, node)]
        for p, j in self.places(index):
            start = weight(self.offset(bias) // 4 + j, VECTOR) if bias else ZERO
            found.append(
                tree.Array(self.variable(index, p, j), VECTOR, kept=source.op == "input", value=start)
            )
        first = self.offset(node["weight"]) // 4
        if source.op == "input":
            return [*found, *self.of_window(index, first)]
        sums = self.names(f"v{index}", index)
        for i in range(source.type.shape[0]):
            factors = [self.at(node.args[0], p, i // 4).lane(i % 4) for p in range(self.pixels)]
            found += self.multiplied(self.weights_row(index, const(first), i), sums, factors)
        return found

    def names(self, sums: str, index: int) -> list[list[str]]:
        """Return the names of sums, by vector and pixel."""
        return [[f"{sums}_{p}_{j}" for p in range(self.pixels)] for j in range(self.vectors(index))]

    def weights_row(self, index: int, first: tree.Expr, row: int) -> list[tree.Expr]:
        """Return a row of weights."""
        count = self.vectors(index)
        return [weight(first + (row * count + j), self.weights) for j in range(count)]

    def of_window(self, index: int, first: int) -> list[tree.Statement]:
        """Return the products of all taps with the weights from vector `first` on."""
        found: list[tree.Statement] = []
        taps = self.gather.rows * self.gather.columns * self.vectors(index)
        sizes = [image.channels * taps for image in self.gather.images]
        for image, at in zip(self.gather.images, accumulate([first, *sizes]), strict=False):
            found += self.staged([self.pixel(image, c) for c in range(image.channels)])
            found += self.of_taps(index, at, image.channels)
        return found

    def staged(self, values: Sequence[tree.Expr]) -> list[tree.Statement]:
        """Return the copy of a pixel's values for all that the group's windows touch, by all its items.

        A tile that holds others is filled again when all items have read it.
        """
        tile_row, tile_column = name("tile_row"), name("tile_column")
        lines: list[tree.Statement] = [
            tree.Let("tile_row", name("top") + COUNTER // TILE_WIDTH),
            tree.Let("tile_column", name("left") + COUNTER % TILE_WIDTH),
            tree.Let("row", clamp(tile_row, HEIGHT)),
            tree.Let("column", clamp(tile_column, WIDTH)),
            *self.inside(tile_row, tile_column),
        ]
        lines += [
            tree.Store(TILE, (const(plane) * PLANE + COUNTER,), value) for plane, value in enumerate(values)
        ]
        share = tree.For("i", PLANE, tuple(lines), start=name("item"), step=GROUP_WIDTH * GROUP_HEIGHT)
        again, self.is_filled = self.is_filled, True
        return [*([tree.Barrier()] if again else []), share, tree.Barrier()]

    def of_taps(self, index: int, first: int, planes: int) -> list[tree.Statement]:
        """Return the products of the tile's taps: a partial sum for each row of taps [core/sums.py]."""
        parts = self.names("part", index)
        zero = variables([each for names in zip(*parts, strict=True) for each in names], ZERO)
        adds = [
            tree.Store(self.variable(index, p, j), (), name(f"part_{p}_{j}", VECTOR), add=True)
            for p, j in self.places(index)
        ]
        return [loop("dy", self.rows, *zero, self.row_of_taps(index, first, planes, parts), *adds)]

    def row_of_taps(self, index: int, first: int, planes: int, sums: list[list[str]]) -> tree.Statement:
        """Return the products of a row of taps, which are added to sums of these names."""
        step = planes * self.vectors(index)
        lines: list[tree.Statement] = [
            tree.Let("at", (LOCAL_Y + DY) * TILE_WIDTH + LOCAL_X + DX),
            tree.Let("first", first + (DY * self.columns + DX) * step),
        ]
        for c in range(planes):
            names = [f"x{c}_{p}" for p in range(self.pixels)]
            for p, each in enumerate(names):
                place = const(c) * PLANE + AT + const(p) * GROUP_WIDTH
                lines.append(tree.Let(each, load(TILE, place, kind=self.element)))
            lines += self.multiplied(
                self.weights_row(index, FIRST, c), sums, [name(n, self.element) for n in names]
            )
        return loop("dx", self.columns, *lines)
