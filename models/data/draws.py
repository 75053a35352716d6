"""What a data set draws for each frame, to train and for two kinds of test: a time, a camera, lamps.

1. Times follow the golden-ratio sequence over the animation, which no symmetry of a scene divides: every
   stretch of it is nearly even, and a longer one only adds times [`times`].
2. Camera, lamps' colours and their powers are uniform in their ranges, each from random words of its own, so
   that none depends on another or on time [`drawn`].
3. Frames `inside` the ranges continue these sequences after the training frames. Frames `outside` leave them
   in one respect at a time, in turn: a time in an arc of the turn that training leaves out, a camera beyond
   the range of yaw, lamps of more saturation [`drawn_outside`].

Source of the sequence: the additive recurrence of the golden ratio (H. Weyl, "Ueber die Gleichverteilung von
Zahlen mod. Eins", 1916); its steps have at most three lengths (three-distance theorem).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...refimpl.errors import InputError
from ...refimpl.light.scene import Light
from ...refimpl.light.variation import AT_REST, Ranges, Variation, lamp_color
from ...refimpl.rng import counter, random_block

DRAW_TAG = 0x44524157
"""Counter `block` of the words that draw frames ("DRAW" in ASCII); light paths use small numbers."""

GOLDEN = (math.sqrt(5.0) - 1.0) / 2.0
"""Step of the times as a share of the animation: the number that fractions approximate worst."""

POWER_DIMENSION = 1 << 16
"""First dimension of the lamps' powers: no scene has so many lamps that those of their colours reach it."""

BEYOND_DEG = 10.0
"""Degrees of yaw beyond the range of a camera that is outside."""

OUTSIDE_TIME, OUTSIDE_CAMERA, OUTSIDE_LAMPS = "time", "camera", "lamps"
"""What of a frame may be outside."""


@dataclass(frozen=True)
class Draw:
    """One frame's draw: its time in seconds, its variation, and what of it is outside ("" inside)."""

    time_s: float
    variation: Variation = AT_REST
    outside: str = ""


def _uniform(seed: int, frame: int, dimension: int) -> float:
    """Return a number in [0, 1): a function of data set, frame and dimension only."""
    words = random_block(*(counter(np.array([n])) for n in (seed, frame, dimension, DRAW_TAG)))
    return float(words[0][0]) / 2.0**32


def times(seed: int, start_s: float, seconds: float, first: int, count: int) -> list[float]:
    """Return times `first` to before `first + count` of the sequence over [start_s, start_s + seconds)."""
    begin = _uniform(seed, 0, 0)
    return [start_s + seconds * ((begin + (first + k) * GOLDEN) % 1.0) for k in range(count)]


def _between(limits: tuple[float, float], share: float) -> float:
    """Return the number at a share of the way; a range of one number is that number, to the bit."""
    low, high = limits
    return low + (high - low) * share if high > low else low


def _lamps(
    seed: int, frame: int, ranges: Ranges, lights: Sequence[Light]
) -> tuple[tuple[float, float, float], ...]:
    """Return a colour for each lamp: any hue of a saturation in its range, times a power in its range."""
    found = []
    for n, light in enumerate(lights):
        color = light.color
        if ranges.saturation is not None:
            share = _between(ranges.saturation, _uniform(seed, frame, 5 + 2 * n))
            color = lamp_color(color, _uniform(seed, frame, 4 + 2 * n), share)
        if ranges.power is not None:
            factor = _between(ranges.power, _uniform(seed, frame, POWER_DIMENSION + n))
            color = (factor * color[0], factor * color[1], factor * color[2])
        found.append(color)
    return tuple(found)


def variation_of(seed: int, frame: int, ranges: Ranges, lights: Sequence[Light]) -> Variation:
    """Return the camera and the lamps of a frame inside the ranges."""
    yaw, pitch, distance = (
        _between(limits, _uniform(seed, frame, dimension))
        for dimension, limits in enumerate((ranges.yaw_deg, ranges.pitch_deg, ranges.distance), start=1)
    )
    moved = ranges.saturation is not None or ranges.power is not None
    return Variation(yaw, pitch, distance, _lamps(seed, frame, ranges, lights) if moved else ())


def drawn(seed: int, ranges: Ranges, lights: Sequence[Light], first: int, count: int) -> list[Draw]:
    """Return the draws of frames number `first` to before `first + count`, inside the ranges."""
    start, end = ranges.time_s
    moments = times(seed, start, end - start, first, count)
    return [Draw(time, variation_of(seed, first + k, ranges, lights)) for k, time in enumerate(moments)]


def kinds_outside(ranges: Ranges, arc_s: float) -> list[str]:
    """Return what of a frame can be outside of these ranges: only what they move."""
    kinds = [OUTSIDE_TIME] if arc_s > 0.0 else []
    if ranges.yaw_deg[1] > ranges.yaw_deg[0]:
        kinds.append(OUTSIDE_CAMERA)
    if ranges.saturation is not None and ranges.saturation[1] < 1.0:
        kinds.append(OUTSIDE_LAMPS)
    return kinds


def drawn_outside(
    seed: int, ranges: Ranges, arc_s: float, lights: Sequence[Light], first: int, count: int
) -> list[Draw]:
    """Return draws outside the ranges, of each kind in turn; `arc_s` seconds follow the range of times.

    Cameras are BEYOND_DEG beyond the range of yaw, on both sides in turn.
    """
    kinds = kinds_outside(ranges, arc_s)
    if count and not kinds:
        rule = "a data set whose frames differ in time only, all of it trained on, has no outside"
        raise InputError("number of frames outside", count, rule, "give ranges or an arc, or request none")
    found = []
    for k, draw in enumerate(drawn(seed, ranges, lights, first, count)):
        kind, turn = kinds[k % len(kinds)], k // len(kinds)
        time, variation = draw.time_s, draw.variation
        if kind == OUTSIDE_TIME:
            time = ranges.time_s[1] + arc_s * _uniform(seed, first + k, 0)
        elif kind == OUTSIDE_CAMERA:
            low, high = ranges.yaw_deg
            variation = replace(variation, yaw_deg=high + BEYOND_DEG if turn % 2 else low - BEYOND_DEG)
        else:
            assert ranges.saturation is not None
            beyond = replace(ranges, saturation=(ranges.saturation[1], 1.0))
            variation = replace(variation, lights=_lamps(seed, first + k, beyond, lights))
        found.append(Draw(time, variation, kind))
    return found
