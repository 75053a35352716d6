"""Does an alarm go with a loss? Frames that a model has not learned: their distances, and what they lose.

1. A network of each scene learns few frames for a short time; its domain is that of `wamnet train`
   [`Bench.model`].
2. Poses that are held back from both show the false alarms. The same poses with other rays or paths, or by
   another renderer's conventions, lose against themselves [`of_rays`], [`of_conventions`].
3. Cameras farther and farther away, other scenes and other sizes of pictures lose against a network of the
   same recipe and as many frames, which has learned them [`of_views`], [`of_scenes`], [`of_sizes`].
4. Over all frames: which share of those that lose much, and of those that lose little, is outside
   [`together`].

    python experiments/domain.py -o out/domain
"""

from __future__ import annotations

import statistics
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cached_property, partial
from pathlib import Path
from typing import Any

import numpy as np
from lab import command, frames, tables, training
from lab.ground import write_table
from lab.results import PER_FRAME, Results, fill
from lab.sets import SETS, FrameSet

from wamnet.models.data.frame_plan import TEST, TRAIN
from wamnet.refimpl.encoding import to_display
from wamnet.refimpl.frame import Floats, Frame
from wamnet.refimpl.metrics import psnr
from wamnet.refimpl.network.denoise import Model
from wamnet.refimpl.network.domain import Distance, measure_frame, of_model
from wamnet.refimpl.network.train import SHORT

SCENES = ("minicubes", "cornell", "glossy")
"""The scenes."""

FEATURES = (*SHORT.features, "depth")
"""What the networks see: the preset's features, and depth, since it has a unit."""

LEARNED_RAYS = 16
"""Camera rays of the features that the networks learn from, as in the preset `best`."""

HELD_BACK = "poses held back"
"""The frames that are drawn as those of the training are, and are not among them."""


@dataclass(frozen=True)
class Plan:
    """Pixels a side, frames to learn, poses held back, frames of every other kind, samples, training."""

    size: int
    train: int
    test: int
    other: int
    train_spp: int
    test_spp: int
    steps: int
    batch: int


PLANS: Mapping[str, Plan] = {
    "toy": Plan(8, 10, 2, 1, 2, 4, 2, 8),
    "small": Plan(96, 24, 20, 4, 16, 128, 3000, 256),
    "paper": Plan(256, 100, 100, 20, 64, 1024, 12_000, 512),
}
"""Plans by scale."""

RAYS: Mapping[str, Mapping[str, Any]] = {
    "features of 1 ray": {"feature_spp": 0},
    "features of 4 rays that are spread": {"feature_spp": 4, "feature_sampler": "net"},
    "features of 64 rays": {"feature_spp": 64},
    "colour of 4 paths": {"spp": 4},
}
"""The same poses, rendered with other numbers."""

CONVENTIONS: Mapping[str, Callable[[Frame], Mapping[str, Floats]]] = {
    "normals of the other sign": lambda frame: {"normal": -frame["normal"]},
    "normals with z up": lambda frame: {"normal": frame["normal"][..., [0, 2, 1]]},
    "depth in centimetres": lambda frame: {"depth": 100.0 * frame["depth"]},
    "positions in centimetres": lambda frame: {"position": 100.0 * frame["position"]},
    "no albedo": lambda frame: {"albedo": np.zeros_like(frame["albedo"])},
    "one stop brighter": lambda frame: {"color": 2.0 * frame["color"]},
}
"""The same frames by what another renderer may do otherwise."""

VIEWS: Mapping[str, tuple[tuple[float, float], Sequence[float]]] = {
    "distance": ((0.9, 2.0), (1.2, 1.4, 1.7, 2.0)),
    "yaw_deg": ((-24.0, 90.0), (30.0, 45.0, 60.0, 90.0)),
}
"""Ranges of the networks that have learned more, and the views that are tested, by what varies."""

SCALES = {"half as large": 0.5, "twice as large": 2.0}
"""Sizes of pictures."""

MUCH_DB, LITTLE_DB = 1.0, 0.25
"""Losses of a frame that a user should know of, and that nobody sees."""

ALL = "all scenes"
"""Where the shares over all frames stand."""


@dataclass(frozen=True)
class Bench:
    """Frames and networks of a plan, kept in a folder."""

    plan: Plan
    cache: Path
    executor: str

    def shots(self, kind: FrameSet, split: str, count: int, size: int) -> list[frames.Shot]:
        """Return the noisy shots of a split; those of tests are never those of training."""
        plan = self.plan
        counts = kind.counts(plan.train, count if split == TEST else plan.test, 0)
        found = kind.shots(split, replace(counts, train=plan.train), size, LEARNED_RAYS)
        return [frames.noisy(replace(shot, seen=False)) for shot in found]

    def rendered(self, shots: Sequence[frames.Shot]) -> list[Frame]:
        """Return the frames of shots."""
        return frames.frames(self.cache / "frames", shots, self.executor)

    def references(self, shots: Sequence[frames.Shot], spp: int) -> list[Frame]:
        """Return the references of noisy shots."""
        clean = [replace(shot, spp=spp, seed=shot.seed + 1, feature_spp=0) for shot in shots]
        return self.rendered(clean)

    def model(self, kind: FrameSet, size: int) -> Model:
        """Return a network that has learned frames of this kind."""
        plan = self.plan
        shots = self.shots(kind, TRAIN, plan.train, size)
        pairs = list(zip(self.rendered(shots), self.references(shots, plan.train_spp), strict=True))
        recipe = replace(SHORT, features=FEATURES, steps=plan.steps, batch=plan.batch)
        return training.trained(recipe, pairs, self.cache / "networks", self.executor)[0]

    def scores(self, model: Model, noisy: Sequence[Frame], clean: Sequence[Frame]) -> list[float]:
        """Return the PSNR, in dB, of what a network makes of each frame.

        The reference denoises: a kernel for each network would take longer to compile than few small frames.
        """
        pictures = training.denoised(model, noisy, "numpy")
        return [psnr(a, to_display(b["color"])) for a, b in zip(pictures, clean, strict=True)]


@dataclass(frozen=True)
class Study:
    """One scene's network, and what it makes of frames of every kind."""

    bench: Bench
    scene: str

    @property
    def size(self) -> int:
        """Return the width and height of the frames, in pixels."""
        return self.bench.plan.size

    @cached_property
    def model(self) -> Model:
        """Return the scene's network."""
        return self.bench.model(SETS[self.scene], self.size)

    @cached_property
    def held_back(self) -> tuple[list[frames.Shot], list[Frame], list[Frame], list[float]]:
        """Return poses that are held back: shots, frames, references, and the scores of the network."""
        bench = self.bench
        shots = bench.shots(SETS[self.scene], TEST, bench.plan.test, self.size)
        noisy, clean = bench.rendered(shots), bench.references(shots, bench.plan.test_spp)
        return shots, noisy, clean, bench.scores(self.model, noisy, clean)

    def told(self, noisy: Sequence[Frame], lost: Sequence[float]) -> dict[str, Any]:
        """Return the record of frames and of what each of them loses; no losses of held back ones."""
        domain = of_model(self.model)
        if domain is None:
            raise ValueError("a plan has frames enough for a domain")
        found = [measure_frame(domain, self.model, frame) for frame in noisy]
        worst: Distance = max(found, key=lambda each: each.distance)
        distances = [round(each.distance, 3) for each in found]
        return {
            "frames": len(found),
            "outside": sum(each.is_outside for each in found),
            "distance": statistics.median(distances),
            "threshold": domain.threshold,
            "rate": domain.rate,
            "farthest": f"{worst.statistic} of {worst.channel}",
            **({"lost": statistics.fmean(lost)} if lost else {}),
            PER_FRAME: {
                "outside": [int(each.is_outside) for each in found],
                "distance": distances,
                **({"lost": [round(each, 3) for each in lost]} if lost else {}),
            },
        }

    def of_held_back(self, _seed: int) -> dict[str, Any]:
        """Return the record of poses that are held back."""
        _, noisy, _, _ = self.held_back
        return self.told(noisy, [])

    def of_rays(self, name: str, _seed: int) -> dict[str, Any]:
        """Return the record of the same poses with other rays or paths."""
        shots, _, _, _ = self.held_back
        return self._against_themselves(self.bench.rendered([replace(shot, **RAYS[name]) for shot in shots]))

    def of_conventions(self, name: str, _seed: int) -> dict[str, Any]:
        """Return the record of the same frames by another renderer's conventions."""
        _, noisy, _, _ = self.held_back
        changed = [Frame({**frame.layers, **CONVENTIONS[name](frame)}, frame.info) for frame in noisy]
        return self._against_themselves(changed)

    def _against_themselves(self, changed: Sequence[Frame]) -> dict[str, Any]:
        """Return the record of frames of the poses that are held back; a brighter one's reference is too."""
        _, noisy, clean, before = self.held_back
        gains = [
            round(float(frame["color"].mean() / own["color"].mean()))
            for frame, own in zip(changed, noisy, strict=True)
        ]
        shown = [
            Frame({"color": max(gain, 1) * frame["color"]}) for gain, frame in zip(gains, clean, strict=True)
        ]
        after = self.bench.scores(self.model, changed, shown)
        return self.told(changed, [a - b for a, b in zip(before, after, strict=True)])

    def _against(self, other: Model, shots: Sequence[frames.Shot]) -> dict[str, Any]:
        """Return the record of shots that another network has learned."""
        bench = self.bench
        noisy, clean = bench.rendered(shots), bench.references(shots, bench.plan.test_spp)
        best, mine = (bench.scores(model, noisy, clean) for model in (other, self.model))
        return self.told(noisy, [a - b for a, b in zip(best, mine, strict=True)])

    def of_views(self, what: str, value: float, _seed: int) -> dict[str, Any]:
        """Return the record of a view, against a network that has learned a range with it."""
        own, (wide, _) = SETS[self.scene], VIEWS[what]
        learned = replace(own, ranges=replace(own.ranges, **{what: wide}))
        shown = replace(own, ranges=replace(own.ranges, **{what: (value, value)}))
        shots = self.bench.shots(shown, TEST, self.bench.plan.other, self.size)
        return self._against(self.bench.model(learned, self.size), shots)

    def of_scenes(self, other: str, _seed: int) -> dict[str, Any]:
        """Return the record of another scene, against its own network."""
        shots = self.bench.shots(SETS[other], TEST, self.bench.plan.other, self.size)
        return self._against(self.bench.model(SETS[other], self.size), shots)

    def of_sizes(self, name: str, _seed: int) -> dict[str, Any]:
        """Return the record of pictures of another size, against a network that has learned such."""
        size, own = round(SCALES[name] * self.size), SETS[self.scene]
        return self._against(
            self.bench.model(own, size), self.bench.shots(own, TEST, self.bench.plan.other, size)
        )

    def works(self) -> Iterator[tuple[str, Callable[[int], dict[str, Any]]]]:
        """Yield what measures each kind of frames, by its name."""
        yield HELD_BACK, self.of_held_back
        for name in RAYS:
            yield name, partial(self.of_rays, name)
        for name in CONVENTIONS:
            yield name, partial(self.of_conventions, name)
        for what, (_, values) in VIEWS.items():
            for value in values:
                text = f"yaw of {value:g} degrees" if what == "yaw_deg" else f"distance {value:g}"
                yield text, partial(self.of_views, what, value)
        for other in SCENES:
            if other != self.scene:
                yield f"frames of {other}", partial(self.of_scenes, other)
        for name in SCALES:
            yield f"pictures {name}", partial(self.of_sizes, name)


def together(results: Results) -> dict[str, Any]:
    """Return how many frames are outside: of those held back, of those that lose much, or little."""
    lost, outside, held = [], [], []
    for record in results.records():
        found = record["values"].get(PER_FRAME, {})
        if record["configuration"].endswith(f": {HELD_BACK}"):
            held += found["outside"]
        elif "lost" in found:
            lost += found["lost"]
            outside += found["outside"]
    much = [o for o, db in zip(outside, lost, strict=True) if db > MUCH_DB]
    little = [o for o, db in zip(outside, lost, strict=True) if db < LITTLE_DB]
    kinds = {"held": held, "much": much, "little": little}
    counts: dict[str, Any] = {f"{name} frames": len(found) for name, found in kinds.items()}
    counts |= {"much dB": MUCH_DB, "little dB": LITTLE_DB}
    return {**counts, **{f"{name} outside": sum(found) for name, found in kinds.items()}}


def rows(results: Results) -> str:
    """Return the table: frames outside, distance and threshold, what is farthest off, and the loss."""
    found = []
    for record in results.records():
        values = record["values"]
        if "distance" not in values:
            continue
        lost = f"{values['lost']:.2f}" if "lost" in values else "–"
        far = f"{values['distance']:.1f} ({values['threshold']:.1f})"
        count = f"{values['outside']} of {values['frames']}"
        found.append([record["configuration"], count, far, values["farthest"], lost])
    return tables.markdown(HEADS, found)


HEADS = ("model: frames", "outside", "median distance (threshold)", "farthest off", "lost, dB")
"""Heads of the table."""


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure whatever is missing, then print the table."""
    options = command.parser(__doc__, "domain").parse_args(arguments)
    plan = PLANS[options.scale]
    settings = {**asdict(plan), "executor": options.executor}
    results = Results.open(options.output / "results.json", "domain", settings)
    bench = Bench(plan, options.cache, options.executor)
    for scene in SCENES:
        works = {f"{scene}: {name}": work for name, work in Study(bench, scene).works()}
        fill(results, works, [0], scene)
    results.put(ALL, 0, together(results))
    write_table(options.output / "table.md", rows(results))


if __name__ == "__main__":
    command.begin(main)
