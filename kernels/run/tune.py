"""Which schedule runs a denoiser fastest on this device: measured once, remembered, and reported.

1. Each schedule of the executor's target that holds the program is built. Its result on a crop must lie
   within the bound of the float64 reference there: what is wrong is not timed [`Tuning._check`].
2. What would take many times as long as the fastest, going by the time of a larger crop, is not timed either
   [`SLOW`]. The others take turns on noise of the picture's size [measure.py].
3. Each one is then forgotten and built again: drivers keep what they compile on disk, and the second time is
   what the next run will wait for. Where the weights are in the source, another model is another source,
   and the first time counts [`Tuning._built`].
4. The table is kept in the cache folder [cache.py] under all that it depends on: device, driver, cores, shape
   of the network, profile, rank, size of the image to a factor of two, the compiler's own text.
5. [`Tuning.picked`] takes the schedule with the least time to build and to run so many pictures; without a
   table the one that is built in for the device. It says which and why.
"""

from __future__ import annotations

import datetime
import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from ...refimpl import rng
from ...refimpl.errors import CompileError, InputError
from ...refimpl.network.denoise import Model
from ...refimpl.reading import to_dataclass
from .. import cache, measure
from ..devices.executor import Executor
from ..devices.kernel import Images

if TYPE_CHECKING:
    from ...compiler.artifact import Artifact
    from ...compiler.core.ir import Program
    from ...compiler.plan import Plan
    from ...compiler.variants import Varied

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
class Tuning:
    """The schedules of a network on an open device, for pictures of a size (height, width).

    `varied`: what a variant does to the network, whose rank and sine tables are measured for.
    """

    executor: Executor
    model: Model
    size: tuple[int, int]
    varied: Varied | None = None

    def picked(self, pictures: int = 1) -> tuple[str, str]:
        """Return the schedule for so many pictures, as measured here or built in, and why, without a plan."""
        table = None if self.executor.interprets else self.remembered()
        if table is not None and (best := table.best(pictures)) is not None:
            height, width = table.size
            text = f"tuned on this device on {table.day}: {best.ms:.3g} ms at {width}x{height}"
            return best.schedule, f"{text}, {best.again_s:.2g} s to build"
        if self.model.is_whole and (name := self.executor.byte_schedule):
            return name, "built-in choice for integers on devices that multiply bytes"
        return self.executor.schedule_for(self.size), self.executor.schedule_reason

    @property
    def entry(self) -> str:
        """Return the name of the cache's entry: a table of other kernels than today's is no use."""
        model, varied, profile = self.model, self.varied, self.executor.profile
        network = [list(model.siren.widths), list(model.features), model.window.size, model.window.border]
        how = [varied.profile(profile), varied.rank] if varied else [profile, 0]
        how += [size_class(self.size), cache.program_version()]
        return f"tuning-{cache.key(*self.executor.identity, network, *how)}"

    def remembered(self) -> Table | None:
        """Return what was measured for this device, network and size, if it was."""
        with suppress(InputError):
            return to_dataclass(Table, cache.read_json(self.entry), "table")
        return None

    def measured(self, plan: Plan, repeats: int = REPEATS) -> Table:
        """Measure all schedules of a plan of the network, keep the table, and return it."""
        crop, images = noise(plan.analysed, CROP), noise(plan.analysed, self.size)
        rows: dict[str, Row] = {}
        ready: dict[str, Artifact] = {}
        trials: dict[str, float] = {}
        for name in plan.target.schedules:
            try:
                row, artifact = self._built(plan.scheduled(name))
                self._check(artifact, crop)
            except (CompileError, WrongResult) as error:
                rows[name] = Row(name, note=str(error))
                continue
            rows[name], ready[name], trials[name] = row, artifact, self.trial(artifact)
        least = min(trials.values(), default=0.0)
        for name in [name for name, seconds in trials.items() if seconds > SLOW * least]:
            del ready[name]
            note = f"about {trials[name] / least:.0f} times as slow in a trial"
            rows[name] = replace(rows[name], note=note)
        ways = {name: partial(self.executor.run, artifact, images) for name, artifact in ready.items()}
        for name, times in measure.in_turns(ways, repeats).items():
            rows[name] = replace(rows[name], ms=1e3 * times.median)
        day = datetime.datetime.now(datetime.timezone.utc).date().isoformat()
        model, widths = plan.model, "-".join(map(str, plan.model.siren.widths))
        window = f"window {model.window.size} ({model.window.border})"
        network = f"{widths}, {' + '.join(model.features)}, {window}"
        table = Table(self.executor.device, network, self.size, day, tuple(rows.values()))
        cache.write_json(self.entry, asdict(table))
        return table

    def _built(self, plan: Plan) -> tuple[Row, Artifact]:
        """Return a plan's artifact, built, with both times of compilation; raise where it cannot be."""
        from ...compiler.compile import compile_plan

        seconds = []
        for _ in range(2):
            self.executor.forget()
            start = time.perf_counter()
            # A plan keeps what it has computed; a copy has nothing yet.
            artifact = compile_plan(replace(plan))
            if reason := artifact.manifest["schedule"].get("reason"):
                raise CompileError(reason)
            self.executor.build(artifact, self.size)
            seconds.append(time.perf_counter() - start)
        in_source = not any(kernel.weights.size for kernel in artifact.kernels)
        return Row(plan.asked, None, seconds[0], seconds[0] if in_source else seconds[1]), artifact

    def _check(self, artifact: Artifact, crop: Images) -> None:
        """Refuse an artifact whose result on a crop's images is not within the bound there."""
        held = artifact.plan.expected(crop)
        error = np.abs(self.executor.run(artifact, crop).astype(np.float64) - held.value)
        if not (error <= held.bound).all():
            worst = float(np.nanmax(error / held.bound)) if np.isfinite(error).any() else float("nan")
            raise WrongResult(f"its result is wrong on this device: {worst:.3g} times the bound on the error")

    def trial(self, artifact: Artifact) -> float:
        """Return the least seconds of a picture that is no larger than the whole."""
        height, width = self.size
        images = noise(artifact.plan.analysed, (min(TRIAL, height), min(TRIAL, width)))
        run = partial(self.executor.run, artifact, images)
        return min(measure.in_turns({"trial": run}, 2, pause_s=0.0)["trial"].seconds)


class WrongResult(Exception):
    """A kernel whose result on this device is not within its bound."""


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


def size_class(size: tuple[int, int]) -> int:
    """Return k for pictures of more than 2^(k - 1) and at most 2^k pixels."""
    return (size[0] * size[1] - 1).bit_length()


def first_time(identity: Sequence[object], artifact_digest: str, seconds: float) -> float:
    """Return how long this kernel took to compile on a device when first met; remember it if now.

    `identity` names the device.
    """
    found = cache.kept("first", (*identity, artifact_digest), lambda: seconds)
    return found if isinstance(found, float) else seconds
