"""Speed of a training step: the NumPy reference, the compiled trainer, and PyTorch where it is installed.

1. Each trainer does some steps of a preset on frames of noise, drawing of minibatches included [`TRAINERS`].
2. Trainers and a product of two large matrices (BLAS, float32) take turns, so that drift of the machine's
   speed affects all of them alike [`measured`]. Compiling does not count.
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

from ...refimpl.frame import Frame
from ...refimpl.network import dataset, train
from ...refimpl.network.train import Recipe
from ..devices.registry import open_executor
from . import peers, workload

SGEMM_SIZE = 2048
"""Rows and columns of the two matrices whose product is the measure: large enough for BLAS's full rate."""

WARM_STEPS, PROBE_STEPS, LEAST_STEPS = 3, 10, 3
"""Steps that compile and warm up, steps that say how long one takes, and fewest steps of a measurement."""

Pair = tuple[Frame, Frame]
Way = Callable[[int], Any]
"""Does so many steps."""


def measured(
    recipe: Recipe,
    pairs: Sequence[Pair],
    trainers: Sequence[str],
    seconds: float,
    repeats: int,
    done: Callable[[], None] = lambda: None,
) -> tuple[dict[str, list[float]], float]:
    """Return the seconds a step of each trainer and turn, and the operations a second of the product.

    A measurement takes about so many `seconds`; `done` is called after each.
    """
    ways = {name: TRAINERS[name](recipe, pairs) for name in trainers}
    counts = {name: _count(way, seconds) for name, way in ways.items()}
    times: dict[str, list[float]] = {name: [] for name in ways}
    products: list[float] = []
    for _ in range(repeats):
        products.append(sgemm_rate())
        for name, way in ways.items():
            times[name].append(_seconds(way, counts[name]) / counts[name])
            done()
    return times, max(products)


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


def sgemm_rate() -> float:
    """Return the operations a second of a large product in float32."""
    a = np.ones((SGEMM_SIZE, SGEMM_SIZE), np.float32)
    start = time.perf_counter()
    a @ a
    return 2 * SGEMM_SIZE**3 / (time.perf_counter() - start)


def _seconds(way: Way, steps: int) -> float:
    """Return the time of some steps."""
    start = time.perf_counter()
    way(steps)
    return time.perf_counter() - start


def _count(way: Way, seconds: float) -> int:
    """Return how many steps take about so long, after some that compile and warm up."""
    way(WARM_STEPS)
    return max(LEAST_STEPS, round(seconds * PROBE_STEPS / _seconds(way, PROBE_STEPS)))


def _numpy(recipe: Recipe, pairs: Sequence[Pair]) -> Way:
    """Return the reference's steps, from where the last call ended."""
    data, state, pool = _begun(recipe, pairs)
    held = [state]

    def run(steps: int) -> None:
        for _ in range(steps):
            held[0], _ = train.train_step(held[0], data, pool)

    return run


def _begun(recipe: Recipe, pairs: Sequence[Pair]) -> tuple[Any, Any, Any]:
    """Return data, first state and pool."""
    scales = dataset.normalization_of([noisy for noisy, _ in pairs])
    data = dataset.build(pairs, recipe.features, recipe.window, scales)
    return data, train.start(recipe, scales, data.digest), train.draw_pool(recipe, data)


def _opencl(recipe: Recipe, pairs: Sequence[Pair]) -> Way:
    """Return the compiled trainer's steps, without the data's way to the device."""
    from ..run.trainer import begin

    executor = open_executor("opencl")
    data, state, _ = _begun(recipe, pairs)
    long = replace(recipe, steps=10**9)
    run = begin(executor, long, data, replace(state, recipe=long))
    return lambda steps: list(run.blocks(run.step + steps, []))


def _torch(recipe: Recipe, pairs: Sequence[Pair]) -> Way:
    """Return PyTorch's steps, on windows gathered by the reference or from a pool."""
    trainer = peers.table().trainer
    data, state, pool = _begun(recipe, pairs)
    if pool is not None:
        gathered = dataset.examples_at(data, *pool)
        return trainer(recipe, state.siren, partial(train.draw_picks, recipe), gathered)
    return trainer(
        recipe,
        state.siren,
        lambda step: dataset.examples_at(data, *train.draw_batch(recipe, step, data, None)),
    )


TRAINERS: Mapping[str, Callable[[Recipe, Sequence[Pair]], Way]] = {
    "numpy": _numpy,
    "opencl": _opencl,
    "torch": _torch,
}
"""Trainers by name."""
