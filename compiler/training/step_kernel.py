"""The kernel of a training step: its launches as data, their source, and what they promise [`compile_step`].

1. Lower the reference's step and Adam [step.py]; put the emitted sine and cosine in.
2. The first launch is the sums of each work item, scheduled for processors [`Derivatives`]. An item works by
   itself on a part of the minibatch, TILE examples at a time. The value of a node for these examples is
   vectors in memory of its own [`Derivatives.place`]. An affine map is done for EXAMPLES examples at once:
   every weight that is loaded meets all; the sums stay in registers [`Derivatives.affine`]. Windows are read
   from the images, without a copy. A sum over examples of left right^T is done for some inputs at once
   [`Derivatives.sum`]: its part for these stays in registers while the examples go by. Sums continue from
   tile to tile. Neighbouring elementwise nodes share a loop. One operation on a value that is kept is
   computed again in each loop that reads it: an array would cost more.
3. The loss is one item's, which adds up the squared errors of all work items. One that is not finite changes
   nothing from then on, and leaves its step in `failed` [`loss`].
4. An item of the update moves a vector of parameters: it adds up the work items' sums, in their order, and
   copies weights to where the backward pass reads them transposed [`update`].
5. A first layer of low rank computes with W = V H, and the step has its derivative dW (FAC-4): dV = dW H^T of
   sums over the work items, then dH = V^T dW; the update moves V and H in place of W, which is written anew
   at last [`factors`]. Rows of W are (dy, k), of V's vectors (dy, r), of H's numbers (k, r).

Profile `ieee`: any order of summation, fused multiply-add, emitted sine. What the derivatives of one step may
be off is computed at given examples [`step.sum_errors`]. There is no bound for all weights that training may
reach: sine and cosine are proven only up to their domains, and beyond them the result means nothing.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial, reduce
from typing import NamedTuple

import numpy as np

from ...refimpl.errors import CompileError
from ...refimpl.network.activation import SINE
from ..artifact import Artifact
from ..compile import assemble
from ..core import ir
from ..core.ir import Node
from ..core.ops import OPS
from ..core.passes import pipeline
from ..core.passes.gradient import TRANSPOSED, Sum
from ..core.profiles import IEEE
from ..kernel.interface import BOTH, INTEGERS, READ, TRAIN, Interface
from ..kernel.interface import Array as Memory
from ..kernel.kernel import (
    FLOAT,
    INT,
    WORD,
    Array,
    Block,
    Body,
    Comment,
    Constant,
    Expr,
    For,
    If,
    Kernel,
    Launch,
    Let,
    Statement,
    Store,
    apply,
    const,
    lanes,
    load,
    name,
    splat,
)
from ..languages.renderer import Renderer
from ..schedules.common import Nest, lets, loop
from ..targets import language_named
from .step import SQUARES, TARGET, WINDOW, Split, Step, lower_adam, lower_step
from .step_layout import LANES, Slot, slots, transposed_slots, vectors_for

MATRIX = "W0"
"""Name of the first layer's matrix in a step."""

TILE = 64
"""Examples that a work item holds at once: their values (19 arrays of 8 KiB for the presets) stay in the
second-level cache, and the sums in registers are stored once for so many."""

EXAMPLES = 8
"""Examples of an affine map in registers: with two vectors of neurons 16 sums, enough to hide the latency."""

REGISTERS = 24
"""Vectors of sums in registers, of AVX-512's 32: the rest is for what they are made of."""

BLOCK = 4
"""Vectors of neurons in registers at once; wider layers are done block by block."""

INPUTS = 12
"""Inputs of a sum of products in registers at once; 12 divides the runs of all presets' windows."""

VECTOR = FLOAT.of(LANES)
"""So many numbers, which are neighbours in memory."""

ZERO = splat(const(0.0), LANES)
"""What a sum starts with."""

RUNNING = load("failed", 0, kind=INT) < 0
"""Whether all losses so far were finite."""

BATCH, GROUPS, GROUP, E, J, K, N, DY = map(name, ("BATCH", "groups", "group", "e", "j", "k", "n", "dy"))
BEGIN, FIRST, LAST, COUNT, OWN, SUM = map(name, ("begin", "first", "last", "count", "own", "sum"))
AT, HELD, SUMS, R = map(name, ("at", "COUNT", "SUMS", "r"))


def compile_step(
    widths: tuple[int, ...],
    omegas: tuple[float, float],
    batch: int,
    size: int,
    rank: int = 0,
    activation: str = SINE,
) -> Artifact:
    """Return the kernel that trains layers of `widths` on windows of `size` x `size` pixels.

    With a `rank` the factors of the first layer are what is trained.
    """
    split = Split(MATRIX, size, rank) if rank else None
    return compile_lowered(replace(lower_step(widths, *omegas, batch, activation), split=split), size)


def compile_lowered(step: Step, size: int) -> Artifact:
    """Return the kernel of a step; its window has `size` runs. Its `programs` are the step, analysed."""
    language, digest = language_named("opencl"), ir.digest(step.program)
    renderer = Renderer(language.dialect, step_kernel(step, size), False)
    return assemble(
        "training step",
        language,
        renderer,
        [("", step.program)],
        [("program", [digest[:32]])],
        {
            "program": digest,
            "passes": language.profile.passes,
            "arguments": "by the launches of the kernel: see spec/train_kernel.md",
        },
        step,
    )


def step_kernel(step: Step, size: int) -> Kernel:
    """Return the kernel of a step; its window has `size` runs."""
    first = Derivatives(replace(step, program=pipeline.run(step.program, IEEE.passes)), size)
    copies = max((slot.end for slot in transposed_slots(step).values()), default=1)
    count, end = slots(step)[SQUARES].offset, slots(step)[SQUARES].end
    integers = {"BATCH": step.batch, "COUNT": count, "SUMS": end, "SCRATCH": first.vectors}
    launches = first.launch(), *factors(step)[:2], loss(step), update(step), *factors(step)[2:]
    arrays = (
        Memory("values", READ, ("values",)),
        Memory("targets", READ, ("targets",)),
        Memory("places", READ, (3 * step.batch,), dtype="int32"),
        Memory("rates", READ, ("rates",)),
        Memory("old", READ, (3 * count,), lanes=LANES),
        Memory("moved", BOTH, (3 * count,), lanes=LANES),
        Memory("transposed", BOTH, (copies,), lanes=LANES),
        Memory("scratch", BOTH, ("groups", first.vectors), lanes=LANES),
        Memory("sums", BOTH, ("groups", end), lanes=LANES),
        Memory("losses", BOTH, ("losses",)),
        Memory("failed", BOTH, (1,), dtype="int32"),
    )
    constants = tuple(Constant(key, const(value)) for key, value in integers.items())
    interface = Interface(TRAIN, arrays, INTEGERS[TRAIN])
    return Kernel(interface, launches, constants, step=(const(LANES), const(1)))


# ---- the first launch --------------------------------------------------------------------------------------


class _Rows(NamedTuple):
    """Where numbers of examples are: an array, the rows of each, and where row `dy` of one begins."""

    array: str
    rows: int
    start: Callable[[Expr], Expr]


class Derivatives(Nest):
    """Builds the launch; `size` is the number of rows of the window, `vectors` the memory of a work item."""

    lanes = LANES

    def __init__(self, step: Step, size: int) -> None:
        self.copies = transposed_slots(step)
        self.places = {**slots(step), **self.copies}
        self.begin(step.program, {})
        self.step, self.size, self.vectors = step, size, 0
        self.outputs = dict(self.program.outputs)
        self.gathered = next(i for i, n in enumerate(self.program.nodes) if n.get("name") == WINDOW)
        self.arrays: dict[int, int] = {}
        for index, node in enumerate(self.program.nodes):
            vector = OPS[node.op].elementwise and node.type.shape
            if not vector and node.op not in ("constant", "parameter", "input", "affine"):
                raise CompileError(f"%{index} {node.op} : {node.type} has no schedule in a training kernel")
            if index in self.group_of and self.is_array(index) and not self.again(index):
                self.arrays[index] = self.vectors
                self.vectors += TILE * self.width(index)

    def launch(self) -> Launch:
        """Return the launch."""
        begin, last = (BATCH // GROUPS * g + BATCH % GROUPS * g // GROUPS for g in (GROUP, GROUP + 1))
        example, positions = apply("minimum", FIRST + E, LAST - 1), enumerate(("corner", "row", "target"))
        places = {each: load("places", BATCH * at + name("example"), kind=INT) for at, each in positions}
        read = [Store(each, (E,), place) for each, place in places.items()]
        tile: list[Statement] = [
            Comment("Where the examples lie; those that fill up the last ones are not added up."),
            Let("count", apply("minimum", const(TILE), LAST - FIRST)),
            Let("filled", (COUNT + (EXAMPLES - 1)) // EXAMPLES * EXAMPLES),
            *(Array(each, INT, (TILE,)) for each in places),
            loop("e", name("filled"), Let("example", example), *read),
        ]
        for group in self.groups:
            tile += self.of_group(group)
        for term in self.step.sums:
            tile += self.sum(term)
        part = {"begin": begin, "last": last, "own": GROUP * name("SCRATCH"), "sum": GROUP * name("SUMS")}
        tiles = For("first", LAST, tuple(tile), start=BEGIN, step=const(TILE))
        body = If(RUNNING, (*(Let(each, value) for each, value in part.items()), tiles))
        return Launch(("group",), (GROUPS,), (body,), "step")

    # ---- values ------------------------------------------------------------------------------------------

    def is_array(self, index: int) -> bool:
        """Return whether a value is kept for all examples of a tile: something outside its loop reads it."""
        outside = any(self.group_of[reader] != self.group_of[index] for reader in self.readers[index])
        return index != self.gathered and (outside or index in self.outputs.values())

    def again(self, index: int) -> bool:
        """Return whether other loops compute a value again: one operation on one value that is kept."""
        node = self.program.nodes[index]
        read = {arg for arg in node.args if self.program.nodes[arg].op not in ("constant", "parameter")}
        cheap = OPS[node.op].elementwise and len(read) == 1 and read <= self.arrays.keys()
        return cheap and index not in self.outputs.values()

    def width(self, index: int) -> int:
        """Return the vectors of a value."""
        return vectors_for(self.program.nodes[index].type.shape[0])

    def place(self, index: int, example: Expr, vector: Expr | int) -> Expr:
        """Return where a vector of a value of an example is."""
        return OWN + self.arrays[index] + example * self.width(index) + vector

    def kept(self, index: int, example: Expr, vector: Expr | int, value: Expr) -> list[Store]:
        """Return the store of a vector of a value, if other loops read it."""
        return (
            [Store("scratch", (self.place(index, example, vector),), value)] if index in self.arrays else []
        )

    def parameter(self, key: object, vector: Expr | int) -> Expr:
        """Return a vector of a parameter."""
        array = "transposed" if key in self.copies else "old"
        return load(array, const(self.places[str(key)].offset) + vector, kind=VECTOR)

    def read(self, index: int) -> Expr:
        """Return vector j of a value of example e that another loop has computed."""
        node = self.program.nodes[index]
        if node.op == "parameter":
            return self.parameter(node["name"], J)
        if self.again(index):
            return self._value(node, {}, self.read, LANES)
        if index not in self.arrays:
            raise CompileError(f"%{index}: only affine maps may read the window in a training kernel")
        return load("scratch", self.place(index, E, J), kind=VECTOR)

    def numbers(self, index: int) -> _Rows:
        """Return where the numbers of a value of an example are: the window's are rows of an image."""
        if index == self.gathered:
            corner, row = (partial(load, array, kind=INT) for array in ("corner", "row"))
            return _Rows("values", self.size, lambda n: corner(n) + DY * row(n))
        return _Rows("scratch", 1, lambda n: self.place(index, n, 0) * LANES)

    # ---- nodes -------------------------------------------------------------------------------------------

    def of_group(self, group: tuple[int, ...]) -> list[Statement]:
        """Return the statements of one group."""
        index, node = group[0], self.program.nodes[group[0]]
        if node.op == "affine":
            return self.affine(index, node)
        lines: list[Statement] = []
        if node.op != "input":
            for let, each in zip(self.statements(group, self.read, LANES), group, strict=True):
                lines += [let, *self.kept(each, E, J, name(let.name, let.value.type))]
            lines = [self.span(group), loop("e", name("filled"), loop("j", self.width(index), *lines))]
        elif node["name"] == TARGET:
            (count,), i = node.type.shape, name("i")
            target = load("target", E, kind=INT) * count + apply("minimum", i, const(count - 1))
            value = apply("select", i < count, load("targets", target), const(0.0))
            copy = Store("scratch", (self.place(index, E, 0) * LANES + i,), value)
            lines = [Comment(f"%{index}: the targets")]
            lines.append(loop("e", name("filled"), loop("i", self.width(index) * LANES, copy)))
        return lines

    def affine(self, index: int, node: Node) -> list[Statement]:
        """Return v = W x + b for EXAMPLES examples at once, BLOCK vectors of neurons at a time."""
        slot, bias = self.places[str(node["weight"])], node.get("bias")
        source = self.numbers(node.args[0])
        run, i = slot.rows // source.rows, name("i")
        loops: list[Statement] = [self.mapped(index, node)]
        for block in _blocks(slot):
            examples = range(EXAMPLES if len(block) * EXAMPLES <= REGISTERS else EXAMPLES // 2)
            keys = [(n, j) for n in examples for j in block]
            first = {j: self.parameter(bias, j) if bias else ZERO for j in block}
            weights = {j: self.parameter(slot.name, (DY * run + i) * slot.vectors + j) for j in block}
            numbers = [load(source.array, name(f"x{n}") + i) for n in examples]
            inner = loop("i", run, *_products(weights, numbers))
            body: Body = (
                *(Array(f"s{n}_{j}", VECTOR, value=first[j]) for n, j in keys),
                loop("dy", source.rows, *(Let(f"x{n}", source.start(E + n)) for n in examples), inner),
                *(store for n, j in keys for store in self.kept(index, E + n, j, _register(n, j))),
            )
            loops.append(For("e", name("filled"), body, step=const(len(examples))))
        return loops

    def sum(self, term: Sum) -> list[Statement]:
        """Return the addition of the tile's examples to one sum, for some inputs at once."""
        left, slot = self.outputs[term.left], self.places[term.parameter]
        title, right = f"sum of %{left}", _Rows("", 1, lambda n: const(0))
        if term.right is not None:
            right = self.numbers(self.outputs[term.right])
            title += f" x %{self.outputs[term.right]}"
        run, loops = slot.rows // right.rows, list[Statement]()
        for block in _blocks(slot):
            inputs = min(INPUTS, REGISTERS // len(block))
            whole, rest = run // inputs * inputs, run % inputs
            if whole:
                every = self.part(slot, block, left, right, inputs)
                loops.append(For("k", const(whole), every, step=const(inputs)))
            if rest:
                loops.append(Block((Let("k", const(whole)), *self.part(slot, block, left, right, rest))))
        return [Comment(f"{title}: {term.parameter}"), loop("dy", right.rows, *loops)]

    def part(self, slot: Slot, block: range, left: int, right: _Rows, inputs: int) -> Body:
        """Return the addition to a sum for so many inputs from k on; without an array, of `left` alone."""
        keys = [(i, j) for i in range(inputs) for j in block]
        row = DY * (slot.rows // right.rows) + K
        to = {(i, j): (SUM + slot.offset + (row + i) * slot.vectors + j,) for i, j in keys}
        terms = {j: load("scratch", self.place(left, N, j), kind=VECTOR) for j in block}
        numbers = [load(right.array, name("from") + i) if right.array else const(1.0) for i in range(inputs)]
        before = (Store(f"s{i}_{j}", (), load("sums", *to[i, j], kind=VECTOR)) for i, j in keys)
        return (
            *(Array(f"s{i}_{j}", VECTOR, value=ZERO) for i, j in keys),
            If(BEGIN < FIRST, tuple(before)),
            loop("n", COUNT, Let("from", right.start(N) + K), *_products(terms, numbers)),
            *(Store("sums", to[i, j], _ended(slot, j, _register(i, j))) for i, j in keys),
        )


def _register(row: int, vector: int) -> Expr:
    """Return a sum that is in registers."""
    return name(f"s{row}_{vector}", VECTOR)


def _products(vectors: dict[int, Expr], numbers: list[Expr]) -> list[Statement]:
    """Return the products of some vectors with some numbers, each added to a sum of its own."""
    adds = [
        Store(f"s{n}_{j}", (), name(f"w{j}", VECTOR) * splat(number, LANES), add=True)
        for n, number in enumerate(numbers)
        for j in vectors
    ]
    return [*(Let(f"w{j}", vector) for j, vector in vectors.items()), *adds]


def _blocks(slot: Slot) -> list[range]:
    """Return the vectors of neurons that are in registers at once."""
    return [range(first, min(first + BLOCK, slot.vectors)) for first in range(0, slot.vectors, BLOCK)]


def _ended(slot: Slot, vector: int, value: Expr) -> Expr:
    """Return a vector of a row with zeros beyond the row's end."""
    left = slot.width - vector * LANES
    inside = lanes(LANES) < splat(const(left, WORD), LANES)
    return apply("select", inside, value, ZERO) if left < LANES else value


# ---- launches after the first -----------------------------------------------------------------------------


def _across(vector: Expr) -> Expr:
    """Return the sum of a vector's numbers: of halves, of their halves, then one after another."""
    lanes = [vector.lane(lane) for lane in range(LANES)]
    for half in (LANES // 2, LANES // 4):
        lanes = [apply("add", *pair) for pair in zip(lanes, lanes[half:], strict=False)][:half]
    return reduce(partial(apply, "add"), lanes)


def _total(into: str, place: Expr, end: Expr = GROUPS) -> Body:
    """Return the sum over work items of a vector of their sums."""
    add = Store(into, (), load("sums", N * SUMS + place, kind=VECTOR), add=True)
    first = Array(into, VECTOR, value=load("sums", place, kind=VECTOR))
    return first, For("n", end, (add,), start=const(1))


def loss(step: Step) -> Launch:
    """Return the launch of the loss, and of the test of it."""
    mean, squares = name("mean", FLOAT), _across(name("squares", VECTOR))
    terms = const(float(step.batch * slots(step)[SQUARES].width))
    finite = apply("less_equal", apply("absolute", mean), const(float(np.finfo(np.float32).max)))
    body = (
        Array("loss", FLOAT, value=const(0.0)),
        loop("j", SUMS - HELD, *_total("squares", HELD + J), Store("loss", (), squares, add=True)),
        Let("mean", apply("divide", name("loss", FLOAT), terms)),
        Store("losses", (AT,), mean),
        If(apply("logical_not", finite), (Store("failed", (const(0),), name("step")),)),
    )
    return Launch(("one",), (const(1),), (If(RUNNING, body),), "loss")


def update(step: Step) -> Launch:
    """Return the launch of Adam, and of the copies of transposed matrices."""
    state, rates = ("theta", "m", "v"), ("learning_rate", "grown_1", "grown_2")
    i, places, running, end = name("i"), slots(step), RUNNING, GROUPS
    if step.split is not None:  # factors move in place of their product, and their derivatives are one sum
        product, first = places[step.split.parameter], places[step.split.factors[0]].offset
        running = running & apply("logical_or", i < product.offset, i >= product.end)
        end = apply("select", i < first, GROUPS, const(1))
    lines, moved = lets(lower_adam(), lanes=LANES)
    body: list[Statement] = [
        Let("end", end),
        *_total("g", i, name("end")),
        *(Let(each, load("old", HELD * at + i, kind=VECTOR)) for at, each in enumerate(state)),
        *(Let(each, splat(load("rates", AT * 3 + at), LANES)) for at, each in enumerate(rates)),
        *lines,
        *(Store("moved", (HELD * at + i,), moved[each]) for at, each in enumerate(state)),
    ]
    for key, copy in transposed_slots(step).items():
        slot, row, neuron = places[key.removesuffix(TRANSPOSED)], name("row"), name("neuron")
        copies: list[Statement] = [
            Let("row", (i - slot.offset) // slot.vectors),
            Let("neuron", (i - slot.offset) % slot.vectors * LANES),
        ]
        for lane in range(LANES):
            place = ((neuron + lane) * copy.vectors + copy.offset) * LANES + row
            store = Store("transposed", (place,), moved["theta"].lane(lane))
            copies.append(If(neuron + lane < slot.width, (store,)))
        body.append(If((i >= slot.offset) & (i < slot.end), tuple(copies)))
    return Launch(("i",), (HELD,), (If(running, tuple(body)),), "update")


def factors(step: Step) -> tuple[Launch, ...]:
    """Return the launches of dV, of dH and of the product; none without factors."""
    if step.split is None:
        return ()
    rank, rows, places = step.split.rank, step.split.size, slots(step)
    product, vertical, horizontal = (places[key] for key in (step.split.parameter, *step.split.factors))
    run, neurons, ranks = horizontal.rows, product.vectors, horizontal.vectors
    here = (DY * run + K) * neurons + product.offset + J
    v, h = (DY * rank + R) * neurons + vertical.offset + J, (K * ranks + horizontal.offset) * LANES + R
    slope, start = name("slope", VECTOR), Array("slope", VECTOR, value=ZERO)

    def add(array: str, left: Expr, right: Expr) -> Store:
        return Store("slope", (), load(array, left, kind=VECTOR) * splat(right, LANES), add=True)

    of_v = (
        loop("k", run, *_total("all", here), Store("sums", (here,), name("all", VECTOR))),
        loop("r", rank, start, loop("k", run, add("sums", here, load("old", h))), Store("sums", (v,), slope)),
    )
    over = loop("j", neurons, add("sums", here, load("old", v, kind=VECTOR)))
    of_h = start, For("dy", const(rows), (over,), until=name("r") < rank), Store("sums", (h,), _across(slope))
    terms = loop("r", rank, add("moved", v, load("moved", h)))
    w = If(RUNNING, (loop("j", neurons, start, terms, Store("moved", (here,), slope)),))
    return (
        Launch(("j", "dy"), (const(neurons), const(rows)), of_v, "vertical"),
        Launch(("k",), (const(run),), (loop("r", ranks * LANES, *of_h),), "horizontal"),
        Launch(("k", "dy"), (const(run), const(rows)), (w,), "expand"),
    )
