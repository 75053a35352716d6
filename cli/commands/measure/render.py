"""`wamnet bench render`: samples a second of the reference, of kernels, of Mitsuba 3 and of Embree."""

from __future__ import annotations

import os
import statistics
from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING, Annotated

import typer

from ...common.options import SCENES, parse_names
from ...common.terminal import progress, say
from .shared import Repeats, Square, check_count, counts_of, extent, facts, head, names_of, numpy_version, row

if TYPE_CHECKING:
    from ....kernels.bench.measure_render import Way

EXAMPLES = """Examples:

wamnet bench render --size 512 --spp 2 --repeats 5

wamnet bench render --scenes minicubes --by numpy,opencl,mitsuba,embree --workers 2 --spp 16"""
"""Shown below the help of `wamnet bench render`."""


def render(
    scenes: Annotated[
        str, typer.Option(metavar="NAME,...", help=f"Canonical scenes ({SCENES}) or scene files.")
    ] = "minicubes,cornell",
    by: Annotated[
        str,
        typer.Option(
            "--by",
            "--executors",
            metavar="NAME,...",
            help="Renderers to measure: numpy, opencl, opengl, c, mitsuba, embree, numba.",
        ),
    ] = "numpy",
    workers: Annotated[
        str | None,
        typer.Option(
            metavar="N,...", help="Processes for the NumPy reference.", show_default="1, and one per core"
        ),
    ] = None,
    size: Square = 512,
    spp: Annotated[int, typer.Option(help="Samples per pixel.")] = 2,
    depth: Annotated[int, typer.Option(help="Maximum path length, including the camera ray.")] = 6,
    repeats: Repeats = 5,
) -> None:
    """Measure samples per second: the reference renderer, its kernels, Mitsuba 3, Embree.

    Each renders its first frame with empty compiler caches, then all are interleaved. The table has the
    median and the range, samples (paths) per second, and the ratio to the last row's. A second table
    compares each mean colour with that of the first renderer, in standard errors. [bold]pip install
    mitsuba[/] adds Mitsuba, which also needs libLLVM; Embree needs a C compiler and libembree-dev.
    """
    from ....kernels.bench import measure_render as measuring
    from ....kernels.bench.workload import check_size
    from ....refimpl.light.render import Job
    from ....refimpl.light.transport import Settings

    kinds, shown = names_of("--by", by, measuring.BY), parse_names(scenes) or [scenes]
    usual = f"1,{len(os.sched_getaffinity(0)) if hasattr(os, 'sched_getaffinity') else os.cpu_count() or 1}"
    processes = counts_of("--workers", usual if workers is None else workers, "1,2")
    check_size(size)
    for option, value, example in (("--spp", spp, 2), ("--depth", depth, 6), ("--repeats", repeats, 5)):
        check_count(option, value, example)
    job = Job(size, size, spp, settings=Settings(max_depth=depth - 1))
    ways = [way for name in shown for way in measuring.ways_of(name, job, kinds, processes)]
    with progress("measuring", len(ways) * (repeats + 1), "renders") as advance:
        measuring.measured(ways, repeats, partial(advance, 1.0))
    say(", ".join(facts(numpy_version(), f"{size}x{size}, {spp} spp, {depth} edges")))
    for name in shown:
        _show([way for way in ways if way.scene == name], size**2 * spp)


def _show(ways: Sequence[Way], samples: int) -> None:
    """Print the table of one scene, and how well its means agree."""
    last = statistics.median(ways[-1].seconds)
    say("")
    head("scene", "by", "first frame, s", "s, median", "s, range", "samples/s", f"times {ways[-1].name}")
    for way in ways:
        median = statistics.median(way.seconds)
        row(
            *(way.scene, way.name, f"{way.first_s:.2f}", f"{median:.2f}", extent(way.seconds, 2)),
            *(f"{samples / median:,.0f}", f"{last / median:.2f}"),
        )
    for text in _agreement(ways):
        say(text)


def _agreement(ways: Sequence[Way]) -> list[str]:
    """Return how far the mean colours are from that of the first way."""
    from ....kernels.bench.measure_render import distance, mean_and_error

    first, *others = ways
    if len(first.means) < 2:
        return []
    texts = [""]
    for way in others:
        mean, its_mean = (mean_and_error(each.means)[0] for each in (way, first))
        found = distance(way, first)
        errors = "no spread" if found is None else f"{found:+.1f} errors"
        texts.append(f"{way.name}: mean colour {mean:.6f}, {first.name}'s {its_mean:.6f}: {errors}")
    return texts
