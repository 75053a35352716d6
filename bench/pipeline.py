"""One pipeline against the separate way: milliseconds for one path per pixel and its denoising.

    python bench/pipeline.py --sizes 256 512 --executors opencl opengl --repeats 5

Both ways use kernels that are compiled before, of one executor; they take turns, so that drift of the
machine's speed meets them alike. Separate: trace all layers, read them back, encode in float64, upload,
denoise, read back. The table also has the parts of the pipeline, each ended by waiting for the device. Below
it is what a new time of the scene costs: its kernel is compiled again, since the scene is constants in it.

The network has random weights: speed does not depend on them.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from wamnet.cli.reports import machine
from wamnet.compiler.compile import compile_program
from wamnet.compiler.core.lower import lower
from wamnet.kernels import Pipeline, open_executor, render_on
from wamnet.kernels.devices.passes import PICTURE
from wamnet.kernels.run.denoise_on import images_of
from wamnet.refimpl.light.render import Job
from wamnet.refimpl.light.scenes import CANONICAL, canonical
from wamnet.refimpl.network import dataset, siren
from wamnet.refimpl.network.denoise import Model


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure and print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--scene", default="minicubes", choices=list(CANONICAL))
    parser.add_argument("--executors", nargs="+", default=["opencl", "opengl"])
    parser.add_argument("--sizes", nargs="+", type=int, default=[256, 512], help="widths in pixels")
    parser.add_argument("--features", nargs="+", default=["color", "normal"], choices=list(dataset.FEATURES))
    parser.add_argument("--hidden", nargs="+", type=int, default=[32, 32, 32, 32], help="neurons a layer")
    parser.add_argument("--window", type=int, default=12)
    parser.add_argument("--repeats", type=int, default=5)
    given = parser.parse_args(arguments)
    model = _model(tuple(given.features), given.window, given.hidden)
    facts = [f"{name} {value}" for name, value in machine.describe().items()]
    widths = "-".join(map(str, model.siren.widths))
    print(", ".join([*facts, f"NumPy {np.__version__}", f"{given.scene}, 1 spp, network {widths}"]) + "\n")
    print("| executor | size | way | ms, median | ms, range |\n|---|---|---|---|---|")
    news = []
    for name in given.executors:
        with open_executor(name) as executor:
            for size in given.sizes:
                rows, seconds = _measure(executor, model, given.scene, size, given.repeats)
                for way, times in rows.items():
                    low, middle, high = (1e3 * f(times) for f in (min, statistics.median, max))
                    print(f"| {name} | {size}x{size} | {way} | {middle:.1f} | {low:.1f} - {high:.1f} |")
            news.append(f"{name}: a new time of the scene costs {1e3 * seconds:.0f} ms to compile")
    print("\n" + "\n".join(news))


def _model(features: tuple[str, ...], size: int, hidden: Sequence[int]) -> Model:
    """Return a model with random weights."""
    window = dataset.Window(size)
    widths = [dataset.n_inputs(features, window), *hidden, 3]
    network = siren.init(widths, 3.0, 3.0, seed=1, dtype=np.float32)
    return Model(network, features, window, dataset.Normalization(depth_scale=20.0, position_scale=10.0))


def _measure(
    executor: Any, model: Model, name: str, size: int, repeats: int
) -> tuple[dict[str, list[float]], float]:
    """Return the times of each way in seconds, and the median of compiling a new time."""
    scene, job = canonical(name), Job(size, size)
    denoiser = compile_program(lower(model), executor.name)

    def separate() -> None:
        frame = render_on(executor, scene, job).frame
        executor.run(denoiser, images_of(model, frame))

    with Pipeline(executor, scene, model, (size, size)) as pipeline:
        ways: dict[str, Callable[[], Any]] = {"separate": separate, "one pipeline": pipeline.run}
        parts = _parts(pipeline)
        for way in (*ways.values(), *parts.values()):
            way()  # whatever a driver does at first
        times: dict[str, list[float]] = {way: [] for way in (*ways, *parts)}
        for _ in range(repeats):
            for way, function in (*ways.items(), *parts.items()):
                start = time.perf_counter()
                function()
                times[way].append(time.perf_counter() - start)
        compiling = []
        for second in (0.5, 1.0, 1.5):
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

    return {
        "of it: paths": waited(lambda: passes.trace(pipeline.path, part)),
        "of it: encoding": waited(lambda: passes.encode(1)),
        "of it: denoising": waited(passes.denoise),
        "of it: reading back": lambda: passes.read(PICTURE),
    }


if __name__ == "__main__":
    main()
