"""Whole pictures of a scene that moves: seconds for one path per pixel and its denoising, and of each part.

1. Ours is one pipeline on a device. A scene that moves shows another moment in every picture: its numbers are
   inputs of one kernel [`moments`]. Its parts are each ended by waiting for the device [`_parts`].
2. Beside it are the same pipeline of one moment, and the separate way by kernels of the same executor: trace
   all layers, read them back, encode in float64, upload, denoise, read back.
3. Other makers of whole pictures show the same moments: a renderer and a denoiser [`PEERS`, moving.py].
4. All executors and makers take turns in one run, so that drift of the machine's speed affects them alike;
   everything is compiled before, and has made a picture [`measured`].
5. A scene that is new in another way has a kernel of its own, which is compiled before its first picture
   [`first_pictures`]; a process that finds empty caches compiles everything [first_picture.py].

The network has random weights: speed does not depend on them [`random_model`].
"""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from typing import Any, Protocol

import numpy as np

from ...compiler.compile import compile_plan
from ...compiler.variants import plan_model
from ...models.data.scene_source import scene_source
from ...refimpl.light.render import Job
from ...refimpl.light.scene import Scene
from ...refimpl.network import dataset, siren
from ...refimpl.network.denoise import Model
from ..devices.executor import Executor
from ..devices.passes import PICTURE
from ..measure import in_turns
from ..run.denoise_on import images_of
from ..run.pipeline import Pipeline
from ..run.render_on import render_on
from ..run.tune import choose

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

PEERS = ("mitsuba", "cycles")
"""Other makers of whole pictures [`peers.Table.makers`]."""

Ways = Mapping[str, Callable[[], float | None]]


class Maker(Protocol):
    """What makes pictures of a scene that moves."""

    @property
    def about(self) -> str:
        """Return in words what it is, with versions."""

    def ways(self, shots: Sequence[Scene]) -> Ways:
        """Return what is measured, by name; pictures show the scenes one after another."""

    def close(self) -> None:
        """Give back what it holds."""


def moments(name: str) -> list[Scene]:
    """Return a scene at each time step; a static one only once."""
    source = scene_source(name)
    if source.still is not None:
        return [source.still]
    return [source.at(STEP_S * (moment + 0.5)) for moment in range(MOMENTS)]


def random_model(features: Sequence[str], size: int, hidden: Sequence[int]) -> Model:
    """Return a model with random weights for these features, windows of `size` pixels and hidden layers."""
    dataset.check_features(features)
    window = dataset.Window(size)
    widths = [dataset.n_inputs(tuple(features), window), *hidden, 3]
    network = siren.init(widths, 3.0, 3.0, seed=1, dtype=np.float32)
    return Model(
        network, tuple(features), window, dataset.Normalization(depth_scale=20.0, position_scale=10.0)
    )


@dataclass(frozen=True)
class Measured:
    """Seconds of each way of one size: who makes the pictures, what is measured, and its turns."""

    by: str
    way: str
    seconds: tuple[float, ...]


def measured(
    executors: Sequence[Executor],
    model: Model,
    name: str,
    size: int,
    repeats: int,
    makers: Mapping[str, Maker] | None = None,
    rays: int = 0,
) -> list[Measured]:
    """Return the times of all ways, in seconds: of every executor, then of other makers, by name.

    Features are of `rays` camera rays; 0: of the paths' own.
    """
    shots = moments(name)
    with ExitStack() as stack:
        ways = {
            (executor.name, way): function
            for executor in executors
            for way, function in _ours(stack, executor, model, name, size, shots, rays).items()
        }
        for by, maker in (makers or {}).items():
            ways |= {(by, way): function for way, function in maker.ways(shots).items()}
        named = {f"{by}: {way}": function for (by, way), function in ways.items()}
        found = in_turns(named, repeats, pause_s=PAUSE_S)
    return [Measured(by, way, found[f"{by}: {way}"].seconds) for by, way in ways]


def _ours(
    stack: ExitStack,
    executor: Executor,
    model: Model,
    name: str,
    size: int,
    shots: Sequence[Scene],
    rays: int,
) -> dict[str, Callable[[], Any]]:
    """Return the ways of an executor, whose pipelines are open until the stack is closed."""
    scene, job, shape = scene_source(name).at(), Job(size, size, feature_spp=rays), (size, size)
    denoiser = compile_plan(choose(executor, plan_model(model, executor.name), shape).plan)

    def separate() -> None:
        frame = render_on(executor, scene, job).frame
        executor.run(denoiser, images_of(model, frame))

    opened = partial(Pipeline, executor, model=model, size=shape, feature_spp=rays)
    pipeline = stack.enter_context(opened(scene))
    moving = stack.enter_context(opened(shots[0], moving=shots))
    turn, seeds = itertools.cycle(shots), itertools.count()

    def move() -> None:
        moving.set_scene(next(turn))
        moving.run(next(seeds))

    ways: dict[str, Callable[[], Any]] = {"separate": separate, "one pipeline": pipeline.run}
    if pipeline.path.images:
        apart = stack.enter_context(opened(scene, sums=True))
        ways["with an encoding of its own"] = apart.run
    ways |= {MOVING: move, "of it: the scene's numbers": lambda: moving.set_scene(next(turn))}
    return {way: _timed(function) for way, function in (ways | _parts(moving)).items()}


def _timed(work: Callable[[], Any]) -> Callable[[], None]:
    """Return work that returns nothing: a picture would be read as seconds."""

    def run() -> None:
        work()

    return run


def first_pictures(executor: Executor, model: Model, name: str, size: int, rays: int = 0) -> list[float]:
    """Return the seconds to the first picture of each of some scenes that are not known, by a known model."""
    shots = moments(name)
    return [_first_picture(executor, model, shot, size, rays) for shot in shots[1 : 1 + NEW_SCENES] or shots]


def _first_picture(executor: Executor, model: Model, scene: Scene, size: int, rays: int) -> float:
    """Return the seconds to the first picture of a scene."""
    start = time.perf_counter()
    with Pipeline(executor, scene, model, (size, size), feature_spp=rays) as pipeline:
        pipeline.run()
    return time.perf_counter() - start


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
        "of it: reading back": lambda: passes.read(PICTURE),
    }
