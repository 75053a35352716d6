"""What the network's quality depends on: one factor after another, all others as in the preset `short`.

1. The middle of all lines is the preset `short` with fewer steps [`Factor`], [`FACTORS`].
2. Each value of a factor is trained once for every seed and scored on unseen poses [`work`]. Networks that
   several factors share are trained once. Training frames all show poses of their own, a few as well as many.
3. Sets of features are compared there [`FEATURES`], and those with and without the ray's direction also where
   materials are glossy and the camera moves: on the set `glossy` of lab/sets.py [`MOVING`], [`work_glossy`].
4. A table has a line for each value, and a figure for each factor a curve with its spread [`report`].

    python experiments/ablations.py
    python experiments/ablations.py --scale paper -o out/ablations-paper

The paper fixes windows of 12x12 pixels, four hidden layers of 32 neurons and 20,000 windows of one frame; it
does not give omega_0, and names larger networks as future work. The ray's direction is the input that it
plans for a camera that moves.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from lab import command, figures, tables
from lab.frames import Pair, Shot
from lab.ground import Cost, Ground, measure_all, start, together, told, write_table
from lab.results import Results, Values
from lab.sets import SETS
from lab.tables import Column

from wamnet.refimpl.network.train import PAPER, SHORT, Recipe

FRESH = 0
"""Number of windows that stands for fresh ones in each step."""


@dataclass(frozen=True)
class Factor:
    """A factor: its name, its values by scale, and the recipe that has one of them.

    `frames`: the values are numbers of training frames, and recipes do not change.
    """

    name: str
    values: Mapping[str, Sequence[float]]
    change: Callable[[Recipe, Any], Recipe]
    unit: str
    frames: bool = False


def _window(recipe: Recipe, value: Any) -> Recipe:
    return replace(recipe, window=replace(recipe.window, size=int(value)))


def _width(recipe: Recipe, value: Any) -> Recipe:
    return replace(recipe, widths=(int(value),) * len(recipe.widths))


def _depth(recipe: Recipe, value: Any) -> Recipe:
    return replace(recipe, widths=recipe.widths[:1] * int(value))


def _omega(recipe: Recipe, value: Any) -> Recipe:
    return replace(recipe, omega_0_hidden=float(value))


def _omega_first(recipe: Recipe, value: Any) -> Recipe:
    return replace(recipe, omega_0_first=float(value))


def _windows(recipe: Recipe, value: Any) -> Recipe:
    return replace(recipe, n_windows=int(value))


def _same(recipe: Recipe, value: Any) -> Recipe:
    return recipe


def _features(recipe: Recipe, value: Any) -> Recipe:
    return replace(recipe, features=list(FEATURES.values())[int(value)])


def _by_scale(toy: Sequence[float], small: Sequence[float], paper: Sequence[float]) -> dict[str, Any]:
    return {"toy": toy, "small": small, "paper": paper}


FEATURES: Mapping[str, tuple[str, ...]] = {
    "color": ("color",),
    "color, normal": PAPER.features,
    "color, normal, direction": (*PAPER.features, "direction"),
    "color, normal, albedo": ("color", "normal", "albedo"),
    "short": SHORT.features,
    "short, direction": (*SHORT.features, "direction"),
}
"""Sets of features: the paper's, the one that it plans, those between it and the preset, and the preset's."""

FACTORS: Sequence[Factor] = (
    Factor(
        "window",
        _by_scale((2, 3), (4, 8, 12, 16), (4, 6, 8, 10, 12, 14, 16, 20)),
        _window,
        "pixels a side of the window",
    ),
    Factor("width", _by_scale((4, 32), (16, 32, 64), (8, 16, 24, 32, 48, 64, 128)), _width, "hidden neurons"),
    Factor("depth", _by_scale((1, 4), (2, 4, 6), (1, 2, 3, 4, 5, 6, 8)), _depth, "hidden layers"),
    Factor(
        "omega_0",
        _by_scale((10, 30), (1, 10, 30), (1, 3, 5, 10, 15, 20, 30, 60)),
        _omega,
        "omega_0 of the hidden layers",
    ),
    Factor(
        "omega_0, first layer",
        _by_scale((1, 30), (1, 30), (0.3, 1, 2, 3, 10, 30)),
        _omega_first,
        "omega_0 of the first layer",
    ),
    Factor(
        "windows",
        _by_scale((64, FRESH), (20_000, FRESH), (5000, 20_000, 80_000, 320_000, FRESH)),
        _windows,
        "windows in the pool; the last: fresh ones in each step",
    ),
    Factor(
        "frames",
        _by_scale((1, 2), (1, 2, 4, 8, 24), (1, 2, 4, 8, 16, 32)),
        _same,
        "training frames, each with a pose of its own",
        True,
    ),
    Factor(
        "features",
        _by_scale((1, 4), *[range(len(FEATURES))] * 2),
        _features,
        f"sets of features: {'; '.join(FEATURES)}",
    ),
)
"""All factors, in the order of the table. Values of `features` are places in `FEATURES`."""

GLOSSY = ("color, normal", "color, normal, direction", "short", "short, direction")
"""Sets of features that are compared where materials are glossy and the camera moves."""

MOVING = SETS["glossy"]
"""The set of frames of that comparison."""

GLOSSY_SEED = 6000
"""Seed of its first training frame; tests begin TESTS_APART later."""

TESTS_APART = 500
"""More than there are training frames."""

COLUMNS = (
    Column("parameters", "parameters", 0),
    Column("psnr", "PSNR, dB", 2, interval=True),
    Column("ssim", "SSIM", 3, interval=True),
    Column("flip", "FLIP", 3, interval=True),
)
"""The columns of the table."""


def name_of(factor: Factor, value: float) -> str:
    """Return the name of a configuration."""
    if factor.name == "features":
        return f"features = {list(FEATURES)[int(value)]}"
    return f"{factor.name} = {'fresh' if factor.name == 'windows' and value == FRESH else f'{value:g}'}"


def configurations(scale: str) -> dict[str, tuple[Factor, float]]:
    """Return every factor and value by the configuration's name."""
    return {name_of(factor, value): (factor, value) for factor in FACTORS for value in factor.values[scale]}


def scored(ground: Ground, recipe: Recipe, pairs: Sequence[Pair], tests: Sequence[Pair]) -> Values:
    """Return the scores of a recipe's network on tests, the seconds of its training and its size."""
    model, seconds = ground.train(recipe, pairs)
    count = sum(p.size for p in model.siren.weights + model.siren.biases)
    return together(told(ground.judge(model, tests)), {"seconds": seconds, "parameters": count})


def work(ground: Ground, factor: Factor, value: float) -> Callable[[int], Values]:
    """Return what trains and scores one configuration for a seed."""

    def measure(seed: int) -> Values:
        # The first times of the golden-ratio sequence are as even as all of them.
        shots = ground.training_shots()[: int(value) if factor.frames else None]
        recipe = factor.change(ground.plan.adapt(SHORT, seed=seed), value)
        return scored(ground, recipe, ground.learned(shots), ground.unseen())

    return measure


def glossy_shots(ground: Ground) -> tuple[list[Shot], list[Shot]]:
    """Return the shots to train and to test on where the camera moves about glossy materials."""
    kind = {"ranges": MOVING.ranges, "scene": MOVING.scene}
    tests = ground.test_shots(seed=GLOSSY_SEED + TESTS_APART, **kind)
    return ground.training_shots(seed=GLOSSY_SEED, **kind), tests


def work_glossy(ground: Ground, name: str) -> Callable[[int], Values]:
    """Return what trains and scores a set of features there for a seed."""

    def measure(seed: int) -> Values:
        shots, tests = glossy_shots(ground)
        recipe = ground.plan.adapt(SHORT, seed=seed, features=FEATURES[name])
        return scored(ground, recipe, ground.learned(shots), ground.tested(tests))

    return measure


def works(ground: Ground, scale: str) -> dict[str, Callable[[int], Values]]:
    """Return what measures each configuration for a seed."""
    found = {name: work(ground, *pair) for name, pair in configurations(scale).items()}
    return found | {glossy_name(name): work_glossy(ground, name) for name in GLOSSY}


def glossy_name(name: str) -> str:
    """Return the name of the configuration of a set of features there."""
    return f"glossy, moving camera: features = {name}"


def cost(ground: Ground) -> Cost:
    """Return what the study needs."""
    plan = ground.plan
    train, test = glossy_shots(ground)
    needed = [(shots, plan.train_spp) for shots in (ground.training_shots(), train)]
    needed += [(shots, plan.test_spp) for shots in (ground.test_shots(), test)]
    return Cost(needed, plan.test_frames)


def report(ground: Ground, results: Results, scale: str, folder: Path) -> None:
    """Write the table, and a figure for each factor."""
    names = {name: name for name in works(ground, scale)}
    write_table(folder / "table.md", tables.table(results, COLUMNS, names, "all else as `short`"))
    for factor in FACTORS:
        values = factor.values[scale]
        if factor.name == "features":
            continue
        places = [value or 2 * max(values) for value in values]
        line = [
            (place, results.of(name_of(factor, value), "psnr"))
            for place, value in zip(places, values, strict=True)
        ]
        path = folder / f"{factor.name.replace(', ', '-').replace(' ', '-')}.png"
        figures.curves(path, {factor.name: line}, (factor.unit, "PSNR on unseen poses, dB"), (True, False))


def main(arguments: Sequence[str] | None = None) -> None:
    """Train and score whatever is missing, then report."""
    options, ground, results = start(command.parser(__doc__, "ablations"), "ablations", arguments)
    measure_all(ground, results, works(ground, options.scale), options.seeds, cost(ground))
    report(ground, results, options.scale, options.output)


if __name__ == "__main__":
    command.begin(main)
