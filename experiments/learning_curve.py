"""Error on unseen frames against seconds of training, for the paper's protocol and the preset `short`.

1. A training is stopped at some steps, closer together at its beginning [`stops`]; its clock stands still
   while the network of that moment is scored on unseen poses [`follow`].
2. The paper trains on one frame, the preset on all of them; nothing else is done meanwhile.
3. A table of PSNR after some seconds, and a figure of curves with their spread [`report`].

    python experiments/learning_curve.py
    python experiments/learning_curve.py --scale paper -o out/learning-curve-paper

The paper reports about 90 seconds of training, on a GPU. Both presets run with all their steps at both
scales: the clock is what is looked at. Seconds are of this machine; compiling the step is part of them.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from lab import command, figures, tables
from lab.frames import Pair
from lab.ground import Cost, Ground, measure_all, start, write_table
from lab.results import Results, Values, summary

from wamnet.kernels import open_executor, train_on
from wamnet.refimpl.network.train import PRESETS, Recipe, TrainState, model_of, train

FIRST_STOP = 50
"""Steps before the first look."""

GROWTH = 2.0
"""Each look comes after so many times the steps of the last one."""

MARKS_S = (1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 90.0)
"""Seconds at which the table gives the quality; the last is the paper's."""


def stops(steps: int) -> list[int]:
    """Return the steps at which a training of `steps` is looked at."""
    found = [FIRST_STOP]
    while found[-1] < steps:
        found.append(min(steps, round(found[-1] * GROWTH)))
    return [min(stop, steps) for stop in found] if steps < FIRST_STOP else found


LOOKS = 9
"""Looks at a training, roughly."""

WINDOWS = 1.5e7
"""Windows of the preset `short` that take as long as one of the two trainings, on average and roughly."""

Trainer = Callable[..., TrainState]
"""What trains on pairs and hands out its states: `train` of the reference, or [`train_on`] of a device."""


def follow(
    trainer: Trainer,
    recipe: Recipe,
    pairs: Sequence[Pair],
    look: Callable[[TrainState], Mapping[str, float]],
    clock: Callable[[], float] = time.perf_counter,
) -> list[dict[str, float]]:
    """Train, and look at the state at each stop: step, seconds of training so far, and what `look` finds."""
    found: list[dict[str, float]] = []
    wanted, begun, looked = stops(recipe.steps), clock(), 0.0

    def keep(state: TrainState) -> None:
        nonlocal looked
        if state.step in wanted:
            now = clock()
            seen = look(state)
            found.append({"step": state.step, "seconds": now - begun - looked, **seen})
            looked += clock() - now

    trainer(recipe, pairs, on_checkpoint=keep, checkpoint_every=FIRST_STOP)
    return found


def measure(ground: Ground, recipe: Recipe, lone: bool, seed: int) -> Values:
    """Return the curve of one training."""
    pairs, tests = ground.seen()[: 1 if lone else None], ground.unseen()

    def look(state: TrainState) -> dict[str, float]:
        scores = ground.judge(model_of(state), tests)
        return {name: scores[name] for name in ("psnr", "ssim", "flip")}

    recipe = replace(recipe, seed=seed)
    if ground.executor == "numpy":
        return {"curve": follow(train, recipe, pairs, look)}
    with open_executor(ground.executor) as device:
        return {"curve": follow(partial(train_on, device), recipe, pairs, look)}


def at(curve: Sequence[Mapping[str, float]], seconds: float, name: str) -> float | None:
    """Return a score as last seen before so many seconds, or None if nothing was seen yet or all was over."""
    before = [point for point in curve if point["seconds"] <= seconds]
    return before[-1][name] if before and len(before) < len(curve) else None


def works(ground: Ground, scale: str) -> dict[str, partial[Values]]:
    """Return what measures each preset for a seed; in tests with the plan's steps."""
    plan = ground.plan
    chosen = {name: PRESETS[name] for name in ("paper", "short")}
    if scale == command.HIDDEN_SCALE:
        chosen = {name: plan.adapt(recipe, n_windows=0) for name, recipe in chosen.items()}
    return {name: partial(measure, ground, recipe, name == "paper") for name, recipe in chosen.items()}


def report(results: Results, names: Sequence[str], folder: Path) -> None:
    """Write the table and the figure."""
    curves: dict[str, list[Any]] = {name: results.of(name, "curve") for name in names}
    shown = [mark for mark in MARKS_S if any(at(c, mark, "psnr") for found in curves.values() for c in found)]
    rows = []
    for name, found in curves.items():
        cells = [_cell([at(curve, mark, "psnr") for curve in found]) for mark in shown]
        last = [curve[-1] for curve in found]
        ends = [
            f"{_cell([end[what] for end in last], digits)}" for what, digits in (("psnr", 2), ("seconds", 0))
        ]
        rows.append([name, *cells, *ends])
    heads = ["preset", *(f"after {mark:g} s" for mark in shown), "at the end, dB", "s"]
    write_table(folder / "table.md", tables.markdown(heads, rows))
    lines = {
        name: [
            (sum(p["seconds"] for p in points) / len(points), [p["psnr"] for p in points])
            for points in zip(*found, strict=True)
        ]
        for name, found in curves.items()
    }
    labels = ("seconds of training", "PSNR on unseen poses, dB")
    figures.curves(folder / "curve.png", lines, labels, (True, False))


def _cell(values: Sequence[float | None], digits: int = 2) -> str:
    """Return mean and deviation of values that are there for all seeds, else nothing."""
    there = [value for value in values if value is not None]
    return tables.Column("", "", digits).cell(summary(there)) if len(there) == len(values) else ""


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure whatever is missing, then report."""
    options, ground, results = start(command.parser(__doc__, "learning_curve"), "learning_curve", arguments)
    found = works(ground, options.scale)
    plan = ground.plan
    needed = [(ground.training_shots(), plan.train_spp), (ground.test_shots(), plan.test_spp)]
    measure_all(ground, results, found, options.seeds, Cost(needed, LOOKS * plan.test_frames, WINDOWS))
    report(results, list(found), options.output)


if __name__ == "__main__":
    command.begin(main)
