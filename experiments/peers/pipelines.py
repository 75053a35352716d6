"""Whole pictures of a scene that moves: seconds for one path per pixel and its denoising, and of each part.

1. Ours is one pipeline on a device. A scene that moves shows another moment in every picture: its numbers are
   inputs of one kernel [`moments`]. Its parts are each ended by waiting for the device [`_parts`].
2. Beside it are the same pipeline of one moment, and the separate way by kernels of the same executor: trace
   all layers, read them back, encode in float64, upload, denoise, read back [`Ours.ways`].
3. Other makers of whole pictures show the same moments: a renderer and a denoiser [common.py: `Maker`].
4. A scene that is new in another way has a kernel of its own, which is compiled before its first picture
   [`Ours.first_pictures`]; a process that finds empty caches compiles everything [`first_picture`].

The network has random weights: speed does not depend on them.
"""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from typing import Any

from wamnet.compiler.compile import compile_plan
from wamnet.compiler.variants import plan_model
from wamnet.kernels.bench.fresh import CACHES, empty_caches, in_process
from wamnet.kernels.cache import FOLDER_VARIABLE
from wamnet.kernels.devices.executor import Executor
from wamnet.kernels.devices.registry import open_executor
from wamnet.kernels.measure import Entry
from wamnet.kernels.run.denoise_on import images_of
from wamnet.kernels.run.pipeline import Pipeline
from wamnet.kernels.run.render_on import render_on
from wamnet.kernels.run.tune import Tuning
from wamnet.models.data.scene_source import scene_source
from wamnet.refimpl.light.render import Job
from wamnet.refimpl.light.scene import Scene
from wamnet.refimpl.network.denoise import Model, learned_shadow_rays

from .common import Ways

MOMENTS = 48
"""Pictures of a scene that moves before its first moment is shown again."""

STEP_S = 0.1
"""Time from one of them to the next; the first is half a step from 0, where boxes are not turned."""

NEW_SCENES = 3
"""Scenes that are compiled."""

PAUSE_S = 0.1
"""Seconds before each measurement: threads of a library that ran before may spin for a while."""

MOVING = "one pipeline, moving"
"""What others are compared with."""


def moments(name: str) -> list[Scene]:
    """Return a scene at each time step; a static one only once."""
    source = scene_source(name)
    if source.still is not None:
        return [source.still]
    return [source.at(STEP_S * (moment + 0.5)) for moment in range(MOMENTS)]


def entries(by: str, ways: Ways) -> list[Entry]:
    """Return what is measured of a maker of pictures."""
    return [Entry(name, lambda way=way: lambda _number: way(), by) for name, way in ways.items()]  # type: ignore[misc]


@dataclass(frozen=True)
class Ours:
    """Pictures (size, size) of a scene by its name, traced and denoised on an executor.

    Features are of `rays` camera rays; 0: of the paths' own.
    """

    executor: Executor
    model: Model
    scene: str
    size: int
    rays: int = 0

    def pipeline(self, scene: Scene, **more: Any) -> Pipeline:
        """Return an open pipeline."""
        size = (self.size, self.size)
        return Pipeline(self.executor, scene, self.model, size, feature_spp=self.rays, **more)

    def ways(self, stack: ExitStack) -> dict[str, Callable[[], Any]]:
        """Return what is measured, by name; pipelines are open until the stack is closed."""
        shots, scene, size = moments(self.scene), scene_source(self.scene).at(), self.size
        job = Job(size, size, feature_spp=self.rays, shadow_rays=learned_shadow_rays(self.model))
        plan = plan_model(self.model, self.executor.name)
        schedule, _ = Tuning(self.executor, plan.model, (size, size), plan.varied).picked()
        denoiser = compile_plan(plan.scheduled(schedule))

        def separate() -> None:
            frame = render_on(self.executor, scene, job).frame
            self.executor.run(denoiser, images_of(self.model, frame))

        pipeline = stack.enter_context(self.pipeline(scene))
        moving = stack.enter_context(self.pipeline(shots[0], moving=shots))
        turn, seeds = itertools.cycle(shots), itertools.count()

        def move() -> None:
            moving.set_scene(next(turn))
            moving.run(next(seeds))

        ways: dict[str, Callable[[], Any]] = {"separate": separate, "one pipeline": pipeline.run}
        if pipeline.path.images:
            ways["with an encoding of its own"] = stack.enter_context(self.pipeline(scene, sums=True)).run
        numbers = {"of it: the scene's numbers": lambda: moving.set_scene(next(turn))}
        return ways | {MOVING: move} | numbers | _parts(moving)

    def first_pictures(self) -> list[float]:
        """Return the seconds to the first picture of each of some scenes that are not known."""
        shots, found = moments(self.scene), []
        for shot in shots[1 : 1 + NEW_SCENES] or shots:
            start = time.perf_counter()
            with self.pipeline(shot) as pipeline:
                pipeline.run()
            found.append(time.perf_counter() - start)
        return found


def _parts(pipeline: Pipeline) -> dict[str, Callable[[], Any]]:
    """Return the parts of the pipeline, each ended by waiting for the device."""
    passes, part = pipeline.passes, pipeline.part(0, 1, 0)

    def waited(work: Callable[[], None]) -> Callable[[], None]:
        def both() -> None:
            work()
            passes.finish()

        return both

    encoded = " and encoding" if pipeline.path.images else ""
    return {
        f"of it: paths{encoded}": waited(lambda: passes.trace(pipeline.path, part, pipeline.moment.numbers)),
        **({} if encoded else {"of it: encoding": waited(lambda: passes.encode(1))}),
        "of it: denoising": waited(passes.denoise),
        "of it: reading back": pipeline.picture,
    }


def first_picture(name: str, model: Model, scene: str, size: int) -> float | None:
    """Return the seconds to the first picture (size, size) of a scene, on the executor of this name.

    None where that fails.
    """
    with empty_caches((*CACHES, FOLDER_VARIABLE)):
        return in_process(_first_picture, name, model, scene, size)


def _first_picture(name: str, model: Model, scene: str, size: int) -> float:
    """Return the seconds in which a pipeline is compiled and its first picture read."""
    start, shown = time.perf_counter(), scene_source(scene).at()
    with open_executor(name) as device, Pipeline(device, shown, model, (size, size)) as pipeline:
        pipeline.run()
        return time.perf_counter() - start
