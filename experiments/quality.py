"""How good the denoiser is on frames that it has not seen, beside Open Image Denoise on the same frames.

    python experiments/quality.py
    python experiments/quality.py --sets minicubes --only input best-16 oidn-clean16 --seeds 0

1. A set says what varies: time, camera, lamps [`lab/sets.py`]. Its test frames inside of the ranges and
   outside are compared with those of training before anything is rendered; none shows what another one shows.
2. Each row denoises the test frames of each seed, which is that of the noise and of the training [`judged`].
   Features are those of the colour's one camera ray, or means over 16 rays: then for both denoisers. These
   may send a shadow ray each: then 16 rays are spread evenly, for both denoisers.
3. Each score comes with the number of samples per pixel whose render has the same error [`climbed`].
4. Networks are certified: how far a kernel may be off, over all pictures [`certified`]. Times of a frame
   are interleaved, and go from frame to picture in display encoding [`timed`].
5. Records hold every frame's scores. Tables have means and 95 % intervals over frames and seeds; those of
   documents, and differences between two rows, are in lab/shown.py. The folder gets `quality.json`,
   `times.json` and `quality.md`, and a sheet of pictures for each set.

Open Image Denoise gets linear radiance with `hdr`, and albedo and normals: noisy ones, such that it has
denoised first, or such that are declared clean. Its result is linear, and is clipped and sRGB-encoded before
it is judged, as ours are. A network of one set may be judged on another one's frames: `shipped` is that of
all that the web page moves.
"""

import argparse
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

import numpy as np
from lab import command, figures, results, scores, tables, training
from lab.frames import Pair, Shot, frames, noisy, past_mirrors, reference
from lab.results import PER_FRAME, Results, Values
from lab.sets import SETS, Counts, compared

from wamnet.cli.files.outputs import write_text
from wamnet.compiler.artifact import Artifact
from wamnet.compiler.compile import compile_plan
from wamnet.compiler.schedules.schedules import PLAIN
from wamnet.compiler.targets import language_named
from wamnet.compiler.variants import plan_model
from wamnet.kernels import open_executor
from wamnet.kernels.devices.executor import Executor
from wamnet.kernels.measure import in_turns
from wamnet.kernels.run.denoise_on import Denoiser, images_of
from wamnet.kernels.run.tune import Tuning
from wamnet.models.data.frame_plan import OUTSIDE, TEST, TRAIN
from wamnet.refimpl.encoding import to_display
from wamnet.refimpl.errors import InputError
from wamnet.refimpl.frame import SUN, Floats, Frame
from wamnet.refimpl.network.denoise import Model
from wamnet.refimpl.network.train import BEST, MIRROR_SHADOWS, MIRRORS, SHADOWS, SKY, Recipe
from wamnet.refimpl.network.window import Window
from wamnet_peers.peer_oidn import filtered, prefiltered

SHIPPED_SET = "minicubes-page"
"""The set that the network of the web page learns from: everything that the page can move."""

RAYS = 16
"""Camera rays of features that are declared clean; 4 lose 0.7 dB, ours as those of Open Image Denoise."""


@dataclass(frozen=True)
class Plan:
    """Sizes: frames and their samples; `steps` None means the recipe's; `ladder` are samples per pixel."""

    size: int
    train: int
    train_spp: int
    test: int
    outside: int
    test_spp: int
    ladder: tuple[int, ...]
    steps: int | None = None


PLANS: Mapping[str, Plan] = {
    "toy": Plan(16, train=2, train_spp=4, test=2, outside=2, test_spp=32, ladder=(1, 4), steps=8),
    "small": Plan(256, 240, 64, test=8, outside=4, test_spp=1024, ladder=(1, 16, 64, 128, 256)),
    "paper": Plan(1024, 64, 256, test=8, outside=4, test_spp=4096, ladder=(1, 16, 64, 128, 256)),
}
"""Sizes by the name of a scale."""

LAMPS = ("color", "normal", "albedo", "position", "unshadowed")
"""What a network sees that shall follow the lamps."""

BASIC = ("color", "normal", "albedo")
"""What every renderer writes for a denoiser."""

PAST = ("color", "seen_normal", "seen_albedo", "seen_position")
"""The features of `short`, past mirrors and glass."""

BRIGHT = ("color", "highlights", *PAST[1:])
"""The same, and how bright is what colour clips."""

NARROW = replace(BEST, features=BRIGHT, window=Window(8), widths=(64,) * 4)
"""Fewer taps for wider layers: what mirrors and glass show is remembered, not averaged."""

SLOWER = replace(NARROW, steps=60_000, learning_rate=5e-4)
"""Twice as many steps at half the rate."""

SMOOTH = replace(MIRRORS, features=MIRRORS.features[:-1])
"""The preset for mirrors without what is seen emits."""

FIVE = (*PAST, "seen_direct")
"""Layers that the page and each target can make and read; bounds of a network of them are below 1 / 255."""

RECIPES: Mapping[str, Recipe] = {
    "best": BEST,
    "page": replace(BEST, features=LAMPS, steps=60_000),
    "shadows": SHADOWS,
    "page-shadows": replace(SHADOWS, steps=60_000),
    "basic": replace(BEST, features=BASIC, steps=60_000),
    "past": replace(BEST, features=PAST),
    "bright": replace(BEST, features=BRIGHT),
    "narrow": NARROW,
    "long": replace(NARROW, steps=120_000),
    "hard": SLOWER,
    "slow": replace(SLOWER, steps=120_000),
    "smooth": SMOOTH,
    "smooth-slow": replace(SMOOTH, steps=120_000),
    "lit": MIRRORS,
    "lit-slow": replace(MIRRORS, steps=120_000),
    "lit-shadows": MIRROR_SHADOWS,
    "five-shadows": replace(MIRROR_SHADOWS, features=FIVE),
    "lit7": replace(MIRRORS, window=SKY.window),
    "sun48": replace(SKY, widths=(48,) * 4),
    "sun": SKY,
    "smooth-page": replace(SMOOTH, features=("color", "highlights", "smoothed", *LAMPS[1:])),
    "page48": replace(BEST, features=LAMPS, steps=60_000, widths=(48,) * 4),
}
"""Recipes of the rows by name."""


@dataclass(frozen=True)
class Row:
    """A way to a picture: `rays` of its features; a recipe of ours, or how Open Image Denoise is called.

    `aux`: how its auxiliaries are: "" none are given, `noisy`, `prefiltered`, or `clean`. `of`: the set whose
    frames a network has learned from, if not that of the test. `past`: features are also of what is seen past
    mirrors and glass, which frames of some sets have; Open Image Denoise gets these in place of the others.
    `apart`: what is seen emits is taken off the colour before, and added without its noise after.
    `shadow_rays`: how many each of the features' rays sends; the rays are spread evenly then.
    """

    text: str
    rays: int
    recipe: str = ""
    quality: str = ""
    aux: str = ""
    of: str = ""
    past: bool = False
    apart: bool = False
    shadow_rays: int = 0


ROWS: Mapping[str, Row] = {
    "input": Row("input, 1 spp", 1),
    "oidn-color": Row("Open Image Denoise, high, colour only", 1, quality="high"),
    "oidn-1": Row("Open Image Denoise, high, noisy features (1 ray)", 1, quality="high", aux="noisy"),
    "oidn-prefiltered1": Row("Open Image Denoise, high, prefiltered features (1 ray)",
        1, quality="high", aux="prefiltered"),
    "oidn-clean1": Row("Open Image Denoise, high, noisy features declared clean",
        1, quality="high", aux="clean"),
    "oidn-clean16": Row(f"Open Image Denoise, high, features of {RAYS} rays",
        RAYS, quality="high", aux="clean"),
    "oidn-fast16": Row(f"Open Image Denoise, fast, features of {RAYS} rays",
        RAYS, quality="fast", aux="clean"),
    "oidn-past-clean16": Row(f"Open Image Denoise, high, specular features of {RAYS} rays",
        RAYS, quality="high", aux="clean", past=True),
    "oidn-past-prefiltered16": Row(f"Open Image Denoise, high, prefiltered specular features of {RAYS} rays",
        RAYS, quality="high", aux="prefiltered", past=True),
    "oidn-past-apart16": Row("the same, with visible emission subtracted before and added after",
        RAYS, quality="high", aux="prefiltered", past=True, apart=True),
    "best-16": Row(f"wamnet, preset `best`, features of {RAYS} rays", RAYS, "best"),
    "page-16": Row(f"wamnet, inputs and steps of the web page, {RAYS} rays", RAYS, "page"),
    "basic-16": Row(f"wamnet, colour, normal and albedo alone, {RAYS} rays", RAYS, "basic"),
    "page48-16": Row(f"wamnet, the same with 48 neurons per layer, {RAYS} rays", RAYS, "page48"),
    "smooth-page-16": Row("inputs of the web page, filtered colour, 8x8 window, 64 neurons",
        RAYS, "smooth-page"),
    "past-16": Row(f"wamnet, preset `best`, specular features of {RAYS} rays", RAYS, "past", past=True),
    "bright-16": Row("the same, plus clipped highlights", RAYS, "bright", past=True),
    "narrow-16": Row("the same, 8x8 window, 64 neurons per layer", RAYS, "narrow", past=True),
    "long-16": Row("the same, four times the steps", RAYS, "long", past=True),
    "hard-16": Row("instead: twice the steps at half the learning rate", RAYS, "hard", past=True),
    "slow-16": Row("four times the steps at half the learning rate", RAYS, "slow", past=True),
    "smooth-16": Row("twice the steps, plus filtered colour", RAYS, "smooth", past=True),
    "smooth-slow-16": Row("four times the steps, plus filtered colour", RAYS, "smooth-slow", past=True),
    "lit-16": Row("filtered colour, plus visible emission (preset `mirrors`)", RAYS, "lit", past=True),
    "lit-slow-16": Row("the same, four times the steps", RAYS, "lit-slow", past=True),
    "lit-shadows-16": Row("`mirrors` plus direct light of shadow rays (preset `mirrors-shadows`)",
        RAYS, "lit-shadows", past=True, shadow_rays=1),
    "five-shadows-16": Row("direct light of shadow rays, specular features (the bundled `glossy`)",
        RAYS, "five-shadows", past=True, shadow_rays=1),
    "lit7-16": Row("preset `mirrors` with a 7x7 window", RAYS, "lit7", past=True),
    "sun-16": Row("7x7 window, plus sun direction (preset `sky`)", RAYS, "sun", past=True),
    "sun48-16": Row("the same, 48 neurons per layer", RAYS, "sun48", past=True),
    "shipped": Row(f"wamnet, the same inputs without shadow rays, {RAYS} rays", RAYS, "page", of=SHIPPED_SET),
    "oidn-shadows16": Row(f"Open Image Denoise, high, features of {RAYS} rays spread evenly",
        RAYS, quality="high", aux="clean", shadow_rays=1),
    "shipped-shadows": Row(f"wamnet, the bundled network, {RAYS} rays and shadow rays",
        RAYS, "page-shadows", of=SHIPPED_SET, shadow_rays=1),
    "shadows-16": Row(f"wamnet, preset `shadows`, {RAYS} rays and shadow rays",
        RAYS, "shadows", shadow_rays=1),
}  # fmt: skip
"""The rows by name."""

TIMED = ("oidn-fast16", "oidn-clean16", "page-16")
"""Rows whose time is taken, ours last."""

HARD_TIMED = ("oidn-past-clean16", "oidn-past-prefiltered16", "lit-16")
"""The same of scenes with mirrors, metal and glass."""

SKY_TIMED = (*HARD_TIMED, "sun-16")
"""The same of such scenes under a sky."""

SHOWN = {
    "input": "1 sample per pixel",
    "oidn-clean16": "Open Image Denoise",
    "oidn-past-prefiltered16": "Open Image Denoise, specular features",
    "page-16": "wamnet",
    "shadows-16": "wamnet, with shadow rays",
    "lit-16": "wamnet, specular features",
    "sun-16": "wamnet, with the sun direction",
}
"""Rows that are shown beside the reference, and what their pictures are called."""

COLUMNS = (
    tables.Column("psnr", "PSNR, dB", interval=True),
    tables.Column("ssim", "SSIM", 3, interval=True),
    tables.Column("flip", "FLIP", 3, interval=True),
    tables.Column("relmse", "relMSE", 4, interval=True),
    tables.Column("penumbra", "RMSE in the penumbra, 1/255", 2, interval=True),
    tables.Column("spp", "equivalent spp", 0),
    tables.Column("seconds", "training, s", 0),
)
"""The columns of the table of scores."""

SPECTRA = "fft:16"
"""The fastest schedule, whose bound is larger."""

KEPT = ("psnr", "ssim", "flip", "relmse", "penumbra")
"""Scores that are kept of every frame."""


@dataclass(frozen=True)
class Bench:
    """A set's frames, networks and renders, kept in the folder `cache`."""

    name: str
    plan: Plan
    cache: Path
    executor: str

    @property
    def scene(self) -> str:
        """Return the scene of the set."""
        return SETS[self.name].scene

    @property
    def counts(self) -> Counts:
        """Return the numbers of frames."""
        return SETS[self.name].counts(self.plan.train, self.plan.test, self.plan.outside)

    def _shots(self, split: str, rays: int, noise: int = 0, shadow_rays: int = 0) -> list[Shot]:
        """Return the shots of a split with the noise of a seed."""
        own = rays if rays > 1 else 0
        return SETS[self.name].shots(split, self.counts, self.plan.size, own, noise, shadow_rays)

    def training(self, rays: int, shadow_rays: int = 0) -> list[Pair]:
        """Return the training frames, with features of so many camera rays, and their targets' colours."""
        return training_pairs(self, rays, shadow_rays)

    def tests(self, seed: int, rays: int, split: str = TEST, shadow_rays: int = 0) -> list[Pair]:
        """Return the test frames with the noise of a seed; their references are the same for all.

        References have the layer `direct`, by which a penumbra is known.
        """
        found = self._frames(list(map(noisy, self._shots(split, rays, seed + 1, shadow_rays))))
        spp = self.plan.test_spp * SETS[self.name].cleaner
        clean = self._frames([replace(reference(s, spp), shadow_rays=1) for s in self._shots(split, 1)])
        return list(zip(found, clean, strict=True))

    def renders(self, spp: int) -> list[Frame]:
        """Return renders of the test frames with so many samples per pixel."""
        return self._frames([replace(noisy(shot), spp=spp) for shot in self._shots(TEST, 1)])

    def _frames(self, shots: Sequence[Shot]) -> list[Frame]:
        """Return frames, rendered where they are not there."""
        return frames(self.cache / "frames", shots, self.executor)

    def model(self, row: Row, seed: int) -> tuple[Model, float]:
        """Return the network of a row, and the seconds of its training."""
        recipe = replace(RECIPES[row.recipe], seed=seed)
        if self.plan.steps is not None:
            recipe = replace(recipe, steps=self.plan.steps)
        of = replace(self, name=row.of or self.name)
        pairs = of.training(row.rays, row.shadow_rays)
        return training.trained(recipe, pairs, self.cache / "models", self.executor)


@lru_cache(maxsize=1)
def training_pairs(bench: Bench, rays: int, shadow_rays: int = 0) -> list[Pair]:
    """Return a set's training frames, with features of so many camera rays, and their targets' colours.

    Rows, seeds and splits of one set share them: reading hundreds of frames takes longer than judging some.
    """
    plan, counts = bench.plan, bench.counts
    own = rays if rays > 1 else 0
    shots = SETS[bench.name].shots(TRAIN, counts, plan.size, own, shadow_rays=shadow_rays)
    wanted = [s for shot in shots for s in (noisy(shot), reference(shot, plan.train_spp))]
    found = frames(bench.cache / "frames", wanted, bench.executor)
    targets = [Frame({"color": clean["color"]}, clean.info) for clean in found[1::2]]
    return list(zip(found[::2], targets, strict=True))


def judged(bench: Bench, row: Row, split: str, ladder: scores.Ladder | None, seed: int) -> Values:
    """Return the scores of a row over the test frames of a seed, of each frame and their means, and more."""
    pairs = bench.tests(seed, row.rays, split, row.shadow_rays)
    given = [frame for frame, _ in pairs]
    if row.apart:
        given = [reflected(f, own) for f, (own, _) in zip(given, bench.tests(seed, 1, split), strict=True)]
    pictures, facts = denoised(bench, row, given, seed)
    found = [
        scores.score_lit(picture, clean, linear)
        for (picture, linear), (_, clean) in zip(pictures, pairs, strict=True)
    ]
    mean = scores.mean_scores(found)
    each = {name: [round(scores[name], 5) for scores in found] for name in KEPT if name in mean}
    worth = {} if ladder is None else {"spp": ladder.spp_of(mean["mse"])}
    return {**mean, **worth, **facts, PER_FRAME: each}


def denoised(
    bench: Bench, row: Row, given: Sequence[Frame], seed: int
) -> tuple[list[tuple[Floats, Floats | None]], dict[str, Any]]:
    """Return display-encoded pictures, with their radiance where a row has it, and facts about the row."""
    if row.recipe:
        model, seconds = bench.model(row, seed)
        pictures = training.denoised(model, given, bench.executor)
        parameters = sum(w.size for w in (*model.siren.weights, *model.siren.biases))
        return [(picture, None) for picture in pictures], {"seconds": seconds, "parameters": parameters}
    linear = [frame["color"] if not row.quality else oidn(row, frame) for frame in given]
    return [(to_display(image), image) for image in linear], {}


def reflected(frame: Frame, own: Frame) -> Frame:
    """Return a frame whose colour is without what its own paths, which the other frame is of, saw emit."""
    # A nearly perfect mirror's light may have been found by two ways, each with less than all of it.
    color = np.maximum(frame["color"] - own["seen_emission"], 0.0)
    return Frame({**frame.layers, "color": color}, frame.info)


def oidn(row: Row, frame: Frame) -> Floats:
    """Return the radiance that Open Image Denoise makes of a frame."""
    frame = past_mirrors(frame) if row.past else frame
    if row.aux == "prefiltered":
        found = filtered(frame, prefiltered(frame, row.quality), True, row.quality)
    else:
        found = filtered(frame, frame if row.aux else None, row.aux == "clean", row.quality)
    return found + frame["seen_emission"] if row.apart else found


def certified(bench: Bench, kept: Results, rows: Sequence[str], seed: int) -> None:
    """Keep what the certificates of networks say: how far a colour may be off, over all pictures."""
    known = list(language_named(bench.executor).schedules)
    wanted = {PLAIN: "", **({SPECTRA: ", by spectra"} if SPECTRA in known else {})}
    for row in rows:
        for schedule, end in wanted.items():
            key = f"{certificate(bench.name, row)}{end}"
            if ROWS[row].recipe and kept.get(key, seed) is None:
                model, _ = bench.model(ROWS[row], seed)
                bound = plan_model(model, bench.executor, schedule=schedule).bound
                kept.put(key, seed, {"bound": max(bound.output)})


def certificate(name: str, row: str) -> str:
    """Return the name of the record of a network's bound."""
    return f"{name}, certificate: {row}"


def climbed(bench: Bench, kept: Results) -> scores.Ladder:
    """Return the errors of renders of the test frames, by samples per pixel; they are kept too."""
    name = f"{bench.name}: ladder"
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
    """Take interleaved times of all ways from a frame's layers in memory to a picture."""
    if kept.get("times", 0) is not None:
        return
    frame = bench.tests(0, RAYS)[0][0]
    past = SKY_TIMED if SUN in frame else HARD_TIMED
    rows = past if SETS[bench.name].seen else TIMED
    ways: dict[str, Callable[[], Any]] = {
        row: partial(lambda row: to_display(oidn(ROWS[row], frame)), row)
        for row in rows
        if not ROWS[row].recipe
    }
    with open_executor(bench.executor) as device:
        for row in (row for row in rows if ROWS[row].recipe):
            model, _ = bench.model(ROWS[row], 0)
            size = (frame.height, frame.width)
            plan = plan_model(model, device.name)
            plan = plan.scheduled(Tuning(device, plan.model, size, plan.varied).picked(rounds)[0])
            kernel = compile_plan(plan)
            device.build(kernel, size)
            ways |= _ways(device, model, kernel, frame, row)
        found = in_turns(ways, rounds)
    values = {name: list(times.seconds) for name, times in found.items()}
    kept.put("times", 0, {"device": device.device, "schedule": plan.asked, "seconds": values})


def _ways(device: Executor, model: Model, kernel: Artifact, frame: Frame, row: str) -> dict[str, Any]:
    """Return the ways of a network: from the frame's layers, and from features that are encoded."""
    images = images_of(model, frame)
    return {
        row: lambda: device.run(kernel, Denoiser(device, model).images(frame)),
        f"{row}, encoded features given": lambda: device.run(kernel, images),
    }


SPLITS = {TEST: "inside the training range", OUTSIDE: "outside it"}
"""The kinds of test frames, in words."""


def report(kept: Results, names: Sequence[str], rows: Sequence[str]) -> str:
    """Return the table of scores as Markdown."""
    keys = {
        configuration(name, split, row): f"{name}, {text}: {ROWS[row].text}"
        for name in names
        for split, text in SPLITS.items()
        for row in rows
    }
    shown = {key: text for key, text in keys.items() if kept.summary(key, "psnr") is not None}
    return tables.table(kept, COLUMNS, shown)


def configuration(name: str, split: str, row: str) -> str:
    """Return the name of a record's configuration."""
    return f"{name}, {split}: {row}"


def drawn(bench: Bench, path: Path, rows: Sequence[str]) -> None:
    """Write the first test frame as each row has it, and the reference."""
    pictures = []
    for name in [row for row in SHOWN if row in rows and (SETS[bench.name].seen or not ROWS[row].past)]:
        frame, clean = bench.tests(0, ROWS[name].rays, TEST, ROWS[name].shadow_rays)[0]
        picture = denoised(bench, ROWS[name], [frame], 0)[0][0][0]
        pictures.append((SHOWN[name], picture))
        target = to_display(clean["color"])
    if pictures:
        figures.sheet(path, [(bench.name, [*pictures, ("reference", target)])], inches=3.2)


def main(arguments: Sequence[str] | None = None) -> None:
    """Render, train, judge, time; write the tables."""
    parser = command.parser(__doc__ or "", "quality")
    parser.add_argument("--sets", nargs="+", default=list(SETS), metavar="SET", help=", ".join(SETS))
    parser.add_argument("--only", nargs="+", default=list(ROWS), metavar="ROW", help=", ".join(ROWS))
    parser.add_argument("--rounds", type=int, default=7, help="rounds of the times; 0 takes none")
    options = parser.parse_args(arguments)
    work(options)


def work(options: argparse.Namespace) -> None:
    """Do what the options ask for."""
    for what, chosen, known in (("row", options.only, ROWS), ("set", options.sets, SETS)):
        for name in chosen:
            if name not in known:
                raise InputError(what, name, "unknown", f"choose some of {', '.join(known)}")
    plan = PLANS[options.scale]
    settings = {"scale": options.scale, **asdict(plan), "executor": options.executor}
    kept = Results.open(options.output / "quality.json", "quality", settings)
    clock = Results.open(options.output / "times.json", "quality-times", settings)
    for name in options.sets:
        bench = Bench(name, plan, options.cache, options.executor)
        nearest(bench, kept)
        ladder = climbed(bench, kept)
        ways = {
            configuration(name, split, row): partial(
                judged, bench, ROWS[row], split, ladder if split == TEST else None
            )
            for row in options.only
            for split in SPLITS
            if not (ROWS[row].of and SETS[ROWS[row].of].scene != bench.scene)
            and (SETS[name].seen or not ROWS[row].past)
        }
        results.fill(kept, ways, options.seeds, name)
        own = [row for row in options.only if configuration(name, TEST, row) in ways]
        for seed in options.seeds:
            certified(bench, kept, own, seed)
        drawn(bench, options.output / f"{name}.png", options.only)
    if options.rounds:
        timed(Bench(options.sets[0], plan, options.cache, options.executor), clock, options.rounds)
    text = report(kept, options.sets, options.only)
    write_text(options.output / "quality.md", text)
    print(text)


def nearest(bench: Bench, kept: Results) -> None:
    """Compare what the frames of a set show, and keep how far the nearest training frames are."""
    key = f"{bench.name}: nearest training frame"
    if kept.get(key, 0) is None:
        found = compared(SETS[bench.name], bench.counts)
        kept.put(key, 0, {split: comparison.as_data() for split, comparison in found.items()})


if __name__ == "__main__":
    command.begin(main)
