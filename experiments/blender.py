"""Frames of a Blender file: a network of that film against Blender's own Open Image Denoise, on unseen ones.

1. Two films of our own are made by `examples/blender/scenes.py`; `wamnet dataset --from-blender` renders
   frames to learn from, and others to judge by [`Film.frames`].
2. Networks of the preset `short` learn them, each from a seed of its own [`Study.pictures`].
3. Blender renders the same noisy frames, with the same seed, and denoises them with its accurate prefilter,
   by colour, albedo and normal [`Film.peer`].
4. Both are scored by PSNR, display-encoded, on three kinds of frames: between those of the training, of a
   part of the film that training leaves out, and of the film by a camera from a path aside [`KINDS`].
5. One sample a pixel has jags at edges, which a network of the film can learn to smooth. So pixels with no
   edge of albedo or normal around them are scored by themselves, too [`away_from_edges`].

    python experiments/blender.py -o out/blender

It needs Blender as a Python module: `pip install --no-deps bpy`.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cached_property, partial
from pathlib import Path
from typing import Any

import numpy as np
from lab import command, tables, training
from lab.ground import write_table
from lab.intervals import interval, paired
from lab.results import PER_FRAME, Results, fill
from numpy.typing import NDArray

from wamnet.cli.commands.blender.dataset import Asked, make
from wamnet.cli.files import dataset_files, exr
from wamnet.models.blender.plan import Animation, Request, plan
from wamnet.models.blender.session import Blender
from wamnet.models.data.frame_plan import KINDS as PICTURES
from wamnet.models.data.frame_plan import OUTSIDE, TEST, TRAIN
from wamnet.refimpl.encoding import to_display
from wamnet.refimpl.frame import Floats, Frame
from wamnet.refimpl.metrics import psnr
from wamnet.refimpl.network.dataset import Window, all_windows, pad
from wamnet.refimpl.network.train import SHORT

SCENES = ("hall", "yard")
"""The films."""

SCRIPT = Path(__file__).resolve().parents[1] / "examples/blender/scenes.py"
"""What makes them."""

ASIDE_M = 1.0
"""How far the other camera's path is aside: some 12 degrees, seen from what both look at."""

KINDS = ("between", "other part", "other camera")
"""Frames to judge by: between those of the training, after them, and of the whole film from aside."""

ARC_S = 0.5
"""Seconds at the film's end, a quarter of it, that training leaves out."""

OURS, PEER, NOISY = "network", "oidn", "noisy"
"""Names of the scores, in dB."""


EDGE = 0.1
"""Difference of albedo or normal within 3 x 3 pixels from which on there is an edge."""


def away_from_edges(frame: Frame) -> NDArray[np.bool_]:
    """Return (H, W): whether albedo and normal of the 3 x 3 pixels around each differ by less than EDGE."""
    guides = np.concatenate([frame["albedo"], frame["normal"]], axis=-1).astype(np.float64)
    around = all_windows(pad(guides, Window(3, "clamp")), Window(3, "clamp"))
    taps = around.reshape(*guides.shape[:2], 9, -1)
    smooth: NDArray[np.bool_] = (np.ptp(taps, axis=2) < EDGE).all(axis=-1)
    return smooth


@dataclass(frozen=True)
class Plan:
    """Percent of 384 x 288 pixels, frames to learn and to judge by, samples of their targets, training."""

    percent: int
    train: int
    test: int
    spp: int
    test_spp: int
    steps: int
    batch: int


PLANS: Mapping[str, Plan] = {
    "toy": Plan(5, 2, 1, 2, 4, 2, 8),
    "small": Plan(50, 16, 8, 256, 1024, SHORT.steps, SHORT.batch),
    "paper": Plan(100, 16, 12, 512, 2048, SHORT.steps, SHORT.batch),
}
"""Plans by scale."""


@dataclass(frozen=True)
class Film:
    """A film in a folder: its Blender file, its data set, and what Blender makes of noisy frames."""

    scene: str
    aside: float
    plan: Plan
    folder: Path

    @property
    def name(self) -> str:
        """Return what its files are called."""
        return f"{self.scene}{'-aside' if self.aside else ''}-{self.plan.percent}"

    @cached_property
    def file(self) -> Path:
        """Return the Blender file, made now if it is not there."""
        path = self.folder / f"{self.name}.blend"
        if not path.exists():
            self.folder.mkdir(parents=True, exist_ok=True)
            given = [self.scene, str(path.absolute()), str(self.aside)]
            subprocess.run([sys.executable, str(SCRIPT), *given], check=True, capture_output=True)
        return path

    @cached_property
    def data(self) -> Path:
        """Return the folder of its data set; from aside nothing is learned but one frame, for its form."""
        plan, folder = self.plan, self.folder / self.name
        counts = (1, plan.test, 0) if self.aside else (plan.train, plan.test, plan.test)
        arc = 0.0 if self.aside else ARC_S
        make(folder, Asked(self.file, *counts, plan.spp, plan.test_spp, arc, seed=7, percent=plan.percent))
        return folder

    def frames(self, split: str) -> list[tuple[Frame, Frame]]:
        """Return pairs of a noisy frame and its reference."""
        return dataset_files.read_pairs(self.data, split)

    def peer(self, split: str) -> list[Floats]:
        """Return the display-encoded pictures of Blender's denoiser, of the same frames by the same seeds."""
        asked = dataset_files.read_manifest(self.data)["request"]
        request = Request(**{**asked, "animation": Animation(**asked["animation"])})
        shots = [frame.pictures[PICTURES[0]] for frame in plan(request) if frame.split == split]
        found = []
        with Blender(self.file) as blender, tempfile.TemporaryDirectory() as scratch:
            for shot in shots:
                path = Path(scratch, "picture.exr")
                blender.render(shot, path, "ACCURATE")
                found.append(to_display(exr.read_frame(path)["color"].astype(np.float64)))
        return found


@dataclass(frozen=True)
class Study:
    """One scene: networks of its film, and the scores of both on frames of every kind."""

    scene: str
    plan: Plan
    cache: Path
    executor: str

    @cached_property
    def own(self) -> Film:
        """Return the film that is learned."""
        return Film(self.scene, 0.0, self.plan, self.cache / "blender")

    @cached_property
    def other(self) -> Film:
        """Return the film from aside."""
        return replace(self.own, aside=ASIDE_M)

    @cached_property
    def judged(self) -> Mapping[str, tuple[list[tuple[Frame, Frame]], list[Floats]]]:
        """Return by kind the pairs to judge by, and what the peer makes of them."""
        where = dict(zip(KINDS, ((self.own, TEST), (self.own, OUTSIDE), (self.other, TEST)), strict=True))
        return {kind: (film.frames(split), film.peer(split)) for kind, (film, split) in where.items()}

    def pictures(self, noisy: Sequence[Frame], seed: int) -> tuple[list[Floats], float]:
        """Return what the network of a seed makes of frames, and the seconds of its training."""
        recipe = replace(SHORT, steps=self.plan.steps, batch=self.plan.batch, seed=seed)
        pairs = self.own.frames(TRAIN)
        model, seconds = training.trained(recipe, pairs, self.cache / "networks", self.executor)
        return training.denoised(model, noisy, self.executor), seconds

    def scored(self, kind: str, seed: int) -> dict[str, Any]:
        """Return the record of a kind of frames: PSNR of each frame by each method, and seconds."""
        pairs, peers = self.judged[kind]
        ours, seconds = self.pictures([noisy for noisy, _ in pairs], seed)
        clean = [to_display(reference["color"].astype(np.float64)) for _, reference in pairs]
        inputs = [to_display(noisy["color"].astype(np.float64)) for noisy, _ in pairs]
        scores = {
            name: [psnr(a, b) for a, b in zip(found, clean, strict=True)]
            for name, found in ((OURS, ours), (PEER, peers), (NOISY, inputs))
        }
        gains = [a - b for a, b in zip(scores[OURS], scores[PEER], strict=True)]
        inside = [away_from_edges(noisy) for noisy, _ in pairs]
        flat = [
            psnr(a[where], c[where]) - psnr(b[where], c[where])
            for a, b, c, where in zip(ours, peers, clean, inside, strict=True)
        ]
        return {
            "seconds": seconds,
            "frames": len(pairs),
            "gain": float(np.mean(gains)),
            "flat gain": float(np.mean(flat)),
            "flat share": float(np.mean(inside)),
            **{name: float(np.mean(found)) for name, found in scores.items()},
            PER_FRAME: {**scores, "gain": gains, "flat gain": flat},
        }

    def works(self) -> dict[str, Callable[[int], dict[str, Any]]]:
        """Return what measures each kind of frames, by its name."""
        return {f"{self.scene}: {kind}": partial(self.scored, kind) for kind in KINDS}


def rows(results: Results) -> str:
    """Return the table: PSNR of the noisy frame, of the peer and of the network, and its gain."""
    found = []
    for name in (f"{scene}: {kind}" for scene in SCENES for kind in KINDS):
        if not results.of(name, "gain"):
            continue
        means = [f"{results.summary(name, score).mean:.2f}" for score in (NOISY, PEER, OURS)]
        gain = paired(results.per_pose(name, OURS), results.per_pose(name, PEER))
        flat, seconds = interval(results.per_pose(name, "flat gain")), max(results.of(name, "seconds"))
        found.append([name, *means, gain.text(), flat.text(), f"{seconds:.0f}"])
    return tables.markdown(HEADS, found)


HEADS = (
    "frames",
    "noisy, dB",
    "Open Image Denoise, dB",
    "network, dB",
    "gain, dB",
    "away from edges, dB",
    "training, s",
)
"""Heads of the table."""


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure whatever is missing, then print the table."""
    options = command.parser(__doc__, "blender").parse_args(arguments)
    chosen = PLANS[options.scale]
    settings = {**asdict(chosen), "executor": options.executor}
    results = Results.open(options.output / "results.json", "blender", settings)
    for scene in SCENES:
        study = Study(scene, chosen, options.cache, options.executor)
        fill(results, study.works(), options.seeds, scene)
    write_table(options.output / "table.md", rows(results))


if __name__ == "__main__":
    command.begin(main)
