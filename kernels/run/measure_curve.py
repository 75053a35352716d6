"""Measure a curve: every variant under every schedule of an executor that may pay [`measure`].

1. The full network runs under each schedule on a small picture first. Of the schedules the [`MOST_SCHEDULES`]
   fastest remain: a plain kernel may take a minute where another takes a second [`promising`].
2. Errors and losses are taken on given frames, with the device's own kernels, against the full network in
   float64 [`quality`]; times on a picture of the requested size, of random numbers.
3. Times are those of kernels/measure.py: the ways are interleaved.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from ...compiler import variants
from ...compiler.artifact import Artifact
from ...compiler.compile import compile_plan
from ...compiler.plan import Plan
from ...compiler.variants import plan_model
from ...refimpl import metrics
from ...refimpl.errors import CompileError, InputError
from ...refimpl.frame import Frame
from ...refimpl.network import dataset
from ...refimpl.network.denoise import Model, denoise
from ..devices.executor import Executor
from ..measure import in_turns
from .curve import Curve, Point
from .denoise_on import images_of
from .tune import noise, trial

NAMES = (
    *("full", "sine9", "sine7", "sine5", "window10", "window8", "window6", "rank24", "rank16", "rank12"),
    *("window8+rank24", "window8+rank16", "window8+rank12", "window6+rank12", "window8+rank16+sine7"),
)
"""Variants that are measured when none are named; those that a model cannot have are left out."""

MOST_SCHEDULES = 2
"""Schedules that all variants are measured under."""

REPEATS = 5
"""Rounds of the measurement; their median counts."""

PAUSE_S = 0.05
"""Seconds before each run: no other library runs here whose threads would still spin."""

Pairs = Sequence[tuple[Frame, Frame]]
Done = Callable[[float], None]


def names_for(model: Model, wanted: Sequence[str] = NAMES) -> tuple[str, ...]:
    """Return the variants that this model can have."""
    return tuple(name for name in wanted if _possible(model, name))


def _possible(model: Model, name: str) -> bool:
    """Return whether a model can have a variant."""
    try:
        variants.vary(variants.parse(name), model)
    except InputError:
        return False
    return True


def measure(
    executor: Executor,
    model: Model,
    size: tuple[int, int],
    profile: str,
    pairs: Pairs,
    names: Sequence[str] = NAMES,
    schedules: Sequence[str] = (),
    repeats: int = REPEATS,
    on_done: Done = lambda share: None,
) -> Curve:
    """Return the points of a model on a device at a size (height, width), errors from pairs of frames.

    `schedules`: which to measure; by default those that may be fast. `on_done` gets each variant's share.
    """
    pictures = [denoise(model, noisy, np.float64) for noisy, _ in pairs]
    chosen = tuple(schedules) or promising(executor, model, profile)
    numbers = noise(plan_model(model, executor.name, profile).analysed, size)
    points: dict[str, Point] = {}
    ways: dict[str, Callable[[], object]] = {}
    for name in names:
        varied = variants.vary(variants.parse(name), model)
        given = {feature: numbers[feature] for feature in varied.features}
        for schedule in chosen:
            artifact = _compiled(plan_model(model, executor.name, profile, schedule, name))
            if artifact is None:
                continue
            key = f"{name} {schedule}"
            points[key] = _untimed(executor, artifact, pairs, pictures)
            ways[key] = partial(executor.run, artifact, given)
        on_done(1 / (len(names) + 1))
    times = in_turns(ways, repeats, pause_s=PAUSE_S)
    on_done(1 / (len(names) + 1))
    timed = (replace(points[key], milliseconds=1e3 * found.median) for key, found in times.items())
    return Curve(variants.digest_of(model), executor.device, size, profile, tuple(timed))


def promising(executor: Executor, model: Model, profile: str) -> tuple[str, ...]:
    """Return the schedules under which the full network is fastest on a small picture, the best first."""
    plan = plan_model(model, executor.name, profile)
    found = (_compiled(plan.scheduled(schedule.name)) for schedule in plan.target.schedules)
    trials = {artifact.plan.asked: trial(executor, artifact) for artifact in found if artifact}
    return tuple(sorted(trials, key=trials.__getitem__)[:MOST_SCHEDULES])


def quality(
    pictures: Sequence[NDArray[np.floating]],
    full: Sequence[NDArray[np.floating]],
    targets: Sequence[NDArray[np.floating]],
) -> tuple[float, float, float]:
    """Return the largest and the mean error of pictures (H, W, 3), and the mean PSNR that they lose in dB.

    All are NaN if a picture holds what is not a number.
    """
    if not all(np.isfinite(picture).all() for picture in pictures):
        return math.nan, math.nan, math.nan
    wide = [picture.astype(np.float64) for picture in pictures]
    errors = [np.abs(picture - wanted) for picture, wanted in zip(wide, full, strict=True)]
    losses = [
        metrics.psnr(wanted, target) - metrics.psnr(picture, target)
        for picture, wanted, target in zip(wide, full, targets, strict=True)
    ]
    mean = math.fsum(float(error.sum()) for error in errors) / sum(error.size for error in errors)
    return max(float(error.max()) for error in errors), mean, math.fsum(losses) / len(losses)


def _compiled(plan: Plan) -> Artifact | None:
    """Return the kernel of a plan, or None where its schedule or target cannot hold it."""
    try:
        artifact = compile_plan(plan)
    except CompileError:
        return None
    return artifact if artifact.manifest["schedule"]["name"] == plan.asked else None


def _untimed(
    executor: Executor, artifact: Artifact, pairs: Pairs, full: Sequence[NDArray[np.floating]]
) -> Point:
    """Return the point of a variant's kernel, which lacks its time."""
    plan, model = artifact.plan, artifact.plan.model
    pictures = [executor.run(artifact, images_of(model, noisy)) for noisy, _ in pairs]
    targets = [dataset.target_image(clean, model.normalization) for _, clean in pairs]
    found, bound = quality(pictures, full, targets), variants.bound_of(plan)
    most = math.nan if bound is None else float(bound.max())
    return Point(plan.varied.variant.name, plan.asked, executor.name, math.nan, *found, most)
