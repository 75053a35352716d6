"""Commands that compare parts of wamnet with other programs: each measures one, and prints a Markdown table.

A record is made of the rows (experiments/publish.py); progress is on standard error.
"""

import statistics
from collections.abc import Sequence
from contextlib import ExitStack, nullcontext
from functools import partial
from importlib import metadata

from wamnet.cli.commands.measure import head, names_of, row
from wamnet.cli.common.options import parse_names
from wamnet.cli.common.terminal import progress, say
from wamnet.cli.reports import machine
from wamnet.kernels import EXECUTORS, open_executor
from wamnet.kernels.bench.fresh import empty_caches
from wamnet.kernels.bench.workload import check_size, paper_model
from wamnet.kernels.devices.kernel import Part
from wamnet.kernels.measure import Entry, environment, take_turns
from wamnet.kernels.memory import cores
from wamnet.models.data.scene_source import scene_source
from wamnet.refimpl.errors import ExecutorUnavailable, InputError
from wamnet.refimpl.light.render import Job
from wamnet.refimpl.light.transport import Settings
from wamnet.refimpl.network.dataset import FEATURES
from wamnet.refimpl.network.denoise import Model
from wamnet.refimpl.network.train import PRESETS

from . import paths, pipelines, table, training
from .common import measure

COMMANDS = {f"bench {name}": name for name in ("render", "train", "pipeline", "primitives")}
"""Function of each command, which `wamnet` registers."""

MOST = 1 << 20
"""Largest count that an option takes: a typing error is refused before anything is measured."""

NUMPY = f"NumPy {metadata.version('numpy')}"
"""NumPy's version, with its name."""


def counts_of(option: str, text: str, example: str) -> tuple[int, ...]:
    """Return the integers of a text like `256,512`, or refuse it."""
    try:
        counts = tuple(int(part) for part in parse_names(text))
    except ValueError:
        counts = ()
    if not counts or not all(1 <= count <= MOST for count in counts):
        rule = f"must be integers from 1 to {MOST}, with commas"
        raise InputError(option, text, rule, f"for example {option} {example}")
    return counts


def say_facts(*others: str) -> None:
    """Print what is said of the machine, then what else was given."""
    say(", ".join([*(f"{name} {value}" for name, value in machine.describe().items()), *others]))


def extent(values: Sequence[float], digits: int) -> str:
    """Return the least and the greatest value, as a table shows them."""
    return f"{min(values):.{digits}f} - {max(values):.{digits}f}"


def render(
    scenes: str = "minicubes,cornell",
    by: str = "numpy",
    workers: str | None = None,
    size: int = 512,
    spp: int = 2,
    depth: int = 6,
    repeats: int = 5,
) -> None:
    """Measure samples per second: the reference renderer, its kernels, Mitsuba 3."""
    kinds, shown = names_of("--by", by, paths.BY), parse_names(scenes) or [scenes]
    usual = f"1,{cores()}"
    processes = counts_of("--workers", usual if workers is None else workers, "1,2")
    check_size(size)
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
        if repeats > 1:
            _say_agreement(found)


def _say_agreement(entries: Sequence[Entry]) -> None:
    """Print how far the mean colours are from the first one's."""
    first, *others = entries
    say("")
    for each in others:
        mean, its_mean = (statistics.fmean(entry.facts["means"]) for entry in (each, first))
        found = paths.distance(each, first)
        errors = "no spread" if found is None else f"{found:+.1f} errors"
        say(f"{each.by}: mean colour {mean:.6f}, {first.by}'s {its_mean:.6f}: {errors}")


def primitives(
    executors: str = "opencl,opengl",
    kinds: str = "mixture",
    counts: str = "10,30,100,300",
    size: int = 128,
    spp: int = 4,
    repeats: int = 5,
) -> None:
    """Measure scenes of many primitives in all forms: unrolled statements, tables with a loop, a tree."""
    given = names_of("--executors", executors, paths.BUILT)
    scenes, numbers = names_of("--kinds", kinds, paths.KINDS), counts_of("--counts", counts, "30,100")
    check_size(size)
    say_facts(NUMPY, f"{size}x{size}, {spp} spp")
    head("backend", "scene", "form", "lines", "kB", "trace, s", "build, s", "Msamples/s", "range")
    part = Part(size, size, 0, size, 0, spp, 0)
    with environment(paths.NO_CACHES):
        for name in given:
            with nullcontext() if name in table.renderers else open_executor(name) as executor:
                for scene in (paths.crowd(kind, count) for kind in scenes for count in numbers):
                    if executor is None:
                        entries = [paths.form_of_peer(name, scene, part)]
                    else:
                        entries = paths.forms(executor, scene, part)
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


def train(
    presets: str = "paper,short",
    trainers: str | None = None,
    size: int = 256,
    frames: int = 4,
    seconds: float = 1.0,
    repeats: int = 5,
) -> None:
    """Measure milliseconds per training step: the reference, the compiled trainer, PyTorch."""
    names = names_of("--presets", presets, PRESETS)
    given = training.trainers() if trainers is None else names_of("--trainers", trainers, training.TRAINERS)
    check_size(size)
    packages = [f"{name} {value}" for name, value in machine.versions().items()]
    say_facts(*packages, f"{frames} frames of {size}x{size}")
    pairs = training.noise(frames, size)
    for recipe, preset in ((PRESETS[name], name) for name in names):
        entries, product = training.entries(recipe, pairs, given, seconds), training.sgemm()
        with progress(f"measuring {preset}", (len(given) + 1) * (repeats + 1), "rounds") as advance:
            measure([product, *entries], repeats, warm=0, done=partial(advance, 1.0))
        work, most = training.operations(recipe), product.facts["operations"] / min(product.seconds)
        say("")
        say(f"preset `{preset}`: {work / 1e9:.3f} GFLOP per step; sgemm {most / 1e9:.0f} GFLOP/s")
        head("backend", "ms per step", "range", "GFLOP/s", "of sgemm", f"{recipe.steps:,} steps")
        for entry in entries:
            median = entry.times.median
            row(
                *(entry.name, f"{1e3 * median:.2f}", extent([1e3 * time for time in entry.seconds], 2)),
                *(f"{work / median / 1e9:.0f}", f"{work / median / most:.0%}"),
                f"{median * recipe.steps:,.0f} s",
            )


def pipeline(
    scene: str = "minicubes",
    executors: str = "opencl,opengl",
    sizes: str = "256,512",
    features: str = "color,normal",
    hidden: str = "32,32,32,32",
    window: int = 12,
    feature_rays: int = 0,
    repeats: int = 5,
    peers: str = "",
) -> None:
    """Measure full frames of an animated scene: one path per pixel, and denoising."""
    scene_source(scene)
    given, widths = names_of("--executors", executors, EXECUTORS), counts_of("--sizes", sizes, "256,512")
    others = names_of("--peers", peers, table.makers) if peers else ()
    for width in widths:
        check_size(width)
    seen, layers = names_of("--features", features, FEATURES), counts_of("--hidden", hidden, "32,32")
    model = paper_model(seen, window, layers, depth_scale=20.0, position_scale=10.0)
    rays = f", features of {feature_rays} rays" if feature_rays > 1 else ""
    network = f"network {'-'.join(map(str, model.siren.widths))}"
    say_facts(NUMPY, f"{scene}, 1 spp{rays}, {Settings().max_depth + 1} edges", network)
    head("backend", "size", "method", "ms, median", "ms, range", "images/s", f"times {given[0]}, moving")
    notes: dict[str, None] = {}
    for size in widths:
        found = _entries(given, others, model, scene, size, repeats, notes, feature_rays)
        ours = next(each.times.median for each in found if each.name == pipelines.MOVING)
        for each in found:
            ms, median = [1e3 * second for second in each.seconds], each.times.median
            # Neither a part of a frame nor a first one has a rate.
            full = not each.name.startswith(("of it", "first"))
            rates = (f"{1.0 / median:.2f}", f"{median / ours:.2f}") if full else ("", "")
            row(each.by, f"{size}x{size}", each.name, f"{1e3 * median:.1f}", extent(ms, 1), *rates)
    for line in ("", *notes) if notes else ():
        say(line)


def _entries(
    given: Sequence[str],
    others: Sequence[str],
    model: Model,
    scene: str,
    size: int,
    repeats: int,
    notes: dict[str, None],
    rays: int,
) -> list[Entry]:
    """Return all rows of a size: what takes turns, then first pictures; note what others are, or lack."""
    with ExitStack() as stack, ExitStack() as pipes:
        found: list[Entry] = []
        opened = [stack.enter_context(open_executor(name)) for name in given]
        ours = [pipelines.Ours(each, model, scene, size, rays) for each in opened]
        for each in ours:
            found += pipelines.entries(each.executor.name, each.ways(pipes))
        shots = pipelines.moments(scene)
        for name in others:
            try:
                maker = table.makers[name](shots[0], size)
            except (ExecutorUnavailable, InputError) as error:
                notes[f"No row: {error}"] = None
                continue
            stack.callback(maker.close)
            notes[f"{name}: {maker.about}"] = None
            found += pipelines.entries(name, maker.ways(shots))
        measure(found, repeats, pause_s=pipelines.PAUSE_S)
        pipes.close()
        for each in ours:
            seconds = each.first_pictures()
            found.append(Entry("first picture of a new scene", by=each.executor.name, seconds=seconds))
    for name in given:
        if (cold := pipelines.first_picture(name, model, scene, size)) is not None:
            found.append(Entry("first picture, empty caches", by=name, seconds=[cold]))
    return found
