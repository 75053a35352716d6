"""Features past mirrors and glass: what a denoiser gains from them where materials are glossy.

1. The scene is `glossy`, its camera moves: the set of that name of lab/sets.py [`MOVING`].
2. Networks see the first hit's albedo, normal and position, those of what is seen past mirrors and glass
   (spec/following.md), or both [`INPUTS`], all else as in the preset `short` with fewer steps [`measure`].
3. Open Image Denoise, if it is installed, has colour with albedo and normal of either kind [`measure_other`].
4. Features are means over the colour's camera ray, or over 16 [`RAYS`]. Tests show unseen moments from unseen
   places [`report`].

    python experiments/seen.py
    python experiments/seen.py --scale paper -o out/seen-paper
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from importlib.util import find_spec
from pathlib import Path

from lab import command, tables
from lab.frames import Shot
from lab.ground import Cost, Ground, inputs, judged, measure_all, start, told, write_table
from lab.results import Results, Values
from lab.sets import SETS
from lab.tables import Column

from wamnet.kernels.bench.peers.peer_oidn import filtered, prefiltered
from wamnet.refimpl.encoding import to_display
from wamnet.refimpl.frame import SEEN, Frame
from wamnet.refimpl.network.train import SHORT

MOVING = SETS["glossy"]
"""The set of frames."""

NOISE_SEED, TESTS_APART = 8000, 500
"""Seed of the first training frame; tests begin so many later."""

PAST = ("color", "seen_normal", "seen_albedo", "seen_position")
"""As the features of `short`, past mirrors and glass."""

INPUTS: Mapping[str, tuple[str, ...]] = {
    "first hit": SHORT.features,
    "past mirrors and glass": PAST,
    "both": (*SHORT.features, *PAST[1:]),
}
"""What the networks see. The first two have as many parameters."""

OTHER: Mapping[str, bool] = {"first hit": False, "past mirrors and glass": True}
"""What Open Image Denoise is given, and whether that is past mirrors and glass."""

RAYS = (0, 16)
"""Camera rays that features are means over; 0: the colour's."""


def shots_of(ground: Ground, seen: bool, rays: int) -> tuple[list[Shot], list[Shot]]:
    """Return the shots to train and to test on; those of first hits only are as ever."""
    kind = {"ranges": MOVING.ranges, "scene": MOVING.scene}
    found = (
        ground.training_shots(seed=NOISE_SEED, **kind),
        ground.test_shots(seed=NOISE_SEED + TESTS_APART, **kind),
    )
    train, test = ([replace(shot, seen=seen, feature_spp=rays) for shot in shots] for shots in found)
    return train, test


def measure(ground: Ground, features: tuple[str, ...], rays: int, seed: int) -> Values:
    """Return the scores of a network with these features on unseen frames."""
    train, test = shots_of(ground, features != SHORT.features, rays)
    model, _ = ground.train(ground.plan.adapt(SHORT, features=features, seed=seed), ground.learned(train))
    return told(ground.judge(model, ground.tested(test)))


def measure_input(ground: Ground, seed: int) -> Values:
    """Return the scores of the noisy frames."""
    pairs = ground.tested(shots_of(ground, False, 0)[1])
    return told(judged(inputs(pairs), pairs))


def measure_other(ground: Ground, seen: bool, rays: int, seed: int) -> Values:
    """Return the scores of Open Image Denoise, which denoises albedo and normals first; it has no seeds."""
    pairs = ground.tested(shots_of(ground, seen, rays)[1])
    pictures = []
    for noisy, _ in pairs:
        frame = named_as_first_hits(noisy) if seen else noisy
        pictures.append(to_display(filtered(frame, prefiltered(frame), True)))
    return told(judged(pictures, pairs))


def named_as_first_hits(frame: Frame) -> Frame:
    """Return a frame whose layers of the first hit are those past mirrors and glass."""
    return Frame({**frame.layers, **{first: frame[seen] for seen, first in SEEN.items()}}, frame.info)


def name_of(what: str, rays: int) -> str:
    """Return the name of a row."""
    return f"{what}, features of {rays or 1} ray{'s' if rays else ''}"


def works(ground: Ground) -> dict[str, partial[Values]]:
    """Return what measures each row for a seed."""
    found = {"input": partial(measure_input, ground)}
    for rays in RAYS:
        for name, features in INPUTS.items():
            found[name_of(f"network, {name}", rays)] = partial(measure, ground, features, rays)
    for rays in RAYS if find_spec("pyoidn") else ():
        for name, seen in OTHER.items():
            found[name_of(f"Open Image Denoise, {name}", rays)] = partial(measure_other, ground, seen, rays)
    return found


COLUMNS = (
    Column("psnr", "PSNR, dB", 2, interval=True),
    Column("ssim", "SSIM", 3, interval=True),
    Column("flip", "FLIP", 3, interval=True),
)
"""The columns of the table."""


def cost(ground: Ground) -> Cost:
    """Return what the study needs."""
    kinds = [shots_of(ground, seen, rays) for seen in (False, True) for rays in RAYS]
    plan = ground.plan
    needed = [(train, plan.train_spp) for train, _ in kinds] + [(test, plan.test_spp) for _, test in kinds]
    return Cost(needed, plan.test_frames)


def report(ground: Ground, results: Results, folder: Path) -> None:
    """Write the table."""
    names = {name: name for name in works(ground)}
    write_table(folder / "table.md", tables.table(results, COLUMNS, names, "`glossy`, camera moves"))


def main(arguments: Sequence[str] | None = None) -> None:
    """Train and score whatever is missing, then report."""
    options, ground, results = start(command.parser(__doc__, "seen"), "seen", arguments)
    measure_all(ground, results, works(ground), options.seeds, cost(ground))
    report(ground, results, options.output)


if __name__ == "__main__":
    command.begin(main)
