"""How good the denoiser is on frames that it has not seen, beside Open Image Denoise on the same frames.

    python experiments/quality.py
    python experiments/quality.py --scenes minicubes --only input best-16 oidn-clean16 --seeds 0

1. Training and test frames of each scene are rendered and kept [`Bench.training`, `Bench.tests`]. Test times
   lie between training times; `cornell` does not move, so that only the noise of its test frames is new.
2. Each row denoises the test frames of each seed, which is that of the noise and of the training [`judged`].
   Features are those of the colour's one camera ray, or means over 16 rays: then for both denoisers.
3. Beside a score stands the number of samples per pixel whose render has the same error [`climbed`].
4. Times of a frame are taken in turns, from frame to picture in display encoding [`timed`].
5. The folder gets `quality.json`, `times.json` and `quality.md`, and a sheet of pictures for each scene.

Open Image Denoise gets linear radiance with `hdr`, and albedo and normals: noisy ones, or such that are
declared clean. Its result is linear, and is clipped and sRGB-encoded before it is judged, as ours are.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cached_property, partial
from pathlib import Path
from typing import Any

import numpy as np
from lab import command, figures, results, scores, tables, training
from lab.frames import Pair, Shot, frames, noisy, reference, split_times
from lab.results import Results, Values

from wamnet.cli.outputs import write_text
from wamnet.compiler.compile import compile_program
from wamnet.compiler.lower import lower
from wamnet.kernels import open_executor, tune
from wamnet.kernels.bench.peer_oidn import filtered
from wamnet.kernels.denoise_on import images_of
from wamnet.kernels.measure import in_turns
from wamnet.refimpl.denoise import Model
from wamnet.refimpl.encoding import to_display
from wamnet.refimpl.errors import InputError
from wamnet.refimpl.frame import Floats, Frame
from wamnet.refimpl.scenes import TURN_SECONDS
from wamnet.refimpl.train import PRESETS

SCENES = ("minicubes", "cornell", "glossy")
"""The scenes of the comparison."""

RAYS = 16
"""Camera rays of features that are declared clean; 4 lose 0.7 dB, ours as those of Open Image Denoise."""


@dataclass(frozen=True)
class Plan:
    """Sizes: frames and their samples; `steps` None means the preset's; `ladder` are samples per pixel."""

    size: int
    train: int
    train_spp: int
    test: int
    test_spp: int
    ladder: tuple[int, ...]
    steps: int | None = None


PLANS: Mapping[str, Plan] = {
    "toy": Plan(size=16, train=2, train_spp=4, test=1, test_spp=32, ladder=(1, 4), steps=8),
    "small": Plan(size=256, train=64, train_spp=64, test=4, test_spp=1024, ladder=(1, 16, 64, 128, 256)),
    "paper": Plan(size=1024, train=64, train_spp=256, test=8, test_spp=4096, ladder=(1, 16, 64, 128, 256)),
}
"""Sizes by the name of a scale."""


@dataclass(frozen=True)
class Row:
    """A way to a picture: `rays` of its features; a preset of ours, or how Open Image Denoise is called."""

    text: str
    rays: int
    preset: str = ""
    quality: str = ""
    clean: bool = False


ROWS: Mapping[str, Row] = {
    "input": Row("input, 1 spp", 1),
    "oidn-color": Row("Open Image Denoise, high, colour alone", 0, quality="high"),
    "oidn-1": Row("Open Image Denoise, high, features of 1 ray", 1, quality="high"),
    "oidn-clean1": Row("Open Image Denoise, high, the same, declared clean", 1, quality="high", clean=True),
    "oidn-clean16": Row(f"Open Image Denoise, high, clean, {RAYS} rays", RAYS, quality="high", clean=True),
    "oidn-fast16": Row(f"Open Image Denoise, fast, clean, {RAYS} rays", RAYS, quality="fast", clean=True),
    "short-1": Row("wamnet, short, features of 1 ray", 1, "short"),
    "best-1": Row("wamnet, best, features of 1 ray", 1, "best"),
    "best-16": Row(f"wamnet, best, {RAYS} rays", RAYS, "best"),
}
"""The rows by name."""

TIMED = ("oidn-fast16", "oidn-clean16", "best-16")
"""Rows whose time is taken."""

SHOWN = ("input", "oidn-clean16", "best-16")
"""Rows that are shown beside the reference."""

COLUMNS = (
    tables.Column("psnr", "PSNR dB"),
    tables.Column("ssim", "SSIM", 4),
    tables.Column("flip", "FLIP", 4),
    tables.Column("relmse", "relMSE", 4),
    tables.Column("spp", "worth, spp", 0),
    tables.Column("seconds", "training, s", 0),
)
"""The columns of the table of scores."""


@dataclass(frozen=True)
class Bench:
    """A scene's frames, networks and renders, kept in the folder `cache`."""

    scene: str
    plan: Plan
    cache: Path
    executor: str

    def _shots(self, times: Sequence[float], seed: int, rays: int) -> list[Shot]:
        """Return the shots of some times; a frame's number is added to the seed."""
        rays = rays if rays > 1 else 0
        return [
            Shot(self.scene, time, self.plan.size, seed=seed + at, feature_spp=rays)
            for at, time in enumerate(times)
        ]

    @cached_property
    def times(self) -> tuple[list[float], list[float]]:
        """Return the times of training and of test frames."""
        return split_times(self.plan.train, self.plan.test, TURN_SECONDS)

    def training(self, rays: int) -> list[Pair]:
        """Return the training frames, with features of so many camera rays."""
        return self._pairs(self._shots(self.times[0], 0, rays), self.plan.train_spp)

    def tests(self, seed: int, rays: int) -> list[Pair]:
        """Return the test frames with the noise of a seed; their references are the same for all."""
        first = self.plan.train
        clean = self._shots(self.times[1], first, 1)
        own = self._shots(self.times[1], first + (seed + 1) * self.plan.test, rays)
        found = self._frames(list(map(noisy, own)))
        return list(zip(found, self._frames([reference(s, self.plan.test_spp) for s in clean]), strict=True))

    def renders(self, spp: int) -> list[Frame]:
        """Return renders of the test frames with so many samples per pixel."""
        shots = self._shots(self.times[1], self.plan.train, 1)
        return self._frames([replace(noisy(shot), spp=spp) for shot in shots])

    def _pairs(self, shots: Sequence[Shot], spp: int) -> list[Pair]:
        """Return a noisy frame and a reference of each shot; both of a time follow each other."""
        wanted = [shot for each in shots for shot in (noisy(each), reference(each, spp))]
        found = self._frames(wanted)
        return list(zip(found[::2], found[1::2], strict=True))

    def _frames(self, shots: Sequence[Shot]) -> list[Frame]:
        """Return frames, rendered where they are not there."""
        return frames(self.cache / "frames", shots, self.executor)

    def model(self, row: Row, seed: int) -> tuple[Model, float]:
        """Return the network of a row, and the seconds of its training."""
        recipe = replace(PRESETS[row.preset], seed=seed)
        if self.plan.steps is not None:
            recipe = replace(recipe, steps=self.plan.steps)
        return training.trained(recipe, self.training(row.rays), self.cache / "models", self.executor)


def judged(bench: Bench, row: Row, ladder: scores.Ladder, seed: int) -> Values:
    """Return the mean scores of a row over the test frames of a seed, and what else is known of it."""
    pairs = bench.tests(seed, row.rays)
    pictures, facts = denoised(bench, row, [frame for frame, _ in pairs], seed)
    found = [
        scores.score(picture, clean["color"], linear)
        for (picture, linear), (_, clean) in zip(pictures, pairs, strict=True)
    ]
    mean = scores.mean_scores(found)
    return {**mean, "spp": ladder.spp_of(mean["mse"]), **facts}


def denoised(
    bench: Bench, row: Row, given: Sequence[Frame], seed: int
) -> tuple[list[tuple[Floats, Floats | None]], dict[str, Any]]:
    """Return display-encoded pictures, with their radiance where a row has it, and facts about the row."""
    if row.preset:
        model, seconds = bench.model(row, seed)
        pictures = training.denoised(model, given, bench.executor)
        parameters = sum(w.size for w in (*model.siren.weights, *model.siren.biases))
        return [(picture, None) for picture in pictures], {"seconds": seconds, "parameters": parameters}
    linear = [frame["color"] if not row.quality else oidn(row, frame) for frame in given]
    return [(to_display(image), image) for image in linear], {}


def oidn(row: Row, frame: Frame) -> Floats:
    """Return the radiance that Open Image Denoise makes of a frame."""
    return filtered(frame, frame if row.rays else None, row.clean, row.quality)


def climbed(bench: Bench, kept: Results) -> scores.Ladder:
    """Return the errors of renders of the test frames, by samples per pixel; they are kept too."""
    name = f"{bench.scene}: ladder"
    if (found := kept.get(name, 0)) is None:
        clean = [frame["color"] for _, frame in bench.tests(0, 1)]
        renders = {
            spp: [(f["color"], r) for f, r in zip(bench.renders(spp), clean, strict=True)]
            for spp in bench.plan.ladder
        }
        ladder = scores.ladder(renders)
        found = {"rungs": list(ladder.spp), "errors": list(ladder.mse)}
        kept.put(name, 0, found)
    return scores.Ladder(tuple(found["rungs"]), tuple(found["errors"]))


def timed(bench: Bench, kept: Results, rounds: int) -> None:
    """Take the times of a frame from its layers in memory to a picture, all ways in turns."""
    if kept.get("times", 0) is not None:
        return
    frame = bench.tests(0, RAYS)[0][0]
    model, _ = bench.model(ROWS["best-16"], 0)
    with open_executor(bench.executor) as device:
        size = (frame.height, frame.width)
        schedule = tune.choose(device, model, size, "ieee", 0, rounds).schedule
        kernel = compile_program(lower(model), device.name, "ieee", schedule)
        device.build(kernel, size)
        images = images_of(model, frame)
        ways: dict[str, Callable[[], Any]] = {
            row: partial(lambda row: to_display(oidn(ROWS[row], frame)), row) for row in TIMED[:-1]
        }
        ways["best-16"] = lambda: device.run(kernel, images_of(model, frame))
        ways["best-16, encoded features given"] = lambda: device.run(kernel, images)
        found = in_turns({name: _done(way) for name, way in ways.items()}, rounds)
    values = {name: list(times.seconds) for name, times in found.items()}
    kept.put("times", 0, {"device": device.device, "schedule": schedule, "seconds": values})


def _done(way: Callable[[], Any]) -> Callable[[], None]:
    """Return a way that returns nothing: what it returned would be taken for a time."""

    def run() -> None:
        way()

    return run


def report(kept: Results, clock: Results, scenes: Sequence[str], rows: Sequence[str]) -> str:
    """Return all tables as Markdown."""
    parts = []
    for scene in scenes:
        names = {f"{scene}: {row}": ROWS[row].text for row in rows}
        parts += [f"## {scene}\n", tables.table(kept, COLUMNS, names), _ahead(kept, scene, rows)]
    if (times := clock.get("times", 0)) is not None:
        cells = [
            [name, f"{1000 * float(np.median(s)):.1f}", f"{1000 * min(s):.1f} - {1000 * max(s):.1f}"]
            for name, s in times["seconds"].items()
        ]
        heads = ["a frame, in turns", "ms, median", "ms, range"]
        parts += [
            f"## Time ({times['device']}, schedule {times['schedule']})\n",
            tables.markdown(heads, cells),
        ]
    return "\n".join(part for part in parts if part)


def _ahead(kept: Results, scene: str, rows: Sequence[str]) -> str:
    """Return by how much the best preset is ahead of the best Open Image Denoise with the same features."""
    lines = []
    for ours, rays in (("best-1", (0, 1)), ("best-16", (0, 1, RAYS))):
        peers = [row for row in rows if ROWS[row].quality and ROWS[row].rays in rays]
        own = kept.of(f"{scene}: {ours}", "psnr")
        found = {peer: kept.of(f"{scene}: {peer}", "psnr") for peer in peers}
        if not own or not all(len(values) == len(own) for values in found.values()) or not found:
            continue
        peer = max(found, key=lambda name: float(np.mean(found[name])))
        gaps = results.summary([a - b for a, b in zip(own, found[peer], strict=True)])
        lines.append(f"{ROWS[ours].text}: {gaps.text()} dB ahead of {ROWS[peer].text}.\n")
    return "".join(lines)


def drawn(bench: Bench, path: Path, rows: Sequence[str]) -> None:
    """Write the first test frame as each row has it, and the reference."""
    pictures = []
    for name in [row for row in SHOWN if row in rows]:
        frame, clean = bench.tests(0, ROWS[name].rays)[0]
        picture = denoised(bench, ROWS[name], [frame], 0)[0][0][0]
        pictures.append((ROWS[name].text, picture))
        target = to_display(clean["color"])
    if pictures:
        figures.sheet(path, [(bench.scene, [*pictures, ("reference", target)])], inches=3.2)


def main(arguments: Sequence[str] | None = None) -> None:
    """Render, train, judge, time; write the tables."""
    parser = command.parser(__doc__ or "", "quality")
    parser.add_argument("--scenes", nargs="+", default=list(SCENES), metavar="SCENE", help="canonical scenes")
    parser.add_argument("--only", nargs="+", default=list(ROWS), metavar="ROW", help=", ".join(ROWS))
    parser.add_argument("--rounds", type=int, default=7, help="rounds of the times; 0 takes none")
    options = parser.parse_args(arguments)
    work(options)


def work(options: argparse.Namespace) -> None:
    """Do what the options ask for."""
    for row in options.only:
        if row not in ROWS:
            raise InputError("row", row, "there is none of this name", f"use some of {', '.join(ROWS)}")
    plan = PLANS[options.scale]
    settings = {"scale": options.scale, **asdict(plan), "executor": options.executor}
    kept = Results.open(options.output / "quality.json", "quality", settings)
    clock = Results.open(options.output / "times.json", "quality-times", settings)
    for scene in options.scenes:
        bench = Bench(scene, plan, options.cache, options.executor)
        ladder = climbed(bench, kept)
        ways = {f"{scene}: {row}": partial(judged, bench, ROWS[row], ladder) for row in options.only}
        results.fill(kept, ways, options.seeds, scene)
        drawn(bench, options.output / f"{scene}.png", options.only)
    if options.rounds:
        timed(Bench(options.scenes[0], plan, options.cache, options.executor), clock, options.rounds)
    text = report(kept, clock, options.scenes, options.only)
    write_text(options.output / "quality.md", text)
    print(text)


if __name__ == "__main__":
    command.begin(main)
