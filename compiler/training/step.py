"""A step of training as a program of one example, and sums over the examples of a minibatch.

1. The network and the squared error are traced as refimpl writes them [`lower_step`], the backward pass is
   derived [core/passes/gradient.py], and both simplified. The program maps a window and a target to the
   squared error, and to the factors of every derivative [`Step`]. It is a program like any other: verified,
   interpreted, bounded, rewritten by passes.
2. What the examples give is added up: for each sum the outer products of two outputs, or one output
   [`Sum`].
3. Weights change from step to step. A matrix that is also used transposed is there twice, the second time
   under its name and [`TRANSPOSED`].
4. The error of a sum follows from the enclosures of what is added, for every order of summation
   [`sum_errors`].
5. Where the first layer has low rank, its factors move in place of its matrix [`Split`].
6. Adam's update of one number is traced too: learning rate and the growth of the means are inputs
   [`lower_adam`].
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...refimpl.network import adam, siren
from ...refimpl.network.activation import SINE
from ...refimpl.network.siren import Siren
from ...refimpl.network.train import squared_error
from ..core.ir import Program, Type
from ..core.passes import pipeline
from ..core.passes.gradient import Sum, gradient
from ..core.profiles import EMITTED_COSINE, EMITTED_SINE, FLUSH
from ..core.sums import gamma
from ..core.trace import trace
from ..proof.bounds import OUTWARD, Enclosure, enclose

Array = NDArray[Any]

SQUARES = "squares"
"""The output and the sum of squared errors."""

WINDOW, TARGET = "window", "target"
"""The program's inputs."""

OUTPUT, SLOPE = "output", "slope"
"""Outputs of the traced step: the network's value, and the derivative of the loss by it."""

ADAM_INPUTS = ("theta", "g", "m", "v", "learning_rate", "grown_1", "grown_2")
"""Inputs of Adam's program, in order; its outputs are the first, third and fourth, moved on."""


def factor_names(parameter: str) -> tuple[str, str]:
    """Return the names of a matrix's vertical and of its horizontal factor."""
    return f"{parameter}.vertical", f"{parameter}.horizontal"


@dataclass(frozen=True)
class Split:
    """The matrix `parameter` (D_out, size run) is the product of two factors, which are trained in its place.

    As parameters they are matrices, vertical (D_out, size rank) and horizontal (rank, run) [factored.py].
    """

    parameter: str
    size: int
    rank: int

    @property
    def factors(self) -> tuple[str, str]:
        """Return the names of the vertical and of the horizontal factor."""
        return factor_names(self.parameter)


@dataclass(frozen=True)
class Step:
    """A program of one example, and what is added up over `batch` examples; `split`: see there."""

    program: Program
    sums: tuple[Sum, ...]
    batch: int
    split: Split | None = None

    @property
    def trained(self) -> tuple[str, ...]:
        """Return the names of the parameters that have a derivative, in the program's order."""
        return tuple(known.parameter for known in self.sums if known.parameter != SQUARES)


def lower_step(
    widths: Sequence[int],
    omega_0_first: float,
    omega_0_hidden: float,
    batch: int,
    activation: str = SINE,
) -> Step:
    """Return the step of a network with layers of `widths` (D_in, D_1, ..., D_out) on `batch` examples.

    The arrays that are traced stand for weights that change: each is filled with a number of its own, so that
    no two become one.
    """
    network = Siren(
        tuple(
            np.full((n_out, n_in), layer + 1, np.float32)
            for layer, (n_in, n_out) in enumerate(pairwise(widths))
        ),
        tuple(np.full(n_out, layer + 1, np.float32) for layer, n_out in enumerate(widths[1:])),
        omega_0_first,
        omega_0_hidden,
        activation,
    )
    return step_of(lambda window: siren.forward(network, window), widths[0], widths[-1], batch)


def step_of(forward: Callable[[Any], Any], n_in: int, n_out: int, batch: int) -> Step:
    """Return the step of a function of a window (n_in,) with values (n_out,); its arrays are its weights."""

    def function(window: Any, target: Any) -> dict[str, Any]:
        output = forward(window)
        squares, slope = squared_error(output, target, n_out * batch)
        return {OUTPUT: output, SLOPE: slope, SQUARES: squares}

    types = {WINDOW: Type(shape=(n_in,)), TARGET: Type(shape=(n_out,))}
    program, found = gradient(trace(function, types), OUTPUT, SLOPE)
    kept = tuple(pair for pair in program.outputs if pair[0] not in (OUTPUT, SLOPE))
    program = pipeline.run(replace(program, outputs=kept), pipeline.COMMON)
    return Step(program, (Sum(SQUARES, SQUARES), *found), batch)


def lower_adam() -> Program:
    """Return Adam's update of one number."""

    def function(theta: Any, g: Any, m: Any, v: Any, rate: Any, grown_1: Any, grown_2: Any) -> dict[str, Any]:
        moved = adam.update(theta, g, m, v, rate, (grown_1, grown_2))
        return dict(zip(("theta", "m", "v"), moved, strict=True))

    return pipeline.run(trace(function, {name: Type() for name in ADAM_INPUTS}), pipeline.COMMON)


def sum_errors(step: Step, windows: Array, targets: Array) -> dict[str, Array]:
    """Return how far each sum of a kernel may be from the float64 one, at given examples.

    N terms l_n r_n are added, each with the errors of its factors, one rounding for the product and at most N
    for the sum; padding adds zeros, which round nothing, and the sum over groups is part of the order.
    """
    given = {name: (np.asarray(x, np.float64),) * 2 for name, x in ((WINDOW, windows), (TARGET, targets))}
    nodes = enclose(step.program, given, EMITTED_SINE, EMITTED_COSINE, local=False)
    ends = dict(step.program.outputs)
    return {known.parameter: _sum_error(known, ends, nodes, len(windows)) for known in step.sums}


def _sum_error(known: Sum, ends: Mapping[str, int], nodes: Sequence[Enclosure], n: int) -> Array:
    """Return the bound of one sum, widened by more than float64 can have rounded it."""
    left = nodes[ends[known.left]]
    if known.right is None:
        error = left.read.sum(axis=0) + gamma(n) * (left.seen + FLUSH).sum(axis=0) + n * FLUSH
    else:
        right = nodes[ends[known.right]]
        factors = left.read.T @ right.largest + left.largest.T @ right.read + left.read.T @ right.read
        error = factors + gamma(n + 1) * ((left.seen + FLUSH).T @ (right.seen + FLUSH)) + 2 * n * FLUSH
    widened: Array = error * (1 + OUTWARD)
    return widened
