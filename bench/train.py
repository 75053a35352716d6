"""Speed of a training step: the NumPy reference, the compiled trainer, and PyTorch where it is installed.

    python bench/train.py --presets paper short --repeats 5
    python bench/train.py --trainers numpy opencl torch --presets paper

1. Each trainer does some steps of a preset on frames of noise, drawing of minibatches included [`_ways`].
2. Trainers and a product of two large matrices (BLAS, float32) take turns, so that drift of the machine's
   speed meets all of them alike [`main`]. Compiling does not count.
3. A Markdown table: milliseconds a step (median, range), GFLOP/s, their share of the product's, and what all
   steps of the preset would take at the median. Only products of matrices are counted as operations: twice
   N D_in D_out for forward pass, weights' and inputs' derivatives, the last not in the first layer.

How good the result is: `experiments/presets.py --executor opencl`. The project does not need PyTorch.
"""

from __future__ import annotations

import argparse
import importlib.util
import statistics
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np

from wamnet.cli.reports import machine
from wamnet.kernels import open_executor
from wamnet.refimpl.frame import LAYERS, Frame
from wamnet.refimpl.network import dataset, train
from wamnet.refimpl.network.train import PRESETS, Recipe

SGEMM_SIZE = 2048
"""Rows and columns of the two matrices whose product is the measure: large enough for BLAS's full rate."""

Pair = tuple[Frame, Frame]
Way = Callable[[int], Any]
"""Does so many steps."""


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure and print the tables."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    known = ["numpy", "opencl", *(["torch"] if importlib.util.find_spec("torch") else [])]
    parser.add_argument("--presets", nargs="+", default=["paper", "short"], choices=list(PRESETS))
    parser.add_argument("--trainers", nargs="+", default=known, choices=known)
    parser.add_argument("--size", type=int, default=256, help="width and height of a frame in pixels")
    parser.add_argument("--frames", type=int, default=4)
    parser.add_argument("--seconds", type=float, default=1.0, help="of one measurement, about")
    parser.add_argument("--repeats", type=int, default=5)
    given = parser.parse_args(arguments)
    facts = [f"{name} {value}" for name, value in machine.describe().items()]
    facts += [f"{name} {value}" for name, value in machine.versions().items()]
    print(", ".join([*facts, f"{given.frames} frames of {given.size}x{given.size}"]))
    for preset in given.presets:
        recipe = PRESETS[preset]
        pairs = noise(recipe, given.frames, given.size)
        ways = {name: _WAYS[name](recipe, pairs) for name in given.trainers}
        counts = {name: _count(way, given.seconds) for name, way in ways.items()}
        seconds: dict[str, list[float]] = {name: [] for name in ways}
        products: list[float] = []
        for _ in range(given.repeats):
            products.append(sgemm_rate())
            for name, way in ways.items():
                seconds[name].append(_seconds(way, counts[name]) / counts[name])
        _table(preset, recipe, seconds, max(products))


def _table(preset: str, recipe: Recipe, seconds: dict[str, list[float]], sgemm: float) -> None:
    """Print one preset's table."""
    work = operations(recipe)
    print(f"\npreset `{preset}`: {work / 1e9:.3f} GFLOP a step; sgemm {sgemm / 1e9:.0f} GFLOP/s\n")
    print(
        f"| by | ms a step | range | GFLOP/s | of sgemm | {recipe.steps:,} steps |\n|---|---|---|---|---|---|"
    )
    for name, times in seconds.items():
        median = statistics.median(times)
        extent = f"{1e3 * min(times):.2f} - {1e3 * max(times):.2f}"
        share, whole = f"{work / median / sgemm:.0%}", f"{median * recipe.steps:,.0f} s"
        print(f"| {name} | {1e3 * median:.2f} | {extent} | {work / median / 1e9:.0f} | {share} | {whole} |")


def noise(recipe: Recipe, count: int, size: int) -> list[Pair]:
    """Return pairs of frames of noise: how long a step takes does not depend on what it sees."""
    random = np.random.default_rng(0)
    needed = {"color"} | {dataset.FEATURES[name].layer for name in recipe.features}

    def frame() -> Frame:
        shapes = {name: (size, size, LAYERS[name].channels) for name in sorted(needed)}
        return Frame({name: random.uniform(0, 1, shape).astype(np.float32) for name, shape in shapes.items()})

    return [(frame(), frame()) for _ in range(count)]


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
    way(3)
    return max(3, round(seconds * 10 / _seconds(way, 10)))


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
    from wamnet.kernels.run.trainer import begin

    executor = open_executor("opencl")
    data, state, _ = _begun(recipe, pairs)
    long = replace(recipe, steps=10**9)
    run = begin(executor, long, data, replace(state, recipe=long))
    return lambda steps: list(run.blocks(run.step + steps, []))


def _torch(recipe: Recipe, pairs: Sequence[Pair]) -> Way:
    """Return PyTorch's steps (eager, its own Adam), on windows gathered by the reference or from a pool."""
    import torch

    data, state, pool = _begun(recipe, pairs)
    weights = [torch.tensor(w, requires_grad=True) for w in state.siren.weights]
    biases = [torch.tensor(b, requires_grad=True) for b in state.siren.biases]
    optimizer = torch.optim.Adam([*weights, *biases], lr=recipe.learning_rate, fused=True)
    omegas = [recipe.omega_0_first] + [recipe.omega_0_hidden] * len(recipe.widths)
    gathered = None if pool is None else [torch.from_numpy(a) for a in dataset.examples_at(data, *pool)]
    number = [0]

    def step() -> None:
        if gathered is None:
            drawn = dataset.examples_at(data, *train.draw_batch(recipe, number[0], data, None))
            x, target = map(torch.from_numpy, drawn)
        else:
            pick = torch.from_numpy(train.draw_picks(recipe, number[0]))
            x, target = (array[pick] for array in gathered)
        for layer, (weight, bias) in enumerate(zip(weights, biases, strict=True)):
            x = torch.nn.functional.linear(x, weight, bias)
            if layer < len(weights) - 1:
                x = torch.sin(omegas[layer] * x)
        optimizer.zero_grad()
        torch.nn.functional.mse_loss(x, target).backward()
        optimizer.step()
        number[0] += 1

    def run(steps: int) -> None:
        for _ in range(steps):
            step()

    return run


_WAYS: dict[str, Callable[[Recipe, Sequence[Pair]], Way]] = {
    "numpy": _numpy,
    "opencl": _opencl,
    "torch": _torch,
}
"""Trainers by name."""

if __name__ == "__main__":
    main()
