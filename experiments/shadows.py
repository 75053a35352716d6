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
   too [`lab/scores.py`]. Milliseconds are those of a pipeline's frame, paths, features and network, 512 x 512
   pixels, rows in turn [`milliseconds`]. A picture shows a test frame by the rows in `SHOWN`.
5. With `--models` nothing is trained: their rows have the rays that they were trained on, and fewer of them
   [`rows_of_models`]. `--frames` is then the number of frames of their training. `--rows` leaves rows out.

Prints a Markdown table.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from lab.command import begin
from lab.frames import Shot, frames, noisy, one_scattering, past_mirrors, reference, relit
from lab.scores import mean_scores, score_lit
from lab.sets import SETS, Counts
from lab.tables import markdown
from lab.training import denoised, trained

import wamnet
from wamnet.cli.files.images import write_panels
from wamnet.kernels import open_executor
from wamnet.kernels.devices.executor import Executor
from wamnet.kernels.run.pipeline import Pipeline
from wamnet.models.data.frame_plan import TEST, TRAIN
from wamnet.refimpl.encoding import to_display
from wamnet.refimpl.frame import Floats, Frame
from wamnet.refimpl.light.render import FEATURE_SAMPLER, spread_rays
from wamnet.refimpl.light.scene import Scene
from wamnet.refimpl.light.scenes import canonical
from wamnet.refimpl.light.transport import Settings
from wamnet.refimpl.network.denoise import Model, learned_feature_spp, learned_shadow_rays
from wamnet.refimpl.network.train import BEST, PRESETS, Recipe
from wamnet_peers.peer_oidn import filtered, prefiltered

TIMED_PX = 512
"""Side of the timed image."""

ROUNDS = 7
"""Times of each row, of which the median is shown."""


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
    "4 camera rays, 4 shadow rays": Row(4, 1),
    "8 camera rays, 8 shadow rays": Row(8, 1),
    "16 camera rays, no shadow ray": Row(16),
    "16 camera rays, 16 shadow rays": Row(16, 1),
    "Open Image Denoise, 16 camera rays, no shadow ray": Row(16, oidn=True),
    "Open Image Denoise, 16 camera rays, 16 shadow rays": Row(16, 1, oidn=True),
    "Open Image Denoise, 16 camera rays, 16 paths of one scattering": Row(16, 1, oidn=True, usual=True),
}
"""The rows by name; shadow rays are those of all camera rays together."""

THEIRS = {name: row for name, row in ROWS.items() if row.oidn}
"""The rows of Open Image Denoise."""

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


@dataclass(frozen=True)
class Bench:
    """Sizes, and where frames and networks are kept."""

    options: argparse.Namespace

    @cached_property
    def rows(self) -> Mapping[str, Row]:
        """The rows by name."""
        rows = {**rows_of_models(self.options.models), **THEIRS} if self.options.models else ROWS
        mirrors = SETS[self.options.set].seen  # whose direct light is not what the layer says
        shown = {
            name: row
            for name, row in rows.items()
            if not (mirrors and row.oidn and row.shadow_rays) or row.usual
        }
        return {name: row for name, row in shown.items() if self.options.rows in name}

    def frames(self, shots: Sequence[Shot]) -> list[Frame]:
        """Return frames, rendered where they are not there."""
        return frames(self.options.cache / "frames", shots, self.options.executor)

    def shots(self, split: str, row: Row, seed: int) -> list[Shot]:
        """Return the noisy shots of a row."""
        of, noise = SETS[self.options.set], 2 * seed + (split == TEST)
        counts = Counts(self.options.frames, self.options.tests, 0)
        found = of.shots(split, counts, self.options.size, row.rays, noise, row.shadow_rays)
        return [replace(noisy(s), seen=s.seen or row.emission, spread=not row.at_random) for s in found]

    def pairs(self, split: str, row: Row, seed: int) -> list[tuple[Frame, Frame]]:
        """Return noisy frames and references; those of tests have the layer `direct`."""
        spp, shadow_rays = (4 * self.options.spp, 1) if split == TEST else (self.options.spp, 0)
        of, counts = SETS[self.options.set], Counts(self.options.frames, self.options.tests, 0)
        clean = [reference(shot, spp) for shot in of.shots(split, counts, self.options.size)]
        targets = self.frames([replace(shot, shadow_rays=shadow_rays) for shot in clean])
        return list(zip(self.frames(self.shots(split, row, seed)), targets, strict=True))

    def recipe(self, row: Row, seed: int) -> Recipe:
        """Return the recipe of a row: that of a set's preset, with direct light if it has shadow rays."""
        preset, layers = BEST, row.layers
        if SETS[self.options.set].seen:
            name = "sky" if canonical(SETS[self.options.set].scene).environment else "mirrors"
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

    def images(self, name: str, seed: int) -> list[Floats]:
        """Return the denoised test frames of a row."""
        row = self.rows[name]
        noisy = [frame for frame, _ in self.pairs(TEST, row, seed)]
        if not row.oidn:
            return denoised(self.model(row, seed), noisy, self.options.executor)
        relit = self.relit(noisy, row, seed) if row.shadow_rays else noisy
        if SETS[self.options.set].seen:
            relit = list(map(past_mirrors, relit))
        found = [filtered(frame, prefiltered(frame), clean=True) for frame in relit]
        return [to_display(image) for image in found]

    def relit(self, found: Sequence[Frame], row: Row, seed: int) -> list[Frame]:
        """Return test frames whose colour has the layer `direct` for what its path has found of that."""
        jobs = [one_scattering(shot, row.rays) for shot in self.shots(TEST, row, seed)]
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


def milliseconds(
    executor: Executor, scene: Scene, rows: Mapping[str, Row], models: Mapping[str, Model]
) -> dict[str, float]:
    """Return the median milliseconds of a frame by each row's pipeline."""
    size, found = (TIMED_PX, TIMED_PX), {name: list[float]() for name in models}
    with ExitStack() as stack:
        opened = {
            name: stack.enter_context(Pipeline(executor, scene, model, size, **rows[name].of_pipeline))
            for name, model in models.items()
        }
        for number in range(ROUNDS + 1):
            for name, pipeline in opened.items():
                started = time.perf_counter()
                pipeline.run(number, rows[name].spp)
                if number:
                    found[name].append(1000.0 * (time.perf_counter() - started))
    return {name: statistics.median(times) for name, times in found.items()}


def options_of(arguments: Sequence[str] | None) -> argparse.Namespace:
    """Return the options."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--set", default="minicubes", metavar="SET", help=", ".join(SETS))
    parser.add_argument("--models", nargs="+", default=[], help="bundled models, or files, in place of rows")
    parser.add_argument("--rows", default="", metavar="WORDS", help="rows whose name has these words")
    parser.add_argument("--frames", type=int, default=24, help="frames to train on")
    parser.add_argument("--tests", type=int, default=4)
    parser.add_argument("--size", type=int, default=128)
    parser.add_argument(
        "--spp", type=int, default=256, help="samples of references; those of tests: four times"
    )
    parser.add_argument("--steps", type=int, default=12_000)
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--executor", default="opencl")
    parser.add_argument("--cache", type=Path, default=Path("out/lab"))
    return parser.parse_args(arguments)


def main(arguments: Sequence[str] | None = None) -> None:
    """Train, measure, draw and print."""
    bench = Bench(options_of(arguments))
    seeds = range(bench.options.seeds)
    pairs = bench.pairs(TEST, next(iter(bench.rows.values())), 0)
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
    # What is seen past mirrors and glass has no further camera rays in a pipeline: no time of that row.
    seen = SETS[bench.options.set].seen
    rows = {} if seen else {n: row for n, row in bench.rows.items() if not (row.oidn or row.emission)}
    timed = {name: bench.model(row, 0) for name, row in rows.items()}
    with open_executor(bench.options.executor) as executor:
        times = milliseconds(executor, canonical(SETS[bench.options.set].scene), bench.rows, timed)
    heads = ["features", *(head for head, _ in COLUMNS.values()), "PSNR, range of seeds", "ms"]
    print(markdown(heads, [shown(name, found, times) for name, found in scores.items()]))


def shown(name: str, found: Sequence[dict[str, float]], times: Mapping[str, float]) -> list[str]:
    """Return the line of a row: means over its seeds, the range of their PSNR, milliseconds if timed."""
    means, each = mean_scores(found), [scores["psnr"] for scores in found]
    line = [f"{means[key]:.{digits}f}" if key in means else "" for key, (_, digits) in COLUMNS.items()]
    milliseconds = f"{times[name]:.0f}" if name in times else ""
    return [name, *line, f"{min(each):.2f} to {max(each):.2f}", milliseconds]


if __name__ == "__main__":
    begin(main)
