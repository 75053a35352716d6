"""Interleaved times of several entries, or ways to do one thing: drift of the machine affects all alike.

1. Each entry opens and does its work `warm` times unmeasured [`begin`], then all take turns [`take_turns`].
2. In each of `repeats` rounds every entry works once, after a pause: threads of a library that ran before may
   spin for a while, and a processor that is hot slows down [`take_turns`].
3. Medians are compared, or ratios of times of one round.
"""

from __future__ import annotations

import os
import statistics
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

PAUSE_S = 0.3
"""Seconds before a measurement: threads of OpenMP and OpenBLAS spin for a while after their last work."""

Clock = Callable[[], float]
Round = Callable[[int], Any]
"""The work of a round by its number, 0 for one that is not measured; a float is the seconds by itself."""


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


@dataclass
class Entry:
    """A row of a measurement: how it opens, who does the work (`by`), and what was measured.

    `first_s`: seconds until it was open and had done its unmeasured rounds; `most`: rounds that it takes part
    in. An entry without a `round` is not open, or out.
    """

    name: str
    open: Callable[[], Round] | None = None
    by: str = ""
    facts: dict[str, Any] = field(default_factory=dict)
    seconds: list[float] = field(default_factory=list)
    first_s: float = 0.0
    most: int = sys.maxsize
    round: Round | None = None

    @property
    def times(self) -> Times:
        """Return the seconds of all rounds."""
        return Times(tuple(self.seconds))

    def turn(self, number: int, clock: Clock) -> None:
        """Do a round, and note its seconds."""
        assert self.round is not None
        start = clock()
        own = self.round(number)
        self.seconds.append(own if isinstance(own, float) else clock() - start)


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


def begin(entries: Iterable[Entry], warm: int = 1, done: Callable[[], None] = lambda: None) -> None:
    """Open entries and let each do its unmeasured rounds."""
    for entry in entries:
        assert entry.open is not None
        start = time.perf_counter()
        entry.round = entry.open()
        for _ in range(warm):
            entry.round(0)
        entry.first_s = time.perf_counter() - start
        done()


def take_turns(
    entries: Sequence[Entry],
    repeats: int,
    pause_s: float = 0.0,
    done: Callable[[], None] = lambda: None,
    clock: Clock = time.perf_counter,
) -> None:
    """Let all open entries work in turn; `done` is called after each."""
    for number in range(1, repeats + 1):
        for entry in entries:
            if entry.round is not None and number <= entry.most:
                rest(pause_s)
                entry.turn(number, clock)
            done()


def in_turns(
    ways: Mapping[str, Callable[[], Any]],
    repeats: int,
    warm: int = 1,
    pause_s: float = PAUSE_S,
    clock: Clock = time.perf_counter,
) -> dict[str, Times]:
    """Return the times of each way; a way that returns a float has measured itself, in seconds."""
    for _ in range(warm):
        for way in ways.values():
            way()
    entries = [Entry(name, round=lambda _, way=way: way()) for name, way in ways.items()]  # type: ignore[misc]
    take_turns(entries, repeats, pause_s, clock=clock)
    return {entry.name: entry.times for entry in entries}
