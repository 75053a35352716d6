"""Lights of other colours: where the paper's network fails (its sections 6.1 and 6.2), and what mends it.

1. A set of lights is the colours of both lamps of `minicubes` [`light_set`]: A is the scene's own; those of
   the tests were never trained on.
2. Networks are trained on A alone, on several sets, or on one of the tests' sets alone, which is as good as
   it can get. Frames are as many in all cases [`trained_on`].
3. Four inputs are compared [`INPUTS`]: the paper's colour and normal; the preset `short`; the lamps' light
   without shadows in place of its albedo (spec/transport.md, LTR-11), which tells their colours; and both.
4. Pictures of unseen sets at unseen times are scored, and their error of colour is told [`lab/colors.py`].

    python experiments/lights.py
    python experiments/lights.py --scale paper -o out/lights-paper

The paper shows pictures and no numbers here; it says that colours are not reproduced, in both cases.
"""

from __future__ import annotations

import colorsys
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from lab import colors, command, figures, tables
from lab.frames import Pair, Shot
from lab.ground import TEST_SEED, Ground, inputs, judged, start, targets, write_table
from lab.results import Results, Values, fill
from lab.tables import Column

from wamnet.refimpl.scenes import COOL, WARM
from wamnet.refimpl.train import PAPER, SHORT

COUNTS: Mapping[str, Sequence[int]] = {"toy": (1, 2), "small": (1, 4, 16), "paper": (1, 2, 4, 8, 16, 32)}
"""Numbers of light sets that are trained on, by scale."""

TESTS: Mapping[str, Sequence[int]] = {"toy": (-1,), "small": (-1, -2), "paper": (-1, -2, -3, -4, -5, -6)}
"""Light sets of the tests, by scale; -1 is the one that stands for the paper's B."""

INPUTS: Mapping[str, tuple[str, ...]] = {
    "paper": PAPER.features,
    "short": SHORT.features,
    "unshadowed": ("color", "normal", "unshadowed", "position"),
    "both": (*SHORT.features, "unshadowed"),
}
"""What the networks see. `short` and `unshadowed` have as many parameters, `both` a quarter more."""

SET_SEED = 61
"""Seed of the light sets' colours."""

LEAST_SATURATION, MOST_SATURATION = 0.3, 0.9
"""Range of the saturation of light colours; A's are 0.58 and 0.55."""

B = {"warm": (0.30, 1.0, 0.45), "cool": (1.0, 0.35, 0.80)}
"""The set -1: green and pink, far from A and from each other."""


def light_set(number: int) -> dict[str, tuple[float, ...]]:
    """Return the light colours of a set: 0 is A, positive ones are trained on, negative ones are tested.

    Hues are uniform, and each lamp keeps the mean of its channels, so that pictures stay as bright.
    """
    if number == 0:
        return {"warm": WARM, "cool": COOL}
    draw = np.random.default_rng([SET_SEED, abs(number), number < 0])
    found = {}
    for name, own in (("warm", WARM), ("cool", COOL)):
        saturation = draw.uniform(LEAST_SATURATION, MOST_SATURATION)
        drawn = np.array(colorsys.hsv_to_rgb(draw.uniform(), saturation, 1.0) if number != -1 else B[name])
        red, green, blue = (drawn * (sum(own) / drawn.sum())).tolist()
        found[name] = (red, green, blue)
    return found


def shots_of(ground: Ground, times: Sequence[float], sets: Sequence[int], seed: int) -> list[Shot]:
    """Return shots at times, under the sets in turn."""
    plain = ground.shots(times, seed)
    return [
        replace(shot, parameters=light_set(number) if number else {})
        for shot, number in zip(plain, (sets[k % len(sets)] for k in range(len(times))), strict=True)
    ]


def trained_on(ground: Ground, sets: Sequence[int]) -> list[Pair]:
    """Return as many training pairs for any number of sets."""
    times = ground.times()[0]
    return ground.pairs(shots_of(ground, times, sets, 0), ground.plan.train_spp)


def tested_on(ground: Ground, number: int) -> list[Pair]:
    """Return the test pairs of a set."""
    times = ground.times()[1]
    return ground.pairs(shots_of(ground, times, [number], TEST_SEED), ground.plan.test_spp)


def seen_colors(pictures: Sequence[Any], pairs: Sequence[Pair]) -> dict[str, float]:
    """Return scores and the mean colour error of pictures."""
    errors = [colors.color_error(p, t) for p, t in zip(pictures, targets(pairs), strict=True)]
    return {**judged(pictures, pairs), "color": float(np.mean(errors))}


NAMES = ("psnr", "ssim", "flip", "color")
"""The scores that are kept."""


def measure(
    ground: Ground, features: tuple[str, ...], sets: Sequence[int], tests: Sequence[int], seed: int
) -> Values:
    """Return the mean scores of a network on the test sets, and on A."""
    recipe = ground.plan.adapt(SHORT, features=features, seed=seed)
    model, _ = ground.train(recipe, trained_on(ground, sets))
    found = []
    for number in tests:
        pairs = tested_on(ground, number)
        found.append(seen_colors(ground.pictures(model, pairs), pairs))
    own = tested_on(ground, 0)
    on_a = seen_colors(ground.pictures(model, own), own)
    values = {name: float(np.mean([scores[name] for scores in found])) for name in NAMES}
    return {**values, **{f"{name} on A": on_a[name] for name in NAMES}}


def measure_own(ground: Ground, features: tuple[str, ...], tests: Sequence[int], seed: int) -> Values:
    """Return the mean scores of networks that are each trained on the very set of their test."""
    found = [measure(ground, features, [number], [number], seed) for number in tests]
    return {name: float(np.mean([values[name] for values in found])) for name in NAMES}


def measure_input(ground: Ground, tests: Sequence[int], seed: int) -> Values:
    """Return the mean scores of the noisy frames."""
    found = [seen_colors(inputs(pairs), pairs) for number in tests for pairs in [tested_on(ground, number)]]
    return {name: float(np.mean([scores[name] for scores in found])) for name in NAMES}


def sets_of(count: int) -> list[int]:
    """Return the sets that are trained on: A first."""
    return list(range(count))


def works(ground: Ground, scale: str) -> dict[str, partial[Values]]:
    """Return what measures each configuration for a seed."""
    tests = TESTS[scale]
    found = {"input": partial(measure_input, ground, tests)}
    for count in COUNTS[scale]:
        for name, features in INPUTS.items():
            found[f"{name}, {count}"] = partial(measure, ground, features, sets_of(count), tests)
    for name, features in INPUTS.items():
        found[f"{name}, own"] = partial(measure_own, ground, features, tests)
    return found


COLUMNS = (
    Column("psnr", "unseen colours: PSNR, dB", 2),
    Column("ssim", "SSIM", 3),
    Column("flip", "FLIP", 3),
    Column("color", "colour error", 4),
    Column("psnr on A", "A's colours: PSNR, dB", 2),
    Column("color on A", "colour error", 4),
)
"""The columns of the table."""


def report(ground: Ground, results: Results, scale: str, seed: int, folder: Path) -> None:
    """Write the table, two curves, and pictures of one seed."""
    names = {"input": "input"}
    for count in COUNTS[scale]:
        told = "A alone" if count == 1 else f"{count} sets"
        names |= {f"{name}, {count}": f"{name}, trained on {told}" for name in INPUTS}
    names |= {f"{name}, own": f"{name}, trained on the test's colours" for name in INPUTS}
    write_table(folder / "table.md", tables.table(results, COLUMNS, names))
    for value, label in (("psnr", "PSNR, dB"), ("color", "colour error")):
        lines: dict[str, Any] = {
            name: [(count, results.of(f"{name}, {count}", value)) for count in COUNTS[scale]]
            for name in INPUTS
        }
        ends = (COUNTS[scale][0], COUNTS[scale][-1])
        own = {f"{name}, the test's colours": results.of(f"{name}, own", value) for name in INPUTS}
        lines |= {name: [(count, values) for count in ends] for name, values in own.items()}
        labels = ("light sets trained on", f"unseen colours: {label}")
        figures.curves(folder / f"{value}.png", lines, labels, (True, False))
    _pictures(ground, scale, seed, folder)


def _pictures(ground: Ground, scale: str, seed: int, folder: Path) -> None:
    """Write what the networks of A and of all sets make of A's colours and of unseen ones."""
    most = COUNTS[scale][-1]
    for path, count in (("a-on-b.png", 1), (f"{most}-sets.png", most)):
        rows: list[figures.Row] = []
        models = {
            name: ground.train(
                ground.plan.adapt(SHORT, features=features, seed=seed), trained_on(ground, sets_of(count))
            )[0]
            for name, features in INPUTS.items()
        }
        for number in (0, *TESTS[scale]):
            pairs = tested_on(ground, number)[:1]
            pictures = [("input", inputs(pairs)[0])]
            pictures += [(name, ground.pictures(model, pairs)[0]) for name, model in models.items()]
            label = "colours A" if number == 0 else f"unseen colours {-number}"
            rows.append((label, [*pictures, ("reference", targets(pairs)[0])]))
        figures.sheet(folder / path, rows)


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure whatever is missing, then report."""
    options, ground, results = start(command.parser(__doc__, "lights"), "lights", arguments)
    fill(results, works(ground, options.scale), options.seeds, "measuring lights")
    report(ground, results, options.scale, options.seeds[0], options.output)


if __name__ == "__main__":
    command.begin(main)
