"""What a network sees beyond its window, and what its outputs mean: demodulation, weights for taps, scales.

1. Scenes are `minicubes`, `glossy` and `vitrine` under a camera that moves: the sets of these names of
   lab/sets.py. Frames have the layers of what is seen past mirrors and glass (spec/following.md).
2. A row is a head [`HEADS`] with the preset `short`'s window, hidden layers and features, of the first hit or
   past mirrors and glass [`FEATURES`]; baselines/headed.py says what heads are, and trains them in PyTorch.
3. Open Image Denoise, if it is installed, has the same features, denoised first.
4. Each row says what it costs too: parameters, each of which is a product a pixel.

    python experiments/heads.py
    python experiments/heads.py --scenes glossy --seeds 0 1

It needs PyTorch, `pip install torch`. Pictures are small and trainings short: rows are compared
with each other, and not with those of `quality.py`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from lab import command, tables
from lab.frames import Pair, Shot, past_mirrors
from lab.ground import PLANS, Cost, Ground, inputs, judged, measure_all, told, write_table
from lab.results import Results, Values
from lab.sets import SETS
from lab.tables import Column

from wamnet.refimpl.encoding import to_display
from wamnet.refimpl.network import dataset
from wamnet.refimpl.network.train import SHORT
from wamnet_peers.peer_oidn import filtered, prefiltered

SCENES = ("minicubes", "glossy", "vitrine")
"""The sets of frames."""

SMALL = {"size": 96, "train_frames": 16, "test_frames": 4, "test_spp": 512, "steps": 1000, "batch": 256}
"""Most of each number of the plan, except for the scale `paper`: a row takes ten seconds of one core."""

NOISE_SEED, TESTS_APART = 9000, 500
"""Seed of the first training frame; tests begin so many later."""

FEATURES: Mapping[str, tuple[str, ...]] = {
    "first hit": ("normal", "albedo", "position"),
    "past mirrors and glass": ("seen_normal", "seen_albedo", "seen_position"),
    "both": ("normal", "albedo", "position", "seen_normal", "seen_albedo", "seen_position"),
}
"""What the networks see of surfaces; `minicubes` has no mirror, and the first only."""

HEADS = (
    "regression",
    "regression, squares around",
    "regression, wide window",
    "regression, smooth picture",
    "regression, smooth picture and squares",
    "added to the smooth picture",
    "demodulated",
    "demodulated, squares around",
    "weights for taps",
    "weights for taps of light",
)
"""The heads, in the order of the table."""


def head_of(name: str, features: Sequence[str]) -> Any:
    """Return a head that sees these features."""
    from baselines import headed
    from baselines.headed import Head

    color, light = ("color", *features), ("light", *features)
    taps = SHORT.window.size**2
    return {
        "regression": Head(color),
        "regression, squares around": Head(color, points=("around",)),
        "regression, wide window": Head(color, spread=("wide",)),
        "regression, smooth picture": Head(("smooth", *color)),
        "regression, smooth picture and squares": Head(("smooth", *color), points=("around",)),
        "added to the smooth picture": Head(("smooth", *color), finish=headed.added),
        "demodulated": Head(light, finish=headed.remodulated),
        "demodulated, squares around": Head(light, ("around, light",), finish=headed.remodulated),
        "weights for taps": Head(color, outputs=taps, finish=headed.weighted),
        "weights for taps of light": Head(light, outputs=taps, finish=headed.weighted_light),
    }[name]


@dataclass(frozen=True)
class Row:
    """A scene, features by name, and a head by name, or Open Image Denoise, or the noisy frames."""

    scene: str
    features: str
    head: str

    @property
    def name(self) -> str:
        """Return the name of the configuration."""
        return f"{self.scene}: {self.head}" + (f", {self.features}" if self.features else "")


INPUT, OTHER = "input", "Open Image Denoise"
"""What is not a head."""


def rows(scenes: Sequence[str]) -> list[Row]:
    """Return all rows of the scenes."""
    found = []
    for scene in scenes:
        kinds = list(FEATURES) if scene != "minicubes" else ["first hit"]
        found.append(Row(scene, "", INPUT))
        if find_spec("pyoidn"):
            found += [Row(scene, kind, OTHER) for kind in kinds if kind != "both"]
        found += [Row(scene, kind, head) for kind in kinds for head in HEADS if wanted(kind, head)]
    return found


def wanted(kind: str, head: str) -> bool:
    """Tell whether a head is tried with features past mirrors and glass: what may gain from them there is."""
    return kind == "first hit" or head in (HEADS[0], HEADS[1], HEADS[4])


def shots_of(ground: Ground, scene: str) -> tuple[list[Shot], list[Shot]]:
    """Return the shots to train and to test on."""
    kind = {"ranges": SETS[scene].ranges, "scene": scene}
    found = (
        ground.training_shots(seed=NOISE_SEED, **kind),
        ground.test_shots(seed=NOISE_SEED + TESTS_APART, **kind),
    )
    train, test = ([replace(shot, seen=True) for shot in shots] for shots in found)
    return train, test


@dataclass(frozen=True)
class Made:
    """A scene's pairs to train and to test on, and the planes and targets of their frames."""

    test: Sequence[Pair]
    planes: Mapping[str, list[Any]]
    targets: Mapping[str, list[Any]]


class Scenes:
    """What is made of one scene after another; that of the last one is kept."""

    def __init__(self, ground: Ground) -> None:
        self.ground = ground
        self._last: tuple[str, Made] | None = None

    def of(self, scene: str) -> Made:
        """Return what is made of a scene."""
        if self._last is None or self._last[0] != scene:
            self._last = scene, self._made(scene)
        return self._last[1]

    def _made(self, scene: str) -> Made:
        """Render frames, and make planes of them."""
        from baselines import headed

        train, test = shots_of(self.ground, scene)
        pairs = {"train": self.ground.learned(train), "test": self.ground.tested(test)}
        scales = dataset.normalization_of([noisy for noisy, _ in pairs["train"]])
        names = ("color", *FEATURES["both"])
        planes = {
            kind: [headed.planes(noisy, names, scales) for noisy, _ in found] for kind, found in pairs.items()
        }
        clean = {
            kind: [dataset.target_image(each, scales) for _, each in found] for kind, found in pairs.items()
        }
        return Made(pairs["test"], planes, clean)


def measure(scenes: Scenes, row: Row, seed: int) -> Values:
    """Return the scores of a head, and what it costs."""
    from baselines import headed

    made, recipe = scenes.of(row.scene), scenes.ground.plan.adapt(SHORT, seed=seed)
    head = head_of(row.head, FEATURES[row.features])
    names = headed.names_of(head)
    train, test = (headed.table(made.planes[kind], made.targets[kind], names) for kind in ("train", "test"))
    network = headed.fit(head, train, recipe)
    pictures = [headed.picture(network, head, test, k, recipe.window.size) for k in range(len(made.test))]
    count = sum(each.numel() for each in network.parameters())
    return {**told(judged(pictures, made.test)), "parameters": count}


def measure_input(scenes: Scenes, row: Row, seed: int) -> Values:
    """Return the scores of the noisy frames."""
    test = scenes.of(row.scene).test
    return told(judged(inputs(test), test))


def measure_other(scenes: Scenes, row: Row, seed: int) -> Values:
    """Return the scores of Open Image Denoise, which denoises albedo and normals first; it has no seeds."""
    test = scenes.of(row.scene).test
    pictures = []
    for noisy, _ in test:
        frame = past_mirrors(noisy) if row.features != "first hit" else noisy
        pictures.append(to_display(filtered(frame, prefiltered(frame), True)))
    return told(judged(pictures, test))


def works(ground: Ground, scenes: Sequence[str]) -> dict[str, Callable[[int], Values]]:
    """Return what measures each row for a seed."""
    kinds, made = {INPUT: measure_input, OTHER: measure_other}, Scenes(ground)
    return {row.name: partial(kinds.get(row.head, measure), made, row) for row in rows(scenes)}


COLUMNS = (
    Column("parameters", "parameters", 0),
    Column("psnr", "PSNR, dB", 2, interval=True),
    Column("ssim", "SSIM", 3, interval=True),
    Column("flip", "FLIP", 3, interval=True),
)
"""The columns of the table."""


def main(arguments: Sequence[str] | None = None) -> None:
    """Train and score whatever is missing, then report."""
    parser = command.parser(__doc__, "heads")
    parser.add_argument("--scenes", nargs="+", default=list(SCENES), choices=SCENES, help="sets of frames")
    options = parser.parse_args(arguments)
    plan = PLANS[options.scale]
    if options.scale != "paper":
        plan = replace(plan, **{name: min(getattr(plan, name), most) for name, most in SMALL.items()})
    ground = Ground(plan, options.cache, options.executor)
    settings = {**asdict(plan), "executor": options.executor}
    results = Results.open(options.output / "results.json", "heads", settings)
    needed = [(shots, spp) for scene in options.scenes for shots, spp in _needed(ground, scene)]
    measure_all(ground, results, works(ground, options.scenes), options.seeds, Cost(needed, plan.test_frames))
    report(results, options.scenes, options.output)


def _needed(ground: Ground, scene: str) -> list[tuple[list[Shot], int]]:
    """Return the shots that a scene needs, and the samples of their references."""
    train, test = shots_of(ground, scene)
    return [(train, ground.plan.train_spp), (test, ground.plan.test_spp)]


def report(results: Results, scenes: Sequence[str], folder: Path) -> None:
    """Write the table."""
    names = {row.name: row.name for row in rows(scenes)}
    write_table(folder / "table.md", tables.table(results, COLUMNS, names, "camera moves"))


if __name__ == "__main__":
    command.begin(main)
