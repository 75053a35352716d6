"""A step of training in float64: its sums at given weights, and the errors of factors' derivatives.

1. Weights change from step to step: each step gets its own [`with_parameters`].
2. What the examples give is added up [`sums`], and what work items of a kernel have left [`summed`].
   Its errors: `step.sum_errors`.
3. Where factors are trained, the error of their derivatives follows from that of the matrix's
   [`factor_errors`], the error of their product from its sums [`expansion_error`].
"""

from dataclasses import replace

import numpy as np

from wamnet.compiler.core.interpret import interpret
from wamnet.compiler.core.passes.gradient import TRANSPOSED
from wamnet.compiler.core.profiles import FLUSH
from wamnet.compiler.core.sums import gamma
from wamnet.compiler.proof.bounds import OUTWARD
from wamnet.compiler.training.step import TARGET, WINDOW
from wamnet.compiler.training.step_layout import LANES, slots, unpack
from wamnet.refimpl.network import factored
from wamnet.refimpl.network.factored import Factors


def with_parameters(step, arrays):
    """Return the step at other weights: `arrays` holds one for each parameter that is trained."""
    given = {name: np.asarray(arrays[name.removesuffix(TRANSPOSED)]) for name in step.program.parameters}
    parameters = {
        name: np.ascontiguousarray(array.T if name.endswith(TRANSPOSED) else array)
        for name, array in given.items()
    }
    return replace(step, program=replace(step.program, parameters=parameters))


def sums(step, windows, targets, dtype=np.float64):
    """Return each sum over examples windows (N, D_in), targets (N, 3): as its parameter; squares (3,)."""
    values = interpret(step.program, {WINDOW: windows, TARGET: targets}, dtype)
    found = {}
    for known in step.sums:
        left = values[known.left]
        found[known.parameter] = left.sum(axis=0) if known.right is None else left.T @ values[known.right]
    return found


def summed(step, found, groups):
    """Return the sums of all work items, in order; those of factors and their product are one already."""
    every, places = found.reshape(groups, -1, LANES).copy(), slots(step)
    for key in (step.split.parameter, *step.split.factors) if step.split else ():
        every[1:, places[key].offset : places[key].end] = 0
    return unpack(places, np.add.accumulate(every)[-1])


def factor_errors(factors, dweight, error):
    """Return how far the kernels' derivatives by both factors may be from [`factored.backward`].

    `error` (D_out, D_in) is that of dweight. A sum of n products is rounded at most n + 1 times.
    """
    magnitude = _magnitude(factors)
    errors = factored.backward(magnitude, error)
    sizes = factored.backward(magnitude, np.abs(dweight) + error + FLUSH)
    n_out, run = magnitude.vertical.shape[0] * magnitude.vertical.shape[1], magnitude.horizontal.shape[1]
    terms = (errors.vertical, sizes.vertical, run), (errors.horizontal, sizes.horizontal, n_out)
    return Factors(*((e + gamma(n + 1) * s + 2 * n * FLUSH) * (1 + OUTWARD) for e, s, n in terms))


def _magnitude(factors):
    """Return the sizes of all numbers of both factors."""
    return Factors(np.abs(factors.vertical.astype(np.float64)), np.abs(factors.horizontal.astype(np.float64)))


def expansion_error(factors):
    """Return how far the kernels' product (D_out, D_in) of two factors may be from [`factored.expand`]."""
    magnitude = _magnitude(factors)
    rank = factors.rank
    return (gamma(rank + 1) * factored.expand(magnitude) + 2 * rank * FLUSH) * (1 + OUTWARD)
