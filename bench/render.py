"""Speed of the renderer: samples a second of the NumPy reference and of the kernels traced from it.

    python bench/render.py --size 512 --spp 2 --repeats 5
    python bench/render.py --scenes minicubes --executors numpy opencl opengl --spp 16

Variants take turns, so that drift of the machine's speed meets all of them alike; the median and the range
are printed as a Markdown table, under a line about the machine. A sample is one path with up to five
scatterings, each with a shadow ray. Start-up of worker processes counts, compiling a kernel does not.
"""

from __future__ import annotations

import argparse
import os
import statistics
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from wamnet.cli import machine
from wamnet.kernels import open_executor, render_on
from wamnet.kernels.render_pool import render_parallel
from wamnet.refimpl.render import Job
from wamnet.refimpl.scene import Scene
from wamnet.refimpl.scenes import CANONICAL, canonical


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure and print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--scenes", nargs="+", default=["minicubes", "cornell"], choices=list(CANONICAL))
    parser.add_argument("--workers", nargs="+", type=int, default=[1, len(os.sched_getaffinity(0))])
    parser.add_argument("--executors", nargs="+", default=["numpy"], choices=["numpy", "opencl", "opengl"])
    parser.add_argument("--size", type=int, default=512, help="width and height in pixels")
    parser.add_argument("--spp", type=int, default=2, help="samples per pixel")
    parser.add_argument("--repeats", type=int, default=5)
    given = parser.parse_args(arguments)
    job = Job(given.size, given.size, given.spp)
    ways = _ways(given.executors, given.workers)
    seconds: dict[tuple[str, str], list[float]] = {(s, way): [] for s in given.scenes for way in ways}
    for scene in given.scenes:
        for executor in set(given.executors) - {"numpy"}:
            ways[executor](canonical(scene), replace(job, spp=1))  # compile
    for _ in range(given.repeats):
        for scene, way in seconds:
            start = time.perf_counter()
            ways[way](canonical(scene), job)
            seconds[scene, way].append(time.perf_counter() - start)
    facts = [
        *(f"{name} {value}" for name, value in machine.describe().items()),
        f"NumPy {np.__version__}",
        f"{given.size}x{given.size}, {given.spp} spp",
    ]
    print(", ".join(facts) + "\n")
    print("| scene | by | s, median | s, range | samples/s |\n|---|---|---|---|---|")
    for (scene, way), times in seconds.items():
        median = statistics.median(times)
        rate = given.size**2 * given.spp / median
        print(f"| {scene} | {way} | {median:.2f} | {min(times):.2f} - {max(times):.2f} | {rate:,.0f} |")


def _ways(executors: Sequence[str], workers: Sequence[int]) -> dict[str, Callable[[Scene, Job], Any]]:
    """Return the functions that render a scene, by the name that the table gives them."""
    ways: dict[str, Callable[[Scene, Job], Any]] = {}
    if "numpy" in executors:
        for count in dict.fromkeys(workers):
            ways[f"numpy, {count} process{'es' if count > 1 else ''}"] = partial(
                render_parallel, workers=count
            )
    for name in executors:
        if name != "numpy":
            ways[name] = partial(render_on, open_executor(name))
    return ways


if __name__ == "__main__":
    main()
