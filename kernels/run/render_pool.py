"""The reference renderer on several processes: the same bits as on one, sooner.

1. Rows are dealt out in bands [`bands`]; a band is an independent [`render`] of the reference.
2. Workers count finished samples in shared memory; the caller's progress function sees the sum
   [`render_parallel`].
3. The bands are joined top to bottom. A pixel's random numbers depend only on (seed, pixel, sample), so the
   number of workers does not change the image.
"""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable
from concurrent.futures import FIRST_EXCEPTION, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from typing import Any

from ...refimpl.errors import InputError
from ...refimpl.light.render import Job, Render, join_rows, render
from ...refimpl.light.scene import Scene
from ..memory import cores, keep_freed_memory
from ..orphans import end_with_parent, starting_workers

PROGRESS_INTERVAL_S = 0.2
"""Seconds between two looks at the workers' counter: smooth for a progress bar, free for the workers."""

BANDS_PER_WORKER = 2
"""Bands dealt to each worker: the second evens out unequal work, more would make the tiles small."""

LEAST_SAMPLES = 1 << 17
"""Samples below which one process is sooner done than others have started (about half a second)."""

_finished: Any = None
"""In a worker: the shared counter of finished samples."""


def render_parallel(
    scene: Scene,
    job: Job,
    *,
    workers: int | None = None,
    on_progress: Callable[[int], None] | None = None,
) -> Render:
    """Render a scene on `workers` processes (None: one per processor that this process may use).

    on_progress is called with the number of samples finished since the last call. Raises InputError for fewer
    workers than one, and when the system has ended one of them. An interrupt ends the workers and is passed
    on.
    """
    count = workers if workers is not None else cores()
    if count < 1:
        raise InputError("workers", count, "at least one process must work", "use 1 or more")
    parts = bands(job, count)
    keep_freed_memory()
    if count == 1 or len(parts) == 1 or job.samples < LEAST_SAMPLES:
        return render(scene, job, on_progress=on_progress)
    context = multiprocessing.get_context("spawn")
    counter = context.Value("Q", 0)
    others = set(multiprocessing.active_children())
    pool = ProcessPoolExecutor(count, context, _start_worker, (counter,))
    try:
        with starting_workers():
            futures = [pool.submit(_render_band, scene, job, rows) for rows in parts]
        _watch(futures, counter, on_progress)
        return join_rows([future.result() for future in futures])
    except BrokenProcessPool:
        rule = "one of these processes was ended from outside, perhaps for want of memory"
        raise InputError("workers", count, rule, "use fewer, or render a smaller frame") from None
    except BaseException:
        # A band may take minutes: do not wait for it.
        for worker in set(multiprocessing.active_children()) - others:
            worker.terminate()
        raise
    finally:
        # Wait: the workers are idle or ended. The pool's own thread, were it left to close its pipes while
        # this process exits, would meet the interpreter that wants to write into them.
        pool.shutdown(wait=True, cancel_futures=True)


def bands(job: Job, workers: int) -> list[tuple[int, int]]:
    """Return row ranges [first, last) of nearly equal height that cover the image."""
    rows = -(-job.height // (workers * BANDS_PER_WORKER))
    return [(first, min(first + rows, job.height)) for first in range(0, job.height, rows)]


def _watch(futures: list[Future[Render]], counter: Any, on_progress: Callable[[int], None] | None) -> None:
    """Wait until all bands are done or one has failed, and pass on what the workers count."""
    seen = 0
    pending = set(futures)
    while pending:
        done, pending = wait(pending, PROGRESS_INTERVAL_S, FIRST_EXCEPTION)
        now = counter.value
        if on_progress is not None and now > seen:
            on_progress(now - seen)
        seen = now
        if any(future.exception() is not None for future in done):
            break


def _start_worker(counter: Any) -> None:
    """Keep the shared counter in this worker, in which SIGINT is blocked: it ends with its parent."""
    end_with_parent()
    keep_freed_memory()
    global _finished  # noqa: PLW0603 - the pool's initializer has no other way to reach the tasks
    _finished = counter


def _render_band(scene: Scene, job: Job, rows: tuple[int, int]) -> Render:
    """Render a band in a worker."""

    def count(samples: int) -> None:
        with _finished.get_lock():
            _finished.value += samples

    return render(scene, job, rows=rows, on_progress=count)
