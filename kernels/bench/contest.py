"""One run of the benchmark of denoisers: contenders open, take turns, and are judged.

1. The machine's limits once, and the rates of each executor and schedule [rates.py]. A kernel whose predicted
   time is far over the budget is left out, and its row says so [`Contest._open`].
2. Packages are imported, executors opened; then a contender opens and makes its first frame, which is
   compared with the reference [accuracy.py]. That time less a later frame's is its compilation.
3. Rounds in which every contender makes a frame and the machine's limits are measured again, in turn
   [measure.py]. A contender whose repeats would take longer than the budget takes fewer turns; where a
   frame takes more than half of it, the first one counts [`Contest._warm`].
4. Quality on unseen frames [`Contest._judge`].
5. Other sizes, ascending: what took t at p pixels is taken to need t p' / p at p' pixels, and is left out,
   with that reason, where it is over the budget [`Contest._grow`].

A step that a contender refuses ends in its row, not in the run. Ctrl-C leaves all rows as they are. Rows are
JSON's types with the keys of spec/bench.md; a number that is not finite, or was not measured, is null.
"""

from __future__ import annotations

import math
import statistics
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from functools import partial
from typing import Any

from numpy.typing import NDArray

from ...compiler.schedules.names import split
from ...refimpl.errors import ExecutorUnavailable, WamnetError
from ...refimpl.frame import Frame
from ...refimpl.network.denoise import Model, denoise
from ..cache import clean
from ..measure import PAUSE_S, Clock, Entry, Times, begin, take_turns
from ..memory import keep_freed_memory
from . import accuracy, rates
from .contenders import IEEE, MACHINE, Contender, Opened, Tools, parameters_of
from .fresh import first_runs
from .rates import Rates, predicted_seconds
from .workload import Given, filled, given, noise

SCHEMA = "wamnet-bench-2"
"""Name and version of the form of the data."""

MEASURED, MISSING, SKIPPED, FAILED, PENDING = "measured", "missing", "skipped", "failed", "pending"
"""States of a row: `pending` is one that an interrupted run has not come to."""

KERNEL, PEER = "kernel", "peer"
"""Kinds of rows: what this compiler makes, and what others make."""

MOST_TOLD = 200
"""Characters of a peer's error that are repeated."""

PROBE_PAUSE_S = 0.05
"""Seconds before a run of a small program: only one library runs, whose threads wait for it."""

DOUBT = 4.0
"""Times the budget that a prediction must reach for a kernel to be left out unseen: it may be off."""

FRONTS = {"error": ("max", None), "quality": ("psnr_loss_db", 0.01), "rounding": ("bound", None)}
"""Parts of a row with a front: the number that is set against time, and differences of it, here in dB, that
no front sees: those of rounding."""

GROWTH_ROUNDS = 3
"""Most frames of each contender at another size: what grows is seen from few."""

COUNTS = ("products", "sines", "bytes")
"""What the cost model counts of a pixel."""


@dataclass(kw_only=True)
class Row(Entry):
    """A contender whose failure does not end the run: `state` says how far it got, `reason` why no further.

    `opened`: the contender that is ready, if it is.
    """

    contender: Contender
    state: str = PENDING
    reason: str = ""
    kernel_seconds: list[float] = field(default_factory=list)
    opened: Opened | None = None

    @property
    def kind(self) -> str:
        """Return whether this compiler makes it."""
        return KERNEL if self.contender.executor else PEER

    @contextmanager
    def failing(self) -> Iterator[None]:
        """Let an error put the row out; a peer may raise what it likes, others only our errors."""
        try:
            yield
            return
        except ExecutorUnavailable as error:
            self.state, self.reason = MISSING, str(error)
        except (WamnetError, MemoryError) as error:
            self.state, self.reason = FAILED, str(error) or type(error).__name__
        except Exception as error:
            if self.kind != PEER:
                raise
            told = " ".join(str(error).split())[:MOST_TOLD]
            self.state, self.reason = FAILED, f"{type(error).__name__}: {told}"
        self.round = None

    def turn(self, number: int, clock: Clock) -> None:
        """Do a round; one that fails is the last."""
        with self.failing():
            super().turn(number, clock)

    def make(self, shown: Given) -> NDArray[Any]:
        """Return the picture that an open contender makes of a frame."""
        assert self.opened is not None, "a row that is measured is open"
        return self.opened.run(shown)

    def make_in_rounds(self, shown: Given, alone: bool = True) -> None:
        """Let a round be a frame, whose time counts, and the kernel's `alone`, which is noted."""
        kernel_seconds = self.opened.kernel_seconds if alone and self.opened else None

        def work(_number: int) -> float:
            start = time.perf_counter()
            self.make(shown)
            seconds = time.perf_counter() - start
            if kernel_seconds:
                self.kernel_seconds.append(kernel_seconds(shown))
            return seconds

        self.round = work

    def leave_out(self, seconds: float, by: str, budget_s: float) -> None:
        """Note the reason for which something is left out."""
        budget = f"more than --budget {budget_s:g} s"
        self.state, self.reason = SKIPPED, f"left out: a frame would take {seconds:.1f} s by {by}, {budget}"

    def as_data(self) -> dict[str, Any]:
        """Return the row as JSON's types."""
        # One that was interrupted between its first frame and its rounds has no time.
        state = PENDING if self.state == MEASURED and not self.seconds else self.state
        head = {"name": self.name, "text": self.contender.text, "kind": self.kind, "state": state}
        times = {"ms": milliseconds(self.seconds), "kernel_ms": milliseconds(self.kernel_seconds)}
        found: dict[str, Any] = clean({**head, "reason": self.reason, **times, **self.facts})
        return found


@dataclass(frozen=True)
class Request:
    """What is measured: a model on pictures of `size` pixels in width and height, `repeats` times.

    `pairs` are unseen noisy frames with their references, empty where noise is denoised, and `frames` says
    what is known of them; `name` is the model's, `sizes` are further sizes, `budget_s` is the longest that
    one contender may take at one size. `quick` halves the machine's measurements,
    `first_runs` measures compilation with empty caches and with those on disk.
    """

    model: Model
    size: int = 1024
    repeats: int = 5
    sizes: tuple[int, ...] = ()
    pairs: tuple[tuple[Frame, Frame], ...] = ()
    frames: Mapping[str, Any] = field(default_factory=dict)
    name: str = ""
    budget_s: float = 30.0
    quick: bool = False
    first_runs: bool = False
    pause_s: float = PAUSE_S

    @property
    def scale(self) -> int:
        """Return the divisor of the lengths of the machine's measurements."""
        return 2 if self.quick else 1

    def shown(self, size: int) -> Given:
        """Return the picture of a size: an unseen frame, or noise."""
        return given(self.model, filled(self.pairs[0][0], size) if self.pairs else noise(size))


@dataclass
class Contest:
    """A run and what it has found so far; made for open `tools`. `told` is called with shares of the work."""

    request: Request
    contenders: Sequence[Contender]
    tools: Tools
    told: Callable[[float], None] = lambda share: None
    machine: list[Entry] = field(default_factory=list)
    found_rates: dict[str, Rates] = field(default_factory=dict)
    sizes: dict[int, dict[str, Row]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.rows = self.sizes[self.request.size] = {}
        for each in self.contenders:
            facts = {"caches": each.caches, "executor": each.executor}
            facts |= each.variant.facts(self.request.model) if each.variant else {}
            self.rows[each.name] = Row(name=each.name, contender=each, facts=facts)

    def run(self) -> None:
        """Do all steps."""
        keep_freed_memory()
        request, shown = self.request, self.request.shown(self.request.size)
        crop = accuracy.Crop(request.model, shown.images)
        ways = rates.machine_ways(request.scale)
        self.machine = [Entry(name, lambda way=way: way) for name, way in ways.items()]  # type: ignore[misc]
        begin(self.machine)
        take_turns(self.machine, 1, request.pause_s)
        self.told(0.02)
        for row in self.rows.values():
            with row.failing():
                self._open(row, shown, crop)
            self.told(0.45 / len(self.rows))
        for row in self._going():
            with row.failing():
                self._warm(row, shown)
        entries = [*self._going(), *self.machine]
        share = 0.48 / (request.repeats * len(entries))
        take_turns(entries, request.repeats, request.pause_s, lambda: self.told(share))
        self._judge()
        if request.first_runs:
            self._begin_anew()
        for size in sorted(set(request.sizes) - {request.size}):
            self._grow(size)

    @property
    def limits(self) -> rates.Limits | None:
        """Return the machine's limits by what has been measured so far."""
        if not self.machine or not all(entry.seconds for entry in self.machine):
            return None
        return rates.limits_of({entry.name: entry.times for entry in self.machine}, self.request.scale)

    def _going(self) -> list[Row]:
        """Return the rows that are open, and have not failed."""
        return [row for row in self.rows.values() if row.opened and row.state == MEASURED]

    # ---- opening ------------------------------------------------------------------------------------------

    def _open(self, row: Row, shown: Given, crop: accuracy.Crop) -> None:
        """Open a contender and let it make its first frame, which is compared with the reference."""
        contender, budget_s = row.contender, self.request.budget_s
        contender.prepare(self.tools)
        start = time.perf_counter()
        opened = contender.open(self.tools, self.request.model, self.request.size)
        seconds = time.perf_counter() - start
        needed = self._predict(opened, row)
        if contender.executor and needed is not None and needed > DOUBT * budget_s:
            row.leave_out(needed, "the cost model", budget_s)
            return
        start = time.perf_counter()
        picture = opened.display(opened.run(shown))
        row.facts |= {"open_s": seconds, "first_frame_s": time.perf_counter() - start}
        row.state, row.opened = MEASURED, opened
        if contender.variant is None:  # another denoiser has no error
            return
        row.facts["error"] = accuracy.errors(crop.cut(picture), crop.full)
        expected, bound = crop.rounding(contender.variant, contender.executor, opened.schedule)
        proven: dict[str, Any] = {"bound": None, "bound_all": None, "certified": False}
        if contender.executor:
            proven = {"bound": bound, "bound_all": opened.bound, "certified": opened.certified}
        row.facts["rounding"] = proven | {"max": accuracy.errors(crop.cut(picture), expected)["max"]}

    def _predict(self, opened: Opened, row: Row) -> float | None:
        """Note what a contender is and does for a pixel, and return the time that the cost model gives."""
        stages = opened.stages
        seconds = predicted_seconds(stages, self._rates_of(opened.rates), self.request.size**2)
        row.facts |= {"device": opened.device, "source_bytes": opened.source_bytes}
        row.facts |= {"schedule": opened.schedule or None, "rates": opened.rates if stages else None}
        row.facts["predicted_ms"] = seconds and 1e3 * seconds
        row.facts |= {name: sum(getattr(stage, name) for stage in stages) or None for name in COUNTS}
        return seconds

    def _rates_of(self, name: str) -> Rates:
        """Return the machine's rates, or an executor's with a schedule, measured at its first use."""
        limits = self.limits
        assert limits is not None, "the machine is measured first"
        if name == MACHINE:
            return limits.rates
        if name not in self.found_rates:
            executor, schedule, profile = split(name)
            pause_s = min(PROBE_PAUSE_S, self.request.pause_s)
            device = self.tools.executor(executor)
            language = device.language.under(profile or IEEE)
            times, side = rates.probe_times(device, language, schedule, pause_s)
            self.found_rates[name] = rates.rates_of(times, side * side, limits.bytes_per_s)
        return self.found_rates[name]

    # ---- times --------------------------------------------------------------------------------------------

    def _warm(self, row: Row, shown: Given) -> None:
        """Let a contender make a second frame, by which it takes part in as many rounds as the budget allows.

        A frame that takes half of it is the only one: a kernel is built by then. What a peer compiles with
        its first frame does not count as a frame.
        """
        repeats, budget, frame = self.request.repeats, self.request.budget_s, row.facts["first_frame_s"]
        row.make_in_rounds(shown)
        if row.kind != KERNEL or frame <= budget / 2:
            start = time.perf_counter()
            row.make(shown)
            frame = time.perf_counter() - start
        row.most = min(repeats, int(budget / max(frame, 1e-9)) - 1)
        if row.most < 1:
            row.seconds.append(frame)
            row.reason = f"only one frame: it took {frame:.1f} s of --budget {budget:g} s"
        elif row.most < repeats:
            took = f"a frame takes {frame:.1f} s, --budget is {budget:g} s"
            row.reason = f"{row.most} of {repeats} rounds: {took}"

    def _grow(self, size: int) -> None:
        """Measure at another size all that its time at the nearest size lets hope for."""
        shown, rows = self.request.shown(size), self.sizes.setdefault(size, {})
        for main in self._going():
            hoped, predicted = self._hoped(main.name, size), main.facts["predicted_ms"]
            if hoped is None:
                continue
            facts = {key: main.facts[key] for key in COUNTS}
            facts["predicted_ms"] = predicted and predicted * (size / self.request.size) ** 2
            row = Row(name=main.name, contender=main.contender, facts=facts, opened=main.opened)
            rows[main.name] = row
            if hoped > self.request.budget_s:
                row.leave_out(hoped, "its time at another size", self.request.budget_s)
                continue
            with row.failing():
                row.state = MEASURED
                row.make(shown)
                row.make_in_rounds(shown, alone=False)
            self.told(0.02)
        take_turns([*rows.values()], min(GROWTH_ROUNDS, self.request.repeats), self.request.pause_s)

    def _hoped(self, name: str, size: int) -> float | None:
        """Return the time that a contender should need at a size; None if it has none, or failed at one."""
        known = {at: rows[name] for at, rows in self.sizes.items() if name in rows}
        measured = {at: statistics.median(row.seconds) for at, row in known.items() if row.seconds}
        if not measured or any(row.state not in (MEASURED, SKIPPED) for row in known.values()):
            return None
        nearest = min(measured, key=lambda at: abs(at - size))
        return measured[nearest] * (size / nearest) ** 2

    # ---- quality, and the result --------------------------------------------------------------------------

    def _judge(self) -> None:
        """Note the quality of each contender's pictures of unseen frames, where there are any."""
        model, pairs = self.request.model, self.request.pairs
        if not pairs:
            return
        full = accuracy.scores(model, pairs, partial(denoise, model))
        images = {id(noisy): given(model, noisy) for noisy, _ in pairs}
        pixels = sum(noisy.height * noisy.width for noisy, _ in pairs)
        going = self._going()
        for row in going:
            hoped = self._hoped(row.name, 1)
            if hoped is not None and hoped * pixels > self.request.budget_s:
                row.facts["quality"] = None
                continue

            def show(frame: Frame, row: Row = row) -> NDArray[Any]:
                assert row.opened is not None, "a row that goes on is open"
                return row.opened.display(row.make(images[id(frame)]))

            with row.failing():
                row.facts["quality"] = accuracy.quality(accuracy.scores(model, pairs, show), full)
            self.told(0.05 / len(going))

    def _begin_anew(self) -> None:
        """Note how long a first frame takes with empty caches, and with what a process before has left."""
        # A form that was trained has a kernel of another network: the process would not have it.
        for row in self._going():
            if not (row.contender.variant and row.contender.variant.model):
                never, later = first_runs(row.name, self.request.model, self.request.size)
                row.facts |= {"first_run_s": never, "later_run_s": later}
                self.told(0.05)

    def as_data(self) -> dict[str, Any]:
        """Return all that is known so far as JSON's types; the keys are those of spec/bench.md."""
        request, model, limits = self.request, self.request.model, self.limits
        sizes: list[dict[str, Any]] = [
            {"size_px": size, "contenders": [self._data_of(row, size) for row in rows.values()]}
            for size, rows in self.sizes.items()
        ]
        found: dict[str, Any] = clean(
            {
                "schema": SCHEMA,
                **sizes[0],
                "repeats": request.repeats,
                "budget_s": request.budget_s,
                "frames": request.frames or None,
                "network": {
                    "name": request.name,
                    "widths": model.siren.widths,
                    "features": model.features,
                    "window": model.window.size,
                    "border": model.window.border,
                    "parameters": parameters_of(model),
                    "omega_0": [model.siren.omega_0_first, model.siren.omega_0_hidden],
                },
                "unseen_frames": len(request.pairs),
                "limits": limits and asdict(limits),
                "limits_rounds_s": {entry.name: entry.seconds for entry in self.machine},
                "rates": {name: asdict(found) for name, found in self.found_rates.items()},
                "front": {part: _front_of(sizes[0]["contenders"], part) for part in FRONTS},
                "sizes": sizes[1:],
            }
        )
        return found

    def _data_of(self, row: Row, size: int) -> dict[str, Any]:
        """Return a row as JSON's types, with what follows from its times of pictures of this size."""
        data, limits = row.as_data(), self.limits
        if data["ms"] is None:
            return data
        ms, counted_s = data["ms"]["median"], 1e-3 * (data["kernel_ms"] or data["ms"])["median"]
        data["frames_per_s"] = 1e3 / ms
        if data.get("products") and limits:
            flops, memory = (size**2 * n / counted_s for n in (2 * data["products"], data["bytes"]))
            data |= {"gflops": 1e-9 * flops, "of_sgemm": flops / limits.flops_per_s}
            data["of_memory"] = memory / limits.bytes_per_s
        if data.get("predicted_ms"):
            data["predicted_over_measured"] = data["predicted_ms"] / ms
        if "first_frame_s" in data:
            data["compile_s"] = max(0.0, data["open_s"] + data["first_frame_s"] - 1e-3 * ms)
        return data


# ---- what follows from rows -------------------------------------------------------------------------------


def _front_of(rows: Sequence[Mapping[str, Any]], part: str) -> list[str]:
    """Return the names on the front of a part of the rows, whose numbers are taken to multiples of a step."""
    key, step = FRONTS[part]
    points = {}
    for row in rows:
        found, median = (row.get(part) or {}).get(key), row["ms"] and row["ms"]["median"]
        points[row["name"]] = median, found if step is None or found is None else step * round(found / step)
    return front(points)


def milliseconds(seconds: Sequence[float]) -> dict[str, Any] | None:
    """Return median, extremes, spread (their difference over the median) and all times; None without any."""
    if not seconds:
        return None
    times = Times(tuple(1e3 * value for value in seconds))
    found = {"median": times.median, "min": min(times.seconds), "max": max(times.seconds)}
    return {**found, "spread": times.spread, "rounds": list(times.seconds)}


def front(points: Mapping[str, tuple[float | None, float | None]]) -> list[str]:
    """Return the names of the points (time, error) that no other point beats, by time.

    One beats another if it is not worse in either and better in one; equal points stay both. A point with a
    NaN, an infinity or without a number is on no front, and beats none.
    """
    known = {
        name: (time, error)
        for name, (time, error) in points.items()
        if time is not None and error is not None and math.isfinite(time) and math.isfinite(error)
    }

    def beaten(point: tuple[float, float]) -> bool:
        return any(o[0] <= point[0] and o[1] <= point[1] and o != point for o in known.values())

    return sorted((name for name, point in known.items() if not beaten(point)), key=lambda name: known[name])
