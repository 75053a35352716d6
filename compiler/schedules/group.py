"""The grouped schedule, for graphics processors: a work group shares a tile of the image, an item its pixels.

1. The image is cut into tiles: a group of `width` x `height` items computes as many pixels, times `pixels`
   along the row. An item's pixels are `width` columns apart, so that neighbours in a group read and write
   neighbours in memory at every step.
2. All that the group's windows touch, one image at a time, is loaded once into memory that the group shares,
   channel by channel, under the border rule [`Grouped.staged`]; the loops over taps know no border.
3. Layers are straight code [straight.py]; only the loops over taps are loops.
4. A weight is read once by an item for all its pixels, four neurons at a time, and all items of a group read
   the same one at the same time: it is broadcast.

No item ends before the others: those beyond the image's edge load, wait, compute, and store nothing.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..core.ir import Node, Program
from ..kernel import kernel as tree
from ..kernel.kernel import const, load, name
from ..kernel.sizes import shared_bytes
from .common import HEIGHT, WIDTH, X, Y, clamp, kernel_gather, loop, named
from .straight import Straight
from .tile import all_stored, shared_matrix

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


class Grouped(Straight):
    """A tile of the image for each group of `group` (x, y) items, `pixels` of a row for each item.

    `element`: the type of a value in the tile; `part`: what partial sums are called, where there are some.
    """

    order = (
        "vectors filled up to multiples of 4 with zeros; matrices D_in x neurons; the rows of one that reads "
        f"the window go image by image, at most {MOST_CHANNELS} channels at a time, then tap by tap in rows, "
        "then channel by channel"
    )

    pixels: int
    group: tuple[int, int]
    element = tree.FLOAT
    part = "part"
    is_filled = False

    def tiles(self) -> list[list[tree.Expr]]:
        """Return the values of a pixel that are in the tile at once, one tile after another."""
        return [[self.pixel(image, c) for c in range(image.channels)] for image in self.gather.images]

    def constants(self) -> list[tree.Constant]:
        """Return the sizes of window, group and tile."""
        return self.window() + named(
            GROUP_WIDTH=(self.group[0], "items of a group along a row"),
            GROUP_HEIGHT=self.group[1],
            PIXELS=(self.pixels, "pixels of an item, GROUP_WIDTH columns apart"),
            TILE_WIDTH=(GROUP_WIDTH * PIXELS + self.columns - 1, "all that windows touch"),
            TILE_HEIGHT=GROUP_HEIGHT + self.rows - 1,
            PLANE=(TILE_WIDTH * TILE_HEIGHT, "values of a channel"),
            TILE_NUMBERS=PLANE * max(map(len, self.tiles())),
        )

    def built(self) -> tree.Kernel:
        """Return the kernel."""
        constants = self.constants()
        body: list[tree.Statement] = [
            tree.Array(TILE, self.element, (TILE_NUMBERS,), "group"),
            tree.Let("left", X - LOCAL_X - self.middle),
            tree.Let("top", Y - LOCAL_Y - self.row),
            *self.all_groups(),
            self.output_comment(),
        ]
        for p in range(self.pixels):
            column = X + const(p) * GROUP_WIDTH
            inside = (column < WIDTH) & (Y < HEIGHT)
            body.append(tree.If(inside, tuple(self.output(Y, column, p))))
        more = {"functions": self.functions(), "step": (PIXELS, const(1)), "group": self.group}
        return self.assembled(body, constants, **more, weights=self.weights)

    def of_window(self, index: int, node: Node) -> list[tree.Statement]:
        """Return the products of all taps, one tile after another."""
        first, found = self.offset(node["weight"]) // 4, list[tree.Statement]()
        for values in self.tiles():
            found += [*self.staged(values), self.of_taps(index, first, len(values))]
            first += self.gather.rows * self.gather.columns * len(values) * self.vectors(index)
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
            *self.column(tile_row, tile_column),
        ]
        lines += [
            tree.Store(TILE, (const(plane) * PLANE + COUNTER,), value) for plane, value in enumerate(values)
        ]
        share = tree.For("i", PLANE, tuple(lines), start=name("item"), step=GROUP_WIDTH * GROUP_HEIGHT)
        again, self.is_filled = self.is_filled, True
        return [*([tree.Barrier()] if again else []), share, tree.Barrier()]

    def of_taps(self, index: int, first: int, planes: int) -> tree.Statement:
        """Return the products of the tile's taps: a partial sum for each row of taps [core/sums.py]."""
        step, sums = planes * self.vectors(index), self.names(self.part or self.total(index), index)
        lines: list[tree.Statement] = [
            tree.Let("at", (LOCAL_Y + DY) * TILE_WIDTH + LOCAL_X + DX),
            tree.Let("first", first + (DY * self.columns + DX) * step),
        ]
        for c in range(planes):
            names = [f"x{c}_{p}" for p in range(self.pixels)]
            for p, each in enumerate(names):
                place = const(c) * PLANE + AT + const(p) * GROUP_WIDTH
                lines.append(tree.Let(each, load(TILE, place, kind=self.element)))
            factors = [name(n, self.element) for n in names]
            lines += self.multiplied(self.weights_row(index, FIRST, c), sums, factors)
        row = loop("dx", self.columns, *lines)
        return loop("dy", self.rows, *(self.summed(index, self.part, [row]) if self.part else [row]))

    def refusal(self, program: Program) -> str:
        """Return why this schedule cannot hold the program, or nothing."""
        return (
            super().refusal(program)
            or shared_matrix(program)
            or self.beyond_tile(program)
            or self.beyond_straight(program)
            or self.beyond_memory(program)
        )

    def beyond_tile(self, program: Program) -> str:
        """Return why a tile cannot hold the images, or nothing."""
        gather = kernel_gather(program)
        if gather.joined or any(image.channels > MOST_CHANNELS for image in gather.images):
            return f"a tile holds {MOST_CHANNELS} channels at once, and one row of taps is one partial sum"
        return ""

    def at_once(self, program: Program, inputs: int | None) -> int:
        """Return the rows of weights that are in straight code: for so many inputs, or of a tap."""
        widest = max(image.channels for image in kernel_gather(program).images)
        return widest if inputs is None else inputs

    def beyond_straight(self, program: Program) -> str:
        """Return why registers and straight code cannot hold the layers, or nothing."""
        numbers, count = 0, 0
        for node in program.nodes:
            if node.op != "affine":
                continue
            source, neurons = program.nodes[node.args[0]], node.type.shape[0]
            inputs = None if source.op == "input" else source.type.shape[0]
            numbers = max(numbers, self.pixels * (neurons + (inputs or 0)))
            count += self.pixels * self.at_once(program, inputs) * -(-neurons // 4)
        if numbers > LARGEST_NUMBERS:
            return (
                f"two layers of {self.pixels} pixels are {numbers} numbers, of at most {LARGEST_NUMBERS}: "
                "no registers hold them"
            )
        if count > LARGEST_STATEMENTS:
            return f"it unrolls to {count} products, of at most {LARGEST_STATEMENTS}: drivers take minutes"
        return ""

    def beyond_memory(self, program: Program) -> str:
        """Return why a group's memory cannot hold the tile, or nothing."""
        if (shared := shared_bytes(self.kernel(program))) > (most := self.dialect.largest_shared):
            return f"its tile takes {shared} bytes that a group shares, of at most {most}"
        return ""

    def stored(self, program: Program) -> Mapping[str, NDArray[np.float32]]:
        """Return all weights as they are stored, by name."""
        return all_stored(program, 4, LARGEST_NUMBERS)

    def details(self, program: Program) -> Mapping[str, Any]:
        """Return the size of a group and what it shares."""
        return {"group": list(self.group), "shared_bytes": shared_bytes(self.kernel(program))}
