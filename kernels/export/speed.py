"""How long an export's denoiser takes on this machine, for its README: `wamnet export --measure` (EXP-16).

1. What runs the target's kernels here builds a text that no driver has seen: the seconds to compile it
   [`_unseen`].
2. It denoises a picture of the usual size several times; the images of the check pair, repeated, are its
   input [`_repeated`].
"""

from __future__ import annotations

import secrets
import time
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...compiler.artifact import Artifact
from ...refimpl.errors import InputError
from ..devices.executor import Executor
from ..measure import Clock, Times, in_turns
from .check import runner
from .package import Export
from .runners import WAYS

SIZE_PX = 512
"""Width and height of the picture, as in the project's tables of speed."""

ROUNDS = 3
"""Pictures that are timed, after the first."""

MS = 1e3
"""Milliseconds of a second."""


@dataclass(frozen=True)
class Speed:
    """Milliseconds of a picture: the median of `rounds`, the least and the most; and seconds to compile."""

    device: str
    size: int
    rounds: int
    ms: float
    least_ms: float
    most_ms: float
    compile_s: float

    def facts(self) -> dict[str, Any]:
        """Return the entry `speed` of a manifest."""
        return asdict(self)


def measure(
    export: Export, size: int = SIZE_PX, rounds: int = ROUNDS, clock: Clock = time.perf_counter
) -> Speed:
    """Return how long the denoiser takes for a picture of `size` x `size` pixels, copies there and back too.

    Raises InputError for a target whose own kind of device nothing opens here, ExecutorUnavailable where it
    is missing on this machine.
    """
    check_measured(export.target)
    assert export.denoiser is not None, "targets that are measured have kernels"
    denoiser = _unseen(export.denoiser)
    images = {name: _repeated(image, size) for name, image in export.pair.images.items()}
    with runner(export.target, denoiser.target) as opened:
        start = clock()
        opened.build(denoiser, (size, size))
        _run(opened, denoiser, images)
        first, ways = clock() - start, {"frame": lambda: _run(opened, denoiser, images)}
        found = in_turns(ways, rounds, warm=0, clock=clock)["frame"]
        # Some drivers compile when a kernel first runs: what that took beyond a picture is theirs.
        return _speed(WAYS[export.target].route + opened.device, size, found, max(0.0, first - found.median))


def _unseen(denoiser: Artifact) -> Artifact:
    """Return the kernel, or both of a rank, with a comment that is new: drivers keep what they compile."""
    before = denoiser.before and _unseen(denoiser.before)
    return replace(denoiser, source=f"{denoiser.source}\n/* {secrets.token_hex()} */\n", before=before)


def check_measured(target: str) -> None:
    """Refuse a target of which nothing here runs what its users would run."""
    way = WAYS.get(target)
    if way is None or way.stands_in:
        rule = "does not run on real hardware here, so a time would be meaningless"
        known = ", ".join(name for name, each in WAYS.items() if not each.stands_in)
        raise InputError("--measure with target", target, rule, f"leave it out, or choose one of {known}")


def _run(opened: Executor, denoiser: Artifact, images: Mapping[str, NDArray[np.float32]]) -> None:
    """Denoise once; nothing is returned, so that the round is timed as a whole."""
    opened.run(denoiser, images)


def _speed(device: str, size: int, times: Times, compiled: float) -> Speed:
    """Return the numbers of a README."""
    least, most = min(times.seconds), max(times.seconds)
    return Speed(device, size, len(times.seconds), MS * times.median, MS * least, MS * most, compiled)


def _repeated(image: NDArray[np.float32], size: int) -> NDArray[np.float32]:
    """Return an image (H, W, C) beside and below itself until it has size x size pixels."""
    height, width, _ = image.shape
    whole = np.tile(image, (-(-size // height), -(-size // width), 1))
    return np.ascontiguousarray(whole[:size, :size])
