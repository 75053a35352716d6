"""Which schedule runs a denoiser fastest on this device: measured once, remembered, and reported.

1. Each schedule of the executor's target that holds the program is built. Its result on a crop must lie
   within the bound of the float64 reference there: what is wrong is not timed [`_checked`].
2. What would take many times as long as the fastest, going by the time of a larger crop, is not timed either
   [`SLOW`]. The others take turns on noise of the picture's size [measure.py].
3. Each one is then forgotten and built again: drivers keep what they compile on disk, and the second time is
   what the next run will wait for. Where the weights are in the source, another model is another source,
   and the first time counts [`_built`].
4. The table is kept in the cache folder [cache.py] under all that it depends on: device, driver, cores, shape
   of the network, profile, rank, size of the image to a factor of two, the compiler's own text [`_entry`].
5. [`choose`] takes the schedule with the least time to build and to run so many pictures; without a table the
   one that is built in for the device. It says which and why.
"""

from __future__ import annotations

import datetime
import os
import time
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from ...refimpl import rng
from ...refimpl.errors import CompileError
from ...refimpl.network.denoise import Model
from .. import cache, measure
from ..devices.executor import Executor
from ..devices.images import Images

if TYPE_CHECKING:
    from ...compiler.artifact import Artifact
    from ...compiler.core.ir import Program
    from ...compiler.plan import Plan

CROP = (19, 45)
"""Rows and columns of the picture on which results are checked: neither is a multiple of any group's."""

TRIAL = 128
"""Rows and columns of the picture whose time foretells that of the whole."""

SLOW = 8.0
"""What seems this many times as slow as the fastest is left out: small pictures foretell no more."""

REPEATS = 5
"""Rounds of measurement."""


@dataclass(frozen=True)
class Row:
    """What was found about a schedule: `ms` a picture, or a `note` why it was not timed.

    `first_s`: compilation when no driver has seen the kernel (or what it took, if one had); `again_s`:
    compilation that a later run waits for.
    """

    schedule: str
    ms: float | None = None
    first_s: float = 0.0
    again_s: float = 0.0
    note: str = ""


@dataclass(frozen=True)
class Table:
    """The rows of a device, network and size (height, width), and the day on which they were measured."""

    device: str
    network: str
    size: tuple[int, int]
    day: str
    rows: tuple[Row, ...]

    def best(self, pictures: int) -> Row | None:
        """Return the schedule that has built and run so many pictures first, None if none was timed."""
        timed = [row for row in self.rows if row.ms is not None]
        return min(timed, key=lambda row: row.again_s + pictures * (row.ms or 0.0) / 1e3, default=None)


@dataclass(frozen=True)
class Subject:
    """What a table is about: a network, the name of its profile, and the rank of its first layer or 0."""

    model: Model
    profile: str = "ieee"
    rank: int = 0

    @staticmethod
    def of(plan: Plan) -> Subject:
        """Return that of a plan."""
        return Subject(plan.model, plan.profile.name, plan.cut.rank if plan.cut else 0)


def choose(executor: Executor, plan: Plan, size: tuple[int, int], pictures: int = 1) -> tuple[str, str]:
    """Return the schedule of a plan for so many pictures of `size` (height, width), by name, and why."""
    return pick(executor, Subject.of(plan), size, pictures)


def pick(executor: Executor, subject: Subject, size: tuple[int, int], pictures: int = 1) -> tuple[str, str]:
    """Return the schedule for a subject, as measured here or built in, and why, without a plan."""
    table = None if executor.interprets else remembered(executor, subject, size)
    if table is not None and (best := table.best(pictures)) is not None:
        height, width = table.size
        text = f"tuned on this device on {table.day}: {best.ms:.3g} ms at {width}x{height}"
        return best.schedule, f"{text}, {best.again_s:.2g} s to build"
    if subject.model.is_whole and (name := executor.byte_schedule):
        return name, "built-in choice for integers on devices that multiply bytes"
    return executor.schedule_for(size), executor.schedule_reason


def remembered(executor: Executor, subject: Subject, size: tuple[int, int]) -> Table | None:
    """Return what was measured for this device, network and size, if it was."""
    found = cache.read_json(_entry(executor, subject, size))
    try:
        rows = tuple(Row(**row) for row in found["rows"])
        height, width = found["size"]
        return Table(found["device"], found["network"], (height, width), found["day"], rows)
    except (TypeError, KeyError, ValueError):
        return None


def tune(
    executor: Executor,
    plan: Plan,
    size: tuple[int, int],
    repeats: int | None = None,
    progress: Callable[[str], None] = lambda _: None,
) -> Table:
    """Measure all schedules for pictures of `size` (height, width), keep the table, and return it."""
    crop, images = noise(plan.analysed, CROP), noise(plan.analysed, size)
    rows: dict[str, Row] = {}
    ready: dict[str, Artifact] = {}
    trials: dict[str, float] = {}
    for schedule in plan.target.schedules:
        progress(schedule.name)
        try:
            row, artifact = _built(executor, plan.scheduled(schedule.name), size)
            _checked(executor, artifact, crop)
        except (CompileError, WrongResult) as error:
            rows[schedule.name] = Row(schedule.name, note=str(error))
            continue
        rows[schedule.name], ready[schedule.name] = row, artifact
        trials[schedule.name] = trial(executor, artifact, size)
    least = min(trials.values(), default=0.0)
    for name in [name for name, seconds in trials.items() if seconds > SLOW * least]:
        del ready[name]
        note = f"about {trials[name] / least:.0f} times as slow in a trial"
        rows[name] = Row(name, None, rows[name].first_s, rows[name].again_s, note)
    ways = {name: partial(executor.run, artifact, images) for name, artifact in ready.items()}
    for name, times in measure.in_turns(ways, repeats or REPEATS).items():
        rows[name] = Row(name, 1e3 * times.median, rows[name].first_s, rows[name].again_s)
    day = datetime.datetime.now(datetime.timezone.utc).date().isoformat()
    table = Table(executor.device, shape_text(plan.model), size, day, tuple(rows.values()))
    cache.write_json(_entry(executor, Subject.of(plan), size), asdict(table))
    return table


class WrongResult(Exception):
    """A kernel whose result on this device is not within its bound."""


def _built(executor: Executor, plan: Plan, size: tuple[int, int]) -> tuple[Row, Artifact]:
    """Return a plan's artifact, built, with both times of compilation; raise where it cannot be."""
    from ...compiler.compile import compile_plan

    seconds = []
    for _ in range(2):
        executor.forget()
        start = time.perf_counter()
        artifact = compile_plan(replace(plan))  # a plan keeps what it has computed; a copy has nothing yet
        reason = artifact.manifest["schedule"].get("reason")
        if reason:
            raise CompileError(reason)
        executor.build(artifact, size)
        seconds.append(time.perf_counter() - start)
    in_source = not any(kernel.weights.size for kernel in artifact.kernels)
    return Row(plan.asked, None, seconds[0], seconds[0] if in_source else seconds[1]), artifact


def _checked(executor: Executor, artifact: Artifact, crop: Images) -> None:
    """Refuse an artifact whose result on a crop's images is not within the bound there."""
    held = artifact.plan.expected(crop)
    error = np.abs(executor.run(artifact, crop).astype(np.float64) - held.value)
    if not (error <= held.bound).all():
        worst = float(np.nanmax(error / held.bound)) if np.isfinite(error).any() else float("nan")
        raise WrongResult(f"its result is wrong on this device: {worst:.3g} times the bound on the error")


def trial(executor: Executor, artifact: Artifact, size: tuple[int, int] = (TRIAL, TRIAL)) -> float:
    """Return the least seconds of a picture that is no larger than the whole."""
    images = noise(artifact.plan.analysed, (min(TRIAL, size[0]), min(TRIAL, size[1])))
    run = partial(executor.run, artifact, images)
    return min(measure.in_turns({"trial": run}, 2, pause_s=0.0)["trial"].seconds)


def noise(program: Program, size: tuple[int, int]) -> Images:
    """Return images of `size` (height, width) with noise in the ranges that a program's may hold."""
    images = {}
    gather = program.gather
    assert gather is not None, "lower gives a program with a window"
    for number, image in enumerate(gather.images):
        low, high = np.float32(image.low), np.float32(image.high)
        count = size[0] * size[1] * image.channels
        blocks = rng.counter(np.arange(-(-count // 4)))
        words = rng.uniforms(rng.counter(1), blocks, rng.counter(number), rng.counter(0))
        drawn = np.concatenate(words)[:count].reshape(*size, image.channels)
        images[image.name] = np.minimum(low + (high - low) * drawn, high)
    return images


def shape_text(model: Model) -> str:
    """Return the network's shape for a reader."""
    widths = "-".join(map(str, model.siren.widths))
    return f"{widths}, {' + '.join(model.features)}, window {model.window.size} ({model.window.border})"


def size_class(size: tuple[int, int]) -> int:
    """Return k for pictures of more than 2^(k - 1) and at most 2^k pixels."""
    return (size[0] * size[1] - 1).bit_length()


def device_parts(executor: Executor) -> list[Any]:
    """Return what names a device with its driver, for keys of the cache."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    return [executor.name, executor.device, executor.driver, cores]


def _entry(executor: Executor, subject: Subject, size: tuple[int, int]) -> str:
    """Return the name of the cache's entry: a table of other kernels than today's is no use."""
    model = subject.model
    network = [list(model.siren.widths), list(model.features), model.window.size, model.window.border]
    how = [subject.profile, subject.rank, size_class(size), cache.program_version()]
    return f"tuning-{cache.key(*device_parts(executor), network, *how)}"


FIRSTS = 64
"""Kernels of a device whose first time to compile is remembered."""


def first_time(executor: Executor, artifact_digest: str, seconds: float) -> float:
    """Return how long this kernel took to compile on this device when first met; remember it if now."""
    entry = f"first-{cache.key(*device_parts(executor))}"
    found = cache.read_json(entry)
    known: dict[str, float] = dict(found) if isinstance(found, Mapping) else {}
    if isinstance(known.get(artifact_digest), float):
        return known[artifact_digest]
    newest = list(known.items())[-(FIRSTS - 1) :]
    cache.write_json(entry, dict([*newest, (artifact_digest, seconds)]))
    return seconds
