"""Unseen poses and unseen camera orientations: the paper says that pictures are as good there; is that so?

1. Networks are trained on frames of one orientation of the camera, or of a range of them, where each frame
   draws its orientation and its time independently [`RANGE`]; frames are as many in both cases [`learned`].
2. The cubes repeat their pose each quarter of the turn, so an arc of the turn is not new geometry. A third
   kind of network learns from times of all quarters whose pose is in the first part of the quarter only, and
   is tested on poses of its rest, beside a network that has learned from all poses [`posed`].
3. All are scored at several orientations, from that of the networks of one to beyond the range, and on the
   poses held out [`TEST_DEGREES`], [`tests`]; each test frame has a pose of its own, at each orientation.
4. A table, a curve of PSNR against orientation with its spread, and pictures [`report`].

    python experiments/generalisation.py
    python experiments/generalisation.py --scale paper -o out/generalisation-paper

The camera turns about the vertical through what it looks at. Three inputs are compared: the paper's, the same
with the ray's direction, which the paper plans for its camera, and those of the preset `short`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

from lab import command, figures, tables
from lab.frames import TIMES_SEED, Pair, Shot
from lab.ground import (
    Cost,
    Ground,
    inputs,
    judged,
    measure_all,
    start,
    targets,
    together,
    told,
    write_table,
)
from lab.results import Results, Values
from lab.tables import Column

from wamnet.models.data.draws import Draw, times
from wamnet.refimpl.light.scenes import TURN_SECONDS
from wamnet.refimpl.light.variation import Ranges
from wamnet.refimpl.network.train import PAPER, SHORT, Recipe

RANGE = Ranges(yaw_deg=(-24.0, 24.0))
"""Orientations that the networks of a range are trained on; the width is that of the set `cornell`."""

TEST_DEGREES: Mapping[str, Sequence[float]] = {
    "toy": (0.0, 40.0),
    "small": (0.0, 4.0, 10.0, 16.0, 24.0, 40.0),
    "paper": (0.0, 2.0, 4.0, 10.0, 16.0, 24.0, 40.0, 90.0),
}
"""Orientations of the tests, by scale; 0 is that of the networks of one orientation."""

RECIPES: Mapping[str, Recipe] = {
    "paper's features": replace(SHORT, features=PAPER.features),
    "paper's features, direction": replace(SHORT, features=(*PAPER.features, "direction")),
    "short": SHORT,
}
"""Recipes: all else is as in the preset `short`."""

PERIOD_S = TURN_SECONDS / 4.0
"""Seconds after which the lattice of cubes shows the same pose again: a quarter turn."""

LEARNED_S = 0.75 * PERIOD_S
"""Poses of the first seconds of a period are learned by the networks that miss some; the rest is held out."""

ONE, SEVERAL, SOME_POSES = "one", "a range", "one, a quarter of the poses left out"
"""What networks are trained on."""

HELD_OUT = "poses held out"
"""Name of the tests with poses that some networks have never seen; their orientation is 0."""

SEEDS = {ONE: 0, SEVERAL: 1000, SOME_POSES: 2000, HELD_OUT: 2500}
"""Seeds of the first frame of each kind: none share their noise."""

TEST_SEEDS_FROM, TEST_SEEDS_APART = 3000, 100
"""Seeds of the first frames at the orientations that are tested."""


def posed(first: int, count: int, held_out: bool) -> list[float]:
    """Return times, in seconds, over all four quarters: with a learned pose, or with one that is held out.

    They follow the golden-ratio sequence over the seconds that remain when the others are cut out.
    """
    begin, seconds = (LEARNED_S, PERIOD_S - LEARNED_S) if held_out else (0.0, LEARNED_S)
    found = times(TIMES_SEED, 0.0, 4.0 * seconds, first, count)
    return [PERIOD_S * (time // seconds) + begin + time % seconds for time in found]


def learned(ground: Ground, kind: str) -> list[Shot]:
    """Return as many shots to train on for each kind."""
    if kind == SOME_POSES:
        found = posed(0, ground.plan.train_frames, held_out=False)
        return ground.shots([Draw(time) for time in found], SEEDS[kind])
    return ground.training_shots(RANGE if kind == SEVERAL else Ranges(), SEEDS[kind])


def turned(ground: Ground, degrees: float, number: int) -> list[Shot]:
    """Return the test shots of an orientation, the `number`th; those of 0 are those of the other studies."""
    if degrees == 0.0:
        return ground.test_shots()
    count = ground.plan.test_frames
    # Further draws of the sequence: poses that no training frame and no other orientation has.
    draws = ground.draws(Ranges(yaw_deg=(degrees, degrees)), ground.plan.train_frames + number * count, count)
    return ground.shots(draws, TEST_SEEDS_FROM + TEST_SEEDS_APART * number)


def tests(ground: Ground, scale: str) -> dict[str, list[Shot]]:
    """Return the shots of all tests, by name."""
    found = {f"at {d:g}": turned(ground, d, number) for number, d in enumerate(TEST_DEGREES[scale])}
    times_of = posed(ground.plan.train_frames, ground.plan.test_frames, held_out=True)
    return {**found, f"at {HELD_OUT}": ground.shots([Draw(time) for time in times_of], SEEDS[HELD_OUT])}


def measure(ground: Ground, recipe: Recipe, kind: str, found: Mapping[str, list[Shot]], seed: int) -> Values:
    """Return the scores of a network on each test."""
    model, _ = ground.train(ground.plan.adapt(recipe, seed=seed), ground.learned(learned(ground, kind)))
    return together(
        *(told(ground.judge(model, ground.tested(shots)), where) for where, shots in found.items())
    )


def of_input(ground: Ground, found: Mapping[str, list[Shot]], seed: int) -> Values:
    """Return the scores of the noisy frames."""
    pairs: dict[str, list[Pair]] = {where: ground.tested(shots) for where, shots in found.items()}
    return together(*(told(judged(inputs(of), of), where) for where, of in pairs.items()))


def works(ground: Ground, scale: str) -> dict[str, partial[Values]]:
    """Return what measures each configuration for a seed."""
    found = tests(ground, scale)
    work = {"input": partial(of_input, ground, found)}
    for name, recipe in RECIPES.items():
        for kind in (ONE, SEVERAL):
            work[f"{name}: {kind}"] = partial(measure, ground, recipe, kind, found)
    # Their orientation is that of the networks of one: only the poses held out are of interest.
    held_out = {where: shots for where, shots in found.items() if where.endswith(HELD_OUT)}
    for name, recipe in RECIPES.items():
        work[f"{name}: {SOME_POSES}"] = partial(measure, ground, recipe, SOME_POSES, held_out)
    return work


def cost(ground: Ground, scale: str) -> Cost:
    """Return what the study needs."""
    plan, found = ground.plan, tests(ground, scale)
    needed = [(learned(ground, kind), plan.train_spp) for kind in (ONE, SEVERAL, SOME_POSES)]
    needed += [(shots, plan.test_spp) for shots in found.values()]
    return Cost(needed, len(found) * plan.test_frames)


def columns(scale: str) -> list[Column]:
    """Return the columns of the table: PSNR at each orientation, and on the poses held out."""
    found = [Column(f"psnr at {d:g}", f"{d:g} degrees", 2, interval=True) for d in TEST_DEGREES[scale]]
    return [*found, Column(f"psnr at {HELD_OUT}", HELD_OUT, 2, interval=True)]


def report(ground: Ground, results: Results, scale: str, seed: int, folder: Path) -> None:
    """Write the table, the curve, and pictures of one seed."""
    names = {name: name for name in works(ground, scale)}
    rows = tables.table(results, columns(scale), names, "inputs: trained on orientations; PSNR, dB")
    write_table(folder / "table.md", rows)
    lines = {
        f"{name}: {kind}": [(d, results.of(f"{name}: {kind}", f"psnr at {d:g}")) for d in TEST_DEGREES[scale]]
        for name in RECIPES
        for kind in (ONE, SEVERAL)
    }
    labels = ("orientation of the camera, degrees", "PSNR on unseen poses, dB")
    figures.curves(folder / "orientations.png", lines, labels)
    _pictures(ground, scale, seed, folder / "pictures.png")


def _pictures(ground: Ground, scale: str, seed: int, path: Path) -> None:
    """Write what the preset's two networks make of each orientation."""
    models = {
        kind: ground.train(ground.plan.adapt(SHORT, seed=seed), ground.learned(learned(ground, kind)))[0]
        for kind in (ONE, SEVERAL)
    }
    rows: list[figures.Row] = []
    for number, degrees in enumerate(TEST_DEGREES[scale]):
        pairs = ground.tested(turned(ground, degrees, number))[:1]
        pictures = [("input", inputs(pairs)[0])]
        pictures += [(f"trained on {kind}", ground.pictures(m, pairs)[0]) for kind, m in models.items()]
        rows.append((f"{degrees:g} degrees", [*pictures, ("reference", targets(pairs)[0])]))
    figures.sheet(path, rows)


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure whatever is missing, then report."""
    options, ground, results = start(command.parser(__doc__, "generalisation"), "generalisation", arguments)
    needed = cost(ground, options.scale)
    measure_all(ground, results, works(ground, options.scale), options.seeds, needed)
    report(ground, results, options.scale, options.seeds[0], options.output)


if __name__ == "__main__":
    command.begin(main)
