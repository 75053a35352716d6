"""A history on an executor: first hits by a path kernel, one picture more by the history's [`follow_on`].

1. The camera rays of a job's first sample are traced to what they meet: a path kernel of no scatterings whose
   planes are the state in which a path ends [`first_hits_on`].
2. Motions of primitives and both cameras become rows and numbers [`_motions`, `_cameras`]: they are the
   reference's, computed in float64.
3. The kernel gives the planes of the picture, which are a `History` again, so that either may continue what
   the other began. A first picture follows one that knows nothing [`_nothing`].

The definition is refimpl/light/history.py. A device may decide otherwise for a pixel whose ray passes an
edge, or whose place lies between two pixels, by less than the rounding error; elsewhere HIS-6 holds.
"""

from __future__ import annotations

from dataclasses import fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...compiler.kernel.interface import CAMERAS, FIRST, IMAGE, MOTIONS, PAST
from ...compiler.scenes.emit_path import planes
from ...compiler.scenes.history_kernel import compile_history
from ...refimpl import vectors
from ...refimpl.frame import Floats
from ...refimpl.light import history
from ...refimpl.light.camera import CameraBasis, camera_basis
from ...refimpl.light.history import LIMITS, First, History, Limits, Motion
from ...refimpl.light.render import Job
from ...refimpl.light.scene import Scene
from ..devices.executor import Executor
from ..devices.planes import followed
from .render_on import Frames, frames_of, sums_of

END = ("last_surface", "last_point", "last_normal", "last_direction")
"""Groups of planes of a path's end, which is its first surface where nothing scatters."""


def follow_on(
    executor: Executor,
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
    first = first_hits_on(executor, scene, job, frames)
    before = _nothing(scene, job, first) if past is None else past
    moves = history.motion(scene, before.scene)
    arrays = {
        FIRST: _stacked(first.number, first.point, first.normal, first.direction),
        PAST: _stacked(before.number, before.normal, before.color, before.count),
        f"{IMAGE}color": np.ascontiguousarray(color, np.float32),
        MOTIONS: _motions(moves, limits),
        CAMERAS: _cameras(scene, before.scene),
    }
    number, *normal, red, green, blue, count = followed(executor, compile_history(executor.language), arrays)
    mean = np.stack([red, green, blue], axis=-1)
    return History(scene, number.astype(np.int32), np.stack(normal, axis=-1), mean, count)


def first_hits_on(executor: Executor, scene: Scene, job: Job, frames: Frames | None = None) -> First:
    """Return the first hits (H, W) of a job's first sample."""
    unscattered = replace(job.settings, max_depth=0)
    plain = replace(job, spp=1, feature_spp=0, feature_sampler="", seen=False)
    plain = replace(plain, shadow_rays=0, settings=unscattered)
    moment = (frames or frames_of(scene)).of(executor, scene, plain, groups=END)
    sums = sums_of(executor, moment, plain)
    found = dict(zip(planes(END), sums, strict=True))
    point, normal, direction = (
        np.stack([found[f"last_{name}_{axis}"] for axis in "xyz"], axis=-1)
        for name in ("point", "normal", "direction")
    )
    surface = found["last_surface"].astype(np.int32)
    return First(vectors.look_up(history.surface_numbers(scene), surface), point, normal, direction)


def _nothing(scene: Scene, job: Job, first: First) -> History:
    """Return a picture that knows nothing: all of it shows "nothing", of no samples."""
    numbers = np.full_like(first.number, history.surface_numbers(scene)[-1])
    none = np.zeros((job.height, job.width, 3), np.float32)
    return History(scene, numbers, none, none, np.zeros_like(none[..., 0]))


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


def _cameras(scene: Scene, before: Scene) -> NDArray[np.float32]:
    """Return the numbers of both cameras."""
    bases = [camera_basis(each.camera, np.float32) for each in (scene, before)]
    parts = [np.ravel(getattr(basis, field.name)) for basis in bases for field in fields(CameraBasis)]
    return np.concatenate(parts, dtype=np.float32)
