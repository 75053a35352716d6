"""Common ground of the studies: one plan of sizes, and what each of them does again and again.

1. A plan says how large and how many the frames are, and how long a network is trained [`Plan`], [`PLANS`].
2. Pairs of noisy frames and references come from the kept frames [`Ground.pairs`]; training and test times
   lie over one turn of the animation, each test time amid two training times [`Ground.times`].
3. A network is trained on some pairs, looked at on others, and scored [`Ground.train`], [`Ground.judge`].
4. Tables are written beside the results, and printed [`write_table`].

All seeds share the frames: the spread is that of first weights and minibatches.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from wamnet.cli.outputs import write_text
from wamnet.refimpl.denoise import Model
from wamnet.refimpl.encoding import to_display
from wamnet.refimpl.frame import Floats
from wamnet.refimpl.scenes import TURN_SECONDS
from wamnet.refimpl.train import Recipe

from . import frames, scores, training
from .frames import Pair, Shot
from .results import Results


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
    "toy": Plan(16, 2, 1, 2, 4, 2, 8, 2, 8),
    "small": Plan(128, 16, 2, 64, 512, 4000, 512, 4000, 2048),
    "paper": Plan(1024, 32, 8, 256, 1024, 12_000, 512, 20_000, 10_000),
}
"""Plans by scale. The paper's picture and its protocol of training are those of the scale `paper`; a network
of one scene needs no thousand frames, which would not fit into memory either."""


@dataclass
class Ground:
    """Where a study stands: its plan, the folder that keeps frames and networks, and the executor."""

    plan: Plan
    cache: Path
    executor: str

    def times(self) -> tuple[list[float], list[float]]:
        """Return training and test times over one turn."""
        return frames.split_times(self.plan.train_frames, self.plan.test_frames, TURN_SECONDS)

    def shots(self, times: Sequence[float], seed: int = 0, **parameters: Any) -> list[Shot]:
        """Return shots of `minicubes` at times, with the scene's other parameters; each has its own seed."""
        size = self.plan.size
        return [
            Shot("minicubes", time, size, seed=seed + k, parameters=parameters)
            for k, time in enumerate(times)
        ]

    def pairs(self, shots: Sequence[Shot], spp: int) -> list[Pair]:
        """Return the pairs of shots, with references of `spp` samples."""
        return frames.pairs(self.cache / "frames", shots, spp, self.executor)

    def seen(self, **parameters: Any) -> list[Pair]:
        """Return the training pairs."""
        return self.pairs(self.shots(self.times()[0], **parameters), self.plan.train_spp)

    def unseen(self, **parameters: Any) -> list[Pair]:
        """Return the test pairs."""
        shots = self.shots(self.times()[1], TEST_SEED, **parameters)
        return self.pairs(shots, self.plan.test_spp)

    def train(self, recipe: Recipe, pairs: Sequence[Pair]) -> tuple[Model, float]:
        """Return a trained network and the seconds of its training."""
        return training.trained(recipe, pairs, self.cache / "networks", self.executor)

    def pictures(self, model: Model, pairs: Sequence[Pair]) -> list[Floats]:
        """Return what the network makes of the noisy frames."""
        return training.denoised(model, [noisy for noisy, _ in pairs], self.executor)

    def judge(self, model: Model, pairs: Sequence[Pair]) -> dict[str, float]:
        """Return the mean scores of a network on pairs."""
        return judged(self.pictures(model, pairs), pairs)


TEST_SEED = 500
"""Seed of the first test frame: training frames have smaller ones."""


def judged(pictures: Sequence[Floats], pairs: Sequence[Pair]) -> dict[str, float]:
    """Return the mean scores of display-encoded pictures against the references of pairs."""
    found = [
        scores.score(picture, clean["color"]) for picture, (_, clean) in zip(pictures, pairs, strict=True)
    ]
    return scores.mean_scores(found)


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


def write_table(path: Path, text: str) -> None:
    """Write a table, and print it."""
    write_text(path, text)
    sys.stdout.write(text)
