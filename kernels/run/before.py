"""Pictures before one another: frames with the layers of history, of a film or of a data set.

1. Each picture of a film leaves a history for the next [`Film`].
2. A frame of a data set has so many pictures before it, 1 / PER_S apart, by samples that the frame itself
   does not use [`followed`]. Its other pictures are rendered by bands of rows [`carry_out`].

A history is defined in refimpl/light/history.py. Any executor renders the pictures; one that has the
history's kernel computes the history too [follow_on.py].
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import replace

from ...models.data.frame_plan import Task, version
from ...refimpl.errors import InputError
from ...refimpl.frame import HISTORY, Floats, Frame
from ...refimpl.light import history
from ...refimpl.light.history import History
from ...refimpl.light.render import Job
from ...refimpl.light.scene import Scene
from .follow_on import follow_on
from .render_frame import REFERENCE, Progress, device_of, render_frame
from .render_on import Frames

PER_S = 24.0
"""Pictures per second before a frame of a data set."""


def wants(features: Collection[str]) -> bool:
    """Tell whether a model reads layers of history."""
    return any(name in HISTORY for name in features)


class Film:
    """Pictures that follow each other, of one size; the first one begins a history.

    It is computed by the executor of this name where that has a kernel for it, else by the reference.
    `scenes` are those to come, where they are known: one kernel traces them all.
    """

    def __init__(self, executor: str = REFERENCE, scenes: Sequence[Scene] = ()) -> None:
        self._past: History | None = None
        self._executor, self._frames = executor, Frames(scenes)

    def add(self, scene: Scene, job: Job, frame: Frame) -> Frame:
        """Return the next frame with its layers of history.

        Raises InputError for a scene with other primitives than the last one's.
        """
        self._past = self._next(scene, job, frame["color"])
        return Frame({**frame.layers, **history.layers_of(self._past)}, frame.info)

    def _next(self, scene: Scene, job: Job, color: Floats) -> History:
        """Return the history after a picture."""
        past = self._past
        if self._executor != REFERENCE and job.dtype == "float32":
            device = device_of(self._executor)
            if device.smooths:
                return follow_on(device, past, scene, job, color, frames=self._frames)
        return history.begin(scene, job, color) if past is None else history.follow(past, scene, job, color)


def jobs_before(job: Job, count: int) -> Iterator[Job]:
    """Yield the jobs of so many pictures before a job's, the earliest first: of colour, by other samples."""
    plain = replace(job, feature_spp=0, feature_sampler="", seen=False, shadow_rays=0)
    return (replace(plain, first_sample=job.first_sample + job.spp * k) for k in range(count, 0, -1))


def followed(
    executor: str,
    scene_at: Callable[[float], Scene],
    job: Job,
    count: int,
    on_progress: Progress | None = None,
) -> Frame:
    """Return a job's frame with layers of history after `count` pictures, of a scene by its time from now."""
    scenes = [scene_at((number - count) / PER_S) for number in range(count + 1)]
    film, kernels = Film(executor, scenes), Frames(scenes)
    for each, now in zip([*jobs_before(job, count), job], scenes, strict=True):
        rendered = render_frame(executor, now, each, on_progress=on_progress, frames=kernels).frame
        frame = film.add(now, each, rendered)
    return frame


def carry_out(task: Task, on_progress: Progress | None = None) -> Frame:
    """Render a task's rows; a worker that has another version of this package refuses."""
    if task.version != version():
        rule = f"the data set is made by {task.version}, and every worker must have the same"
        raise InputError("version of wamnet on a worker", version(), rule, "install that version there")
    picture = task.picture
    executor = picture.request.executor
    if picture.before:
        return followed(executor, picture.scene_at, picture.job, picture.before, on_progress)
    return render_frame(executor, picture.scene, picture.job, rows=task.rows, on_progress=on_progress).frame
