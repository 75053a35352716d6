"""Frames by the name of what renders them: the one place that knows how each executor traces paths.

1. The registry names what renders, and which of it uses all cores by itself [`RENDERERS`, `shares_work`].
2. [`render_frame`] renders all of a frame, or a band of rows of it.
3. A device stays open in the thread that opened it: opening it and building a kernel take longer than a
   small picture [`device_of`].
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import replace

from ...models.data.frame_plan import Rows
from ...refimpl.errors import InputError, choice
from ...refimpl.light.environment import with_sun
from ...refimpl.light.render import Job, Render, render
from ...refimpl.light.scene import Scene
from ..devices.executor import Executor
from ..devices.registry import open_executor
from ..memory import keep_freed_memory
from .render_on import Frames, render_on
from .render_pool import render_parallel

Progress = Callable[[int], None]
"""Called with the number of samples that were just finished."""

REFERENCE, DEVICES = "numpy", ("opencl", "opengl", "c")
"""Executors that trace paths: the reference, on any number of processes, and kernels' devices."""

RENDERERS = (REFERENCE, *DEVICES)
"""What traces paths, by the executor's name: a new one is a name among the devices."""

_opened = threading.local()
"""The devices that are open, by name: a thread's own, since a graphics context belongs to one."""


def device_of(name: str) -> Executor:
    """Return this thread's device, open."""
    devices: dict[str, Executor] = _opened.__dict__
    if name not in devices:
        devices[name] = open_executor(name)
    return devices[name]


def shares_work(renderer: str) -> bool:
    """Return whether a renderer uses all cores by itself, without processes; or refuse its name."""
    if renderer not in RENDERERS:
        raise InputError("executor that renders", renderer, "unknown", choice(renderer, RENDERERS))
    return renderer in DEVICES


def render_frame(
    executor: str,
    scene: Scene,
    job: Job,
    *,
    rows: Rows | None = None,
    workers: int | None = 1,
    on_progress: Progress | None = None,
    frames: Frames | None = None,
) -> Render:
    """Render a scene on an executor: all rows, or the band [first, last); `frames` may have its kernel.

    The frame has the layer `sun` where the scene has one. `workers` is the number of processes that may share
    all rows of the reference, None one per processor; it changes no bit.
    """
    band = rows or (0, job.height)
    if shares_work(executor):
        device = device_of(executor)
        found = render_on(device, scene, job, rows=band, on_progress=on_progress, frames=frames)
    elif band == (0, job.height) and workers != 1:
        found = render_parallel(scene, job, workers=workers, on_progress=on_progress)
    else:
        keep_freed_memory()
        found = render(scene, job, rows=band, on_progress=on_progress)
    return replace(found, frame=with_sun(scene, found.frame))
