"""Soft shadows: what shadow rays of the features gain, beside what they cost.

    python experiments/publish.py --run shadows python experiments/shadows.py

1. Frames of the mini cubes are drawn from the ranges of the set `minicubes`, at every time and from moving
   cameras, with the features of each row [`ROWS`]: camera rays, shadow rays of each, paths per pixel.
2. A network is trained for each row and seed by the preset `best`, whose input is the layer `unshadowed`
   where there are no shadow rays, and `direct` in its place where there are [`Bench.images`].
3. Scores are means over test frames that nothing was chosen on, in the penumbra and after a blur too
   [`scored`]. Milliseconds are those of the kernel of paths and features, 512 x 512 pixels, rows in turn
   [`milliseconds`]. A picture beside the frames shows a test frame by the rows in `SHOWN`.

Prints a Markdown table.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import statistics
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path

from lab.command import begin
from lab.scores import mean_scores, score
from lab.sets import SETS, Counts
from lab.tables import markdown
from lab.training import denoised, trained

from wamnet.cli.files import exr
from wamnet.cli.files.images import write_panels
from wamnet.compiler.scenes.lower_scene import FeatureRays, lower_scene
from wamnet.compiler.scenes.path_kernel import compile_path, forms_of
from wamnet.kernels import open_executor
from wamnet.kernels.devices.executor import Executor
from wamnet.kernels.devices.kernel import Part
from wamnet.kernels.run.render_frame import render_frame
from wamnet.kernels.run.render_on import Frames
from wamnet.models.data.frame_plan import TEST, TRAIN
from wamnet.refimpl import metrics
from wamnet.refimpl.encoding import LEVELS, to_display
from wamnet.refimpl.frame import Floats, Frame
from wamnet.refimpl.light.render import Job
from wamnet.refimpl.light.scene import Scene, scene_digest
from wamnet.refimpl.light.scenes import canonical
from wamnet.refimpl.light.transport import Settings
from wamnet.refimpl.light.variation import varied
from wamnet.refimpl.network.train import BEST

SET = SETS["minicubes"]
"""Where the frames are drawn from."""

TIMED_PX = 512
"""Side of the timed image."""

ROUNDS = 7
"""Times of each row, of which the median is shown."""

SEED_STEP = 1000
"""Noise of frames has the seed of the network times this, and more."""


@dataclass(frozen=True)
class Row:
    """Camera rays of the features, shadow rays of each, and paths, per pixel; `both`: `unshadowed` too."""

    rays: int
    shadow_rays: int = 0
    spp: int = 1
    both: bool = False

    @property
    def layers(self) -> tuple[str, ...]:
        """Return the layers that the network reads."""
        lit = ("unshadowed",) if self.both or not self.shadow_rays else ()
        return "color", "normal", "albedo", "position", *lit, *(("direct",) if self.shadow_rays else ())


ROWS = {
    "1 camera ray, no shadow ray": Row(1),
    "1 camera ray, 1 shadow ray": Row(1, 1),
    "4 camera rays, no shadow ray": Row(4),
    "4 camera rays, 4 shadow rays": Row(4, 1),
    "4 camera rays, 16 shadow rays": Row(4, 4),
    "4 camera rays, 4 shadow rays, both layers": Row(4, 1, both=True),
    "4 camera rays, 16 shadow rays, both layers": Row(4, 4, both=True),
    "4 camera rays, no shadow ray, 2 paths": Row(4, 0, 2),
}
"""The rows by name; shadow rays are those of all camera rays together."""

SHOWN = {
    "4 camera rays, no shadow ray": "no shadow ray",
    "4 camera rays, 4 shadow rays": "4 shadow rays",
    "4 camera rays, 16 shadow rays": "16 shadow rays",
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
    def kernels(self) -> Frames:
        """The kernels that all frames share: compiling one for each frame takes longer than rendering it."""
        return Frames([scene for split in (TRAIN, TEST) for scene in self.scenes(split)])

    def scenes(self, split: str) -> list[Scene]:
        """Return the scenes of a split."""
        draws = SET.draws(split, Counts(self.options.frames, self.options.tests, 0))
        return [varied(canonical(SET.scene, time=draw.time_s), draw.variation) for draw in draws]

    def frame(self, scene: Scene, job: Job) -> Frame:
        """Return a frame, rendered if it is not there."""
        folder, executor = self.options.cache / "frames", self.options.executor
        text = json.dumps([scene_digest(scene), job.facts(), executor], sort_keys=True)
        path = folder / f"{hashlib.sha256(text.encode()).hexdigest()[:16]}.exr"
        if not path.exists():
            folder.mkdir(parents=True, exist_ok=True)
            exr.write_frame(path, render_frame(executor, scene, job, frames=self.kernels).frame)
        return exr.read_frame(path)

    def pairs(self, split: str, row: Row, seed: int) -> list[tuple[Frame, Frame]]:
        """Return noisy frames and references; those of tests have the layer `direct`."""
        size, found = self.options.size, []
        for index, scene in enumerate(self.scenes(split)):
            number = 2 * (SEED_STEP * seed + index) + (SEED_STEP if split == TEST else 0)
            noisy = Job(size, size, row.spp, number, feature_spp=row.rays, shadow_rays=row.shadow_rays)
            clean = Job(size, size, self.options.spp, 2 * index + 1)
            if split == TEST:
                clean = replace(clean, spp=4 * clean.spp, seed=2 * index + 1 + SEED_STEP, shadow_rays=4)
            found.append((self.frame(scene, noisy), self.frame(scene, clean)))
        return found

    def images(self, name: str, seed: int) -> list[Floats]:
        """Return the denoised test frames of a row."""
        row, executor = ROWS[name], self.options.executor
        recipe = replace(BEST, features=row.layers, steps=self.options.steps, seed=seed)
        model, _ = trained(recipe, self.pairs(TRAIN, row, seed), self.options.cache / "models", executor)
        return denoised(model, [noisy for noisy, _ in self.pairs(TEST, row, seed)], executor)


def scored(image: Floats, reference: Frame) -> dict[str, float]:
    """Return the scores of a denoised frame, in the penumbra and after a blur too."""
    target, mask = (
        to_display(reference["color"]),
        metrics.penumbra(reference["direct"], reference["unshadowed"]),
    )
    return {
        **score(image, reference["color"]),
        "penumbra": LEVELS * metrics.inside(mask, image, target),
    }


def milliseconds(executor: Executor) -> dict[str, float]:
    """Return the median milliseconds of each row's kernel of paths and features."""
    scene, part = canonical(SET.scene), Part(TIMED_PX, TIMED_PX, 0, TIMED_PX, 0, 1, 0)
    launches: dict[str, Callable[[], object]] = {}
    for name, row in ROWS.items():
        rays = FeatureRays(row.rays, "net") if row.rays > 1 else None
        programs = lower_scene(
            scene, Settings(), forms_of(executor.name), rays=rays, shadow_rays=row.shadow_rays
        )
        kernel = compile_path(programs, executor.name, "native", executor.lanes, row.layers)
        executor.build(kernel)
        launches[name] = partial(executor.trace, kernel, replace(part, samples=row.spp))
    found: dict[str, list[float]] = {name: [] for name in launches}
    for number in range(ROUNDS + 1):
        for name, launch in launches.items():
            started = time.perf_counter()
            launch()
            if number:
                found[name].append(1000.0 * (time.perf_counter() - started))
    return {name: statistics.median(times) for name, times in found.items()}


def main(arguments: Sequence[str] | None = None) -> None:
    """Train, measure, draw and print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--frames", type=int, default=24, help="frames to train on")
    parser.add_argument("--tests", type=int, default=4)
    parser.add_argument("--size", type=int, default=128)
    parser.add_argument(
        "--spp", type=int, default=256, help="samples of references; those of tests: four times"
    )
    parser.add_argument("--steps", type=int, default=12_000)
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--executor", default="opencl")
    parser.add_argument("--cache", type=Path, default=Path("out/shadows"))
    bench = Bench(parser.parse_args(arguments))
    with open_executor(bench.options.executor) as executor:
        times = milliseconds(executor)
    today = bench.pairs(TEST, ROWS[next(iter(SHOWN))], 0)
    references, rows = [clean for _, clean in today], []
    panels = [("one path", to_display(today[0][0]["color"]))]
    for name in ROWS:
        images = [image for seed in range(bench.options.seeds) for image in bench.images(name, seed)]
        each = [scored(image, references[n % len(references)]) for n, image in enumerate(images)]
        found = mean_scores(each)
        rows.append([name, *(f"{found[key]:.{digits}f}" for key, (_, digits) in COLUMNS.items())])
        rows[-1].append(f"{times[name]:.0f}")
        panels += [(SHOWN[name], images[0])] if name in SHOWN else []
    panels.append(("reference", to_display(references[0]["color"])))
    write_panels(bench.options.cache / "shadows.png", panels, "experiments/shadows.py")
    print(markdown(["features", *(head for head, _ in COLUMNS.values()), "ms"], rows))


if __name__ == "__main__":
    begin(main)
