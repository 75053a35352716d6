"""Interleaved times of several ways to do one thing: drift of the machine affects all of them alike.

1. Each way runs `warm` times unmeasured.
2. In each of `repeats` rounds every way runs once, after a pause: threads of a library that ran before may
   spin for a while, and a processor that is hot slows down.
3. Medians are compared, or ratios of times of one round.
"""

from __future__ import annotations

import os
import statistics
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass

PAUSE_S = 0.3
"""Seconds before a measurement: threads of OpenMP and OpenBLAS spin for a while after their last work."""

Clock = Callable[[], float]


@dataclass(frozen=True)
class Times:
    """Seconds of each round."""

    seconds: tuple[float, ...]

    @property
    def median(self) -> float:
        """Return the median, in seconds."""
        return statistics.median(self.seconds)

    @property
    def spread(self) -> float:
        """Return (longest - shortest) / median."""
        return (max(self.seconds) - min(self.seconds)) / self.median


@contextmanager
def environment(values: Mapping[str, str]) -> Iterator[None]:
    """Set variables of the environment, also for what is started, and set them back."""
    before = {name: os.environ.get(name) for name in values}
    os.environ.update(values)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value


def rest(seconds: float) -> None:
    """Wait; tests, which assert no times, do without."""
    time.sleep(seconds)


def in_turns(
    ways: Mapping[str, Callable[[], float | None]],
    repeats: int,
    warm: int = 1,
    pause_s: float = PAUSE_S,
    clock: Clock = time.perf_counter,
) -> dict[str, Times]:
    """Return the times of each way; a way that returns a number has measured itself, in seconds."""
    for _ in range(warm):
        for way in ways.values():
            way()
    found: dict[str, list[float]] = {name: [] for name in ways}
    for _ in range(repeats):
        for name, way in ways.items():
            rest(pause_s)
            start = clock()
            own = way()
            found[name].append(clock() - start if own is None else own)
    return {name: Times(tuple(seconds)) for name, seconds in found.items()}
