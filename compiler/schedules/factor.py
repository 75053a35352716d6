"""A first layer of low rank as two programs: one along the rows of the images, one along the columns.

1. The matrix of the only affine map that reads the window is cut to rank R [`factored.cut`], in float64; both
   factors are rounded to float32 [`factor`].
2. The first program maps a row of taps to R numbers, without a bias: an image of R channels, or several side
   by side where an image holds fewer [`between`]. The second one maps a column of taps of it to the layer's
   neurons, and continues as the given program does. Both border rules hold for each axis by itself
   (spec/factored.md, FAC-2).
3. The error of both together, against the given program, is that of its own values, the first affine map's
   being [`Cut.enclosures`]

       |V (H x)' - W x| <= |V (H x)' - V H x| + |W - V H| |x|

   where ' is what the kernels compute: the rules of bounds.py for both passes, and the cut. From there on the
   rules of bounds.py hold as they are. Without the last term it is the error of rounding only, against the
   network whose weights are the product V H.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...refimpl.errors import CompileError
from ...refimpl.network import factored, window
from ...refimpl.network.window import Window
from ..core.ir import Gather, Image, Node, Program, Type, attributes
from ..core.profiles import SineContract
from ..core.trace import trace
from ..core.verify import verify
from ..proof import bounds
from ..proof.bounds import Enclosure
from .common import kernel_gather, reading_window
from .schedules import Images, windows

Array = NDArray[np.float64]

HORIZONTAL = "horizontal"
"""Name of the intermediate image, of the first one's output, and of its files."""

NO_SINE = SineContract("none: the first pass has no sine", None)
"""The contract of a program without sines."""


@dataclass(frozen=True)
class Cut:
    """A program and its two passes; `layer` is the index of the first affine map in it and in `vertical`."""

    whole: Program
    horizontal: Program
    vertical: Program
    layer: int

    @property
    def rank(self) -> int:
        """Return R."""
        return kernel_gather(self.vertical).channels

    @property
    def factors(self) -> factored.Factors:
        """Return the factors that the passes apply, in float64."""
        size = kernel_gather(self.whole).window.size
        vertical = _weight(self.vertical, self.layer)
        (layer,) = (index for index, node in enumerate(self.horizontal.nodes) if node.op == "affine")
        return factored.Factors(vertical.reshape(len(vertical), size, -1), _weight(self.horizontal, layer))

    @property
    def product(self) -> Program:
        """Return the whole program with the weights V H, in float64: what both passes compute, unrounded."""
        name = str(self.whole.nodes[self.layer]["weight"])
        return replace(self.whole, parameters={**self.whole.parameters, name: factored.expand(self.factors)})

    def enclosures(
        self, contract: SineContract, images: Images | None = None, of_cut: bool = True
    ) -> list[Enclosure]:
        """Return the enclosure of every node of the whole program, the kernel being both passes.

        For all images in their ranges, or for given ones (H, W, C). `of_cut`: against the given program, else
        against the one with the weights V H.
        """
        gathers = kernel_gather(self.whole), kernel_gather(self.horizontal)
        boxes = [bounds.window_box(g) if images is None else (windows(g, images),) * 2 for g in gathers]
        (output,) = (index for _, index in self.horizontal.outputs)
        h = bounds.enclose(self.horizontal, {"window": boxes[1]}, contract)[output]
        read = self.whole.nodes[self.layer].args[0]
        columns = _columns(h, gathers[0].window, images is not None)
        until = replace(self.vertical, nodes=self.vertical.nodes[: self.layer + 1], outputs=())
        second = bounds.enclose(until, {}, contract, known={read: columns})[self.layer]
        until = replace(self.whole, nodes=self.whole.nodes[: self.layer + 1], outputs=())
        wanted = bounds.enclose(until, {"window": boxes[0]}, contract)[self.layer]
        left_out = np.maximum(*np.abs(boxes[0])) @ left(self).T
        if of_cut:
            low, high, error = wanted.low, wanted.high, second.error + left_out
        else:
            low, high, error = wanted.low - left_out, wanted.high + left_out, second.error
        known = Enclosure(low, high, error * (1 + bounds.OUTWARD), second.size)
        return bounds.enclose(self.whole, {"window": boxes[0]}, contract, known={self.layer: known})


def factor(program: Program, rank: int, widest: int | None = None) -> Cut:
    """Return the passes of a program whose window is read by one affine map, cut to this rank.

    `widest`: most channels of an image between them, if there is a limit.
    """
    gather, layer = kernel_gather(program), _layer(program)
    name, size = str(program.nodes[layer]["weight"]), gather.window.size
    factors = factored.cut(program.parameters[name].astype(np.float64), size, rank)
    vertical, horizontal = (a.astype(np.float32) for a in (factors.vertical, factors.horizontal))
    row = replace(gather, axes=(1,))
    first = trace(lambda window: {HORIZONTAL: window @ horizontal.T}, {"window": _window(row)}, row)
    images = between(rank, _range(first), widest)
    column = Gather(gather.window, images, axes=(0,), joined=len(images) > 1)
    nodes = tuple(_read_by(column, node) if node.op == "input" else node for node in program.nodes)
    parameters = {**program.parameters, name: vertical.reshape(len(vertical), -1)}
    second = replace(program, nodes=nodes, parameters=parameters, gather=column)
    return Cut(program, verify(first, "horizontal pass"), verify(second, "vertical pass"), layer)


def between(rank: int, reach: tuple[float, float], widest: int | None) -> tuple[Image, ...]:
    """Return the images between both passes: one, or as many of at most `widest` channels as are needed."""
    text = "sums along the rows, of the kernel before this one"
    if widest is None:
        return (Image(HORIZONTAL, rank, *reach, text),)
    starts = range(0, rank, widest)
    return tuple(
        Image(f"{HORIZONTAL}_{n}", min(widest, rank - start), *reach, text) for n, start in enumerate(starts)
    )


def left(cut: Cut) -> Array:
    """Return |W - V H| (D_out, D_in), not less than it is: what the cut leaves out."""
    weight, factors = _weight(cut.whole, cut.layer), cut.factors
    expanded = factored.expand(factors)
    magnitude = factored.expand(factored.Factors(np.abs(factors.vertical), np.abs(factors.horizontal)))
    # float64 rounds the sums of R products, and the difference.
    rounding = (cut.rank + 2) * 2.0**-52 * (magnitude + np.abs(weight))
    found: Array = np.abs(weight - expanded) + rounding
    return found


def _columns(h: Enclosure, of: Window, of_images: bool) -> Enclosure:
    """Return the enclosure of columns of taps of the first pass's numbers: of images, or of all of them.

    Beyond the border they are 0, without an error, where the rule says so.
    """
    if of_images:
        padded = (window.pad(part, of, (0,)) for part in (h.low, h.high, h.error))
        return Enclosure(*(window.all_windows(part, of, (0,)) for part in padded))
    zero = of.border == "zero"
    low, high = (np.minimum(h.low, 0.0), np.maximum(h.high, 0.0)) if zero else (h.low, h.high)
    return Enclosure(*(np.tile(part, of.size) for part in (low, high, h.error)))


def _layer(program: Program) -> int:
    """Return the index of the affine map that is the window's only reader, or refuse the program."""
    readers = reading_window(program)
    names = [node["weight"] for node in program.nodes if node.op == "affine"]
    if len(readers) != 1 or program.nodes[readers[0]].op != "affine":
        found = ", ".join(f"%{index} ({program.nodes[index].op})" for index in readers) or "nothing"
        raise CompileError(
            f"{found} reads the window: only a first layer that is one affine map can be reduced to a rank; "
            "compile the program without a rank"
        )
    if names.count(program.nodes[readers[0]]["weight"]) != 1:
        raise CompileError(
            "another layer shares the first layer's matrix and would change with its rank; compile the "
            "program without a rank"
        )
    return readers[0]


def _read_by(gather: Gather, node: Node) -> Node:
    """Return the input that a window is, as this one fills it."""
    kind = _window(gather)
    return replace(node, type=kind, attributes=attributes(**{**dict(node.attributes), "type": kind}))


def _window(gather: Gather) -> Type:
    """Return the type of a window vector."""
    return Type(shape=(gather.n_inputs,))


def _weight(program: Program, layer: int) -> Array:
    """Return the matrix of an affine map in float64."""
    return program.parameters[str(program.nodes[layer]["weight"])].astype(np.float64)


def _range(horizontal: Program) -> tuple[float, float]:
    """Return the least and largest number that the first pass may write."""
    box, (output,) = bounds.window_box(kernel_gather(horizontal)), (i for _, i in horizontal.outputs)
    found = bounds.enclose(horizontal, {"window": box}, NO_SINE)[output]
    return float(np.min(found.low - found.read)), float(np.max(found.high + found.read))
