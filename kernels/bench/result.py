"""What a benchmark has found, as JSON's types, and which points of it are worth choosing.

The keys are documented in spec/bench.md. A number that is not finite, or was not measured, is null.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from ..measure import Times

SCHEMA = "wamnet-bench-2"
"""Name and version of the form of the data."""

MEASURED, MISSING, SKIPPED, FAILED, PENDING = "measured", "missing", "skipped", "failed", "pending"
"""States of a contender: `pending` is one that an interrupted run has not come to."""


KERNEL, PEER = "kernel", "peer"
"""Kinds of contenders: what this compiler makes, and what others make."""


@dataclass
class Row:
    """What is known of a contender; `state` says how far it got, `reason` why no further."""

    name: str
    text: str
    kind: str
    state: str = PENDING
    reason: str = ""
    facts: dict[str, Any] = field(default_factory=dict)
    seconds: list[float] = field(default_factory=list)
    kernel_seconds: list[float] = field(default_factory=list)

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
    on_it = [
        name
        for name, point in known.items()
        if not any(
            other[0] <= point[0] and other[1] <= point[1] and other != point for other in known.values()
        )
    ]
    return sorted(on_it, key=lambda name: known[name])


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


def median_ms(row: Mapping[str, Any]) -> float | None:
    """Return a row's median time, if it has one."""
    found: float | None = row["ms"] and row["ms"]["median"]
    return found


def of_front(
    row: Mapping[str, Any], part: str, key: str, step: float | None = None
) -> tuple[float | None, float | None]:
    """Return a row's median time, and a number of one of its parts, to the nearest multiple of a step."""
    found = (row.get(part) or {}).get(key)
    return median_ms(row), found if step is None or found is None else step * round(found / step)
