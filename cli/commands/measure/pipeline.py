"""`wamnet bench pipeline`: one pipeline on a device against rendering and denoising one after the other."""

from __future__ import annotations

import statistics
from typing import Annotated

import typer

from ...common.options import SCENES
from ...common.terminal import say
from .shared import Repeats, check_count, counts_of, extent, facts, head, names_of, numpy_version, row

EXAMPLES = """Examples:

wamnet bench pipeline --sizes 256,512 --executors opencl,opengl --repeats 5

wamnet bench pipeline --scene cornell --features color,albedo,normal --hidden 32,32"""
"""Shown below the help of `wamnet bench pipeline`."""


def pipeline(
    scene: Annotated[str, typer.Option(metavar="NAME", help=f"Canonical scene ({SCENES}).")] = "minicubes",
    executors: Annotated[
        str, typer.Option(metavar="NAME,...", help="What runs the kernels: numpy, opencl, opengl, c.")
    ] = "opencl,opengl",
    sizes: Annotated[
        str, typer.Option(metavar="N,...", help="Widths and heights of the picture, in pixels.")
    ] = "256,512",
    features: Annotated[
        str, typer.Option(metavar="NAME,...", help="What the network sees.")
    ] = "color,normal",
    hidden: Annotated[str, typer.Option(metavar="N,...", help="Neurons of each hidden layer.")] = (
        "32,32,32,32"
    ),
    window: Annotated[int, typer.Option(help="Width and height of the window, in pixels.")] = 12,
    repeats: Repeats = 5,
) -> None:
    """Measure one pipeline against the separate way: one path per pixel and its denoising.

    Both ways use compiled kernels of one executor, and take turns. Separate: trace all layers, read them
    back, encode, upload, denoise, read back. Moving: every picture shows another moment. The table also has
    the parts of the pipeline; below it is the time to the first picture of a new scene, whose kernel is
    compiled first. The network has random weights.
    """
    from ....kernels import EXECUTORS, open_executor
    from ....kernels.bench import measure_pipeline as measuring
    from ....kernels.bench.workload import check_size
    from ....refimpl.light.scenes import canonical
    from ....refimpl.network.dataset import FEATURES

    canonical(scene)
    given, widths = names_of("--executors", executors, EXECUTORS), counts_of("--sizes", sizes, "256,512")
    for size in widths:
        check_size(size)
    check_count("--window", window, 12)
    check_count("--repeats", repeats, 5)
    seen, layers = names_of("--features", features, FEATURES), counts_of("--hidden", hidden, "32,32")
    model = measuring.random_model(seen, window, layers)
    network = "-".join(map(str, model.siren.widths))
    say(", ".join(facts(numpy_version(), f"{scene}, 1 spp, network {network}")))
    say("")
    head("executor", "size", "way", "ms, median", "ms, range")
    news = []
    for each in given:
        with open_executor(each) as executor:
            for size in widths:
                rows, seconds = measuring.measured(executor, model, scene, size, repeats)
                for way, times in rows.items():
                    ms = [1e3 * time for time in times]
                    row(each, f"{size}x{size}", way, f"{statistics.median(ms):.1f}", extent(ms, 1))
            news.append(f"{each}: the first picture of a new scene takes {1e3 * seconds:.0f} ms")
    for line in ("", *news):
        say(line)
