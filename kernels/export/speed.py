"""How long an export's denoiser takes on this machine, for its README: `wamnet export --measure` (EXP-16).

1. What runs the target's kernels here builds a text that no driver has seen: the seconds to compile it
   [`_unseen`].
2. It denoises a picture of the usual size several times; the images of the check pair, repeated, are its
   input [`repeated`].
"""

from __future__ import annotations

import secrets
import time
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from ...compiler.artifact import Artifact
from ...refimpl.errors import InputError
from ..bench.workload import repeated
from ..measure import PAUSE_S, Clock, Entry, take_turns
from .check import runner
from .host_runner import HostRunner
from .package import Export
from .targets import TARGETS

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
    the median of a program in C that is compiled without the advised options. Raises InputError for a target
    whose own kind of device nothing opens here, ExecutorUnavailable where it is missing on this machine.
    """
    check_measured(export.target)
    advised, *plain = TARGETS[export.target].timed or [()]
    found = _measured(export, size, rounds, clock, advised)
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


def check_measured(target: str) -> None:
    """Refuse a target of which nothing here runs what its users would run."""
    row = TARGETS.get(target)
    if row is None or row.stands_in:
        rule = "does not run on real hardware here, so a time would be meaningless"
        known = ", ".join(name for name, each in TARGETS.items() if not each.stands_in)
        raise InputError("--measure with target", target, rule, f"leave it out, or choose one of {known}")
