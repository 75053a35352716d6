"""Lights of other colours: where the paper's network fails (its sections 6.1 and 6.2), and what helps.

1. A set of lights is the colours of both lamps of `minicubes`: A is the scene's own; others have hues and
   saturations drawn within a range, and keep the lamps' brightness [`light_set`].
2. Networks are trained on A only, on several sets, of which every frame draws one independently of its time,
   or on frames that each have colours of their own [`numbers`]. Frames and their times are the same in all
   cases, and so many that each of a few sets is seen in many poses [`trained_on`].
3. Inputs are compared [`INPUTS`]: the paper's colour and normal, also with the ray's direction; the preset
   `short`; the lamps' light without shadows in place of its albedo (spec/transport.md, LTR-11), which tells
   their colours; and both.
4. The last network has the preset's inputs for lamps and colour smoothed, learns from ten times the plan's
   frames for fifteen times its steps, and has features of 16 camera rays [`measure_long`]; so has Open Image
   Denoise, if it is installed, which denoises them first [`measure_other`].
5. Every test frame has colours of its own, within the range and never trained on, at an unseen time; scores
   and the error of colour [`lab/colors.py`] are those of these frames, and of the same times under A.

    python experiments/lights.py
    python experiments/lights.py --scale paper -o out/lights-paper

The paper shows pictures and no numbers here; it says that colours are not reproduced, in both cases. The
camera does not move, so that the ray's direction only says the place in the picture.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from lab import colors, command, figures, tables
from lab.frames import Pair, Shot
from lab.ground import (
    AS_IT_IS,
    KEPT,
    SCENE,
    TEST_SEED,
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
from lab.results import PER_FRAME, Results, Values
from lab.tables import Column

from wamnet.models.data.draws import variation_of
from wamnet.refimpl.encoding import to_display
from wamnet.refimpl.light.scenes import canonical
from wamnet.refimpl.light.variation import AT_REST, Ranges, Variation
from wamnet.refimpl.network.train import MIRRORS, PAPER, SHORT
from wamnet_peers.peer_oidn import filtered, prefiltered

EACH = 0
"""Number of light sets that stands for colours of its own in each frame."""

COUNTS: Mapping[str, Sequence[int]] = {
    "toy": (1, 2, EACH),
    "small": (1, 4, 16, EACH),
    "paper": (1, 2, 4, 8, 16, 32, EACH),
}
"""Numbers of light sets that are trained on, by scale."""

FRAMES = 2
"""Times the plan's training frames: each of 4 sets is seen in about twelve poses."""

INPUTS: Mapping[str, tuple[str, ...]] = {
    "paper": PAPER.features,
    "paper, direction": (*PAPER.features, "direction"),
    "short": SHORT.features,
    "unshadowed": ("color", "normal", "unshadowed", "position"),
    "both": (*SHORT.features, "unshadowed"),
}
"""What the networks see. `short` and `unshadowed` have as many parameters, `both` a quarter more."""

ENDS_ONLY = ("paper, direction",)
"""Inputs that are trained on A and on colours of each frame only."""

SET_SEED = 61
"""Seed of the light sets' colours, and of which set a frame has."""

COLORS = Ranges(saturation=(0.3, 0.9))
"""Range of the colours of trained and tested sets; it contains A's saturations."""

FIRST_OF_FRAMES, FIRST_OF_TESTS, FIRST_OF_LONG = 1000, 5000, 6000
"""Numbers of the first set of frames with colours of their own, of tests, of the last network's frames."""

NOISE_SEED = 4000
"""Seed of the first training frame here."""


def light_set(number: int) -> Variation:
    """Return the lamps of a set: 0 is A; the others' hues are uniform, and so is saturation in its range."""
    lights = canonical(SCENE).lights
    return AT_REST if number == 0 else variation_of(SET_SEED, number, COLORS, lights)


def numbers(count: int, frames: int) -> list[int]:
    """Return the set of each training frame: one of `count`, A among them, or one of its own."""
    if count == EACH:
        return [FIRST_OF_FRAMES + k for k in range(frames)]
    return [int(number) for number in np.random.default_rng([SET_SEED, count]).integers(count, size=frames)]


def under(shots: Sequence[Shot], sets: Sequence[int]) -> list[Shot]:
    """Return shots under a set of lights each."""
    return [replace(shot, variation=light_set(n)) for shot, n in zip(shots, sets, strict=True)]


def trained_on(ground: Ground, count: int) -> list[Shot]:
    """Return as many training shots, at the same times, for any number of sets.

    They are draws after those of the tests, so that no more of them changes the tests.
    """
    plan = ground.plan
    frames = FRAMES * plan.train_frames
    draws = ground.draws(AS_IT_IS, plan.train_frames + plan.test_frames, frames)
    return under(ground.shots(draws, NOISE_SEED), numbers(count, frames))


def recoloured(ground: Ground) -> list[Shot]:
    """Return the test shots, each under colours of its own that no network has seen."""
    shots = ground.test_shots(seed=TEST_SEED)
    return under(shots, [FIRST_OF_TESTS + k for k in range(len(shots))])


def seen_colors(pictures: Sequence[Any], pairs: Sequence[Pair]) -> dict[str, Any]:
    """Return scores and the mean colour error of pictures, and those of each."""
    errors = [colors.color_error(p, t) for p, t in zip(pictures, targets(pairs), strict=True)]
    each = {PER_FRAME: {"color": [round(error, 5) for error in errors]}, "color": float(np.mean(errors))}
    return together(judged(pictures, pairs), each)


LONG = "smoothed, 64 neurons, 16 rays, ten times the frames: colours of each frame"
"""The configuration of the network that has what the other studies found."""

OTHER = "Open Image Denoise, high, prefiltered, 16 rays"
"""The configuration of the general denoiser."""

MORE_FRAMES, MORE_STEPS, RAYS = 10, 15, 16
"""Times the plan's training frames, and its steps; camera rays of features."""

LAMPS_SMOOTHED = replace(
    MIRRORS,
    features=("color", "highlights", "smoothed", "normal", "albedo", "position", "unshadowed"),
)
"""The preset `mirrors` where nothing mirrors: what is seen at the first hit, and the lamps' light without
shadows."""

NAMES = (*KEPT, "color")
"""The scores that are kept."""


def measure(ground: Ground, features: tuple[str, ...], count: int, seed: int) -> Values:
    """Return the scores of a network on unseen colours, and on A."""
    recipe = ground.plan.adapt(SHORT, features=features, seed=seed)
    model, _ = ground.train(recipe, ground.learned(trained_on(ground, count)))
    parts = []
    for shots, where in ((recoloured(ground), ""), (ground.test_shots(), "on A")):
        pairs = ground.tested(shots)
        parts.append(told(seen_colors(ground.pictures(model, pairs), pairs), where, NAMES))
    return together(*parts)


def by_more_rays(shots: Sequence[Shot]) -> list[Shot]:
    """Return the same shots with features of more camera rays."""
    return [replace(shot, feature_spp=RAYS) for shot in shots]


def long_shots(ground: Ground) -> list[Shot]:
    """Return the training frames of the last network, each under colours of its own; none is a test's."""
    plan = ground.plan
    count = MORE_FRAMES * plan.train_frames
    first = plan.train_frames + plan.test_frames + FRAMES * plan.train_frames
    shots = ground.shots(ground.draws(AS_IT_IS, first, count), NOISE_SEED + FRAMES * plan.train_frames)
    sets = [FIRST_OF_LONG + k for k in range(count)]
    return by_more_rays(under(shots, sets))


def measure_long(ground: Ground, seed: int) -> Values:
    """Return the scores of the network that has what the other studies found."""
    steps = MORE_STEPS * ground.plan.steps
    recipe = replace(ground.plan.adapt(LAMPS_SMOOTHED, seed=seed), steps=steps)
    model, _ = ground.train(recipe, ground.learned(long_shots(ground)))
    return _both(ground, lambda pairs: ground.pictures(model, pairs))


def measure_other(ground: Ground, seed: int) -> Values:
    """Return the scores of Open Image Denoise on the same frames; it has no seeds."""

    def denoised(pairs: Sequence[Pair]) -> list[Any]:
        noisy = [frame for frame, _ in pairs]
        return [to_display(filtered(frame, prefiltered(frame), True)) for frame in noisy]

    return _both(ground, denoised)


def _both(ground: Ground, pictures: Callable[[Sequence[Pair]], Sequence[Any]]) -> Values:
    """Return the scores of pictures on unseen colours, and on A, of frames with features of more rays."""
    parts = []
    for shots, where in ((recoloured(ground), ""), (ground.test_shots(), "on A")):
        pairs = ground.tested(by_more_rays(shots))
        parts.append(told(seen_colors(pictures(pairs), pairs), where, NAMES))
    return together(*parts)


def measure_input(ground: Ground, seed: int) -> Values:
    """Return the scores of the noisy frames."""
    found = [(ground.tested(recoloured(ground)), ""), (ground.unseen(), "on A")]
    return together(*(told(seen_colors(inputs(pairs), pairs), where, NAMES) for pairs, where in found))


def rows(scale: str) -> dict[str, tuple[str, int]]:
    """Return the inputs and the number of sets of every network, by the configuration's name."""
    counts = COUNTS[scale]
    words = {1: "A only", EACH: "colours of each frame"}
    return {
        f"{name}: {words.get(count, f'{count} sets')}": (name, count)
        for count in counts
        for name in INPUTS
        if name not in ENDS_ONLY or count in (1, EACH)
    }


def works(ground: Ground, scale: str) -> dict[str, partial[Values]]:
    """Return what measures each configuration for a seed."""
    found = {"input": partial(measure_input, ground)}
    found |= {
        text: partial(measure, ground, INPUTS[name], count) for text, (name, count) in rows(scale).items()
    }
    found[LONG] = partial(measure_long, ground)
    return found | ({OTHER: partial(measure_other, ground)} if find_spec("pyoidn") else {})


def cost(ground: Ground, scale: str) -> Cost:
    """Return what the study needs."""
    plan = ground.plan
    needed = [(trained_on(ground, count), plan.train_spp) for count in COUNTS[scale]]
    needed += [(recoloured(ground), plan.test_spp), (ground.test_shots(), plan.test_spp)]
    needed += [(long_shots(ground), plan.train_spp)]
    return Cost(needed, 2 * plan.test_frames)


COLUMNS = (
    Column("psnr", "unseen colours: PSNR, dB", 2, interval=True),
    Column("ssim", "SSIM", 3, interval=True),
    Column("flip", "FLIP", 3, interval=True),
    Column("color", "colour error", 4, interval=True),
    Column("psnr on A", "A's colours: PSNR, dB", 2, interval=True),
    Column("color on A", "colour error", 4, interval=True),
)
"""The columns of the table."""


def report(ground: Ground, results: Results, scale: str, seed: int, folder: Path) -> None:
    """Write the table, two curves, and pictures of one seed."""
    found = rows(scale)
    names = {name: name for name in ("input", *found, LONG, OTHER)}
    write_table(folder / "table.md", tables.table(results, COLUMNS, names, "inputs: trained on"))
    for value, label in (("psnr", "PSNR, dB"), ("color", "colour error")):
        lines: dict[str, Any] = {
            name: [
                (count or FRAMES * ground.plan.train_frames, results.of(text, value))
                for text, (of, count) in found.items()
                if of == name
            ]
            for name in INPUTS
        }
        labels = ("light sets trained on; the last: colours of each frame", f"unseen colours: {label}")
        figures.curves(folder / f"{value}.png", lines, labels, (True, False))
    _pictures(ground, seed, folder)


def _pictures(ground: Ground, seed: int, folder: Path) -> None:
    """Write what the networks of A and of each frame's colours make of A's colours and of unseen ones."""
    for path, count in (("a-on-b.png", 1), ("each-frame.png", EACH)):
        pictures_of: list[figures.Row] = []
        models = {
            name: ground.train(
                ground.plan.adapt(SHORT, features=features, seed=seed),
                ground.learned(trained_on(ground, count)),
            )[0]
            for name, features in INPUTS.items()
        }
        shown = [("colours A", ground.test_shots()[:1])]
        shown += [(f"unseen colours {k + 1}", [shot]) for k, shot in enumerate(recoloured(ground)[:SHOWN])]
        for label, shots in shown:
            pairs = ground.tested(shots)
            pictures = [("input", inputs(pairs)[0])]
            pictures += [(name, ground.pictures(model, pairs)[0]) for name, model in models.items()]
            pictures_of.append((label, [*pictures, ("reference", targets(pairs)[0])]))
        figures.sheet(folder / path, pictures_of)


SHOWN = 2
"""Unseen colours that the sheets of pictures show."""


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure whatever is missing, then report."""
    options, ground, results = start(command.parser(__doc__, "lights"), "lights", arguments)
    needed = cost(ground, options.scale)
    measure_all(ground, results, works(ground, options.scale), options.seeds, needed)
    report(ground, results, options.scale, options.seeds[0], options.output)


if __name__ == "__main__":
    command.begin(main)
