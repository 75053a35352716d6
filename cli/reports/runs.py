"""One model and one frame on every executor: picture, times, error against the float64 reference, bounds."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ... import kernels
from ...compiler.artifact import Artifact
from ...compiler.core.enclosure import round_up
from ...compiler.plan import Plan
from ...compiler.variants import plan_model
from ...kernels.run.denoise_on import images_of
from ...refimpl.errors import CompileError, ExecutorUnavailable
from ...refimpl.frame import Frame
from ...refimpl.metrics import largest_error
from ...refimpl.network.denoise import Model, denoise


@dataclass(frozen=True)
class Run:
    """One executor on one frame; where it cannot run, `missing` says why and the numbers are None.

    `error` is the largest difference from the float64 reference. `bound_frame` bounds it for this very frame,
    `bound_all` for all frames; they are None where the target's sine promises nothing.
    """

    executor: str
    device: str = ""
    seconds_compile: float | None = None
    seconds_run: float | None = None
    error: float | None = None
    bound_frame: float | None = None
    bound_all: float | None = None
    missing: str = ""


def run_all(
    model: Model, frame: Frame, compiled: dict[str, Artifact], on_done: Callable[[float], None]
) -> tuple[dict[str, Any], tuple[Run, ...]]:
    """Run each executor that is here; return pictures (H, W, 3) by executor, and what was found about all."""
    truth = denoise(model, frame, np.float64)
    images: dict[str, Any] = {}
    runs = []
    for name, kernel in compiled.items():
        try:
            images[name], run = run_one(name, kernel, model, frame, truth)
        except (ExecutorUnavailable, CompileError) as error:
            run = Run(name, missing=str(error))
        runs.append(run)
        on_done(1)
    return images, tuple(runs)


def run_one(name: str, kernel: Artifact, model: Model, frame: Frame, truth: Any) -> tuple[Any, Run]:
    """Return one executor's picture, and its times, error and bounds.

    The kernel runs twice and the second time counts: drivers put off work until the first run.
    """
    with kernels.open_executor(name) as executor:
        schedule = executor.schedule_for((frame.height, frame.width))
        plan = plan_model(model, executor.language.under(kernel.profile), schedule)
        # The bound is that of the network's kernel: its images are the reference's.
        images = images_of(model, frame)
        first = kernels.denoise_on(executor, model, frame, images=images)
        second = kernels.denoise_on(executor, model, frame, images=images)
    everywhere = plan.bound.output
    run = Run(
        name,
        second.device,
        first.seconds_compile,
        second.seconds_run,
        largest_error(second.image, truth),
        frame_bound(plan, frame),
        round_up(max(everywhere)) if everywhere else None,
    )
    return second.image, run


def frame_bound(plan: Plan, frame: Frame) -> float | None:
    """Return the bound on the largest error of a plan's kernel in this frame, or None where it has none."""
    largest = float(plan.expected(images_of(plan.model, frame)).bound.max())
    return largest if np.isfinite(largest) else None
