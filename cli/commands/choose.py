"""Choosing a variant of a model: by name, or from a curve of measured points.

The curve is a file's, or the user's cache folder's, or measured then and there and kept.
"""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from ...compiler import variants
from ...kernels import cache, open_executor
from ...kernels.devices.executor import Executor
from ...kernels.run import curve, measure_curve
from ...kernels.run.curve import Choice, Curve, Limits
from ...refimpl.errors import NO_VALUE, InputError
from ...refimpl.frame import Frame
from ...refimpl.network.denoise import Model
from ..common.options import option
from ..common.request import given
from ..common.terminal import progress, say
from ..files import dataset_files

SMALLEST_PX, LARGEST_PX = 16, 4096
"""Sides of pictures on which times are taken."""


@dataclass(frozen=True)
class Request:
    """What a choice is asked to keep, and where its curve comes from; None for what is not given."""

    max_error: float | None = option(
        "E  Choose the fastest variant whose measured error is at most E: the largest difference in "
        "display-encoded colour (0 to 1) from the full float64 network, over the frames. [default: no limit]"
    )
    max_ms: float | None = option(
        "T  Choose the most accurate variant that takes at most T milliseconds on this machine. [default: no "
        "limit]"
    )
    max_loss_db: float | None = option(
        "D  Choose the fastest variant whose PSNR over the frames is at most D dB below the full network's. "
        "[default: no limit]"
    )
    curve: Path | None = option(
        "FILE  Choose from the measured points in this file (.json). [default: measured and cached]"
    )
    frames: Path | None = option("FOLDER  Data set; errors are measured on its test frames.")
    size: int | None = option("N  Frame size for the times: N x N pixels. [default: 1024]")

    @property
    def limited(self) -> bool:
        """Return whether anything is to be chosen."""
        return not (self.max_error is self.max_ms is self.max_loss_db is None)


def check_request(request: Request, variant: str | None) -> None:
    """Refuse options that contradict each other, or have nothing to act on."""
    named = list(given(request))
    if variant is not None and named:
        rule = f"{named[0]} chooses a variant itself"
        raise InputError("--variant", variant, rule, "leave out one of them")
    if named and not request.limited:
        rule = "a choice needs --max-error, --max-ms or --max-loss-db"
        raise InputError("list of options", ", ".join(named), rule, f"leave out {named[0]}, or give a limit")
    if request.curve is not None and (request.frames is not None or request.size is not None):
        rule = "its points are measured already"
        raise InputError("--curve", str(request.curve), rule, "leave out --frames and --size")
    if request.size is not None and not SMALLEST_PX <= request.size <= LARGEST_PX:
        rule = f"must be from {SMALLEST_PX} to {LARGEST_PX}"
        raise InputError("--size", request.size, rule, "for example --size 1024")
    curve.check_limits(_limits(request))


def choose(
    model: Model, request: Request, executor: str, profile: str, schedule: str | None
) -> tuple[str, str]:
    """Return the variant and the schedule that the limits ask for, and say what was chosen and why."""
    found = _curve(model, request, executor, profile)
    points = [point for point in found.points if point.executor == executor]
    if schedule is not None:
        points = [point for point in points if point.schedule == schedule]
    choice = curve.choose(points, _limits(request))
    _say(choice, found)
    return choice.point.variant, choice.point.schedule


def _limits(request: Request) -> Limits:
    """Return the limits of a request."""
    return Limits(request.max_error, request.max_ms, request.max_loss_db)


def _say(choice: Choice, found: Curve) -> None:
    """Say what was chosen, and which rule each other point broke."""
    height, width = found.size
    say(f"chosen: {choice.point.text} ({width}x{height} on {found.device})")
    for point, rules in choice.rejected:
        say(f"not {point.variant}, schedule {point.schedule}: {rules}")


def _curve(model: Model, request: Request, executor: str, profile: str) -> Curve:
    """Return the curve to choose from."""
    if request.curve is not None:
        found = curve.read(request.curve)
        wanted = Curve(variants.digest_of(model), found.device, found.size, profile, ())
        curve.check_fits(found, wanted, str(request.curve))
        return found
    if request.frames is None:
        rule = "missing, and errors are measured on frames"
        raise InputError("--frames", NO_VALUE, rule, "name a data set, or a curve with --curve")
    pairs, digest = _frames(request.frames)
    with open_executor(executor) as runner:
        return _kept_or_measured(model, runner, profile, request.size or 1024, pairs, digest)


def _frames(folder: Path) -> tuple[list[tuple[Frame, Frame]], str]:
    """Return the pairs on which errors are measured, a data set's test frames, and a name for them."""
    pairs = dataset_files.read_pairs(folder, "test")
    if not pairs:
        rule = "has no test frames"
        raise InputError("--frames", str(folder), rule, "give a data set made with --test 1 or more")
    manifest = (folder / dataset_files.MANIFEST).read_bytes()
    return pairs, hashlib.sha256(manifest).hexdigest()


def _kept_or_measured(
    model: Model,
    runner: Executor,
    profile: str,
    side: int,
    pairs: Sequence[tuple[Frame, Frame]],
    digest: str,
) -> Curve:
    """Return the curve from the cache folder, or measure it and keep it; say which."""
    names = measure_curve.names_for(model)
    wanted = Curve(variants.digest_of(model), runner.device, (side, side), profile, ())
    key = curve.key_of(wanted, runner.name, digest, names)
    if (kept := curve.cached(key, wanted)) is not None:
        say(f"curve: {len(kept.points)} points, measured before, cached in {cache.path_of(key)}")
        return kept
    with progress(f"measuring {len(names)} variants", 1.0) as advance:
        found = measure_curve.measure(runner, model, (side, side), profile, pairs, names, on_done=advance)
    path = cache.write_json(key, found.as_data())
    where = f"cached in {path}" if path else "not cached: no cache folder is writable"
    say(f"curve: {len(found.points)} points, measured now, {where}")
    return found
