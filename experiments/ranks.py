"""First layers of low rank: what a cut costs on unseen frames, and what training wins back.

    wamnet demo -o out/demo
    python experiments/ranks.py --dataset out/demo/frames --ranks 16 12 8 --executor opencl

Train the preset `short` in full, cut its first layer, and train on in factored form; with --fresh also train
in that form from the start, for as many steps as the full network. Print PSNR of display-encoded colour on
the test frames of a data set, as a Markdown table. Seconds are wall-clock times.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from itertools import pairwise
from pathlib import Path

from wamnet.cli.files import dataset_files
from wamnet.kernels import open_executor, train_on
from wamnet.refimpl import metrics
from wamnet.refimpl.frame import Frame
from wamnet.refimpl.network import dataset, factored
from wamnet.refimpl.network.denoise import Model, denoise
from wamnet.refimpl.network.train import SHORT, Recipe, TrainState, model_of, train

Pair = tuple[Frame, Frame]
Fit = Callable[..., TrainState]


def scores(model: Model, tests: Sequence[Pair]) -> str:
    """Return the PSNR of each test frame."""
    scales = model.normalization
    pictures = [(denoise(model, noisy), dataset.target_image(clean, scales)) for noisy, clean in tests]
    return " / ".join(f"{metrics.psnr(image, target):.2f}" for image, target in pictures)


def cut(model: Model, rank: int) -> Model:
    """Return the model with its first layer cut, and nothing trained."""
    network = model.siren
    first = factored.expand(factored.cut(network.weights[0], model.window.size, rank))
    return replace(model, siren=replace(network, weights=(first, *network.weights[1:])))


def products(recipe: Recipe, rank: int) -> int:
    """Return the multiplications a pixel of the whole network; rank 0 is a first layer in full."""
    widths, size = recipe.layer_widths, recipe.window.size
    first = rank * (widths[0] // size + size * widths[1]) if rank else widths[0] * widths[1]
    return first + sum(a * b for a, b in pairwise(widths[1:]))


def main() -> None:
    """Train, cut, train on, and print one line a network."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--dataset", type=Path, default=Path("out/demo/frames"), help="folder of a data set")
    parser.add_argument("--steps", type=int, default=6000, help="steps of the full network")
    parser.add_argument("--tune", nargs="+", type=int, default=[2000], help="steps after the cut")
    parser.add_argument("--ranks", nargs="+", type=int, default=[16, 12, 8])
    parser.add_argument("--executor", choices=("numpy", "opencl"), default="numpy", help="what trains")
    parser.add_argument("--fresh", action="store_true", help="also with a rank from random weights on")
    options = parser.parse_args()
    fit: Fit = train
    if options.executor != "numpy":
        fit = partial(train_on, open_executor(options.executor).__enter__())
    pairs, tests = (dataset_files.read_pairs(options.dataset, split) for split in ("train", "test"))
    recipe = replace(SHORT, steps=options.steps, seed=1)
    print("| first layer | products a pixel | s | PSNR dB, unseen frames |\n|---|---|---|---|")

    def row(name: str, rank: int, make: Callable[[], Model]) -> Model:
        started = time.perf_counter()
        model = make()
        seconds = time.perf_counter() - started
        cells = name, f"{products(recipe, rank):,}", f"{seconds:.0f}", scores(model, tests)
        print(f"| {' | '.join(cells)} |", flush=True)
        return model

    full = row(f"full, {options.steps} steps", 0, lambda: model_of(fit(recipe, pairs)))
    for rank in options.ranks:
        row(f"cut to rank {rank}", rank, lambda rank=rank: cut(full, rank))  # type: ignore[misc]
        for steps in options.tune:
            tuned = replace(recipe, rank=rank, steps=steps, seed=2)
            row(
                f"the same and {steps} steps",
                rank,
                lambda tuned=tuned: model_of(fit(tuned, pairs, network=full.siren)),  # type: ignore[misc]
            )
        if options.fresh:
            fresh = replace(recipe, rank=rank)
            row(
                f"rank {rank} from the start, {options.steps} steps",
                rank,
                lambda fresh=fresh: model_of(fit(fresh, pairs)),  # type: ignore[misc]
            )


if __name__ == "__main__":
    main()
