"""Frames by the name of what renders them: the one place that knows how each executor traces paths.

1. The registry says how an executor renders, and whether it uses all cores by itself [`RENDERERS`].
2. [`render_frame`] renders all of a frame, or a band of rows of it.
3. A device stays open in the thread that opened it: opening it and building a kernel take longer than a
   small picture [`device_of`].
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Protocol

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


class RenderRows(Protocol):
    """Renders the rows of a job, on so many processes if it knows how."""

    def __call__(
        self,
        scene: Scene,
        job: Job,
        rows: Rows,
        workers: int | None,
        on_progress: Progress | None,
        frames: Frames | None,
    ) -> Render:
        """Return the rows [first, last) of the frame."""


@dataclass(frozen=True)
class Renderer:
    """How an executor renders; one that `shares_work` by itself gains nothing from more processes."""

    render_rows: RenderRows
    shares_work: bool


def _reference(
    scene: Scene,
    job: Job,
    rows: Rows,
    workers: int | None,
    on_progress: Progress | None,
    frames: Frames | None,
) -> Render:
    """Render by the definition, which compiles nothing; only all rows together are shared among processes."""
    if rows == (0, job.height) and workers != 1:
        return render_parallel(scene, job, workers=workers, on_progress=on_progress)
    keep_freed_memory()
    return render(scene, job, rows=rows, on_progress=on_progress)


_opened = threading.local()
"""The devices that are open, by name: a thread's own, since a graphics context belongs to one."""


def device_of(name: str) -> Executor:
    """Return this thread's device, open."""
    devices: dict[str, Executor] = _opened.__dict__
    if name not in devices:
        devices[name] = open_executor(name)
    return devices[name]


def _by_kernel(name: str) -> RenderRows:
    """Return how a device renders."""

    def render_rows(
        scene: Scene,
        job: Job,
        rows: Rows,
        workers: int | None,
        on_progress: Progress | None,
        frames: Frames | None,
    ) -> Render:
        return render_on(device_of(name), scene, job, rows=rows, on_progress=on_progress, frames=frames)

    return render_rows


RENDERERS: Mapping[str, Renderer] = {
    "numpy": Renderer(_reference, shares_work=False),
    **{name: Renderer(_by_kernel(name), shares_work=True) for name in ("opencl", "opengl", "c")},
}
"""What traces paths, by the executor's name: a new one is a line here."""


def renderer(executor: str) -> Renderer:
    """Return how an executor renders, or refuse its name."""
    if executor not in RENDERERS:
        raise InputError("executor that renders", executor, "unknown", choice(executor, RENDERERS))
    return RENDERERS[executor]


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

    The frame has the layer `sun` where the scene has one.

    `workers` is the number of processes that may share the work, None one per processor; it changes no bit. A
    device shares the work by itself, with none.
    """
    band = rows or (0, job.height)
    found = renderer(executor).render_rows(scene, job, band, workers, on_progress, frames)
    return replace(found, frame=with_sun(scene, found.frame))
