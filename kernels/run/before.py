"""Pictures before one another: frames with the layers of history, of a film or of a data set.

1. Each picture of a film leaves a history for the next [`Film`].
2. A frame of a data set has so many pictures before it, 1 / PER_S apart, by samples that the frame itself
   does not use [`followed`]. Its other pictures are rendered by bands of rows [`carry_out`].
3. Any executor renders the pictures; one that has the history's kernel computes the history too, of first
   hits by a path kernel of no scatterings [`follow_on`]. Motions of primitives and both cameras are the
   reference's, in float64. Its planes are a `History` again: either may continue what the other began.

The definition is refimpl/light/history.py. A device may decide otherwise for a pixel whose ray passes an
edge, or whose place lies between two pixels, by less than the rounding error; elsewhere HIS-6 holds.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...compiler.kernel.interface import CAMERAS, FIRST, IMAGE, MOTIONS, PAST, RESULT
from ...compiler.scenes.emit_path import planes
from ...compiler.scenes.history_kernel import compile_history
from ...models.data.frame_plan import Picture, Task, version
from ...refimpl import vectors
from ...refimpl.errors import InputError
from ...refimpl.frame import HISTORY, Floats, Frame
from ...refimpl.light import history
from ...refimpl.light.camera import CameraBasis, camera_basis
from ...refimpl.light.history import LIMITS, First, History, Limits, Motion
from ...refimpl.light.render import Job
from ...refimpl.light.scene import Scene
from ..devices.executor import Executor
from ..devices.kernel import plane_integers
from .render_frame import REFERENCE, Progress, device_of, render_frame
from .render_on import Frames, frames_of

PER_S = 24.0
"""Pictures per second before a frame of a data set."""


def wants(features: Collection[str]) -> bool:
    """Tell whether a model reads layers of history."""
    return any(name in HISTORY for name in features)


@dataclass
class Film:
    """Pictures that follow each other, of one size; the first one begins a history.

    It is computed by the executor of this name where that has a kernel for it, else by the reference.
    `scenes` are those to come, where they are known: one kernel traces them all.
    """

    executor: str = REFERENCE
    scenes: Sequence[Scene] = ()
    past: History | None = None

    def __post_init__(self) -> None:
        self.frames = Frames(self.scenes)

    def add(self, scene: Scene, job: Job, frame: Frame) -> Frame:
        """Return the next frame with its layers of history.

        Raises InputError for a scene with other primitives than the last one's.
        """
        past, color, device = self.past, frame["color"], None
        if self.executor != REFERENCE and job.dtype == "float32":
            device = device_of(self.executor)
        if device is not None and device.smooths:
            self.past = follow_on(device, past, scene, job, color, frames=self.frames)
        elif past is None:
            self.past = history.begin(scene, job, color)
        else:
            self.past = history.follow(past, scene, job, color)
        return Frame({**frame.layers, **history.layers_of(self.past)}, frame.info)


def jobs_before(job: Job, count: int) -> Iterator[Job]:
    """Yield the jobs of so many pictures before a job's, the earliest first: of colour, by other samples."""
    plain = replace(job, feature_spp=0, feature_sampler="", seen=False, shadow_rays=0)
    return (replace(plain, first_sample=job.first_sample + job.spp * k) for k in range(count, 0, -1))


def followed(picture: Picture, on_progress: Progress | None = None) -> Frame:
    """Return a picture's frame with layers of history, after the pictures before it."""
    count, job = picture.before, picture.job
    scenes = [picture.scene_at((number - count) / PER_S) for number in range(count + 1)]
    film = Film(picture.request.executor, scenes)
    for each, now in zip([*jobs_before(job, count), job], scenes, strict=True):
        rendered = render_frame(film.executor, now, each, on_progress=on_progress, frames=film.frames).frame
        frame = film.add(now, each, rendered)
    return frame


def carry_out(task: Task, on_progress: Progress | None = None) -> Frame:
    """Render a task's rows; a worker that has another version of this package refuses."""
    if task.version != version():
        rule = f"the data set is made by {task.version}, and every worker must have the same"
        raise InputError("version of wamnet on a worker", version(), rule, "install that version there")
    picture = task.picture
    if picture.before:
        return followed(picture, on_progress)
    executor = picture.request.executor
    return render_frame(executor, picture.scene, picture.job, rows=task.rows, on_progress=on_progress).frame


# ---- a history on an executor -----------------------------------------------------------------------------


END = ("last_surface", "last_point", "last_normal", "last_direction")
"""Groups of planes of a path's end, which is its first surface where nothing scatters."""


def follow_on(
    device: Executor,
    past: History | None,
    scene: Scene,
    job: Job,
    color: Floats,
    limits: Limits = LIMITS,
    frames: Frames | None = None,
) -> History:
    """Return the history after a picture, of a linear colour (H, W, 3), that follows `past`; None: the first.

    `frames` may have the kernel that traces the scene. Raises InputError as history.begin and follow do.
    """
    history.check_picture(job, color, past)
    first = first_hits_on(device, scene, job, frames)
    before = past
    if before is None:
        # A picture that knows nothing: all of it shows "nothing", of no samples.
        numbers = np.full_like(first.number, history.surface_numbers(scene)[-1])
        none = np.zeros((job.height, job.width, 3), np.float32)
        before = History(scene, numbers, none, none, np.zeros_like(none[..., 0]))
    bases = [camera_basis(each.camera, np.float32) for each in (scene, before.scene)]
    cameras = [np.ravel(getattr(basis, field.name)) for basis in bases for field in fields(CameraBasis)]
    moves = history.motion(scene, before.scene)
    arrays = {
        FIRST: _stacked(first.number, first.point, first.normal, first.direction),
        PAST: _stacked(before.number, before.normal, before.color, before.count),
        f"{IMAGE}color": np.ascontiguousarray(color, np.float32),
        MOTIONS: _motions(moves, limits),
        CAMERAS: np.concatenate(cameras, dtype=np.float32),
    }
    kernel = compile_history(device.language)
    integers = plane_integers(kernel, (job.height, job.width))
    number, *normal, red, green, blue, count = device.call(kernel, arrays, integers)[RESULT]
    mean = np.stack([red, green, blue], axis=-1)
    return History(scene, number.astype(np.int32), np.stack(normal, axis=-1), mean, count)


def first_hits_on(device: Executor, scene: Scene, job: Job, frames: Frames | None = None) -> First:
    """Return the first hits (H, W) of a job's first sample."""
    unscattered = replace(job.settings, max_depth=0)
    plain = replace(job, spp=1, feature_spp=0, feature_sampler="", seen=False)
    plain = replace(plain, shadow_rays=0, settings=unscattered)
    moment = (frames or frames_of(scene)).of(device, scene, plain, groups=END)
    found = dict(zip(planes(END), moment.totals(plain, (0, job.height)).planes, strict=True))
    point, normal, direction = (
        np.stack([found[f"last_{name}_{axis}"] for axis in "xyz"], axis=-1)
        for name in ("point", "normal", "direction")
    )
    surface = found["last_surface"].astype(np.int32)
    return First(vectors.look_up(history.surface_numbers(scene), surface), point, normal, direction)


def _stacked(*parts: NDArray[Any]) -> NDArray[np.float32]:
    """Return planes (P, H, W) of arrays (H, W) and (H, W, 3)."""
    whole = [part[..., np.newaxis] if part.ndim == 2 else part for part in parts]
    return np.ascontiguousarray(np.moveaxis(np.concatenate(whole, axis=-1, dtype=np.float32), -1, 0))


def _motions(moves: Motion, limits: Limits) -> NDArray[np.float32]:
    """Return the rows (N + 1, columns) of primitives, and of "nothing"."""
    count = len(moves.rests)
    found = np.arange(count) < count - 1
    columns = [moves.turn.reshape(count, 9), moves.center, moves.shift]
    flags = [flag[:, np.newaxis] for flag in (moves.rests, limits.of(moves), found)]
    return np.concatenate([*columns, *flags], axis=1, dtype=np.float32)
