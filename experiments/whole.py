"""Networks of integers: what rounding costs the shipped models on unseen frames, by itself and on frames.

    python experiments/whole.py
    python experiments/whole.py --scenes cornell --frames 16 --bits 8

1. Frames of the set that a model has learned from are rendered: the first of its training frames, without
   references, to round on, and test frames, whose draws continue the sequence of training [`rendered`].
2. The model is rounded by itself (WHO-7), and on windows of these frames (WHO-14), once for each seed of the
   draw of windows [`rows`].
3. Print a Markdown table: PSNR of floats, and what integers lose, mean and worst frame; seconds of rounding,
   processor's and wall-clock.
"""

from __future__ import annotations

import time
from argparse import Namespace
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

from lab import command
from lab.frames import Pair, frames, noisy, pairs
from lab.sets import SETS

from models import MADE_OF
from wamnet.compiler.variants import AMPLITUDES
from wamnet.models.data.frame_plan import TEST, TRAIN
from wamnet.models.model_file import load_model
from wamnet.refimpl import metrics
from wamnet.refimpl.network import dataset, whole
from wamnet.refimpl.network.denoise import Model, denoise
from wamnet.refimpl.network.train import whole_of

MODELS = Path(__file__).parents[1] / "models"
"""The shipped models."""

RAYS = 16
"""Camera rays of features: what the shipped models have learned from."""

SIZES = {"toy": (16, 4), "small": (256, 256), "paper": (256, 1024)}
"""Pixels a side of a frame, and samples of a test's reference, by scale."""

HEADS = ("model", "integers", "rounded on", "loss, dB, mean", "worst frame", "CPU s", "wall s")
"""Columns of the table."""

Scores = list[float]
"""PSNR of each test frame, in dB."""


def rendered(scene: str, options: Namespace) -> tuple[list[Pair], list[Pair]]:
    """Return frames to round on, each as its own reference, and test frames with their references."""
    chosen = SETS[MADE_OF[scene][0]]
    counts = chosen.counts(chosen.most, options.tests, 0)
    size, spp = SIZES[options.scale]
    shown = chosen.shots(TRAIN, counts, size, RAYS)[: options.frames]
    seen = frames(options.cache / "frames", map(noisy, shown), options.executor)
    unseen = chosen.shots(TEST, counts, size, RAYS)
    return list(zip(seen, seen, strict=True)), pairs(options.cache / "frames", unseen, spp, options.executor)


def scores(model: Model, tests: Sequence[Pair]) -> Scores:
    """Return the PSNR of each test frame."""
    scales = model.normalization
    return [metrics.psnr(denoise(model, n), dataset.target_image(clean, scales)) for n, clean in tests]


def rows(scene: str, options: Namespace) -> Iterator[tuple[str, ...]]:
    """Yield the rows of one model."""
    model = load_model(MODELS / f"{scene}.safetensors")
    seen, tests = rendered(scene, options)
    floats = scores(model, tests)
    yield scene, f"none: {sum(floats) / len(floats):.2f} dB", "", "", "", "", ""
    for bits in options.bits:
        amplitude = AMPLITUDES[bits]
        for seed in (None, *options.seeds):
            process, wall = time.process_time(), time.perf_counter()
            if seed is None:
                network = whole.rounded(model.siren, model.window.size, amplitude)
                found = replace(model, siren=network)
            else:
                found = whole_of(model, seen, amplitude, seed)
            process, wall = time.process_time() - process, time.perf_counter() - wall
            lost = [before - after for before, after in zip(floats, scores(found, tests), strict=True)]
            on = "nothing" if seed is None else f"{len(seen)} frames, seed {seed}"
            cells = f"{sum(lost) / len(lost):.3f}", f"{max(lost):.3f}", f"{process:.1f}", f"{wall:.1f}"
            yield scene, f"{bits} bits", on, *cells


def main(arguments: Sequence[str] | None = None) -> None:
    """Render, round, score, and print a line a network."""
    parser = command.parser(__doc__ or "", "whole")
    parser.add_argument("--scenes", nargs="+", default=list(MADE_OF), choices=list(MADE_OF))
    parser.add_argument("--frames", type=int, default=32, help="frames to round on")
    parser.add_argument("--tests", type=int, default=8, help="unseen frames")
    parser.add_argument("--bits", type=int, nargs="+", default=list(AMPLITUDES), choices=list(AMPLITUDES))
    options = parser.parse_args(arguments)
    print(f"| {' | '.join(HEADS)} |\n|{'---|' * len(HEADS)}")
    for scene in options.scenes:
        for cells in rows(scene, options):
            print(f"| {' | '.join(cells)} |", flush=True)


if __name__ == "__main__":
    command.begin(main)
