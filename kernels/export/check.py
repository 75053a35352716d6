"""Hold an export to its promise: compile it by its own tools, run it, compare with the check pair, time it.

1. Tools that compile or validate the files are run; one that is missing is a verdict and no error
   [`targets.Tool`].
2. What is nearest to the target runs the denoiser on the pair's images [`runner`]; each number must lie
   within the pair's bound, be its bits where that is 0. With a scene its paths are run too, and compared
   with the reference's sums [`_paths`].
3. On request it builds a text that no driver has seen and denoises a picture of the usual size several times
   [`measure`] (EXP-16).
"""

from __future__ import annotations

import secrets
import tempfile
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...compiler.artifact import Artifact
from ...compiler.core.ir import sha256
from ...refimpl.errors import CompileError, ExecutorUnavailable, InputError
from ..bench.workload import repeated
from ..devices.executor import Executor
from ..devices.kernel import Part
from ..measure import PAUSE_S, Clock, Entry, take_turns
from . import onnx_export
from .check_pair import PATHS_ALIKE, PATHS_WITHIN, SEED
from .host_runner import HostRunner
from .package import Export, Request
from .targets import ONNX, TARGETS, Row, opened


@dataclass(frozen=True)
class Verdict:
    """What was found: `compiled` and `executed` name tools and device, or say what was missing or wrong.

    `error` is the largest error, `bound` the largest of the pair's bounds, `share` the largest error / bound,
    `paths` the share of the sums that agree, `digest` the SHA-256 of the picture.
    """

    target: str
    weights: str
    size: int
    compiled: str
    executed: str
    error: float | None = None
    bound: float | None = None
    promised: bool = True
    share: float | None = None
    paths: float | None = None
    wrong: str = ""
    digest: str = ""

    @property
    def holds(self) -> bool:
        """Return whether nothing that was tried has failed."""
        return not self.wrong

    def cells(self) -> tuple[str, ...]:
        """Return the row of a table: target, weights, emitted, compiled, executed, error, bound, paths."""
        bound = _number(self.bound) + ("" if self.promised else ", expected")
        return (
            self.target,
            self.weights,
            f"{self.size / 1000:.0f} kB",
            self.compiled,
            self.executed,
            _number(self.error),
            bound if self.bound is not None else "-",
            "-" if self.paths is None else f"{self.paths:.1%}",
        )


HEAD = ("target", "weights", "emitted", "compiled by", "executed on", "error", "bound", "paths alike")
"""The heads of such a table."""


def _number(value: float | None) -> str:
    """Return an error for a table; 0 is exact."""
    return "-" if value is None else f"{value:.1e}" if value else "0"


def check(export: Export) -> Verdict:
    """Return the verdict of an export."""
    kernels = [n for kernel in export.manifest["kernels"] for n in kernel["files"]]
    size = sum(len(export.files[name]) for name in kernels)
    known = (export.target, export.manifest["weights"]["where"], size)
    compiled, wrong = _compiled(export)
    if wrong:
        return Verdict(*known, "refused", "-", wrong=wrong)
    try:
        device, found, paths = _executed(export)
    except ExecutorUnavailable as error:
        return Verdict(*known, compiled, f"missing: {error}")
    except CompileError as error:
        return Verdict(*known, compiled, "refused", wrong=str(error))
    pair = export.pair
    off = np.abs(found.astype(np.float64) - pair.output)
    with np.errstate(divide="ignore"):
        # No error is a share of 0 even of a bound 0; any other is infinite then.
        share = float(np.max(np.divide(off, pair.bound, out=np.zeros_like(off), where=off != 0)))
    times = f"{share:.3g} times the bound" if pair.bound.any() else "where each bit is promised"
    wrong = "" if share <= 1 else f"off by {off.max():.3g}, {times}"
    if paths is not None and not paths >= PATHS_ALIKE:
        wrong = wrong or f"{paths:.1%} of the paths' sums agree, of at least {PATHS_ALIKE:.0%}"
    numbers = (float(off.max()), float(pair.bound.max()))
    return Verdict(*known, compiled, device, *numbers, pair.promised, share, paths, wrong, digest_of(found))


def digest_of(picture: NDArray[np.float32]) -> str:
    """Return the SHA-256 of a picture as raw little-endian float32, as `check/output.f32` holds one."""
    return sha256(np.ascontiguousarray(picture, "<f4").tobytes())


UNTOLD: Mapping[str, str] = {"metal": "none of Apple's here", "onnx": "onnx.checker"}
"""What the table says of targets without tools here, and whose files a package has checked."""


def _compiled(export: Export) -> tuple[str, str]:
    """Return which tools took the files, and what one of them refused."""
    if export.target == ONNX or (tool := TARGETS[export.target].tool) is None:
        return UNTOLD.get(export.target, "the device's compiler"), ""
    with tempfile.TemporaryDirectory(prefix="wamnet-check-") as name:
        folder = Path(name)
        for path, data in export.files.items():
            (folder / path).parent.mkdir(parents=True, exist_ok=True)
            (folder / path).write_bytes(data)
        try:
            for path in (name for kernel in export.manifest["kernels"] for name in kernel["files"]):
                if path.endswith(tool.suffix):
                    tool.take(folder, path, *tool.options)
        except ExecutorUnavailable as error:
            return f"missing: {error}", ""
        except CompileError as error:
            return "", str(error)
    return tool.title, ""


def runner(row: Row, kernel: str) -> Executor:
    """Return what runs a target's kernels here; `kernel` is the compiler's name of target and place."""
    found = opened(*row.opens)
    home = kernel.partition(":")[2]
    if home and home not in found.homes:
        found.close()
        raise ExecutorUnavailable(f"no runner for {row.name} with this storage of the weights is installed")
    return found


def _executed(export: Export) -> tuple[str, NDArray[np.float32], float | None]:
    """Return the device, the picture that an export makes of the pair's images, and how paths compare."""
    pair = export.pair
    if export.denoiser is None:
        data = export.files["denoise/denoise.onnx"]
        device, found = onnx_export.run_graph(data, pair.images)
        return device, found, None
    row = TARGETS[export.target]
    with runner(row, export.denoiser.target) as device:
        found = device.run(export.denoiser, pair.images)
        return row.route + device.device, found, _paths(export, device)


def _paths(export: Export, device: Any) -> float | None:
    """Return the share of the sums, or of encoded numbers, that only rounding moves off the reference."""
    height, width, _ = export.pair.output.shape
    if export.passes:
        values = {"iFrame": SEED, "seed_number": SEED, "width": width, "height": height}
        drawn = {name: device.draw(text, (height, width), values) for name, text in export.passes.items()}
        held = export.pair.images
        near = [np.abs(drawn[n][..., : held[n].shape[2]] - held[n]) <= PATHS_WITHIN for n in drawn]
        return float(np.mean([x.mean() for x in near]))
    if export.path is None or export.pair.sums is None:
        return None
    part = Part(width, height, 0, height, 0, 1, SEED)
    wanted = [(None, export.pair.sums), *((moment.numbers, moment.sums) for moment in export.pair.moments)]
    alike = []
    for numbers, sums in wanted:
        off = np.abs(device.trace(export.path, part, numbers) - sums)
        alike.append(float((off <= PATHS_WITHIN * np.maximum(1, np.abs(sums))).mean()))
    return min(alike)


# ---- speed ------------------------------------------------------------------------------------------------


SIZE_PX = 512
"""Width and height of the picture, as in the project's tables of speed."""

ROUNDS = 3
"""Pictures that are timed, after the first."""

MS = 1e3
"""Milliseconds of a second."""


def measure(
    export: Export, size: int = SIZE_PX, rounds: int = ROUNDS, clock: Clock = time.perf_counter
) -> dict[str, Any]:
    """Return the entry `speed` of a manifest: what a picture of `size` x `size` pixels takes, with copies.

    It has milliseconds, the median of `rounds`, the least and the most; seconds to compile; and `plain_ms`,
    the median of a program in C that is compiled with -O2 alone. Raises InputError for a target
    whose own kind of device nothing opens here, ExecutorUnavailable where it is missing on this machine.
    """
    check_measured(export.request)
    native, *plain = TARGETS[export.target].timed or [()]
    found = _measured(export, size, rounds, clock, native)
    for options in plain:
        found["plain_ms"] = _measured(export, size, rounds, clock, options)["ms"]
    return found


def _measured(export: Export, size: int, rounds: int, clock: Clock, options: Sequence[str]) -> dict[str, Any]:
    """Return how long the denoiser takes, compiled with options."""
    assert export.denoiser is not None, "targets that are measured have kernels"
    denoiser = _unseen(export.denoiser)
    images = {name: repeated(image, size) for name, image in export.pair.images.items()}
    with runner(TARGETS[export.target], denoiser.target) as opened:
        if isinstance(opened, HostRunner):
            opened.last = options

        def picture(_number: int) -> None:
            opened.run(denoiser, images)

        entry = Entry("denoiser", round=picture)
        start = clock()
        opened.build(denoiser, (size, size))
        picture(0)
        first = clock() - start
        take_turns([entry], rounds, PAUSE_S, clock=clock)
        median, ms = entry.times.median, [MS * seconds for seconds in entry.seconds]
        # Some drivers compile when a kernel first runs: what that took beyond a picture is theirs.
        device = " ".join([TARGETS[export.target].route + opened.device, *options])
        compiled = max(0.0, first - median)
        times = {"ms": MS * median, "least_ms": min(ms), "most_ms": max(ms), "compile_s": compiled}
        return {"device": device, "size": size, "rounds": rounds, **times}


def _unseen(denoiser: Artifact) -> Artifact:
    """Return the kernel, or both of a rank, with a comment that is new: drivers keep what they compile."""
    before = denoiser.before and _unseen(denoiser.before)
    return replace(denoiser, source=f"{denoiser.source}\n/* {secrets.token_hex()} */\n", before=before)


def check_measured(request: Request) -> None:
    """Refuse a target of which nothing here runs what its users would run."""
    target, row = request.target, TARGETS.get(request.target)
    if row is None or row.stands_in:
        rule = "does not run on real hardware here, so a time would be meaningless"
        known = ", ".join(name for name, each in TARGETS.items() if not each.stands_in)
        raise InputError("--measure with target", target, rule, f"leave it out, or choose one of {known}")
