"""One run of the benchmark: contenders open, take turns, and are judged; what is known can be had any time.

1. The machine's limits once, and the rates of each executor and schedule [rates.py]. A kernel whose predicted
   time [cost.py] is far over the budget is left out, and its row says so [`Contest._open`].
2. Packages are imported, executors opened; then a contender opens and makes its first frame, which is
   compared with the reference [accuracy.py]. That time less a later frame's is its compilation.
3. Rounds in which every contender makes a frame and the machine's limits are measured again, in turn
   [`Contest._race`]. A contender whose repeats would take longer than the budget takes fewer turns; where a
   frame takes more than half of it, the first one counts.
4. Quality on unseen frames [`Contest._judge`].
5. Other sizes, ascending: what took t at p pixels is taken to need t p' / p at p' pixels, and is left out,
   with that reason, where it is over the budget [`Contest._grow`].

A step that a contender refuses ends in its row, not in the run. Ctrl-C leaves all rows as they are.
"""

from __future__ import annotations

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
from ...refimpl.network.denoise import Model
from ..measure import PAUSE_S, Times, in_turns
from ..memory import keep_freed_memory
from . import accuracy, rates
from .contender import IEEE, MACHINE, Contender, Opened, Tools, parameters_of
from .cost import Rates, predicted_seconds
from .first_run import first_runs
from .result import (
    FAILED,
    KERNEL,
    MEASURED,
    MISSING,
    PEER,
    SCHEMA,
    SKIPPED,
    Row,
    clean,
    front,
    median_ms,
    of_front,
)
from .workload import Given, filled, given, noise

Told = Callable[[str, float], None]
"""Called with what is done next, and the share of the work that has been done since the last call."""

PROBE_PAUSE_S = 0.05
"""Seconds before a run of a small program: only one library runs, whose threads wait for it."""

DOUBT = 4.0
"""Times the budget that a prediction must reach for a kernel to be left out unseen: it may be off."""

MOST_TOLD = 200
"""Characters of a peer's error that are repeated."""

FRONTS = {"error": "max", "quality": "psnr_loss_db", "rounding": "bound"}
"""Parts of a row with a front, and the number of each that is set against time."""

STEPS = {"quality": 0.01}
"""Differences of a part's number, here in dB, that no front sees: those of rounding."""

GROWTH_ROUNDS = 3
"""Most frames of each contender at another size: what grows is seen from few."""


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


@dataclass
class Contest:
    """A run and what it has found so far; made for open `tools`."""

    request: Request
    contenders: Sequence[Contender]
    tools: Tools
    told: Told = lambda what, share: None
    rows: dict[str, Row] = field(default_factory=dict)
    opened: dict[str, Opened] = field(default_factory=dict)
    machine: dict[str, list[float]] = field(default_factory=dict)
    found_rates: dict[str, Rates] = field(default_factory=dict)
    sizes: dict[int, dict[str, Row]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for each in self.contenders:
            kind = KERNEL if each.executor else PEER
            facts = {"caches": each.caches, "executor": each.executor}
            facts |= each.variant.facts(self.request.model) if each.variant else {}
            self.rows[each.name] = Row(each.name, each.text, kind, facts=facts)

    def run(self) -> None:
        """Do all steps."""
        keep_freed_memory()
        shown = self._given(self.request.size)
        crop = accuracy.Crop(self.request.model, shown.images)
        self.told("the machine's limits", 0.02)
        ways = rates.machine_ways(self._scale)
        self._measure_machine(ways, repeats=1, warm=1)
        for contender in self.contenders:
            self.told(f"opening {contender.name}", 0.45 / len(self.contenders))
            with self._failing(self.rows[contender.name]):
                self._open(contender, shown, crop)
        self._race(shown, ways)
        self._judge()
        if self.request.first_runs:
            self._begin_anew()
        for size in sorted(set(self.request.sizes) - {self.request.size}):
            self._grow(size)

    @property
    def _scale(self) -> int:
        """Return the divisor of the lengths of the machine's measurements."""
        return 2 if self.request.quick else 1

    def _given(self, size: int) -> Given:
        """Return the picture of a size: an unseen frame, or noise."""
        pairs = self.request.pairs
        frame = filled(pairs[0][0], size) if pairs else noise(size)
        return given(self.request.model, frame)

    def _measure_machine(self, ways: Mapping[str, Callable[[], None]], repeats: int, warm: int) -> None:
        """Measure the machine's limits."""
        for name, times in in_turns(ways, repeats, warm, self.request.pause_s).items():
            self.machine.setdefault(name, []).extend(times.seconds)

    @property
    def limits(self) -> rates.Limits | None:
        """Return the machine's limits by what has been measured so far."""
        if not self.machine:
            return None
        times = {name: Times(tuple(seconds)) for name, seconds in self.machine.items()}
        return rates.limits_of(times, self._scale)

    @contextmanager
    def _failing(self, row: Row) -> Iterator[None]:
        """Write an error into a row, and continue; a peer may raise what it likes, others only our errors."""
        try:
            yield
            return
        except ExecutorUnavailable as error:
            row.state, row.reason = MISSING, str(error)
        except (WamnetError, MemoryError) as error:
            row.state, row.reason = FAILED, str(error) or type(error).__name__
        except Exception as error:
            if row.kind != PEER:
                raise
            row.state, row.reason = (
                FAILED,
                f"{type(error).__name__}: {' '.join(str(error).split())[:MOST_TOLD]}",
            )
        self.opened.pop(row.name, None)

    # ---- opening ------------------------------------------------------------------------------------------

    def _open(self, contender: Contender, shown: Given, crop: accuracy.Crop) -> None:
        """Open a contender and let it make its first frame, which is compared with the reference."""
        row = self.rows[contender.name]
        contender.prepare(self.tools)
        start = time.perf_counter()
        opened = contender.open(self.tools, self.request.model, self.request.size)
        seconds = time.perf_counter() - start
        row.facts |= {"device": opened.device, "source_bytes": opened.source_bytes}
        row.facts |= {"schedule": opened.schedule or None}
        self._predict(contender, opened, row)
        needed = row.facts["predicted_ms"]
        if contender.executor and needed is not None and needed > 1e3 * DOUBT * self.request.budget_s:
            row.state, row.reason = SKIPPED, self._too_long(1e-3 * needed, "the cost model")
            return
        start = time.perf_counter()
        picture = opened.display(opened.run(shown))
        first = time.perf_counter() - start
        row.facts |= {"open_s": seconds, "first_frame_s": first}
        row.state, self.opened[contender.name] = MEASURED, opened
        self._compare(contender, opened, crop, picture)

    def _compare(
        self, contender: Contender, opened: Opened, crop: accuracy.Crop, picture: NDArray[Any]
    ) -> None:
        """Note the error of a picture; another denoiser has none."""
        row = self.rows[contender.name]
        if contender.variant is None:
            return
        row.facts["error"] = accuracy.errors(crop.cut(picture), crop.full)
        expected, bound = crop.rounding(contender.variant, contender.executor, opened.schedule)
        found: dict[str, Any] = {"max": accuracy.errors(crop.cut(picture), expected)["max"]}
        if contender.executor:
            found |= {"bound": bound, "bound_all": opened.bound, "certified": opened.certified}
        row.facts["rounding"] = {"bound": None, "bound_all": None, "certified": False} | found

    def _predict(self, contender: Contender, opened: Opened, row: Row) -> None:
        """Note the time that the cost model gives."""
        found = self._rates_of(contender, opened.rates)
        seconds = predicted_seconds(opened.stages, found, self.request.size**2)
        row.facts |= {
            "predicted_ms": seconds and 1e3 * seconds,
            "rates": opened.rates if opened.stages else None,
            "products": sum(stage.products for stage in opened.stages) or None,
            "sines": sum(stage.sines for stage in opened.stages) or None,
            "bytes": sum(stage.bytes for stage in opened.stages) or None,
        }

    def _rates_of(self, contender: Contender, name: str) -> Rates:
        """Return the machine's rates, or an executor's with a schedule, measured at its first use."""
        limits = self.limits
        assert limits is not None, "the machine is measured first"
        if name == MACHINE:
            return limits.rates
        if name not in self.found_rates:
            executor, schedule, profile = split(name)
            pause_s = min(PROBE_PAUSE_S, self.request.pause_s)
            times, side = rates.probed(self.tools.executor(executor), schedule, pause_s, profile or IEEE)
            self.found_rates[name] = rates.rates_of(times, side * side, limits.bytes_per_s)
        return self.found_rates[name]

    def _too_long(self, seconds: float, by: str) -> str:
        """Return the reason for which something is left out."""
        budget = self.request.budget_s
        return f"left out: a frame would take {seconds:.1f} s by {by}, more than --budget {budget:g} s"

    # ---- times --------------------------------------------------------------------------------------------

    def _race(self, shown: Given, machine: Mapping[str, Callable[[], None]]) -> None:
        """Let all that are open make frames in turn, with the machine's measurements between them."""
        turns = {}
        for name, opened in list(self.opened.items()):
            self.told(f"warming {name}", 0.08 / len(self.opened))
            with self._failing(self.rows[name]):
                turns[name] = self._turns(self.rows[name], opened, shown)
        for turn in range(self.request.repeats):
            self.told(f"round {turn + 1} of {self.request.repeats}", 0.4 / self.request.repeats)
            going = [name for name in self.opened if turn < turns.get(name, 0)]
            ways = {name: partial(self._turn, name, shown) for name in going}
            in_turns(ways, 1, 0, self.request.pause_s)
            self._measure_machine(machine, repeats=1, warm=0)

    def _turns(self, row: Row, opened: Opened, shown: Given) -> int:
        """Return how often a contender may run in the budget; a frame that takes half of it is the only one.

        A kernel is built by then; what a peer compiles with its first frame does not count as a frame.
        """
        wanted, budget, frame = self.request.repeats, self.request.budget_s, row.facts["first_frame_s"]
        if row.kind != KERNEL or frame <= budget / 2:
            start = time.perf_counter()
            opened.run(shown)
            frame = time.perf_counter() - start
        turns = min(wanted, int(budget / max(frame, 1e-9)) - 1)
        if turns < 1:
            row.seconds.append(frame)
            row.reason = f"only one frame: it took {frame:.1f} s of --budget {budget:g} s"
        elif turns < wanted:
            row.reason = f"{turns} of {wanted} rounds: a frame takes {frame:.1f} s, --budget is {budget:g} s"
        return turns

    def _turn(self, name: str, shown: Given) -> float:
        """Make a frame and note its time, and the kernel's own; a contender that fails is out."""
        opened, row = self.opened.get(name), self.rows[name]
        if opened is None:
            return 0.0
        with self._failing(row):
            start = time.perf_counter()
            opened.run(shown)
            row.seconds.append(time.perf_counter() - start)
            if opened.kernel_seconds:
                row.kernel_seconds.append(opened.kernel_seconds(shown))
        return row.seconds[-1] if row.seconds else 0.0

    def _grow(self, size: int) -> None:
        """Measure at another size all that its time at the nearest size lets hope for."""
        shown, rows = self._given(size), self.sizes.setdefault(size, {})
        ways = {}
        for contender in self.contenders:
            name, hoped = contender.name, self._hoped(contender.name, size)
            if hoped is None:
                continue
            self.told(f"{name} at {size}x{size}", 0.02)
            row = rows[name] = self._row_of(name, size)
            if hoped > self.request.budget_s:
                row.state, row.reason = SKIPPED, self._too_long(hoped, "its time at another size")
                continue
            with self._failing(row):
                self.opened[name].run(shown)
                ways[name] = partial(self._turn_of, row, shown)
        in_turns(ways, min(GROWTH_ROUNDS, self.request.repeats), 0, self.request.pause_s)

    def _row_of(self, name: str, size: int) -> Row:
        """Return the row of a contender at another size: what it does for a pixel stays."""
        main = self.rows[name]
        facts = {key: main.facts[key] for key in ("products", "sines", "bytes")}
        predicted = main.facts["predicted_ms"]
        facts["predicted_ms"] = predicted and predicted * (size / self.request.size) ** 2
        return Row(name, main.text, main.kind, MEASURED, facts=facts)

    def _turn_of(self, row: Row, shown: Given) -> float:
        """Make a frame of another size and note its time."""
        with self._failing(row):
            start = time.perf_counter()
            self.opened[row.name].run(shown)
            row.seconds.append(time.perf_counter() - start)
        return row.seconds[-1] if row.seconds else 0.0

    def _hoped(self, name: str, size: int) -> float | None:
        """Return the time that a contender should need at a size; None where nothing is known of it."""
        known = {
            self.request.size: self.rows[name],
            **{at: rows[name] for at, rows in self.sizes.items() if name in rows},
        }
        measured = {at: statistics.median(row.seconds) for at, row in known.items() if row.seconds}
        if name not in self.opened or not measured:
            return None
        nearest = min(measured, key=lambda at: abs(at - size))
        return measured[nearest] * (size / nearest) ** 2

    # ---- quality, and the result --------------------------------------------------------------------------

    def _judge(self) -> None:
        """Note the quality of each contender's pictures of unseen frames."""
        model, pairs = self.request.model, self.request.pairs
        full = accuracy.full_quality(model, pairs)
        images = {id(noisy): given(model, noisy) for noisy, _ in pairs}
        for name, opened in list(self.opened.items()):
            if not pairs:
                break
            self.told(f"quality of {name}", 0.05 / len(self.opened))
            hoped = self._hoped(name, 1)
            pixels = sum(noisy.height * noisy.width for noisy, _ in pairs)
            if hoped is not None and hoped * pixels > self.request.budget_s:
                self.rows[name].facts["quality"] = None
                continue
            with self._failing(self.rows[name]):
                self.rows[name].facts["quality"] = accuracy.quality(
                    model,
                    pairs,
                    full,
                    lambda frame, o=opened: o.display(o.run(images[id(frame)])),  # type: ignore[misc]
                )

    def _begin_anew(self) -> None:
        """Note how long a first frame takes with empty caches, and with what a process before has left."""
        # A form that was trained has a kernel of another network: the process would not have it.
        by_name = {each.name: each.variant for each in self.contenders}
        for name in self.opened:
            if (variant := by_name[name]) and variant.model:
                continue
            self.told(f"first run of {name}", 0.05)
            never, later = first_runs(name, self.request.model, self.request.size)
            self.rows[name].facts |= {"first_run_s": never, "later_run_s": later}

    def as_data(self) -> dict[str, Any]:
        """Return all that is known so far as JSON's types; the keys are those of spec/bench.md."""
        request, model = self.request, self.request.model
        rows = [self._with_rates(row.as_data(), request.size) for row in self.rows.values()]
        by_name = {row["name"]: row for row in rows}
        fronts = {
            part: front({name: of_front(row, part, key, STEPS.get(part)) for name, row in by_name.items()})
            for part, key in FRONTS.items()
        }
        limits = self.limits
        found: dict[str, Any] = clean(
            {
                "schema": SCHEMA,
                "size_px": request.size,
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
                "limits_rounds_s": self.machine,
                "rates": {name: asdict(found) for name, found in self.found_rates.items()},
                "contenders": rows,
                "front": fronts,
                "sizes": [
                    {
                        "size_px": size,
                        "contenders": [self._with_rates(row.as_data(), size) for row in found.values()],
                    }
                    for size, found in sorted(self.sizes.items())
                ],
            }
        )
        return found

    def _with_rates(self, row: dict[str, Any], size: int) -> dict[str, Any]:
        """Return a row with what follows from its times at a size."""
        ms, limits, pixels = median_ms(row), self.limits, size * size
        if ms is None:
            return row
        counted = (row["kernel_ms"] or row["ms"])["median"]
        found: dict[str, Any] = {"frames_per_s": 1e3 / ms}
        if row.get("products") and limits:
            flops = 2 * row["products"] * pixels / (1e-3 * counted)
            memory = row["bytes"] * pixels / (1e-3 * counted)
            found |= {"gflops": 1e-9 * flops, "of_sgemm": flops / limits.flops_per_s}
            found |= {"of_memory": memory / limits.bytes_per_s}
        if row.get("predicted_ms"):
            found["predicted_over_measured"] = row["predicted_ms"] / ms
        if "first_frame_s" in row:
            found["compile_s"] = max(0.0, row["open_s"] + row["first_frame_s"] - 1e-3 * ms)
        return {**row, **found}
