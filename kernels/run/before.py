"""Pictures before one another: frames with the layers of history, of a film or of a data set.

1. Each picture of a film leaves a history for the next [`Film`].
2. A frame of a data set has so many pictures before it, 1 / PER_S apart, by samples that the frame itself
   does not use [`followed`].

A history is defined in refimpl/light/history.py; any executor renders the pictures.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from dataclasses import replace

from ...refimpl.frame import HISTORY, Frame
from ...refimpl.light import history
from ...refimpl.light.history import History
from ...refimpl.light.render import Job
from ...refimpl.light.scene import Scene
from .render_frame import Progress, render_frame

PER_S = 24.0
"""Pictures per second before a frame of a data set."""

MOST_BEFORE = 256
"""Most pictures before a frame: at rest a history counts to 64, and studies to four times as many."""


def wants(features: Collection[str]) -> bool:
    """Tell whether a model reads layers of history."""
    return any(name in HISTORY for name in features)


class Film:
    """Pictures that follow each other, of one size; the first one begins a history."""

    def __init__(self) -> None:
        self._past: History | None = None

    def add(self, scene: Scene, job: Job, frame: Frame) -> Frame:
        """Return the next frame with its layers of history.

        Raises InputError for a scene with other primitives than the last one's.
        """
        color = frame["color"]
        past = self._past
        now = history.begin(scene, job, color) if past is None else history.follow(past, scene, job, color)
        self._past = now
        return Frame({**frame.layers, **history.layers_of(now)}, frame.info)


def jobs_before(job: Job, count: int) -> Iterator[Job]:
    """Yield the jobs of so many pictures before a job's, the earliest first: of colour, by other samples."""
    plain = replace(job, feature_spp=0, feature_sampler="", seen=False)
    return (replace(plain, first_sample=job.first_sample + job.spp * k) for k in range(count, 0, -1))


def followed(
    executor: str,
    scene_at: Callable[[float], Scene],
    job: Job,
    count: int,
    on_progress: Progress | None = None,
) -> Frame:
    """Return a job's frame with layers of history after `count` pictures, of a scene by its time from now."""
    film = Film()
    for number, each in enumerate(jobs_before(job, count)):
        scene = scene_at((number - count) / PER_S)
        film.add(scene, each, render_frame(executor, scene, each, on_progress=on_progress).frame)
    scene = scene_at(0.0)
    return film.add(scene, job, render_frame(executor, scene, job, on_progress=on_progress).frame)
