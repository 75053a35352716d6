"""Choosing a variant of a model: by name, or from a curve of measured points.

The curve is a file's, or the user's cache folder's, or measured then and there and kept.
"""

import hashlib
from dataclasses import dataclass, replace
from pathlib import Path

from ...compiler import variants
from ...kernels import cache, open_executor
from ...kernels.run import curve
from ...kernels.run.curve import Curve, Limits
from ...refimpl.errors import NO_VALUE, InputError
from ...refimpl.network.denoise import Model
from ..common.request import KernelRequest, given
from ..common.terminal import progress, say
from ..files import dataset_files


@dataclass(frozen=True)
class Request:
    """What a choice is asked to keep, and where its curve comes from; None for what is not given."""

    max_error: float | None = None
    max_ms: float | None = None
    max_loss_db: float | None = None
    curve: Path | None = None
    frames: Path | None = None
    size: int | None = None

    @property
    def limits(self) -> Limits:
        """Return the limits."""
        return Limits(self.max_error, self.max_ms, self.max_loss_db)

    @property
    def limited(self) -> bool:
        """Return whether anything is to be chosen."""
        return self.limits != Limits(None, None, None)

    def check(self, variant: str | None) -> None:
        """Refuse options that contradict each other, or have nothing to act on."""
        named = list(given(self))
        if variant is not None and named:
            rule = f"{named[0]} chooses a variant itself"
            raise InputError("--variant", variant, rule, "leave out one of them")
        if named and not self.limited:
            rule, remedy = "a choice needs --max-error, --max-ms or --max-loss-db", f"leave out {named[0]}"
            raise InputError("list of options", ", ".join(named), rule, f"{remedy}, or give a limit")
        if self.curve is not None and (self.frames is not None or self.size is not None):
            rule = "its points are measured already"
            raise InputError("--curve", str(self.curve), rule, "leave out --frames and --size")
        curve.check_limits(self.limits)

    def choose(self, model: Model, network: KernelRequest, executor: str) -> KernelRequest:
        """Return a request with the variant and the schedule that the limits ask for; say which, and why."""
        found = self._curve(model, network, executor)
        points = [
            each
            for each in found.points
            if each.executor == executor and network.schedule in (None, each.schedule)
        ]
        choice = curve.choose(points, self.limits)
        height, width = found.size
        say(f"chosen: {choice.point.text} ({width}x{height} on {found.device})")
        for point, rules in choice.rejected:
            say(f"not {point.variant}, schedule {point.schedule}: {rules}")
        return replace(network, variant=choice.point.variant, schedule=choice.point.schedule)

    def _curve(self, model: Model, network: KernelRequest, executor: str) -> Curve:
        """Return the curve to choose from: a file's, the cache folder's, or one that is measured and kept."""
        digest = variants.digest_of(model)
        if self.curve is not None:
            found = curve.read(self.curve)
            wanted = Curve(digest, found.device, found.size, network.profile, ())
            curve.check_fits(found, wanted, str(self.curve))
            return found
        if self.frames is None:
            rule = "missing, and errors are measured on frames"
            raise InputError("--frames", NO_VALUE, rule, "name a data set, or a curve with --curve")
        pairs = dataset_files.read_pairs(self.frames, "test")
        if not pairs:
            rule = "has no test frames"
            raise InputError("--frames", str(self.frames), rule, "give a data set made with --test 1 or more")
        of_frames = hashlib.sha256((self.frames / dataset_files.MANIFEST).read_bytes()).hexdigest()
        names, size = curve.names_for(model), (self.size or 1024, self.size or 1024)
        with open_executor(executor) as runner:
            runner.profile = network.profile
            wanted = Curve(digest, runner.device, size, network.profile, ())
            key = wanted.key(runner.name, of_frames, names)
            if (kept := curve.cached(key, wanted)) is not None:
                say(f"curve: {len(kept.points)} points, measured before, cached in {cache.path_of(key)}")
                return kept
            with progress(f"measuring {len(names)} variants", 1.0) as advance:
                measured = curve.Measurement(runner, model, size, pairs)
                found = measured.curve(names, on_done=advance)
        path = cache.write_json(key, found.as_data())
        where = f"cached in {path}" if path else "not cached: no cache folder is writable"
        say(f"curve: {len(found.points)} points, measured now, {where}")
        return found
