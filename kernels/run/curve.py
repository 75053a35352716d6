"""Speed against error as measured points, and the choice among them.

1. A point is a variant under a schedule on an executor: its median time, how far its pictures are from the
   full network's in float64 (largest and mean difference of display-encoded colour), what it loses of the
   full network's PSNR against references, and what is proven for all images [`Point`].
2. A curve is a list of points of one model, device, size and profile, as JSON [`Curve`], [`from_data`]. It is
   kept in the user's cache folder under all that it depends on [`Curve.key`]; what is damaged, or of
   something else, is measured again [`cached`].
3. The choice: points that break no rule, the cheapest of them where an error is limited, the most accurate
   where only time is [`choose`]. A number that is missing or no number breaks every rule.
4. Every variant is measured under every schedule of an executor that may pay [`Measurement`]: the full
   network runs under each schedule on a small picture first, of which the [`MOST_SCHEDULES`] fastest remain.
   Errors and losses are those of the device's own kernels on given frames, against the full network in
   float64 [`quality`]; times are of random numbers, interleaved [measure.py].
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, fields, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...compiler import variants
from ...compiler.artifact import Artifact
from ...compiler.compile import compile_plan
from ...compiler.plan import Plan
from ...compiler.schedules.schedules import PLAIN
from ...refimpl import metrics
from ...refimpl.errors import CompileError, InputError
from ...refimpl.frame import Frame
from ...refimpl.network import dataset
from ...refimpl.network.denoise import Model, denoise
from ...refimpl.reading import parse_json, read_file, refusing, to_dataclass
from .. import cache
from ..devices.executor import Executor
from ..measure import in_turns
from .denoise_on import images_of
from .tune import TRIAL, Tuning, noise

SCHEMA = "wamnet-curve-1"
"""Name and version of a curve's form; described in spec/variants.md."""

LIMITED = {"max_error": "error_max", "max_ms": "milliseconds", "max_loss_db": "psnr_loss_db"}
"""The number of a point that each limit is about."""


@dataclass(frozen=True)
class Point:
    """One way to denoise; times in milliseconds, errors in display-encoded colour, NaN where unknown."""

    variant: str
    schedule: str
    executor: str
    milliseconds: float
    error_max: float
    error_mean: float
    psnr_loss_db: float
    error_bound: float

    @property
    def text(self) -> str:
        """Return the point for a reader."""
        return (
            f"{self.variant}, schedule {self.schedule}: {self.milliseconds:.4g} ms, "
            f"error {self.error_max:.3g}, PSNR loss {self.psnr_loss_db:.3g} dB"
        )


@dataclass(frozen=True)
class Curve:
    """Points of one model (digest of its program) on a device at a size (height, width) under a profile."""

    model: str
    device: str
    size: tuple[int, int]
    profile: str
    points: tuple[Point, ...]

    def as_data(self) -> dict[str, Any]:
        """Return the curve as JSON's types, null for what is not a finite number."""
        return {"schema": SCHEMA, **cache.clean(asdict(self))}

    def key(self, *others: object) -> str:
        """Return the name under which it is kept: of all that it depends on, such as frames."""
        head = (SCHEMA, self.model, self.device, list(self.size), self.profile)
        return f"curve-{cache.key(*head, *others)}"


@dataclass(frozen=True)
class Limits:
    """Rules for a choice, None for no rule: largest error (display-encoded colour), time (ms), loss (dB)."""

    max_error: float | None = None
    max_ms: float | None = None
    max_loss_db: float | None = None

    @property
    def rules(self) -> tuple[tuple[str, str, float], ...]:
        """Return (option, name of a point's number, limit) of the rules that there are."""
        given = ((f"--{key.replace('_', '-')}", LIMITED[key], limit) for key, limit in vars(self).items())
        return tuple((option, name, limit) for option, name, limit in given if limit is not None)


@dataclass(frozen=True)
class Choice:
    """The point that was chosen, and why others were not: (point, the rules that it breaks)."""

    point: Point
    rejected: tuple[tuple[Point, str], ...]


# ---- choosing ---------------------------------------------------------------------------------------------


def check_limits(limits: Limits) -> None:
    """Refuse limits that nothing can be checked against."""
    for option, name, limit in limits.rules:
        if not math.isfinite(limit) or (limit < 0 and name != "psnr_loss_db"):
            least = "finite" if name == "psnr_loss_db" else "finite and >= 0"
            raise InputError(option, limit, f"must be {least}", f"for example {option} 0.1")


def choose(points: Sequence[Point], limits: Limits) -> Choice:
    """Return the best point within the limits, or refuse with the nearest one.

    With a limit on errors the fastest, of equally fast ones the most accurate; else the most accurate, of
    equals the fastest. What is left of a tie is decided by the order of names.
    """
    check_limits(limits)
    broken = [(point, _broken(point, limits)) for point in points]
    fit = [point for point, rules in broken if not rules]
    if not fit:
        raise _nothing(points, limits)
    by_time = limits.max_error is not None or limits.max_loss_db is not None

    def order(point: Point) -> tuple[Any, ...]:
        error = (_known(point.error_max), _known(point.error_mean))
        time = (_known(point.milliseconds),)
        return (*(time + error if by_time else error + time), point.variant, point.schedule, point.executor)

    return Choice(min(fit, key=order), tuple((point, rules) for point, rules in broken if rules))


def _broken(point: Point, limits: Limits) -> str:
    """Return which rules a point breaks; NaN breaks each."""
    wrong = []
    for option, name, limit in limits.rules:
        value = getattr(point, name)
        if not value <= limit:
            wrong.append(f"{option} {limit:g} ({value:.4g})")
    # A point without a time has not run.
    if not math.isfinite(point.milliseconds) and limits.max_ms is None:
        wrong.append("no time")
    return ", ".join(wrong)


def _known(value: float) -> float:
    """Return a number that can be compared: what is unknown comes last."""
    return math.inf if math.isnan(value) else value


def _nothing(points: Sequence[Point], limits: Limits) -> InputError:
    """Return the error for limits that no point keeps, with the nearest: the least excess over its limits."""
    known = [point for point in points if math.isfinite(point.milliseconds)]
    wanted = ", ".join(f"{option} {limit:g}" for option, _, limit in limits.rules) or "a time"
    if not known:
        rule = "no point of the curve has a time"
        return InputError("curve", f"{len(points)} points", rule, "measure it again")

    def excess(point: Point) -> float:
        found = [
            _known(getattr(point, name)) / limit if limit > 0 else _known(getattr(point, name)) - limit + 1
            for _, name, limit in limits.rules
        ]
        return max(found, default=0.0)

    nearest = min(known, key=lambda point: (excess(point), point.milliseconds, point.variant))
    rule = f"no point of the curve keeps it; the nearest is {nearest.text}"
    return InputError("limit", wanted, rule, "allow more, or train a variant: wamnet train --variant")


# ---- files ------------------------------------------------------------------------------------------------


def from_data(data: Any, where: str) -> Curve:
    """Return the curve that JSON's data hold, or say what is wrong; numbers may be null, and are NaN then."""
    if not isinstance(data, Mapping) or data.get("schema") != SCHEMA:
        found = data.get("schema", "missing") if isinstance(data, Mapping) else type(data).__name__
        raise InputError(f"{where}: schema", found, f"must be {SCHEMA}", "give a curve that wamnet measured")
    names = [[field.name for field in fields(kind)] for kind in (Curve, Point)]
    rule, way_out = "a curve has model, device, size, profile and points", "measure it again"
    with refusing(f"{where}: content", "damaged", rule, way_out):
        # Keys of a point that are not here are another reader's.
        points = [{name: point[name] for name in names[1]} for point in data["points"]]
        held = {name: data[name] for name in names[0]} | {"points": points}
        curve = to_dataclass(Curve, held, where, special={float: _number})
        for point in curve.points:
            variants.parse(point.variant)
        return curve


def _number(value: Any, _path: str) -> float:
    """Return a point's number; NaN where it was not measured."""
    return math.nan if value is None else float(value)


def read(path: Any) -> Curve:
    """Read a curve from a file of JSON."""
    text = read_file(path, "curve file")
    return from_data(parse_json(text, f"curve file {path}", "measure it again"), str(path))


def check_fits(curve: Curve, wanted: Curve, where: str) -> None:
    """Refuse a curve of something else than what is to be chosen for."""
    for name in ("model", "profile"):
        has, wants = getattr(curve, name), getattr(wanted, name)
        if has != wants:
            rule = f"this one is for {wants}"
            raise InputError(f"{where}: {name}", has, rule, "give its own curve, or leave out --curve")


def cached(key: str, wanted: Curve) -> Curve | None:
    """Return the curve that is kept, if it is there, whole, and of what is wanted."""
    with suppress(InputError):
        curve = from_data(cache.read_json(key), key)
        if replace(curve, points=()) == replace(wanted, points=()):
            return curve
    return None


# ---- measuring --------------------------------------------------------------------------------------------


NAMES = (
    *("full", "sine9", "sine7", "sine5", "window10", "window8", "window6", "rank24", "rank16", "rank12"),
    *("window8+rank24", "window8+rank16", "window8+rank12", "window6+rank12", "window8+rank16+sine7"),
)
"""Variants that are measured when none are named; those that a model cannot have are left out."""

MOST_SCHEDULES = 2
"""Schedules that all variants are measured under."""

REPEATS = 5
"""Rounds of the measurement; their median counts."""

PAUSE_S = 0.05
"""Seconds before each run: no other library runs here whose threads would still spin."""

Pairs = Sequence[tuple[Frame, Frame]]
Done = Callable[[float], None]


def names_for(model: Model, wanted: Sequence[str] = NAMES) -> tuple[str, ...]:
    """Return the variants that this model can have."""
    found = []
    for name in wanted:
        with suppress(InputError):
            variants.vary(variants.parse(name), model)
            found.append(name)
    return tuple(found)


@dataclass(frozen=True)
class Measurement:
    """A model on an open device at a size (height, width); errors are those of `pairs`."""

    executor: Executor
    model: Model
    size: tuple[int, int]
    pairs: Pairs

    def curve(
        self,
        names: Sequence[str],
        repeats: int = REPEATS,
        on_done: Done = lambda share: None,
    ) -> Curve:
        """Return the points of variants under schedules that may be fast; `on_done` gets each one's share."""
        model = self.model
        pictures = [denoise(model, noisy, np.float64) for noisy, _ in self.pairs]
        chosen = self.promising()
        numbers = noise(self._plan().analysed, self.size)
        points: dict[str, Point] = {}
        ways: dict[str, Callable[[], object]] = {}
        for name in names:
            for schedule in chosen:
                artifact = _compiled(self._plan(schedule, name))
                if artifact is None:
                    continue
                given = {feature: numbers[feature] for feature in artifact.plan.model.features}
                key = f"{name} {schedule}"
                points[key] = self._untimed(artifact, pictures)
                ways[key] = partial(self.executor.run, artifact, given)
            on_done(1 / (len(names) + 1))
        times = in_turns(ways, repeats, pause_s=PAUSE_S)
        on_done(1 / (len(names) + 1))
        timed = (replace(points[key], milliseconds=1e3 * found.median) for key, found in times.items())
        device, digest = self.executor, variants.digest_of(model)
        return Curve(digest, device.device, self.size, device.profile, tuple(timed))

    def _plan(self, schedule: str = PLAIN, variant: str = variants.FULL) -> Plan:
        """Return the plan of a variant."""
        return variants.plan_model(self.model, self.executor.language, schedule, variant)

    def promising(self) -> tuple[str, ...]:
        """Return the schedules under which the full network is fastest on a small picture, the best first."""
        plan = self._plan()
        found = (_compiled(plan.scheduled(name)) for name in plan.target.schedules)
        small = Tuning(self.executor, plan.model, (TRIAL, TRIAL), plan.varied)
        trials = {artifact.plan.asked: small.trial(artifact) for artifact in found if artifact}
        return tuple(sorted(trials, key=trials.__getitem__)[:MOST_SCHEDULES])

    def _untimed(self, artifact: Artifact, full: Sequence[NDArray[np.floating]]) -> Point:
        """Return the point of a variant's kernel, which lacks its time."""
        plan, model = artifact.plan, artifact.plan.model
        pictures = [self.executor.run(artifact, images_of(model, noisy)) for noisy, _ in self.pairs]
        targets = [dataset.target_image(clean, model.normalization) for _, clean in self.pairs]
        found, bound = quality(pictures, full, targets), variants.bound_of(plan)
        most = math.nan if bound is None else float(bound.max())
        name = plan.varied.variant.name
        return Point(name, plan.asked, self.executor.name, math.nan, *found, most)


def quality(
    pictures: Sequence[NDArray[np.floating]],
    full: Sequence[NDArray[np.floating]],
    targets: Sequence[NDArray[np.floating]],
) -> tuple[float, float, float]:
    """Return the largest and the mean error of pictures (H, W, 3), and the mean PSNR that they lose in dB.

    All are NaN if a picture holds what is not a number.
    """
    if not all(np.isfinite(picture).all() for picture in pictures):
        return math.nan, math.nan, math.nan
    wide = [picture.astype(np.float64) for picture in pictures]
    errors = [np.abs(picture - wanted) for picture, wanted in zip(wide, full, strict=True)]
    losses = [
        metrics.psnr(wanted, target) - metrics.psnr(picture, target)
        for picture, wanted, target in zip(wide, full, targets, strict=True)
    ]
    mean = math.fsum(float(error.sum()) for error in errors) / sum(error.size for error in errors)
    return max(float(error.max()) for error in errors), mean, math.fsum(losses) / len(losses)


def _compiled(plan: Plan) -> Artifact | None:
    """Return the kernel of a plan, or None where its schedule or target cannot hold it."""
    try:
        artifact = compile_plan(plan)
    except CompileError:
        return None
    return artifact if artifact.manifest["schedule"]["name"] == plan.asked else None
