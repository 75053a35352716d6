"""`wamnet bench render` and `wamnet bench primitives`: samples per second of path tracers."""

import os
import statistics
from collections.abc import Iterator, Sequence
from contextlib import nullcontext
from functools import partial
from typing import Annotated

from ....kernels import open_executor
from ....kernels.bench import paths
from ....kernels.bench.crowd import KINDS, crowd
from ....kernels.bench.fresh import empty_caches
from ....kernels.bench.paths import distance
from ....kernels.devices.kernel import Part
from ....kernels.measure import Entry, environment, measure, take_turns
from ....refimpl.light.render import Job
from ....refimpl.light.transport import Settings
from ...common.options import SCENES, option, parse_names, usage
from ...common.terminal import progress, say
from .shared import NUMPY, Repeats, Square, check_counts, counts_of, extent, head, names_of, row, say_facts

Spp = Annotated[int, usage("Samples per pixel.")]


def render(
    scenes: str = option(f"NAME,...  Canonical scenes ({SCENES}) or scene files.", "minicubes,cornell"),
    by: str = option(
        "--by --executors NAME,...  Renderers to measure: numpy, opencl, opengl, c, mitsuba.", "numpy"
    ),
    workers: str | None = option("N,...  Processes for the NumPy reference. [default: 1, and one per core]"),
    size: Square = 512,
    spp: Spp = 2,
    depth: int = option("Maximum path length, including the camera ray.", 6),
    repeats: Repeats = 5,
) -> None:
    """Measure samples per second: the reference renderer, its kernels, Mitsuba 3.

    Each renders its first frame with empty compiler caches, then all are interleaved. The table has the
    median and the range, samples (paths) per second, and the ratio to the last row's. A second table
    compares each mean colour with that of the first renderer, in standard errors. [bold]pip install
    mitsuba[/] adds Mitsuba, which also needs libLLVM.

    Examples:
    wamnet bench render --size 512 --spp 2 --repeats 5
    wamnet bench render --scenes minicubes --by numpy,opencl,mitsuba --workers 2 --spp 16
    """
    kinds, shown = names_of("--by", by, paths.BY), parse_names(scenes) or [scenes]
    usual = f"1,{len(os.sched_getaffinity(0)) if hasattr(os, 'sched_getaffinity') else os.cpu_count() or 1}"
    processes = counts_of("--workers", usual if workers is None else workers, "1,2")
    check_counts([size], spp=(spp, 2), depth=(depth, 6), repeats=(repeats, 5))
    job = Job(size, size, spp, settings=Settings(max_depth=depth - 1))
    tables = [paths.renderers(name, job, kinds, processes) for name in shown]
    entries = [entry for found in tables for entry in found]
    with progress("measuring", len(entries) * (repeats + 1), "renders") as advance, empty_caches():
        measure(entries, repeats, done=partial(advance, 1.0))
    say_facts(NUMPY, f"{size}x{size}, {spp} spp, {depth} edges")
    for found in tables:
        last, last_s = found[-1].by, found[-1].times.median
        head("scene", "backend", "first frame, s", "s, median", "s, range", "samples/s", f"times {last}")
        for each in found:
            median = each.times.median
            row(
                *(each.name, each.by, f"{each.first_s:.2f}", f"{median:.2f}", extent(each.seconds, 2)),
                *(f"{size**2 * spp / median:,.0f}", f"{last_s / median:.2f}"),
            )
        for text in _agreement(found) if repeats > 1 else ():
            say(text)


def _agreement(entries: Sequence[Entry]) -> Iterator[str]:
    """Yield how far the mean colours are from the first one's."""
    first, *others = entries
    yield ""
    for each in others:
        mean, its_mean = (statistics.fmean(entry.facts["means"]) for entry in (each, first))
        found = distance(each, first)
        errors = "no spread" if found is None else f"{found:+.1f} errors"
        yield f"{each.by}: mean colour {mean:.6f}, {first.by}'s {its_mean:.6f}: {errors}"


def primitives(
    executors: str = option(
        "NAME,...  Path tracers to measure: opencl, opengl, c, mitsuba.", "opencl,opengl"
    ),
    kinds: str = option("NAME,...  Kinds of primitives: shared, turned, spheres, quads, mixture.", "mixture"),
    counts: str = option("N,...  Number of primitives.", "10,30,100,300"),
    size: Square = 128,
    spp: Spp = 4,
    repeats: Repeats = 5,
) -> None:
    """Measure scenes of many primitives in all forms: unrolled statements, tables with a loop, a tree.

    The table has the lines and size of the source, the seconds to trace and emit it, the seconds until
    the driver has built it and traced a first row of paths (without disk caches), and million samples
    per second: median and range of the interleaved rounds. A star marks the form that the compiler
    chooses; a tree is measured only if it is expected to pay off.

    Examples:
    wamnet bench primitives
    wamnet bench primitives --executors opencl,mitsuba --kinds spheres --counts 30,3000
    """
    given = names_of("--executors", executors, paths.BUILT)
    scenes, numbers = names_of("--kinds", kinds, KINDS), counts_of("--counts", counts, "30,100")
    check_counts([size], spp=(spp, 4), repeats=(repeats, 5))
    say_facts(NUMPY, f"{size}x{size}, {spp} spp")
    head("backend", "scene", "form", "lines", "kB", "trace, s", "build, s", "Msamples/s", "range")
    part = Part(size, size, 0, size, 0, spp, 0)
    with environment(paths.NO_CACHES):
        for name in given:
            with nullcontext() if name in paths.PEERS else open_executor(name) as executor:
                for scene in (crowd(kind, count) for kind in scenes for count in numbers):
                    entries = paths.forms(executor, name, scene, part)
                    take_turns(entries, repeats)
                    for entry in entries:
                        _show(name, scene.name, entry, size * size * spp)


def _show(by: str, scene: str, entry: Entry, samples: int) -> None:
    """Print the row of a form."""
    facts, rates = entry.facts, [samples / seconds / 1e6 for seconds in entry.seconds]
    source, star = facts["source"], "*" if facts["chosen"] else ""
    row(
        *(by, scene, f"{entry.name}{star}", f"{source.count(chr(10)):,}"),
        *(f"{len(source.encode()) / 1000:,.0f}", f"{facts['trace_s']:.2f}", f"{facts['build_s']:.2f}"),
        *(f"{statistics.median(rates):.2f}", extent(rates, 2)),
    )
