"""How long a table will take, said before it begins: probes of a second each, times what is still missing.

1. Frames without a file are counted as samples; a small picture is rendered to time one [`rendering`].
2. A row without a record is trained: a few steps on made-up frames are timed, and multiplied by all of its
   steps [`training`]. A baseline that stops where its validation error is flat may need fewer.
3. Each picture is scored; scores of one are timed [`judging`].

What was interrupted is counted as a whole, and kernels of new scenes are built in no time: a forecast, not
a promise. PyTorch is imported by what needs it.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace

import numpy as np
from lab import frames, scores
from lab.frames import Shot
from lab.training import seconds_a_step

from wamnet.kernels.bench.workload import noise
from wamnet.kernels.run.render_frame import render_frame
from wamnet.refimpl.network.train import BEST, PAPER, SHORT

from .rows import EQUAL_RAYS, EQUAL_SPP, Bench

PROBE_PX = 256
"""Side of the pictures of the probes."""

PROBE_SPP = 4
"""Samples of the rendering probe."""

PROBE_STEPS = 10
"""Steps of WAMnet that are timed."""

Missing = Sequence[tuple[str, int]]
"""Rows and seeds without a record."""


def wanted(bench: Bench, missing: Missing) -> list[Shot]:
    """Return the shots of all rows and seeds that are missing, some more than once."""
    scale, split, found = bench.scale, bench.split, list[Shot]()
    spp, rays = {"oidn-spp": EQUAL_SPP}, dict.fromkeys(("oidn-rays", "wamnet-best"), EQUAL_RAYS)
    for row, seed in missing:
        own, trains = row.endswith("-own") and "shrunk" not in row, _trains(row)
        judged = (bench.own(seed),) if own else split.test
        found += [bench.noisy(shot, seed, rays.get(row, 0), spp.get(row, 1)) for shot in judged]
        if not own:
            found += [frames.reference(shot, scale.test_spp) for shot in split.test]
        if own or trains == "paper":
            found.append(frames.reference(bench.own(seed), scale.train_spp))
        elif trains == "short":
            few = split.train[: scale.short_frames]
            found += [frames.reference(shot, scale.train_spp) for shot in few]
            found += [bench.noisy(shot, seed, rays.get(row, 0)) for shot in few]
        elif trains:
            found += [frames.reference(shot, scale.train_spp) for shot in split.train]
            found += [frames.reference(shot, scale.validation_spp) for shot in split.validation]
            found += [bench.noisy(shot, seed) for shot in (*split.train, *split.validation)]
    return found


def _trains(row: str) -> str:
    """Return which settings a row is trained with."""
    from .rows import ROWS

    return ROWS[row].trains


def rendering(bench: Bench, shots: Iterable[Shot]) -> float:
    """Return the seconds that the shots without a file take."""
    folder, executor = bench.cache / "frames", bench.executor
    paths = {frames.path_of(folder, shot, executor): shot for shot in shots}
    left = [shot for shot in paths.values() if frames.find(folder, shot, executor) is None]
    if not left:
        return 0.0
    size = min(PROBE_PX, bench.scale.size)
    shot = replace(bench.split.train[0], size=size, spp=PROBE_SPP)
    took = _timed(lambda: render_frame(executor, shot.build(), shot.job, workers=None))
    return took / (PROBE_SPP * size**2) * sum(shot.spp * shot.size**2 for shot in left)


def training(bench: Bench, row: str) -> float:
    """Return the seconds of a row's training, at most; 0 for a row that shares another one's network."""
    trains = _trains(row)
    if not trains or row.endswith("-own"):
        return 0.0
    if trains in ("paper", "short"):
        base = PAPER if trains == "paper" else BEST if row == "wamnet-best" else SHORT
        recipe = replace(base, **getattr(bench.scale, trains))
        made = noise(PROBE_PX)
        return recipe.steps * seconds_a_step(recipe, [(made, made)], bench.device, PROBE_STEPS)
    return _fitting(bench, trains)


def _fitting(bench: Bench, trains: str) -> float:
    """Return the seconds of a baseline's largest number of steps, and of its looks."""
    from . import dncnn, fitting, pix2pix

    base = {"learning_rate": 1e-3, "method": "pix2pix" if trains == "pix2pix" else "dncnn"}
    if trains == "pix2pix":
        base |= {"features": ("color", "normal"), "tiles": True}
    recipe = fitting.Recipe(**{**base, **getattr(bench.scale, trains)})
    method = {"dncnn": dncnn.DnCNN, "pix2pix": pix2pix.Pix2pix}[recipe.method](recipe)
    side = max(recipe.crop, PROBE_PX // 2)
    images = np.full((1, 3 * len(recipe.features), side, side), 0.5, np.float32)
    data = fitting.Examples(images, images[:, :3], "")
    step = _timed(lambda: fitting.seconds_a_step(method, recipe, data))
    look = _timed(lambda: fitting.validated(method, recipe, data))
    pixels = min(fitting.VALIDATION_PX, bench.scale.size // recipe.shrink) ** 2 * bench.scale.validation
    return recipe.steps * (step + look * pixels / side**2 / recipe.every)


def judging(bench: Bench, missing: Missing) -> float:
    """Return the seconds of the scores of all pictures."""
    if not missing:
        return 0.0
    size = min(PROBE_PX, bench.scale.size)
    picture = np.full((size, size, 3), 0.5, np.float32)
    pictures = sum(1 if row.endswith("-own") else bench.scale.test for row, _ in missing)
    return _timed(lambda: scores.score(picture, picture)) * (bench.scale.size / size) ** 2 * pictures


def _timed(work: Callable[[], object]) -> float:
    """Return the seconds of a second run."""
    work()
    begun = time.perf_counter()
    work()
    return time.perf_counter() - begun
