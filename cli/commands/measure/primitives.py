"""`wamnet bench primitives`: scenes of many primitives as statements, loops and trees."""

from __future__ import annotations

import statistics
from contextlib import nullcontext
from typing import TYPE_CHECKING, Annotated

import typer

from ...common.terminal import say
from .shared import Repeats, Square, check_count, counts_of, extent, facts, head, names_of, numpy_version, row

if TYPE_CHECKING:
    from ....kernels.bench.measure_primitives import Kernel

EXAMPLES = """Examples:

wamnet bench primitives

wamnet bench primitives --executors opencl,mitsuba,embree --kinds spheres --counts 30,3000"""
"""Shown below the help of `wamnet bench primitives`."""

HEADS = ("by", "scene", "form", "lines", "kB", "trace, s", "build, s", "Msamples/s", "range")
"""Heads of the table."""


def primitives(
    executors: Annotated[
        str,
        typer.Option(
            metavar="NAME,...", help="Path tracers to measure: opencl, opengl, c, mitsuba, embree, numba."
        ),
    ] = "opencl,opengl",
    kinds: Annotated[
        str,
        typer.Option(
            metavar="NAME,...", help="Kinds of primitives: shared, turned, spheres, quads, mixture."
        ),
    ] = "mixture",
    counts: Annotated[str, typer.Option(metavar="N,...", help="Number of primitives.")] = "10,30,100,300",
    size: Square = 128,
    spp: Annotated[int, typer.Option(help="Samples per pixel.")] = 4,
    repeats: Repeats = 5,
) -> None:
    """Measure scenes of many primitives in all forms: unrolled statements, tables with a loop, a tree.

    The table has the lines and size of the source, the seconds to trace and emit it, the seconds until
    the driver has built it and traced a first row of paths (without disk caches), and million samples
    per second: median and range of the interleaved rounds. A star marks the form that the compiler
    chooses; a tree is measured only if it is expected to pay off.
    """
    from ....kernels import open_executor
    from ....kernels.bench import measure_primitives as measuring
    from ....kernels.bench.workload import check_size
    from ....kernels.devices.kernel import Part
    from ....kernels.measure import environment

    given = names_of("--executors", executors, measuring.EXECUTORS)
    scenes = names_of("--kinds", kinds, measuring.KINDS)
    numbers = counts_of("--counts", counts, "30,100")
    check_size(size)
    check_count("--spp", spp, 4)
    check_count("--repeats", repeats, 5)
    say(", ".join(facts(numpy_version(), f"{size}x{size}, {spp} spp")))
    say("")
    head(*HEADS)
    part = Part(size, size, 0, size, 0, spp, 0)
    with environment(measuring.NO_CACHES):
        for name in given:
            with nullcontext() if name in measuring.PEERS else open_executor(name) as executor:
                for scene in (measuring.crowd(kind, count) for kind in scenes for count in numbers):
                    done = measuring.compare(executor, scene, part, repeats) if executor else None
                    for kernel in done or measuring.peer(name, scene, part, repeats):
                        _show(name, kernel)


def _show(by: str, kernel: Kernel) -> None:
    """Print the row of a kernel."""
    source = kernel.source
    row(
        *(by, kernel.scene, f"{kernel.form}{'*' if kernel.chosen else ''}", f"{source.count(chr(10)):,}"),
        *(f"{len(source.encode()) / 1000:,.0f}", f"{kernel.trace_s:.2f}", f"{kernel.build_s:.2f}"),
        *(f"{statistics.median(kernel.rates):.2f}", extent(kernel.rates, 2)),
    )
