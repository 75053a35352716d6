"""What the network's quality depends on: one factor after another, all others as in the preset `short`.

1. The middle of all lines is the preset `short` with fewer steps [`Factor`], [`FACTORS`].
2. Each value of a factor is trained once for every seed and scored on unseen times [`work`]. Networks that
   several factors share are trained once.
3. A table has a line for each value, and a figure for each factor a curve with its spread [`report`].

    python experiments/ablations.py
    python experiments/ablations.py --scale paper -o out/ablations-paper

The paper fixes windows of 12x12 pixels, four hidden layers of 32 neurons and 20,000 windows of one frame; it
does not give omega_0, and names larger networks as future work.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from lab import command, figures, tables
from lab.ground import Ground, start, write_table
from lab.results import Results, Values, fill
from lab.tables import Column

from wamnet.refimpl.train import SHORT, Recipe

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


def _by_scale(toy: Sequence[float], small: Sequence[float], paper: Sequence[float]) -> dict[str, Any]:
    return {"toy": toy, "small": small, "paper": paper}


FACTORS: Sequence[Factor] = (
    Factor(
        "window",
        _by_scale((2, 3), (4, 8, 12, 16), (4, 6, 8, 10, 12, 14, 16, 20)),
        _window,
        "pixels a side of the window",
    ),
    Factor(
        "width", _by_scale((4, 32), (8, 16, 32, 64), (8, 16, 24, 32, 48, 64, 128)), _width, "hidden neurons"
    ),
    Factor("depth", _by_scale((1, 4), (1, 2, 4, 6), (1, 2, 3, 4, 5, 6, 8)), _depth, "hidden layers"),
    Factor(
        "omega_0",
        _by_scale((10, 30), (1, 3, 10, 30), (1, 3, 5, 10, 15, 20, 30, 60)),
        _omega,
        "omega_0 of the hidden layers",
    ),
    Factor(
        "omega_0, first layer",
        _by_scale((1, 30), (0.3, 1, 3, 30), (0.3, 1, 2, 3, 10, 30)),
        _omega_first,
        "omega_0 of the first layer",
    ),
    Factor(
        "windows",
        _by_scale((64, FRESH), (5000, 20_000, 80_000, FRESH), (5000, 20_000, 80_000, 320_000, FRESH)),
        _windows,
        "windows in the pool; the last: fresh ones in each step",
    ),
    Factor(
        "frames", _by_scale((1, 2), (1, 2, 4, 8, 16), (1, 2, 4, 8, 16, 32)), _same, "training frames", True
    ),
)
"""All factors, in the order of the table."""

COLUMNS = (
    Column("parameters", "parameters", 0),
    Column("seconds", "training, s", 1),
    Column("psnr", "PSNR, dB", 2),
    Column("ssim", "SSIM", 3),
    Column("flip", "FLIP", 3),
)
"""The columns of the table."""


def name_of(factor: Factor, value: float) -> str:
    """Return the name of a configuration."""
    return f"{factor.name} = {'fresh' if factor.name == 'windows' and value == FRESH else f'{value:g}'}"


def configurations(scale: str) -> dict[str, tuple[Factor, float]]:
    """Return every factor and value by the configuration's name."""
    return {name_of(factor, value): (factor, value) for factor in FACTORS for value in factor.values[scale]}


def work(ground: Ground, factor: Factor, value: float) -> Callable[[int], Values]:
    """Return what trains and scores one configuration for a seed."""

    def measure(seed: int) -> Values:
        pairs = ground.seen()
        if factor.frames:
            # Frames are taken evenly over the turn.
            pairs = pairs[:: len(pairs) // int(value)][: int(value)]
        recipe = factor.change(ground.plan.adapt(SHORT, seed=seed), value)
        model, seconds = ground.train(recipe, pairs)
        count = sum(p.size for p in model.siren.weights + model.siren.biases)
        return {**ground.judge(model, ground.unseen()), "seconds": seconds, "parameters": count}

    return measure


def report(results: Results, scale: str, folder: Path) -> None:
    """Write the table, and a figure for each factor."""
    names = {name: name for name in configurations(scale)}
    write_table(folder / "table.md", tables.table(results, COLUMNS, names, "all else as `short`"))
    for factor in FACTORS:
        values = factor.values[scale]
        places = [value or 2 * max(values) for value in values]
        line = [
            (place, results.of(name_of(factor, value), "psnr"))
            for place, value in zip(places, values, strict=True)
        ]
        path = folder / f"{factor.name.replace(', ', '-').replace(' ', '-')}.png"
        figures.curves(path, {factor.name: line}, (factor.unit, "PSNR on unseen times, dB"), (True, False))


def main(arguments: Sequence[str] | None = None) -> None:
    """Train and score whatever is missing, then report."""
    options, ground, results = start(command.parser(__doc__, "ablations"), "ablations", arguments)
    found = {name: work(ground, *pair) for name, pair in configurations(options.scale).items()}
    fill(results, found, options.seeds, "training networks")
    report(results, options.scale, options.output)


if __name__ == "__main__":
    command.begin(main)
