"""Speed of a training step: the NumPy reference, the compiled trainer, and PyTorch where it is installed.

1. Each trainer does some steps of a preset on frames of noise, drawing of minibatches included [`TRAINERS`].
2. Trainers and a product of two large matrices (BLAS, float32) take turns [`entries`, `sgemm`]. Compiling
   does not count.
3. Only products of matrices are counted as operations: twice N D_in D_out for forward pass, weights' and
   inputs' derivatives, the last not in the first layer [`operations`].
"""

from __future__ import annotations

import importlib.util
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np

from wamnet.kernels.bench import workload
from wamnet.kernels.devices.registry import open_executor
from wamnet.kernels.measure import Entry, Round
from wamnet.kernels.run.trainer import begin
from wamnet.refimpl.frame import Frame
from wamnet.refimpl.network import dataset, train
from wamnet.refimpl.network.train import Recipe

from . import peer_torch

SGEMM_SIZE = 2048
"""Rows and columns of the two matrices whose product is the measure: large enough for BLAS's full rate."""

WARM_STEPS, PROBE_STEPS, LEAST_STEPS = 3, 10, 3
"""Steps that compile and warm up, steps that say how long one takes, and fewest steps of a measurement."""

Pair = tuple[Frame, Frame]
Steps = Callable[[int], Any]
"""Does so many steps."""


def entries(recipe: Recipe, pairs: Sequence[Pair], trainers: Sequence[str], seconds: float) -> list[Entry]:
    """Return trainers, whose rounds take about so many `seconds` and return those of a step."""

    def opened(name: str) -> Round:
        work = TRAINERS[name](recipe, pairs)
        work(WARM_STEPS)
        count = max(LEAST_STEPS, round(seconds / _seconds(work, PROBE_STEPS)))
        return lambda _: _seconds(work, count)

    return [Entry(name, partial(opened, name)) for name in trainers]


def sgemm() -> Entry:
    """Return a product of large matrices in float32; its fact `operations` is their number."""
    a = np.ones((SGEMM_SIZE, SGEMM_SIZE), np.float32)

    def product(_number: int) -> None:
        a @ a

    return Entry("sgemm", lambda: product, facts={"operations": 2 * SGEMM_SIZE**3})


def trainers() -> tuple[str, ...]:
    """Return the names of the trainers whose packages are installed."""
    return tuple(name for name in TRAINERS if name != "torch" or importlib.util.find_spec("torch"))


def noise(count: int, size: int) -> list[Pair]:
    """Return pairs of frames of noise: how long a step takes does not depend on what it sees."""
    frames = [workload.noise(size, seed) for seed in range(1, 2 * count + 1)]
    return list(zip(frames[::2], frames[1::2], strict=True))


def operations(recipe: Recipe) -> int:
    """Return the floating-point operations of the products in a step."""
    layers = [n_in * n_out for n_in, n_out in pairwise(recipe.layer_widths)]
    return 2 * recipe.batch * (3 * sum(layers) - layers[0])


def _seconds(work: Steps, steps: int) -> float:
    """Return the time of a step, by some."""
    start = time.perf_counter()
    work(steps)
    return (time.perf_counter() - start) / steps


def _begun(recipe: Recipe, pairs: Sequence[Pair]) -> tuple[Any, Any, Any]:
    """Return data, first state and pool."""
    scales = dataset.normalization_of([noisy for noisy, _ in pairs])
    data = dataset.build(pairs, recipe.features, recipe.window, scales)
    return data, train.start(recipe, scales, data.digest), train.draw_pool(recipe, data)


def _numpy(recipe: Recipe, pairs: Sequence[Pair]) -> Steps:
    """Return the reference's steps, from where the last call ended."""
    data, state, pool = _begun(recipe, pairs)

    def run(steps: int) -> None:
        nonlocal state
        for _ in range(steps):
            state, _loss = train.train_step(state, data, pool)

    return run


def _opencl(recipe: Recipe, pairs: Sequence[Pair]) -> Steps:
    """Return the compiled trainer's steps, without the data's way to the device."""
    data, state, _ = _begun(recipe, pairs)
    long = replace(recipe, steps=10**9)
    run = begin(open_executor("opencl"), long, data, replace(state, recipe=long))
    return lambda steps: list(run.blocks(run.step + steps, []))


def _torch(recipe: Recipe, pairs: Sequence[Pair]) -> Steps:
    """Return PyTorch's steps, on windows gathered by the reference or from a pool."""
    data, state, pool = _begun(recipe, pairs)
    if pool is not None:
        picks, gathered = partial(train.draw_picks, recipe), dataset.examples_at(data, *pool)
        return peer_torch.trainer(recipe, state.siren, picks, gathered)
    drawn = lambda step: dataset.examples_at(data, *train.draw_batch(recipe, step, data, None))  # noqa: E731
    return peer_torch.trainer(recipe, state.siren, drawn)


TRAINERS: Mapping[str, Callable[[Recipe, Sequence[Pair]], Steps]] = {
    "numpy": _numpy,
    "opencl": _opencl,
    "torch": _torch,
}
"""Trainers by name."""
