"""Common ground of the studies: one plan of sizes, and what each of them does again and again.

1. A plan says how large and how many the frames are, and how long a network is trained [`Plan`], [`PLANS`].
2. Frames are drawn one by one: times follow the golden-ratio sequence over the whole turn, so that no two
   show the same pose, and camera and lamps are drawn independently of them [`Ground.draws`]. Tests continue
   the sequence of training.
3. Pairs of noisy frames and references come from the kept frames [`Ground.pairs`].
4. A network is trained on some pairs, looked at on others, and scored [`Ground.train`], [`Ground.judge`]: its
   means, and the scores of each frame [`judged`]. Scores of several kinds of frames stand side by side
   [`told`], [`together`].
5. Before a study begins it says what is left to be rendered and trained, and about how long that takes
   [`measure_all`]. Tables are written beside the results, and printed [`write_table`].

All seeds share the frames: intervals are over frames, and over first weights and minibatches.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from wamnet.cli.files.outputs import write_text
from wamnet.models.data.draws import Draw, drawn
from wamnet.refimpl.encoding import to_display
from wamnet.refimpl.frame import Floats
from wamnet.refimpl.light.scenes import canonical
from wamnet.refimpl.light.variation import Ranges
from wamnet.refimpl.network.denoise import Model
from wamnet.refimpl.network.train import Recipe

from . import frames, scores, training
from .frames import Pair, Shot
from .results import PER_FRAME, Results, Values, fill

SCENE = "minicubes"
"""The scene of all studies."""

AS_IT_IS = Ranges()
"""The scene's own camera and lamps: frames differ in time only."""

KEPT = ("psnr", "ssim", "flip")
"""Scores that are kept of every frame."""


@dataclass(frozen=True)
class Plan:
    """Sizes of a study: pixels a side, frames, samples of references, steps of a training, its minibatch.

    `paper_steps` are those of the paper's protocol, which has a minibatch of its own.
    """

    size: int
    train_frames: int
    test_frames: int
    train_spp: int
    test_spp: int
    steps: int
    batch: int
    paper_steps: int
    paper_batch: int

    def adapt(self, recipe: Recipe, **changes: Any) -> Recipe:
        """Return a recipe with the plan's steps and minibatch, and with further changes."""
        return replace(recipe, **{"steps": self.steps, "batch": self.batch, **changes})


PLANS: Mapping[str, Plan] = {
    "toy": Plan(16, 2, 2, 2, 4, 2, 8, 2, 8),
    "small": Plan(256, 24, 6, 64, 1024, 4000, 512, 20_000, 10_000),
    "paper": Plan(1024, 32, 8, 256, 1024, 12_000, 512, 20_000, 10_000),
}
"""Plans by scale. The paper's protocol of training is whole at both, its picture that of the scale `paper`; a
network of one scene needs no thousand frames, which would not fit into memory either."""


@dataclass
class Ground:
    """What a study builds on: its plan, the folder that keeps frames and networks, and the executor."""

    plan: Plan
    cache: Path
    executor: str

    def times(self) -> tuple[list[float], list[float]]:
        """Return training and test times over one turn."""
        seconds = AS_IT_IS.time_s[1]
        return frames.split_times(self.plan.train_frames, self.plan.test_frames, seconds)

    def draws(self, ranges: Ranges, first: int, count: int, scene: str = SCENE) -> list[Draw]:
        """Return draws number `first` to before `first + count`: times, cameras, lamps, each independent."""
        return drawn(frames.TIMES_SEED, ranges, canonical(scene).lights, first, count)

    def shots(self, draws: Sequence[Draw], seed: int = 0, scene: str = SCENE) -> list[Shot]:
        """Return the shots of draws; the first has this seed of noise, and each its own."""
        size = self.plan.size
        return [
            Shot(scene, draw.time_s, size, seed=seed + k, variation=draw.variation)
            for k, draw in enumerate(draws)
        ]

    def training_shots(self, ranges: Ranges = AS_IT_IS, seed: int = 0, scene: str = SCENE) -> list[Shot]:
        """Return the shots of the training frames."""
        return self.shots(self.draws(ranges, 0, self.plan.train_frames, scene), seed, scene)

    def test_shots(
        self, ranges: Ranges = AS_IT_IS, seed: int | None = None, scene: str = SCENE
    ) -> list[Shot]:
        """Return the shots of the test frames: the draws that follow those of training."""
        found = self.draws(ranges, self.plan.train_frames, self.plan.test_frames, scene)
        return self.shots(found, TEST_SEED if seed is None else seed, scene)

    def pairs(self, shots: Sequence[Shot], spp: int) -> list[Pair]:
        """Return the pairs of shots, with references of `spp` samples."""
        return frames.pairs(self.cache / "frames", shots, spp, self.executor)

    def learned(self, shots: Sequence[Shot]) -> list[Pair]:
        """Return pairs to train on."""
        return self.pairs(shots, self.plan.train_spp)

    def tested(self, shots: Sequence[Shot]) -> list[Pair]:
        """Return pairs to test on."""
        return self.pairs(shots, self.plan.test_spp)

    def seen(self) -> list[Pair]:
        """Return the training pairs of the scene as it is."""
        return self.learned(self.training_shots())

    def unseen(self) -> list[Pair]:
        """Return the test pairs of the scene as it is."""
        return self.tested(self.test_shots())

    def train(self, recipe: Recipe, pairs: Sequence[Pair]) -> tuple[Model, float]:
        """Return a trained network and the seconds of its training."""
        return training.trained(recipe, pairs, self.cache / "networks", self.executor)

    def pictures(self, model: Model, pairs: Sequence[Pair]) -> list[Floats]:
        """Return what the network makes of the noisy frames."""
        return training.denoised(model, [noisy for noisy, _ in pairs], self.executor)

    def judge(self, model: Model, pairs: Sequence[Pair]) -> dict[str, Any]:
        """Return the scores of a network on pairs."""
        return judged(self.pictures(model, pairs), pairs)


TEST_SEED = 500
"""Seed of the first test frame: training frames have smaller ones."""


def judged(pictures: Sequence[Floats], pairs: Sequence[Pair]) -> dict[str, Any]:
    """Return the scores of display-encoded pictures against references: their means, and those of each."""
    found = [
        scores.score(picture, clean["color"]) for picture, (_, clean) in zip(pictures, pairs, strict=True)
    ]
    each = {name: [round(values[name], 5) for values in found] for name in KEPT}
    return {**scores.mean_scores(found), PER_FRAME: each}


def told(found: Values, where: str = "", names: Sequence[str] = KEPT) -> dict[str, Any]:
    """Return some scores under names that say on which frames they are: `psnr at 4`."""
    renamed = {name: f"{name} {where}".rstrip() for name in names}
    each = {renamed[name]: found[PER_FRAME][name] for name in names if name in found[PER_FRAME]}
    return {**{renamed[name]: found[name] for name in names}, PER_FRAME: each}


def together(*parts: Values) -> dict[str, Any]:
    """Return the scores of several parts, and those of each frame, side by side."""
    each = {name: row for part in parts for name, row in part.get(PER_FRAME, {}).items()}
    return {**{name: value for part in parts for name, value in part.items()}, PER_FRAME: each}


def inputs(pairs: Sequence[Pair]) -> list[Floats]:
    """Return the noisy colours of pairs, display-encoded."""
    return [to_display(noisy["color"]) for noisy, _ in pairs]


def targets(pairs: Sequence[Pair]) -> list[Floats]:
    """Return the references of pairs, display-encoded."""
    return [to_display(clean["color"]) for _, clean in pairs]


def start(
    parser: argparse.ArgumentParser, name: str, arguments: Sequence[str] | None
) -> tuple[argparse.Namespace, Ground, Results]:
    """Return the options of a study, its ground, and its results so far."""
    options = parser.parse_args(arguments)
    plan = PLANS[options.scale]
    settings = {**asdict(plan), "executor": options.executor}
    results = Results.open(options.output / "results.json", name, settings)
    return options, Ground(plan, options.cache, options.executor), results


SAMPLES_PER_S = 1.0e7
"""Camera paths of `minicubes` that two quiet cores trace in a second, roughly."""

WINDOWS_PER_S = 3.0e5
"""Windows that the preset `short` trains on in a second there, by the compiled step."""

JUDGED_PER_S = 4.0
"""Pictures of 256x256 pixels that are denoised and scored in a second there."""

Needed = tuple[Sequence[Shot], int]
"""Shots, and the samples of their references."""


@dataclass(frozen=True)
class Cost:
    """What a study needs: shots, and for each configuration and seed a training and scores of pictures.

    `windows` are those of a training, in units of the preset `short`; None: of the plan's.
    """

    needed: Sequence[Needed]
    pictures: int
    windows: float | None = None


def left_to_render(ground: Ground, needed: Sequence[Needed]) -> tuple[int, int]:
    """Return how many frames are not there yet, and their samples."""
    wanted = [
        shot
        for shots, spp in needed
        for each in shots
        for shot in (frames.noisy(each), frames.reference(each, spp))
    ]
    folder = ground.cache / "frames"
    missing = {
        path: shot.job.samples
        for shot in wanted
        for path in [frames.path_of(folder, shot, ground.executor)]
        if not any(folder.glob(f"{path.name}.*.exr"))
    }
    return len(missing), sum(missing.values())


def estimate(ground: Ground, cost: Cost, measures: int) -> str:
    """Return in one line what is left to be done for so many configurations and seeds, and how long it takes.

    Networks that are kept already are counted again: the line says the most that it can be.
    """
    count, samples = left_to_render(ground, cost.needed)
    windows = ground.plan.steps * ground.plan.batch if cost.windows is None else cost.windows
    pixels = (ground.plan.size / 256) ** 2
    each = windows / WINDOWS_PER_S + cost.pictures * pixels / JUDGED_PER_S
    minutes = (samples / SAMPLES_PER_S / 60.0, measures * each / 60.0)
    return (
        f"{count} frames to render, about {minutes[0]:.1f} min; {measures} networks to train and judge, "
        f"at most {minutes[1]:.1f} min: on two quiet cores\n"
    )


def measure_all(
    ground: Ground,
    results: Results,
    work: Mapping[str, Callable[[int], Values]],
    seeds: Sequence[int],
    cost: Cost,
) -> None:
    """Say what a study will cost, then measure whatever has no record."""
    left = sum(results.get(name, seed) is None for name in work for seed in seeds)
    sys.stderr.write(f"{results.experiment}: {estimate(ground, cost, left)}")
    fill(results, work, seeds, "measuring")


def write_table(path: Path, text: str) -> None:
    """Write a table, and print it."""
    write_text(path, text)
    sys.stdout.write(text)
