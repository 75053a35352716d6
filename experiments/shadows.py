"""Soft shadows: what shadow rays of the features gain, beside what they cost.

    python experiments/publish.py --run shadows python experiments/shadows.py

1. Frames are drawn from the ranges of a set (`--set`), at every time and from moving cameras, with the
   features of each row [`ROWS`]: camera rays, shadow rays of each, paths per pixel.
2. A network is trained for each row and seed by the preset `best`, whose input is the layer `unshadowed`
   where there are no shadow rays, and `direct` in its place where there are [`Bench.images`]. `direct` has
   visible lights too: a row without shadow rays, with `seen_emission`, has the gain of these alone. In
   sets of mirrors and glass the preset is `mirrors` or `sky`, or that with -shadows [`Bench.recipe`].
3. Open Image Denoise gets the same frames. With the same direct light, its colour is `direct` in place of
   what the path itself has found of that: of the path that ends after one scattering [`Bench.relit`]. Since
   `direct` approximates lights by disks, which a network learns and it cannot, another row has no such bias.
4. Scores are means over seeds and test frames that nothing was chosen on, in the penumbra and after a blur
   too [`lab/scores.py`]; under a sun, in the penumbra of its light alone [`Bench.pairs`]. With `--outside`
   test frames are ten degrees beyond the cameras of training. A picture shows one by the rows in `SHOWN`.
5. Milliseconds are those of a frame, paths, features and network, 512 x 512 pixels, rows in turn, by a
   pipeline or, where features are traced past mirrors, by kernels one after another [`frame_maker`]. With
   `--times` there is nothing else, of networks that were not trained, and the time is that of all cores.
6. With `--models` nothing is trained: their rows have the rays that they were trained on, and fewer of them
   [`rows_of_models`]. `--frames` is then the number of frames of their training. `--rows` leaves rows out.

Prints a Markdown table.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from lab.command import begin
from lab.frames import Shot, frames, in_sun, noisy, one_scattering, past_mirrors, reference, relit
from lab.scores import mean_scores, score_lit
from lab.sets import SETS, Counts, FrameSet
from lab.tables import markdown
from lab.training import denoised, trained

import wamnet
from wamnet.cli.files.images import write_panels
from wamnet.compiler.scenes.encode_kernel import sees
from wamnet.kernels import open_executor
from wamnet.kernels.devices.executor import Executor
from wamnet.kernels.run.denoise_on import Denoiser
from wamnet.kernels.run.pipeline import Pipeline
from wamnet.kernels.run.render_on import render_on
from wamnet.models.data.frame_plan import OUTSIDE, TEST, TRAIN
from wamnet.refimpl.encoding import to_display
from wamnet.refimpl.frame import Floats, Frame
from wamnet.refimpl.light.environment import sun_of, with_sun
from wamnet.refimpl.light.render import FEATURE_SAMPLER, Job, spread_rays
from wamnet.refimpl.light.scene import Scene
from wamnet.refimpl.light.scenes import canonical
from wamnet.refimpl.light.transport import Settings
from wamnet.refimpl.network.dataset import Normalization
from wamnet.refimpl.network.denoise import Model, learned_feature_spp, learned_shadow_rays
from wamnet.refimpl.network.train import BEST, PRESETS, Recipe, model_of, start
from wamnet_peers.peer_oidn import filtered, prefiltered

TIMED_PX = 512
"""Side of the timed image."""


@dataclass(frozen=True)
class Row:
    """Camera rays of the features, shadow rays of each, and paths, per pixel.

    `emission`: the network sees visible lights without shadow rays. `oidn`: Open Image Denoise; `usual`: its
    direct light is that of as many paths of one scattering, which have no bias. `file`: the network is there;
    `at_random`: it was trained on camera rays that are not spread evenly.
    """

    rays: int
    shadow_rays: int = 0
    spp: int = 1
    emission: bool = False
    oidn: bool = False
    usual: bool = False
    file: str = ""
    at_random: bool = False

    @property
    def of_pipeline(self) -> dict[str, Any]:
        """Return the options of a pipeline with these camera rays."""
        sampler = Settings().sampler if self.at_random else ""
        return {"feature_spp": self.rays, "feature_sampler": sampler}

    @property
    def layers(self) -> tuple[str, ...]:
        """Return the layers that the network reads."""
        lit = ("direct",) if self.shadow_rays else ("unshadowed",)
        return "color", "normal", "albedo", "position", *lit, *(("seen_emission",) if self.emission else ())


ROWS = {
    "4 camera rays, no shadow ray": Row(4),
    "4 camera rays, no shadow ray, visible lights": Row(4, emission=True),
    "1 camera ray, 1 shadow ray": Row(1, 1),
    "2 camera rays, 2 shadow rays": Row(2, 1),
    "4 camera rays, 4 shadow rays": Row(4, 1),
    "8 camera rays, 8 shadow rays": Row(8, 1),
    "16 camera rays, no shadow ray": Row(16),
    "16 camera rays, 16 shadow rays": Row(16, 1),
    "2 paths, 16 shadow rays": Row(16, 1, spp=2),
    "4 paths, no shadow ray": Row(16, spp=4),
    "Open Image Denoise, 16 camera rays, no shadow ray": Row(16, oidn=True),
    "Open Image Denoise, 16 camera rays, 16 shadow rays": Row(16, 1, oidn=True),
    "Open Image Denoise, 16 camera rays, 16 paths of one scattering": Row(16, 1, oidn=True, usual=True),
    "Open Image Denoise, 2 paths, 16 paths of one scattering": Row(16, 1, 2, oidn=True, usual=True),
}
"""The rows by name; shadow rays are those of all camera rays together. Where paths are named, they have the
features of 16 camera rays."""

THEIRS = {name: row for name, row in ROWS.items() if row.oidn}
"""The rows of Open Image Denoise."""

USUAL = "16 camera rays, no shadow ray"
"""The row that times are compared with."""

FEWER = (1, 2, 4)
"""What the camera rays of a model's training are divided by."""

SHOWN = {
    "4 camera rays, no shadow ray": "no shadow ray",
    "8 camera rays, 8 shadow rays": "8 shadow rays",
    "16 camera rays, 16 shadow rays": "16 shadow rays",
    "Open Image Denoise, 16 camera rays, no shadow ray": "OIDN",
    "Open Image Denoise, 16 camera rays, 16 paths of one scattering": "OIDN, 16",
}
"""Rows of the picture, and their labels."""

COLUMNS = {
    "psnr": ("PSNR, dB", 2),
    "ssim": ("SSIM", 4),
    "flip": ("FLIP", 3),
    "penumbra": ("RMSE in the penumbra, 1/255", 2),
    "blurred": ("blurred RMSE, 1/255", 2),
}
"""Heads of the scores that are shown, and their digits."""

SCORED = ("features", *(head for head, _ in COLUMNS.values()), "PSNR, range of seeds", "ms")
"""Heads of the table of scores."""

TIMED = ("features", "processor ms", "ratio")
"""Heads of the table of times."""


@dataclass(frozen=True)
class Bench:
    """A set, sizes, and where frames and networks are kept."""

    options: argparse.Namespace
    set: str = "minicubes"

    @property
    def of(self) -> FrameSet:
        """The set of frames."""
        return SETS[self.set]

    @property
    def scene(self) -> Scene:
        """The set's scene."""
        return canonical(self.of.scene)

    @property
    def counts(self) -> Counts:
        """Numbers of frames."""
        outside = self.options.tests if self.options.outside else 0
        return Counts(self.options.frames, self.options.tests, outside)

    @property
    def tests(self) -> str:
        """The split of the test frames."""
        return OUTSIDE if self.options.outside else TEST

    @cached_property
    def rows(self) -> Mapping[str, Row]:
        """The rows by name."""
        rows = {**rows_of_models(self.options.models), **THEIRS} if self.options.models else ROWS
        mirrors = self.of.seen  # whose direct light is not what the layer says
        shown = {
            name: row
            for name, row in rows.items()
            if not (mirrors and row.oidn and row.shadow_rays) or row.usual
        }
        asked = {name: row for name, row in shown.items() if any(text in name for text in self.options.rows)}
        return asked | {USUAL: ROWS[USUAL]} if self.options.times else asked

    def frames(self, shots: Sequence[Shot]) -> list[Frame]:
        """Return frames, rendered where they are not there."""
        return frames(self.options.cache / "frames", shots, self.options.executor)

    def shots(self, split: str, row: Row, seed: int) -> list[Shot]:
        """Return the noisy shots of a row."""
        noise = 2 * seed + (split != TRAIN)
        found = self.of.shots(split, self.counts, self.options.size, row.rays, noise, row.shadow_rays)
        chosen = {"spp": row.spp, "spread": not row.at_random}
        return [replace(noisy(s), seen=s.seen or row.emission, **chosen) for s in found]

    def pairs(self, split: str, row: Row, seed: int) -> list[tuple[Frame, Frame]]:
        """Return noisy frames and references; those of tests have direct light, under a sun the sun's."""
        spp, shadow_rays = (self.options.spp, 0) if split == TRAIN else (4 * self.options.spp, 1)
        clean = [reference(s, spp) for s in self.of.shots(split, self.counts, self.options.size)]
        clean = [replace(shot, shadow_rays=shadow_rays) for shot in clean]
        targets = self.frames(clean)
        if split != TRAIN and sun_of(self.scene) is not None:
            suns = self.frames([replace(shot, sun=True) for shot in clean])
            lit = zip(targets, suns, clean, strict=True)
            targets = [in_sun(target, sun, shot.build()) for target, sun, shot in lit]
        return list(zip(self.frames(self.shots(split, row, seed)), targets, strict=True))

    def recipe(self, row: Row, seed: int) -> Recipe:
        """Return the recipe of a row: that of a set's preset, with direct light if it has shadow rays."""
        preset, layers = BEST, row.layers
        if self.of.seen:
            name = "sky" if self.scene.environment else "mirrors"
            preset = PRESETS[f"{name}-shadows" if row.shadow_rays else name]
            layers = preset.features
        return replace(preset, features=layers, steps=self.options.steps, seed=seed)

    def model(self, row: Row, seed: int) -> Model:
        """Return the network of a row."""
        if row.file:
            return wamnet.load(row.file)
        recipe = self.recipe(row, seed)
        pairs = self.pairs(TRAIN, row, seed)
        return trained(recipe, pairs, self.options.cache / "models", self.options.executor)[0]

    def untrained(self, row: Row) -> Model:
        """Return the network of a row as it is before training, for its time."""
        facts = {"trained_on_shadow_rays": str(row.shadow_rays)}
        return model_of(start(self.recipe(row, 0), Normalization(), ""), facts)

    def images(self, name: str, seed: int) -> list[Floats]:
        """Return the denoised test frames of a row."""
        row = self.rows[name]
        noisy = [frame for frame, _ in self.pairs(self.tests, row, seed)]
        if not row.oidn:
            return denoised(self.model(row, seed), noisy, self.options.executor)
        relit = self.relit(noisy, row, seed) if row.shadow_rays else noisy
        if self.of.seen:
            relit = list(map(past_mirrors, relit))
        found = [filtered(frame, prefiltered(frame), clean=True) for frame in relit]
        return [to_display(image) for image in found]

    def relit(self, found: Sequence[Frame], row: Row, seed: int) -> list[Frame]:
        """Return test frames whose colour has the layer `direct` for what its path has found of that."""
        jobs = [one_scattering(shot, row.rays) for shot in self.shots(self.tests, row, seed)]
        own = self.frames([job for job, _ in jobs])
        lit = [f["direct"] for f in found]
        if row.usual:
            lit = [frame["color"] for frame in self.frames([paths for _, paths in jobs])]
        return [relit(f, o["color"], light) for f, o, light in zip(found, own, lit, strict=True)]


def rows_of_models(files: Sequence[str]) -> dict[str, Row]:
    """Return the rows of models: with the rays of their training; and fewer, which are spread evenly."""
    rows = {}
    for file in files:
        model = wamnet.load(file)
        rays, shadow_rays, name = learned_feature_spp(model), learned_shadow_rays(model), Path(file).stem
        if f"trained_on_{FEATURE_SAMPLER}" in model.info:
            chosen = [(rays // part, False) for part in FEWER]
        else:
            chosen = [(rays, True), (spread_rays(rays), False)]
        for count, at_random in chosen:
            text = f"{count} shadow rays" if shadow_rays else "no shadow ray"
            at = " at random" if at_random else ""
            row = Row(count, shadow_rays, file=file, at_random=at_random)
            rows[f"{name}, {count} camera rays{at}, {text}"] = row
    return rows


@contextmanager
def frame_maker(executor: Executor, scene: Scene, row: Row, model: Model) -> Iterator[Callable[[int], Any]]:
    """Give what makes a frame of a row, of a number: a pipeline, or all its kernels one after another."""
    if not sees(model.features):
        size = (TIMED_PX, TIMED_PX)
        with Pipeline(executor, scene, model, size, **row.of_pipeline) as pipeline:
            yield lambda number: pipeline.run(number, row.spp)
        return
    job = Job(TIMED_PX, TIMED_PX, row.spp, seen=True, shadow_rays=row.shadow_rays, **row.of_pipeline)
    denoiser = Denoiser(executor, model)
    yield lambda number: denoiser.run(
        with_sun(scene, render_on(executor, scene, replace(job, seed=number)).frame)
    )


def milliseconds(
    bench: Bench, models: Mapping[str, Model], clock: Callable[[], float] = time.perf_counter
) -> dict[str, float]:
    """Return the median milliseconds of a frame of each row."""
    found = {name: list[float]() for name in models}
    with open_executor(bench.options.executor) as executor, ExitStack() as stack:
        makers = {
            name: stack.enter_context(frame_maker(executor, bench.scene, bench.rows[name], model))
            for name, model in models.items()
        }
        for number in range(bench.options.rounds + 1):
            for name, made in makers.items():
                started = clock()
                made(number)
                if number:
                    found[name].append(1000.0 * (clock() - started))
    return {name: statistics.median(times) for name, times in found.items()}


def options_of(arguments: Sequence[str] | None) -> argparse.Namespace:
    """Return the options."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--set", nargs="+", default=["minicubes"], metavar="SET", help=", ".join(SETS))
    parser.add_argument("--models", nargs="+", default=[], help="bundled models, or files, in place of rows")
    parser.add_argument("--rows", nargs="+", default=[""], metavar="WORDS", help="rows whose name has these")
    parser.add_argument("--outside", action="store_true", help="test by cameras beyond those of training")
    parser.add_argument("--times", action="store_true", help="time frames, and nothing else")
    parser.add_argument("--frames", type=int, default=24, help="frames to train on")
    parser.add_argument("--tests", type=int, default=4)
    parser.add_argument("--size", type=int, default=128)
    parser.add_argument(
        "--spp", type=int, default=256, help="samples of references; those of tests: four times"
    )
    parser.add_argument("--steps", type=int, default=12_000)
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--rounds", type=int, default=7, help="times of each row, whose median is shown")
    parser.add_argument("--executor", default="opencl")
    parser.add_argument("--cache", type=Path, default=Path("out/lab"))
    return parser.parse_args(arguments)


def main(arguments: Sequence[str] | None = None) -> None:
    """Train, measure, draw and print."""
    options = options_of(arguments)
    sets = {name: Bench(options, name) for name in options.set}
    measure, heads = (times_of, TIMED) if options.times else (scores_of, SCORED)
    lines = {name: measure(bench) for name, bench in sets.items()}
    if len(sets) > 1:
        lines = {name: [[f"{name}: {row}", *rest] for row, *rest in each] for name, each in lines.items()}
    print(markdown(heads, [line for each in lines.values() for line in each]))


def times_of(bench: Bench) -> list[list[str]]:
    """Return lines of a set's rows: processor time, to which other work adds little, and its ratio."""
    rows = {name: row for name, row in bench.rows.items() if not (row.oidn or row.emission)}
    found = milliseconds(bench, {name: bench.untrained(row) for name, row in rows.items()}, time.process_time)
    return [[name, f"{ms:.0f}", f"{ms / found[USUAL]:.2f}"] for name, ms in found.items()]


def scores_of(bench: Bench) -> list[list[str]]:
    """Return lines of the scores of a set's rows, after drawing a picture."""
    seeds = range(bench.options.seeds)
    pairs = bench.pairs(bench.tests, next(iter(bench.rows.values())), 0)
    references, labels = [clean for _, clean in pairs], SHOWN
    if bench.options.models:
        labels = {n: n for n, row in bench.rows.items() if row.file} | SHOWN
    panels = [("one path", to_display(pairs[0][0]["color"]))]
    scores: dict[str, list[dict[str, float]]] = {}
    for name in bench.rows:
        images = [bench.images(name, seed) for seed in seeds]
        each = [[score_lit(*pair) for pair in zip(found, references, strict=True)] for found in images]
        scores[name] = list(map(mean_scores, each))
        panels += [(labels[name], images[0][0])] if name in labels else []
    panels.append(("reference", to_display(references[0]["color"])))
    write_panels(bench.options.cache / "shadows.png", panels, "experiments/shadows.py")
    # Frames of scenes with mirrors are timed by themselves, since no pipeline makes them.
    timed = {n: row for n, row in bench.rows.items() if not (bench.of.seen or row.oidn or row.emission)}
    times = milliseconds(bench, {name: bench.model(row, 0) for name, row in timed.items()})
    return [shown(name, found, times) for name, found in scores.items()]


def shown(name: str, found: Sequence[dict[str, float]], times: Mapping[str, float]) -> list[str]:
    """Return the line of a row: means over its seeds, the range of their PSNR, milliseconds if timed."""
    means, each = mean_scores(found), [scores["psnr"] for scores in found]
    line = [f"{means[key]:.{digits}f}" if key in means else "" for key, (_, digits) in COLUMNS.items()]
    milliseconds = f"{times[name]:.0f}" if name in times else ""
    return [name, *line, f"{min(each):.2f} to {max(each):.2f}", milliseconds]


if __name__ == "__main__":
    begin(main)
