"""From the reference's training step to programs: the gradient of one example, and Adam of one number.

1. Trace the network and the squared error as refimpl writes them [`lower_step`]. The arrays that are traced
   stand for weights that change: each is filled with a number of its own, so that no two become one.
2. Derive the backward pass [core/passes/gradient.py] and simplify both.
3. Trace Adam's update of one number [`lower_adam`]: learning rate and the growth of the means are inputs.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np

from ...refimpl.network import adam, siren
from ...refimpl.network.activation import SINE
from ...refimpl.network.siren import Siren
from ...refimpl.network.train import squared_error
from ..core.ir import Program, Type
from ..core.passes import pipeline
from ..core.passes.gradient import Sum, gradient
from ..core.trace import trace
from .step import SQUARES, TARGET, WINDOW, Step

OUTPUT, SLOPE = "output", "slope"
"""Outputs of the traced step: the network's value, and the derivative of the loss by it."""

ADAM_INPUTS = ("theta", "g", "m", "v", "learning_rate", "grown_1", "grown_2")
"""Inputs of Adam's program, in order; its outputs are the first, third and fourth, moved on."""


def lower_step(
    widths: Sequence[int],
    omega_0_first: float,
    omega_0_hidden: float,
    batch: int,
    activation: str = SINE,
) -> Step:
    """Return the step of a network with layers of `widths` (D_in, D_1, ..., D_out) on `batch` examples."""
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
