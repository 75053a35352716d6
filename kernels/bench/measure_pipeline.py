"""One pipeline against the separate way: seconds for one path per pixel and its denoising.

1. Both ways use kernels of one executor that are compiled before; they take turns, so that drift of the
   machine's speed affects them alike [`measured`]. Separate: trace all layers, read them back, encode in
   float64, upload, denoise, read back.
2. The parts of the pipeline take turns with them, each ended by waiting for the device [`_parts`].
3. A new time of the scene is compiled again, since the scene is constants in its kernel.

The network has random weights: speed does not depend on them [`random_model`].
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from ...compiler.compile import compile_program
from ...compiler.core.lower import lower
from ...refimpl.light.render import Job
from ...refimpl.light.scenes import canonical
from ...refimpl.network import dataset, siren
from ...refimpl.network.denoise import Model
from ..devices.executor import Executor
from ..devices.passes import PICTURE
from ..run.denoise_on import images_of
from ..run.pipeline import Pipeline
from ..run.render_on import render_on

NEW_TIMES = (0.5, 1.0, 1.5)
"""Times of the scene that are compiled, in seconds."""


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
    """Return the times of each way in seconds, and the median of compiling a new time of the scene."""
    scene, job = canonical(name), Job(size, size)
    denoiser = compile_program(lower(model), executor.name)

    def separate() -> None:
        frame = render_on(executor, scene, job).frame
        executor.run(denoiser, images_of(model, frame))

    with (
        Pipeline(executor, scene, model, (size, size)) as pipeline,
        Pipeline(executor, scene, model, (size, size), sums=True) as apart,
    ):
        ways: dict[str, Callable[[], Any]] = {"separate": separate, "one pipeline": pipeline.run}
        if pipeline.path.images:
            ways["with an encoding of its own"] = apart.run
        ways |= _parts(pipeline)
        for function in ways.values():
            function()  # whatever a driver does at first
        times: dict[str, list[float]] = {way: [] for way in ways}
        for _ in range(repeats):
            for way, function in ways.items():
                start = time.perf_counter()
                function()
                times[way].append(time.perf_counter() - start)
        compiling = []
        for second in NEW_TIMES:
            new = canonical(name, **({"time": second} if name == "minicubes" else {}))
            start = time.perf_counter()
            pipeline.set_scene(new)
            compiling.append(time.perf_counter() - start)
    return times, statistics.median(compiling)


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
