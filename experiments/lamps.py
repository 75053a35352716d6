"""Lamps of any colour and power: a network that denoises each lamp's light by itself, since light adds up.

1. A picture is linear in the lamps' colours: with T_k what lamp k gives under white light, it is the sum of
   color_k T_k. Two renders of the same random numbers, under colours of equal sums, so that both pick the
   same lamps, give T_1 and T_2 of one and the same path a pixel by two equations a channel [`apart`].
2. "Lamps apart" sees windows of both T_k in place of the colour's, and gives both denoised. The picture is
   their sum times the lamps' colours: exactly linear, and no range of colours or powers has to be learned.
3. Beside it are regressions of the picture itself, with the colours of a frame as in lights.py ("each frame")
   or with new ones for each pixel of a minibatch, which the T_k give for nothing ("each pixel"), and Open
   Image Denoise with albedo and normal.
4. Frames are those of `minicubes` as lights.py draws them. Tests have unseen times, and colours of their own:
   of the saturations that are trained on [`COLORS`], and of powers too [`POWERS`]. Scores and errors of
   colour are those of lights.py.

    python experiments/lamps.py

It needs PyTorch, `pip install torch`. A renderer that keeps lights apart would give T_k for one
sum more, and none does here yet: this measures whether that would pay.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from lab import command, tables
from lab.frames import Shot
from lab.ground import AS_IT_IS, PLANS, SCENE, Cost, Ground, measure_all, together, told, write_table
from lab.results import Results, Values
from lab.tables import Column
from lights import NAMES, seen_colors
from numpy.typing import NDArray

from wamnet.models.data.draws import variation_of
from wamnet.refimpl.encoding import to_display
from wamnet.refimpl.frame import Frame
from wamnet.refimpl.light.scenes import canonical
from wamnet.refimpl.light.variation import Ranges, Variation
from wamnet.refimpl.network import dataset
from wamnet.refimpl.network.train import SHORT
from wamnet_peers.peer_oidn import filtered, prefiltered

Array = NDArray[np.float64]

UNDER = (((2.0, 0.5, 0.5), (0.5, 2.0, 0.5)), ((0.5, 0.5, 2.0), (1.25, 1.25, 0.5)))
"""Colours of the two lamps in the two renders: all sums are 3, and no channel's equations are dependent."""

COLORS = Ranges(saturation=(0.3, 0.9))
"""Colours that are trained on, and tested: those of lights.py."""

POWERS = replace(COLORS, power=(0.25, 2.0))
"""Colours and powers that are tested too: a lamp nearly off beside one of twice its power."""

SMALL = {"size": 96, "train_frames": 24, "test_frames": 6, "test_spp": 512, "steps": 2000, "batch": 256}
"""Most of each number of the plan, except for the scale `paper`: a row takes half a minute of one core."""

NOISE_SEED, TESTS_APART, COLOR_SEED = 9300, 500, 67
"""Seeds of the first training frame and, later, of tests; seed of the colours."""

FIRST_OF_TESTS = 5000
"""Number of the first test's colours: those of training are smaller."""

SURFACES = ("normal", "albedo", "position")
"""The features beside colour."""

WAYS = (
    "regression, colours of each frame",
    "regression, colours of each pixel",
    "regression, colours and powers of each pixel",
    "lamps apart",
)
"""The networks; the last is trained under colours of each pixel, and knows powers by its form."""

OTHER = "Open Image Denoise"


@dataclass(frozen=True)
class Moment:
    """A frame: T_1 and T_2 of one path a pixel, and of the reference, (2, H, W, 3) each; its features."""

    noisy: Array
    clean: Array
    frame: Frame


def apart(one: Array, other: Array) -> Array:
    """Return T_1 and T_2 (2, H, W, 3) of the renders (H, W, 3) under both colours of `UNDER`."""
    found = []
    for channel in range(3):
        equations = np.array([[lamp[channel] for lamp in colors] for colors in UNDER])
        both = np.stack([one[..., channel], other[..., channel]])
        found.append(np.einsum("kr,rhw->khw", np.linalg.inv(equations), both.astype(np.float64)))
    # Rounding of float32 leaves some ulps of one lamp in the other's light.
    return np.maximum(np.stack(found, axis=-1), 0.0)


def under(lights: Array, colors: Sequence[Sequence[float]]) -> Array:
    """Return the picture (H, W, 3) of T (2, H, W, 3) under colours."""
    return np.asarray(sum(np.array(color) * light for color, light in zip(colors, lights, strict=True)))


def shots_of(ground: Ground) -> tuple[list[Shot], list[Shot]]:
    """Return the shots to train and to test on, as they are."""
    return (
        ground.training_shots(AS_IT_IS, NOISE_SEED),
        ground.test_shots(AS_IT_IS, NOISE_SEED + TESTS_APART),
    )


def lit(shots: Sequence[Shot], colors: Any) -> list[Shot]:
    """Return shots under the lamps' colours."""
    return [replace(shot, variation=Variation(lights=colors)) for shot in shots]


def moments(ground: Ground, shots: Sequence[Shot], spp: int) -> list[Moment]:
    """Return the moments that shots show."""
    one, other = (ground.pairs(lit(shots, colors), spp) for colors in UNDER)
    return [
        Moment(*(apart(a[k]["color"], b[k]["color"]) for k in (0, 1)), a[0])
        for a, b in zip(one, other, strict=True)
    ]


def colors_of(number: int, ranges: Ranges) -> tuple[tuple[float, float, float], ...]:
    """Return the lamps' colours of a number."""
    return variation_of(COLOR_SEED, number, ranges, canonical(SCENE).lights).lights


class Study:
    """What all rows share: moments to train and to test on, made once."""

    def __init__(self, ground: Ground) -> None:
        self.ground = ground
        self._made: tuple[list[Moment], list[Moment]] | None = None

    @property
    def made(self) -> tuple[list[Moment], list[Moment]]:
        """Return the moments to train and to test on."""
        if self._made is None:
            train, test = shots_of(self.ground)
            plan = self.ground.plan
            self._made = (
                moments(self.ground, train, plan.train_spp),
                moments(self.ground, test, plan.test_spp),
            )
        return self._made


def judged(study: Study, denoise: Callable[[Moment, Any], Array]) -> Values:
    """Return the scores under unseen colours, and under unseen colours and powers."""
    parts = []
    for ranges, where in ((COLORS, ""), (POWERS, "under powers")):
        pictures, pairs = [], []
        for k, moment in enumerate(study.made[1]):
            colors = colors_of(FIRST_OF_TESTS + k, ranges)
            pictures.append(denoise(moment, colors))
            pairs.append(
                tuple(_frame(moment, under(lights, colors)) for lights in (moment.noisy, moment.clean))
            )
        parts.append(told(seen_colors(pictures, pairs), where, NAMES))  # type: ignore[arg-type]
    return together(*parts)


def _frame(moment: Moment, color: Array) -> Frame:
    """Return the moment's frame with another colour."""
    return Frame({**moment.frame.layers, "color": color.astype(np.float32)}, moment.frame.info)


def measure_input(study: Study, seed: int) -> Values:
    """Return the scores of the noisy pictures."""
    return judged(study, lambda moment, colors: to_display(under(moment.noisy, colors)))


def measure_other(study: Study, seed: int) -> Values:
    """Return the scores of Open Image Denoise, which denoises albedo and normals first; it has no seeds."""

    def denoise(moment: Moment, colors: Any) -> Array:
        frame = _frame(moment, under(moment.noisy, colors))
        return np.asarray(to_display(filtered(frame, prefiltered(frame), True)), np.float64)

    return judged(study, denoise)


# ---- networks ----------------------------------------------------------------------------------------------


def measure(study: Study, way: str, seed: int) -> Values:
    """Return the scores of a network, and what it costs."""
    from baselines import lamp_network

    train, _ = study.made
    recipe = study.ground.plan.adapt(SHORT, seed=seed)
    scales = dataset.normalization_of([moment.frame for moment in train])
    own = [colors_of(k, COLORS) for k in range(len(train))]
    drawn = {WAYS[0]: own, WAYS[2]: POWERS}.get(way, COLORS)
    network = lamp_network.fit(way == WAYS[3], drawn, planes_of(train, scales), recipe)
    count = sum(each.numel() for each in network.parameters())

    def denoise(moment: Moment, colors: Any) -> Array:
        return lamp_network.picture(
            network, planes_of([moment], scales), np.array(colors), recipe.window.size
        )

    return {**judged(study, denoise), "parameters": count}


def planes_of(found: Sequence[Moment], scales: dataset.Normalization) -> list[dict[str, Any]]:
    """Return the surfaces' features and the lights of moments, and the targets' lights."""
    return [
        {
            "surfaces": dataset.feature_image(moment.frame, SURFACES, scales),
            "noisy": np.concatenate(list(moment.noisy), axis=-1).astype(np.float32),
            "clean": np.concatenate(list(moment.clean), axis=-1).astype(np.float32),
        }
        for moment in found
    ]


def works(ground: Ground) -> dict[str, Callable[[int], Values]]:
    """Return what measures each row for a seed."""
    study = Study(ground)
    found: dict[str, Callable[[int], Values]] = {"input": partial(measure_input, study)}
    if find_spec("pyoidn"):
        found[OTHER] = partial(measure_other, study)
    return found | {way: partial(measure, study, way) for way in WAYS}


COLUMNS = (
    Column("parameters", "parameters", 0),
    Column("psnr", "unseen colours: PSNR, dB", 2, interval=True),
    Column("flip", "FLIP", 3, interval=True),
    Column("color", "colour error", 4, interval=True),
    Column("psnr under powers", "and powers: PSNR, dB", 2, interval=True),
    Column("flip under powers", "FLIP", 3, interval=True),
    Column("color under powers", "colour error", 4, interval=True),
)
"""The columns of the table."""


def main(arguments: Sequence[str] | None = None) -> None:
    """Train and score whatever is missing, then report."""
    options = command.parser(__doc__, "lamps").parse_args(arguments)
    plan = PLANS[options.scale]
    if options.scale != "paper":
        plan = replace(plan, **{name: min(getattr(plan, name), most) for name, most in SMALL.items()})
    ground = Ground(plan, options.cache, options.executor)
    results = Results.open(
        options.output / "results.json", "lamps", {**asdict(plan), "executor": options.executor}
    )
    train, test = shots_of(ground)
    needed = [
        (lit(shots, colors), spp)
        for colors in UNDER
        for shots, spp in ((train, plan.train_spp), (test, plan.test_spp))
    ]
    measure_all(ground, results, works(ground), options.seeds, Cost(needed, 2 * plan.test_frames))
    report(results, options.output)


def report(results: Results, folder: Path) -> None:
    """Write the table."""
    names: Mapping[str, str] = {name: name for name in ("input", OTHER, *WAYS)}
    write_table(folder / "table.md", tables.table(results, COLUMNS, names, "`minicubes`, camera at rest"))


if __name__ == "__main__":
    command.begin(main)
