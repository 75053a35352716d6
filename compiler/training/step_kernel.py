"""The kernel of a training step: its launches as data, their source, and what they promise [`compile_step`].

1. Lower the reference's step and Adam [step.py]; put the emitted sine and cosine in.
2. The first launch is that of the derivatives [derivatives.py].
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

from dataclasses import replace
from functools import partial, reduce

import numpy as np

from ...refimpl.network.activation import SINE
from ..artifact import Artifact
from ..compile import Draft, assemble
from ..core import ir
from ..core.passes import pipeline
from ..core.passes.gradient import TRANSPOSED
from ..core.profiles import PROFILES
from ..kernel.interface import BOTH, INTEGERS, READ, TRAIN, Interface
from ..kernel.interface import Array as Memory
from ..kernel.kernel import (
    FLOAT,
    Array,
    Body,
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
    load,
    name,
    splat,
)
from ..languages.renderer import Renderer
from ..schedules.common import lets, loop
from ..targets import language_named
from .derivatives import DY, GROUPS, RUNNING, VECTOR, ZERO, Derivatives, J, K, N
from .step import SQUARES, Split, Step, lower_adam, lower_step
from .step_layout import LANES, slots, transposed_slots

FIRST = "W0"
"""Name of the first layer's matrix in a step."""

AT, COUNT, SUMS, R = map(name, ("at", "COUNT", "SUMS", "r"))


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
    split = Split(FIRST, size, rank) if rank else None
    return compile_lowered(replace(lower_step(widths, *omegas, batch, activation), split=split), size)


def compile_lowered(step: Step, size: int) -> Artifact:
    """Return the kernel of a step; its window has `size` runs. Its `programs` are the step, analysed."""
    dialect, profile, digest = language_named("opencl").dialect, PROFILES["ieee"], ir.digest(step.program)
    renderer = Renderer(dialect, step_kernel(step, size), False)
    draft = Draft(
        "training step",
        profile,
        renderer,
        [("", step.program)],
        [("program", [digest[:32]])],
        "by the launches of the kernel: see spec/train_kernel.md",
        {"program": digest, "passes": profile.passes},
        step,
    )
    return assemble(draft)


def step_kernel(step: Step, size: int) -> Kernel:
    """Return the kernel of a step; its window has `size` runs."""
    first = Derivatives(replace(step, program=pipeline.run(step.program, PROFILES["ieee"].passes)), size)
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
        loop("j", SUMS - COUNT, *_total("squares", COUNT + J), Store("loss", (), squares, add=True)),
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
        *(Let(each, load("old", COUNT * at + i, kind=VECTOR)) for at, each in enumerate(state)),
        *(Let(each, splat(load("rates", AT * 3 + at), LANES)) for at, each in enumerate(rates)),
        *lines,
        *(Store("moved", (COUNT * at + i,), moved[each]) for at, each in enumerate(state)),
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
    return Launch(("i",), (COUNT,), (If(running, tuple(body)),), "update")


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
