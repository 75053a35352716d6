"""Speed of the NumPy reference renderer: samples a second, by scene and by number of processes.

    python bench/render.py --size 512 --spp 2 --repeats 5

Variants take turns, so that drift of the machine's speed meets all of them alike; the median and the range
are printed as a Markdown table, under a line about the machine. A sample is one path with up to five
scatterings, each with a shadow ray. Start-up of worker processes counts.
"""

from __future__ import annotations

import argparse
import os
import statistics
import time
from collections.abc import Sequence

import numpy as np

from wamnet.cli import machine
from wamnet.kernels.render_pool import render_parallel
from wamnet.refimpl.render import Job
from wamnet.refimpl.scenes import CANONICAL, canonical


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure and print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--scenes", nargs="+", default=["minicubes", "cornell"], choices=list(CANONICAL))
    parser.add_argument("--workers", nargs="+", type=int, default=[1, len(os.sched_getaffinity(0))])
    parser.add_argument("--size", type=int, default=512, help="width and height in pixels")
    parser.add_argument("--spp", type=int, default=2, help="samples per pixel")
    parser.add_argument("--repeats", type=int, default=5)
    given = parser.parse_args(arguments)
    job = Job(given.size, given.size, given.spp)
    variants = [(scene, workers) for scene in given.scenes for workers in dict.fromkeys(given.workers)]
    seconds: dict[tuple[str, int], list[float]] = {variant: [] for variant in variants}
    for _ in range(given.repeats):
        for scene, workers in variants:
            start = time.perf_counter()
            render_parallel(canonical(scene), job, workers=workers)
            seconds[scene, workers].append(time.perf_counter() - start)
    facts = [
        *(f"{name} {value}" for name, value in machine.describe().items()),
        f"NumPy {np.__version__}",
        f"{given.size}x{given.size}, {given.spp} spp",
    ]
    print(", ".join(facts) + "\n")
    print("| scene | processes | s, median | s, range | samples/s |\n|---|---|---|---|---|")
    for (scene, workers), times in seconds.items():
        median = statistics.median(times)
        rate = given.size**2 * given.spp / median
        print(f"| {scene} | {workers} | {median:.2f} | {min(times):.2f} - {max(times):.2f} | {rate:,.0f} |")


if __name__ == "__main__":
    main()
