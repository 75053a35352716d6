"""Are test frames really unseen? What two frames show is compared before anything is rendered.

1. The first hits of a coarse grid of camera rays, the same for all frames, give each frame's normals and
   depths [`first_hits`]. Colours and noise do not count.
2. Two frames are alike if hardly a pixel differs in either [`difference`].
3. Test frames that are alike among each other, or nearly a training frame, are refused with the pair's names
   [`compare`]: whoever is judged on them is judged once, or on what was learned.
4. What is left is summed up: how far the nearest training frame is in geometry, time, camera and lamps
   [`Comparison`].
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...refimpl.errors import InputError
from ...refimpl.light.render import Job, render
from ...refimpl.light.scene import Camera, Scene
from ...refimpl.light.scenes import TURN_SECONDS
from ...refimpl.light.transport import Settings

GRID_PX = 48
"""Rays of the grid along each side: 2,304 of them tell frames apart that differ by a fifth of a degree,
and take a hundredth of a second."""

NORMAL_TOLERANCE = 2e-3
"""Largest difference of a component of two normals that counts as the same: a turn of a tenth of a degree."""

DEPTH_TOLERANCE = 1e-3
"""Largest relative difference of two depths that counts as the same."""

ALIKE = 0.01
"""Share of pixels that must differ for two frames to be different ones."""

Floats = NDArray[np.float32]

Hits = tuple[Floats, Floats]
"""Normals (GRID_PX, GRID_PX, 3) and depths (GRID_PX, GRID_PX)."""


def first_hits(scene: Scene) -> Hits:
    """Return normals and depths at the first hits of the grid of rays."""
    frame = render(scene, Job(GRID_PX, GRID_PX, settings=Settings(max_depth=0))).frame
    return frame["normal"], frame["depth"][..., 0]


def difference(one: Hits, other: Hits) -> float:
    """Return the share of rays whose normals or depths differ, in [0, 1]."""
    turned = np.abs(one[0] - other[0]).max(axis=-1) > NORMAL_TOLERANCE
    moved = np.abs(one[1] - other[1]) > DEPTH_TOLERANCE * np.maximum(one[1], other[1])
    return float(np.mean(turned | moved))


@dataclass(frozen=True)
class Shown:
    """A frame as it is compared: its name, its time in seconds, its scene."""

    name: str
    time_s: float
    scene: Scene


@dataclass(frozen=True)
class Comparison:
    """How far the nearest training frame is from test frames, each number by itself, nearest first.

    `differing` is the share of rays, `time_s` seconds modulo a turn, `camera_deg` the angle between positions
    as seen from what the camera looks at, `distance` the camera's distance as a factor, `lamps` the largest
    difference of a channel of a lamp's colour.
    """

    differing: float
    time_s: float
    camera_deg: float
    distance: float
    lamps: float

    def as_data(self) -> dict[str, float]:
        """Return the numbers rounded, as JSON's types."""
        return {name: round(value, 6) for name, value in vars(self).items()}


def compare(
    train: Sequence[Shown],
    tests: Mapping[str, Sequence[Shown]],
    on_progress: Callable[[int], None] = lambda frames: None,
) -> dict[str, Comparison]:
    """Return the comparison of each split of test frames, or refuse a pair that is alike.

    on_progress is called with the number of frames that were just looked at.
    """
    hits: dict[str, Hits] = {}
    for frame in (*train, *(frame for split in tests.values() for frame in split)):
        hits[frame.name] = first_hits(frame.scene)
        on_progress(1)
    seen: list[Shown] = []
    found = {}
    for split, frames in tests.items():
        for frame in frames:
            for other in (*train, *seen):
                if difference(hits[frame.name], hits[other.name]) < ALIKE:
                    what, same = (f"{shown.name} ({shown.time_s:g} s)" for shown in (frame, other))
                    rule = f"normals and depths are those of {same} in over 99 % of the pixels"
                    way_out = "move the camera (--yaw, --pitch, --distance) or the scene, choose another "
                    raise InputError("test frame", what, rule, f"{way_out}--seed, or --test 0")
            seen.append(frame)
        if frames and train:
            found[split] = _nearest(train, frames, hits)
    return found


def _nearest(train: Sequence[Shown], frames: Sequence[Shown], hits: Mapping[str, Hits]) -> Comparison:
    """Return the smallest of each distance over all pairs of a test and a training frame."""
    pairs = [(a, b) for a in frames for b in train]
    return Comparison(
        min(difference(hits[a.name], hits[b.name]) for a, b in pairs),
        min(_apart_s(a.time_s, b.time_s) for a, b in pairs),
        min(_angle_deg(a.scene.camera, b.scene.camera) for a, b in pairs),
        min(abs(_radius(a.scene.camera) / _radius(b.scene.camera) - 1.0) for a, b in pairs),
        min(_lamps_apart(a.scene, b.scene) for a, b in pairs),
    )


def _apart_s(one: float, other: float) -> float:
    """Return the seconds between two times of a turn."""
    apart = abs(one - other) % TURN_SECONDS
    return min(apart, TURN_SECONDS - apart)


def _away(camera: Camera) -> NDArray[Any]:
    """Return from where the camera looks, (3,)."""
    return np.subtract(camera.position, camera.look_at)


def _radius(camera: Camera) -> float:
    """Return how far the camera is from what it looks at."""
    return float(np.linalg.norm(_away(camera)))


def _angle_deg(one: Camera, other: Camera) -> float:
    """Return the angle between two cameras as seen from what they look at, by its tangent."""
    a, b = _away(one), _away(other)
    return math.degrees(math.atan2(float(np.linalg.norm(np.cross(a, b))), float(a @ b)))


def _lamps_apart(one: Scene, other: Scene) -> float:
    """Return the largest difference of a channel of a lamp's colour; 0 without lamps."""
    pairs = [(a.color, b.color) for a, b in zip(one.lights, other.lights, strict=True)]
    return max((abs(x - y) for a, b in pairs for x, y in zip(a, b, strict=True)), default=0.0)
