"""One pipeline against the separate way: seconds for one path per pixel and its denoising.

1. Both ways use kernels of one executor that are compiled before; they take turns, so that drift of the
   machine's speed affects them alike [`measured`]. Separate: trace all layers, read them back, encode in
   float64, upload, denoise, read back.
2. The parts of the pipeline take turns with them, each ended by waiting for the device [`_parts`].
3. A scene that moves shows another moment in every picture: its numbers are inputs of one kernel [`moments`].
   What is new in another way has a kernel of its own, which is compiled before its first picture.

The network has random weights: speed does not depend on them [`random_model`].
"""

from __future__ import annotations

import inspect
import itertools
import statistics
import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from ...compiler.compile import compile_program
from ...compiler.core.lower import lower
from ...refimpl.light.render import Job
from ...refimpl.light.scene import Scene
from ...refimpl.light.scenes import CANONICAL, canonical
from ...refimpl.network import dataset, siren
from ...refimpl.network.denoise import Model
from ..devices.executor import Executor
from ..devices.passes import PICTURE
from ..run.denoise_on import images_of
from ..run.pipeline import Pipeline
from ..run.render_on import render_on

MOMENTS = 48
"""Pictures of a scene that moves before its first moment is shown again."""

STEP_S = 0.1
"""Time from one of them to the next; the first is half a step from 0, where boxes are not turned."""

NEW_SCENES = 3
"""Scenes that are compiled."""


def moments(name: str) -> list[Scene]:
    """Return a canonical scene at each moment; one without a time only once."""
    if "time" not in inspect.signature(CANONICAL[name]).parameters:
        return [canonical(name)]
    return [canonical(name, time=STEP_S * (moment + 0.5)) for moment in range(MOMENTS)]


def random_model(features: Sequence[str], size: int, hidden: Sequence[int]) -> Model:
    """Return a model with random weights for these features, windows of `size` pixels and hidden layers."""
    dataset.check_features(features)
    window = dataset.Window(size)
    widths = [dataset.n_inputs(tuple(features), window), *hidden, 3]
    network = siren.init(widths, 3.0, 3.0, seed=1, dtype=np.float32)
    return Model(
        network, tuple(features), window, dataset.Normalization(depth_scale=20.0, position_scale=10.0)
    )


def measured(
    executor: Executor, model: Model, name: str, size: int, repeats: int
) -> tuple[dict[str, list[float]], float]:
    """Return the times of each way in seconds, and the median time to the first picture of a new scene."""
    scene, job, shots = canonical(name), Job(size, size), moments(name)
    denoiser = compile_program(lower(model), executor.name)

    def separate() -> None:
        frame = render_on(executor, scene, job).frame
        executor.run(denoiser, images_of(model, frame))

    with (
        Pipeline(executor, scene, model, (size, size)) as pipeline,
        Pipeline(executor, scene, model, (size, size), sums=True) as apart,
        Pipeline(executor, shots[0], model, (size, size), moving=shots) as moving,
    ):
        turn = itertools.cycle(shots)

        def move() -> None:
            moving.set_scene(next(turn))
            moving.run()

        ways: dict[str, Callable[[], Any]] = {"separate": separate, "one pipeline": pipeline.run}
        if pipeline.path.images:
            ways["with an encoding of its own"] = apart.run
        ways |= {"one pipeline, moving": move, **_parts(pipeline)}
        for function in ways.values():
            function()  # whatever a driver does at first
        times: dict[str, list[float]] = {way: [] for way in ways}
        for _ in range(repeats):
            for way, function in ways.items():
                start = time.perf_counter()
                function()
                times[way].append(time.perf_counter() - start)
    return times, statistics.median(
        _first_picture(executor, model, shot, size) for shot in shots[1 : 1 + NEW_SCENES] or shots
    )


def _first_picture(executor: Executor, model: Model, scene: Scene, size: int) -> float:
    """Return the time to the first picture of a scene that is not known, by a model that is."""
    start = time.perf_counter()
    with Pipeline(executor, scene, model, (size, size)) as pipeline:
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
        f"of it: paths{encoded}": waited(lambda: passes.trace(pipeline.path, part)),
        **({} if encoded else {"of it: encoding": waited(lambda: passes.encode(1))}),
        "of it: denoising": waited(passes.denoise),
        "of it: reading back": lambda: passes.read(PICTURE),
    }
