"""Features of more camera rays for what they are worth: quality against the pipeline's total time.

    python experiments/feature_rays.py --models minicubes

1. Unseen frames of a model's scene are drawn by a pipeline on the device, once for each source and number of
   rays of the features [`pipelines`], and scored against references [`scored`]. Colours are the same.
2. Pipelines of larger pictures take turns, each ended by waiting for the device [`timed`]: the whole, without
   reading back, and the paths with the rays and their encoding by themselves.

Print a Markdown table: per model, source and number of rays the means of the scores, and the medians of the
times. One ray is the colour's. Sources are `pcg4d`, rays at random, and `net`, spread evenly (RND-2c).
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path

import numpy as np
from lab.command import begin
from lab.scores import mean_scores, score
from numpy.typing import NDArray

from wamnet.cli.commands.bench_frames import TEST_SEED, request_for
from wamnet.cli.common.inputs import load_model
from wamnet.kernels import Pipeline, open_executor
from wamnet.kernels.devices.executor import Executor
from wamnet.kernels.run.render_frame import render_frame
from wamnet.models.data.frame_plan import KINDS, TEST, Picture, plan
from wamnet.refimpl.network.denoise import Model

SOURCES = ("pcg4d", "net")
"""Where the rays come from: at random, or spread evenly."""

RAYS = (1, 2, 4, 8, 16)
"""Camera rays per pixel; one is the colour's."""

SHOWN = ("psnr", "ssim", "flip")
"""The scores of the table."""

Way = tuple[str, int]
"""A source and a number of rays."""


def ways(rays: Sequence[int]) -> list[Way]:
    """Return the rows of the table; one ray is the same from every source that begins with the colour's."""
    return [(source, count) for count in rays for source in SOURCES[count == 1 :]]


@contextmanager
def pipelines(
    executor: Executor, model: Model, shots: Sequence[Picture], size: int, rows: Sequence[Way]
) -> Iterator[Mapping[Way, Pipeline]]:
    """Open one pipeline for each row, for pictures of `size` pixels a side of all the shots' scenes."""
    scenes, settings = [shot.scene for shot in shots], shots[0].job.settings
    with ExitStack() as made:
        yield {
            (source, rays): made.enter_context(
                Pipeline(
                    executor,
                    scenes[0],
                    model,
                    (size, size),
                    settings=settings,
                    pictures=len(shots),
                    moving=scenes,
                    feature_spp=rays,
                    feature_sampler=source,
                )
            )
            for source, rays in rows
        }


def scored(
    pipeline: Pipeline, model: Model, shots: Sequence[Picture], references: Sequence[NDArray[np.float32]]
) -> dict[str, float]:
    """Return the mean scores of what a pipeline draws of the shots, with their seeds."""
    found = []
    for shot, reference in zip(shots, references, strict=True):
        pipeline.set_scene(shot.scene)
        picture = pipeline.run(shot.job.seed)
        found.append(score(picture, reference, exposure_stops=model.normalization.exposure_stops))
    return mean_scores(found)


def timed(opened: Mapping[Way, Pipeline], repeats: int) -> dict[Way, tuple[float, float]]:
    """Return the medians, in ms, of each pipeline's picture, and of its paths, rays and encoding only."""
    times: dict[Way, tuple[list[float], list[float]]] = {way: ([], []) for way in opened}
    for turn in range(repeats + 1):
        for way, pipeline in opened.items():
            passes, part = pipeline.passes, pipeline.part(turn, 1, 0)
            start = time.perf_counter()
            pipeline.draw(turn)
            passes.finish()
            whole = time.perf_counter()
            passes.trace(pipeline.path, part, pipeline.moment.numbers)
            if not pipeline.path.images:
                passes.encode(1)
            passes.finish()
            end = time.perf_counter()
            if turn:  # whatever a driver does at first is left out
                times[way][0].append(1e3 * (whole - start))
                times[way][1].append(1e3 * (end - whole))
    return {way: (statistics.median(a), statistics.median(b)) for way, (a, b) in times.items()}


def measured(executor: Executor, name: str, options: argparse.Namespace) -> Iterator[str]:
    """Yield the rows of one model."""
    model = load_model(Path(name))
    numbers = {"frames": 1, "test_frames": options.frames, "spp": 1, "test_spp": options.reference_spp}
    request = request_for(model, executor.name, size_px=options.size, seed=TEST_SEED, **numbers)
    tests = [frame.pictures for frame in plan(request) if frame.split == TEST]
    noisy, targets = ([pictures[kind] for pictures in tests] for kind in KINDS)
    references = [
        render_frame(executor.name, each.scene, each.job, workers=None).frame["color"] for each in targets
    ]
    rows = ways(options.rays)
    with pipelines(executor, model, noisy, options.size, rows) as opened:
        scores = {way: scored(pipeline, model, noisy, references) for way, pipeline in opened.items()}
    with pipelines(executor, model, noisy[:1], options.time_size, rows) as opened:
        times = timed(opened, options.repeats)
    for way in rows:
        source, rays = way
        psnr, ssim, flip = (scores[way][name] for name in SHOWN)
        kept = f"{Path(name).stem}, {rays} {'ray' if rays == 1 else f'rays of {source}'}"
        whole, paths = times[way]
        yield f"| {kept} | {psnr:.2f} | {ssim:.4f} | {flip:.4f} | {whole:.1f} | {paths:.1f} |"


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--models", nargs="+", default=["minicubes"], help="shipped models, or model files")
    parser.add_argument("--executor", default="opencl")
    parser.add_argument("--rays", type=int, nargs="+", default=list(RAYS))
    parser.add_argument("--frames", type=int, default=8, help="unseen frames")
    parser.add_argument("--size", type=int, default=256, help="their width and height, in pixels")
    parser.add_argument("--reference-spp", type=int, default=1024)
    parser.add_argument("--time-size", type=int, default=512, help="width and height of what is timed")
    parser.add_argument("--repeats", type=int, default=15, help="turns of the pipelines")
    options = parser.parse_args(arguments)
    print("| features | PSNR, dB | SSIM | FLIP | total, ms | paths and rays, ms |\n|---|---|---|---|---|---|")
    with open_executor(options.executor) as executor:
        for name in options.models:
            for row in measured(executor, name, options):
                print(row, flush=True)


if __name__ == "__main__":
    begin(main)
