"""Pictures before: what a denoiser gains from them, in motion and at rest, with and without a network.

1. Successive pictures of one path a pixel, 24 a second: camera and scene move, or both rest. Each has a
   history, from where its surfaces were (spec/history.md) [`lab/sequences.py`].
2. A network of the preset `short` with fewer steps sees colour and features, or history and its weight as
   well or in place of colour; it learns from takes that move and some that rest [`INPUTS`].
3. Beside it: the noisy picture, the history as it is, and Open Image Denoise, if it is installed, on the
   noisy picture and on the history [`rows`].
4. Unseen moments from unseen places: scores, and FLIP from picture to picture beyond the references'; at rest
   the variance from picture to picture [`measure`].

    python experiments/history.py
    python experiments/history.py --rays 16 -o out/history-16
    python experiments/history.py --scene glossy --limits 16:8:64 -o out/history-glossy
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cached_property, partial
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from lab import command, motion, sequences, tables, training
from lab.frames import Pair, Shot
from lab.ground import PLANS, Ground, Plan, judged, write_table
from lab.results import Results, Values, fill
from lab.sequences import Take, taken
from lab.sets import SETS
from lab.tables import Column

from wamnet.refimpl.encoding import to_display
from wamnet.refimpl.errors import InputError
from wamnet.refimpl.frame import HISTORY, Floats, Frame
from wamnet.refimpl.light.history import LIMITS, Limits
from wamnet.refimpl.network.train import SHORT
from wamnet_peers.peer_oidn import filtered

CHANGES: Mapping[str, Mapping[str, int]] = {
    "toy": {},
    "small": {"size": 96, "test_frames": 4, "test_spp": 512},
    "paper": {"size": 512},
}
"""What differs from the plan of other studies, by scale: each frame here is the last one of many pictures."""

INPUTS: Mapping[str, tuple[str, ...]] = {
    "network": SHORT.features,
    "network, with history": (*SHORT.features, *HISTORY),
    "network, history in place of colour": (*HISTORY, *SHORT.features[1:]),
}
"""What the networks see. A history that is new is the colour itself, so the last one lacks nothing then."""

OIDN = "Open Image Denoise"
"""How the rows begin that need the package `pyoidn`."""

BEFORE, BEFORE_AT_REST = 16, 64
"""Pictures before those that are looked at: as many as a history counts."""

RESTING = 4
"""One take of so many that are learned from rests."""

MOVING, STILL = "moving", "still"
"""Kinds of takes that are tested."""

KEPT = 4
"""Successive pictures of a tested take that are looked at."""

NOISE_SEED, SEEDS_APART = 20_000, 100
"""Seed of the first picture, and how many seeds later the next take begins."""


@dataclass
class Study:
    """A scene, limits of its histories, rays of its features, and a plan; its ground keeps what is made."""

    ground: Ground
    scene: str
    limits: Limits
    rays: int = 0

    def takes(self, first: int, count: int, kept: int, rests: Callable[[int], bool]) -> list[Take]:
        """Return the takes of draws `first` to before `first + count`."""
        draws = self.ground.draws(SETS[self.scene].ranges, first, count, self.scene)
        shots = [
            Shot(
                self.scene,
                draw.time_s,
                self.ground.plan.size,
                seed=NOISE_SEED + SEEDS_APART * (first + k),
                variation=draw.variation,
                feature_spp=self.rays,
            )
            for k, draw in enumerate(draws)
        ]
        before = [BEFORE_AT_REST if rests(k) else BEFORE for k in range(count)]
        return [taken(shot, before[k], kept, not rests(k), k % 2 == 1) for k, shot in enumerate(shots)]

    def tests(self, kind: str) -> list[Take]:
        """Return the takes to test on: draws that follow those of training."""
        plan = self.ground.plan
        first = plan.train_frames + (plan.test_frames if kind == STILL else 0)
        return self.takes(first, plan.test_frames, KEPT, lambda _: kind == STILL)

    def pairs(self, takes: Sequence[Take], spp: int) -> list[list[Pair]]:
        """Return the last frames of takes with their references."""
        folder, executor = self.ground.cache / "sequences", self.ground.executor
        noisy = sequences.followed(folder, takes, self.limits, executor)
        clean = sequences.references(folder, takes, spp, executor)
        return [list(zip(*both, strict=True)) for both in zip(noisy, clean, strict=True)]

    @cached_property
    def training(self) -> list[Pair]:
        """Return the pairs to train on: one of each take."""
        plan = self.ground.plan
        takes = self.takes(0, plan.train_frames, 1, lambda k: k % RESTING == RESTING - 1)
        return [pair for pairs in self.pairs(takes, plan.train_spp) for pair in pairs]

    @cached_property
    def tested(self) -> dict[str, list[list[Pair]]]:
        """Return the pairs to test on, by kind of take."""
        return {kind: self.pairs(self.tests(kind), self.ground.plan.test_spp) for kind in (MOVING, STILL)}

    def by_network(self, features: tuple[str, ...], frames: Sequence[Frame], seed: int) -> list[Floats]:
        """Return the pictures of a network that sees these features."""
        model, _ = self.ground.train(
            self.ground.plan.adapt(SHORT, features=features, seed=seed), self.training
        )
        return training.denoised(model, frames, self.ground.executor)


Method = Callable[[Sequence[Frame], int], list[Floats]]
"""From frames and a seed to display-encoded pictures (H, W, 3)."""


def shown(layer: str, frames: Sequence[Frame], seed: int) -> list[Floats]:
    """Return a layer as it is."""
    return [to_display(frame[layer]) for frame in frames]


def by_oidn(layer: str, frames: Sequence[Frame], seed: int) -> list[Floats]:
    """Return what Open Image Denoise makes of a layer, with albedo and normal; it has no seeds."""
    named = [Frame({**frame.layers, "color": frame[layer]}) for frame in frames]
    return [to_display(filtered(frame, frame)) for frame in named]


def rows(study: Study) -> dict[str, Method]:
    """Return what makes pictures, in the order of the table."""
    found: dict[str, Method] = {"input": partial(shown, "color"), "history": partial(shown, "history")}
    for name, features in INPUTS.items():
        found[name] = partial(study.by_network, features)
    if find_spec("pyoidn"):
        found[OIDN] = partial(by_oidn, "color")
        found[f"{OIDN}, on the history"] = partial(by_oidn, "history")
    return found


def measure(study: Study, method: Method, seed: int) -> Values:
    """Return scores of both kinds of takes, FLIP between pictures that move, variance of those that rest."""
    found: dict[str, Any] = {}
    for kind, takes in study.tested.items():
        pictures = [method([noisy for noisy, _ in pairs], seed) for pairs in takes]
        flat = [pair for pairs in takes for pair in pairs]
        scores = judged([picture for each in pictures for picture in each], flat)
        found |= {f"{kind} {name}": scores[name] for name in ("psnr", "ssim", "flip")}
        clean = [np.stack([to_display(reference["color"]) for _, reference in pairs]) for pairs in takes]
        stacked = [np.stack(each) for each in pictures]
        both = list(zip(stacked, clean, strict=True))
        found[f"{kind} steps"] = float(np.mean([motion.flip_steps(each) for each in stacked]))
        found[f"{kind} excess"] = float(np.mean([motion.excess_flip(*each) for each in both]))
        found[f"{kind} error"] = float(np.mean([motion.error_variance(*each) for each in both]))
        found[f"{kind} variance"] = float(np.mean([motion.temporal_variance(each) for each in stacked]))
    return found


COLUMNS = (
    Column("moving psnr", "in motion: PSNR, dB"),
    Column("moving ssim", "SSIM", 3),
    Column("moving flip", "FLIP", 3),
    Column("moving excess", "FLIP from picture to picture beyond the reference's", 4),
    Column("moving error", "variance of the error, 1e-4", 2, 1e4),
    Column("still psnr", "at rest: PSNR, dB"),
    Column("still flip", "FLIP", 3),
    Column("still variance", "variance from picture to picture, 1e-4", 2, 1e4),
)
"""The columns of the table."""


def limits_of(text: str) -> Limits:
    """Return the limits that an option names, such as 16:4:64."""
    try:
        moving, of_mirrors, rest = map(float, text.split(":"))
    except ValueError:
        rule = "three numbers of samples with colons"
        raise InputError("--limits", text, rule, "for example 16:4:64") from None
    return Limits(moving, of_mirrors, rest)


def plan_of(scale: str) -> Plan:
    """Return the plan of a scale."""
    return replace(PLANS[scale], **CHANGES[scale])


def parser() -> argparse.ArgumentParser:
    """Return the options."""
    made = command.parser(__doc__ or "", "history")
    made.add_argument("--scene", choices=("minicubes", "glossy", "cornell"), default="minicubes")
    usual = ":".join(f"{limit:g}" for limit in vars(LIMITS).values())
    made.add_argument("--rays", type=int, default=0, help="camera rays of the features; 0: the colour's")
    made.add_argument("--takes", type=int, help="takes that networks learn from")
    made.add_argument("--steps", type=int, help="steps of a training")
    made.add_argument("--limits", default=usual, help="most samples: in motion, of mirrors then, at rest")
    return made


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure whatever is missing, then report."""
    options = parser().parse_args(arguments)
    chosen = {"train_frames": options.takes, "steps": options.steps}
    plan = replace(
        plan_of(options.scale), **{name: value for name, value in chosen.items() if value is not None}
    )
    ground = Ground(plan, options.cache, options.executor)
    study = Study(ground, options.scene, limits_of(options.limits), options.rays)
    settings = {
        **asdict(plan),
        "executor": options.executor,
        "scene": study.scene,
        "limits": vars(study.limits),
        **({"rays": study.rays} if study.rays else {}),
    }
    results = Results.open(Path(options.output) / "results.json", "history", settings)
    work = {name: partial(measure, study, method) for name, method in rows(study).items()}
    fill(results, work, options.seeds, "measuring")
    head = f"`{study.scene}`, limits {options.limits}"
    names = {name: name for name in work}
    write_table(options.output / "table.md", tables.table(results, COLUMNS, names, head))


if __name__ == "__main__":
    command.begin(main)
