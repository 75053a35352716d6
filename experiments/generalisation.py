"""Unseen times and unseen camera orientations: the paper says that pictures are as good there; is that so?

1. Networks are trained on frames of one orientation of the camera, or of several; frames are as many in both
   cases [`trained_on`]. Times of the tests lie amid training times.
2. All are scored at orientations that were trained on, between them, and beyond them [`TEST_DEGREES`];
   beside them stand a network of that very orientation, and the noisy input.
3. A table, a curve of PSNR against orientation with its spread, and pictures [`report`].

    python experiments/generalisation.py
    python experiments/generalisation.py --scale paper -o out/generalisation-paper

The camera turns about the vertical through the cubes (its yaw). The first column of the
table is of training times with other noise: what is lost at unseen times is the difference of the first two.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

from lab import command, figures, tables
from lab.frames import Pair
from lab.ground import Ground, inputs, judged, start, targets, write_table
from lab.results import Results, Values, fill
from lab.tables import Column

from wamnet.refimpl.train import PAPER, SHORT, Recipe
from wamnet.refimpl.variation import Variation

SEVERAL_DEGREES = (-24.0, -8.0, 8.0, 24.0)
"""Orientations of the camera that the networks of several orientations are trained on."""

TEST_DEGREES: Mapping[str, Sequence[float]] = {
    "toy": (0.0, 40.0),
    "small": (0.0, 4.0, 16.0, 40.0, 90.0),
    "paper": (0.0, 2.0, 4.0, 8.0, 16.0, 24.0, 40.0, 90.0, 180.0),
}
"""Orientations of the tests, by scale; 0 is that of the networks of one orientation."""

RECIPES: Mapping[str, Recipe] = {
    "paper's features": replace(SHORT, features=PAPER.features),
    "short": SHORT,
}
"""Recipes: the preset `short`, and the same with colour and normal alone."""

OWN_DEGREES: Mapping[str, Sequence[float]] = {
    "toy": (40.0,),
    "small": (16.0, 90.0),
    "paper": TEST_DEGREES["paper"][1:],
}
"""Orientations that have a network of their own, by scale; that of 0 is there anyway."""

DEGREES_PER_SEED = 10
"""Apart for each degree are the seeds of frames of other orientations: their noise is not the same."""


def seed_of(degrees: float) -> int:
    """Return the seed of the first frame of an orientation."""
    return 1000 + DEGREES_PER_SEED * round(degrees + 180.0)


def trained_on(ground: Ground, kind: str) -> list[Pair]:
    """Return as many pairs at the training times of `one` orientation, of `several`, or of `<degrees>`."""
    times = ground.times()[0]
    if kind == "one":
        return ground.seen()
    degrees = SEVERAL_DEGREES if kind == "several" else (float(kind),)
    shots = [
        replace(ground.shots([time], seed_of(turned) + 4000 + k)[0], variation=Variation(yaw_deg=turned))
        for k, time in enumerate(times)
        for turned in [degrees[k % len(degrees)]]
    ]
    return ground.pairs(shots, ground.plan.train_spp)


def tested_on(ground: Ground, degrees: float) -> list[Pair]:
    """Return pairs of an orientation at unseen times; those of 0 are those of the other studies."""
    if degrees == 0.0:
        return ground.unseen()
    shots = ground.shots(ground.times()[1], seed_of(degrees))
    turned = [replace(shot, variation=Variation(yaw_deg=degrees)) for shot in shots]
    return ground.pairs(turned, ground.plan.test_spp)


def measure(ground: Ground, recipe: Recipe, kind: str, degrees: Sequence[float], seed: int) -> Values:
    """Return the scores of a network by orientation, and on its training frames for one orientation."""
    pairs = trained_on(ground, kind)
    model, _ = ground.train(ground.plan.adapt(recipe, seed=seed), pairs)
    found = {f"psnr at {turned:g}": ground.judge(model, tested_on(ground, turned)) for turned in degrees}
    values = {name: scores["psnr"] for name, scores in found.items()}
    values |= {name.replace("psnr", "ssim"): scores["ssim"] for name, scores in found.items()}
    if kind == "one":
        again = _again(ground)
        values["psnr at training times"] = ground.judge(model, again)["psnr"]
    return values


def _again(ground: Ground) -> list[Pair]:
    """Return pairs at some training times, with noise that was not trained on."""
    times = ground.times()[0][:: max(1, ground.plan.train_frames // ground.plan.test_frames)]
    shots = ground.shots(times[: ground.plan.test_frames], 700)
    return ground.pairs(shots, ground.plan.test_spp)


def of_input(ground: Ground, degrees: Sequence[float], seed: int) -> Values:
    """Return the scores of the noisy frames."""
    values = {}
    for turned in degrees:
        pairs = tested_on(ground, turned)
        scores = judged(inputs(pairs), pairs)
        values |= {f"{name} at {turned:g}": scores[name] for name in ("psnr", "ssim")}
    return {**values, "psnr at training times": judged(inputs(_again(ground)), _again(ground))["psnr"]}


def works(ground: Ground, scale: str) -> dict[str, partial[Values]]:
    """Return what measures each configuration for a seed."""
    degrees = TEST_DEGREES[scale]
    found = {"input": partial(of_input, ground, degrees)}
    for name, recipe in RECIPES.items():
        for kind in ("one", "several"):
            found[f"{name}, {kind}"] = partial(measure, ground, recipe, kind, degrees)
    for turned in OWN_DEGREES[scale]:
        found[f"short, own {turned:g}"] = partial(measure, ground, SHORT, f"{turned:g}", (turned,))
    return found


def report(ground: Ground, results: Results, scale: str, seed: int, folder: Path) -> None:
    """Write the table, the curve, and pictures of one seed."""
    degrees = TEST_DEGREES[scale]
    heads = {
        "psnr at training times": "training times",
        **{f"psnr at {d:g}": f"{d:g} degrees" for d in degrees},
    }
    shown = ["input", *(f"{name}, {kind}" for name in RECIPES for kind in ("one", "several"))]
    names = {name: name for name in shown}
    columns = [Column(value, head, 2) for value, head in heads.items()]
    rows = tables.table(results, columns, names, "trained on orientations: PSNR, dB")
    own = ["short, that orientation alone", ""]
    own += [results.text("short, one" if d == 0 else f"short, own {d:g}", f"psnr at {d:g}") for d in degrees]
    write_table(folder / "table.md", rows + "| " + " | ".join(own) + " |\n")
    lines = {
        name: [(d, results.of(name, f"psnr at {d:g}")) for d in degrees] for name in shown if name != "input"
    }
    lines["short, that orientation alone"] = [
        (d, results.of("short, one" if d == 0 else f"short, own {d:g}", f"psnr at {d:g}"))
        for d in (0.0, *OWN_DEGREES[scale])
    ]
    labels = ("orientation of the camera, degrees", "PSNR on unseen times, dB")
    figures.curves(folder / "orientations.png", lines, labels)
    _pictures(ground, scale, seed, folder / "pictures.png")


def _pictures(ground: Ground, scale: str, seed: int, path: Path) -> None:
    """Write what the preset's two networks make of each orientation."""
    models = {
        kind: ground.train(ground.plan.adapt(SHORT, seed=seed), trained_on(ground, kind))[0]
        for kind in ("one", "several")
    }
    rows: list[figures.Row] = []
    for turned in TEST_DEGREES[scale]:
        pairs = tested_on(ground, turned)[:1]
        pictures = [("input", inputs(pairs)[0])]
        pictures += [(f"trained on {kind}", ground.pictures(m, pairs)[0]) for kind, m in models.items()]
        rows.append((f"{turned:g} degrees", [*pictures, ("reference", targets(pairs)[0])]))
    figures.sheet(path, rows)


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure whatever is missing, then report."""
    options, ground, results = start(command.parser(__doc__, "generalisation"), "generalisation", arguments)
    fill(results, works(ground, options.scale), options.seeds, "measuring orientations")
    report(ground, results, options.scale, options.seeds[0], options.output)


if __name__ == "__main__":
    command.begin(main)
