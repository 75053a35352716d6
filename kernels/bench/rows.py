"""Rows of the benchmark of denoisers as JSON's types, and which of them are worth choosing.

The keys are documented in spec/bench.md. A number that is not finite, or was not measured, is null.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

from ...refimpl.errors import ExecutorUnavailable, WamnetError
from ..measure import Clock, Entry, Times

SCHEMA = "wamnet-bench-2"
"""Name and version of the form of the data."""

MEASURED, MISSING, SKIPPED, FAILED, PENDING = "measured", "missing", "skipped", "failed", "pending"
"""States of a row: `pending` is one that an interrupted run has not come to."""

KERNEL, PEER = "kernel", "peer"
"""Kinds of rows: what this compiler makes, and what others make."""

MOST_TOLD = 200
"""Characters of a peer's error that are repeated."""


@dataclass
class Row(Entry):
    """An entry whose failure does not end the run: `state` says how far it got, `reason` why no further.

    `opened`: the contender that is ready, if it is [contenders.py]."""

    text: str = ""
    kind: str = KERNEL
    state: str = PENDING
    reason: str = ""
    kernel_seconds: list[float] = field(default_factory=list)
    opened: Any = None

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

    def as_data(self) -> dict[str, Any]:
        """Return the row as JSON's types."""
        # One that was interrupted between its first frame and its rounds has no time.
        state = PENDING if self.state == MEASURED and not self.seconds else self.state
        head = {"name": self.name, "text": self.text, "kind": self.kind, "state": state}
        times = {"ms": milliseconds(self.seconds), "kernel_ms": milliseconds(self.kernel_seconds)}
        found: dict[str, Any] = clean({**head, "reason": self.reason, **times, **self.facts})
        return found


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


def clean(value: Any) -> Any:
    """Return data with null in place of numbers that JSON does not know, and Python's own numbers."""
    if isinstance(value, Mapping):
        return {str(key): clean(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [clean(item) for item in value]
    if isinstance(value, bool | str | int) or value is None:
        return value
    number = float(value)
    return number if math.isfinite(number) else None
