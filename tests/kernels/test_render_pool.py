"""Tests of the pool of render processes: nothing of it is left when it gives up."""

from __future__ import annotations

import multiprocessing
import threading

import pytest

from wamnet.kernels.run import render_pool
from wamnet.refimpl.light.render import Job
from wamnet.refimpl.light.scenes import canonical


def test_an_interrupt_leaves_neither_threads_nor_processes(monkeypatch) -> None:
    """A thread of the pool that closes its pipes while the interpreter ends is a traceback after the end."""

    def interrupt(*_arguments: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(render_pool, "_watch", interrupt)
    threads, processes = set(threading.enumerate()), set(multiprocessing.active_children())
    with pytest.raises(KeyboardInterrupt):
        render_pool.render_parallel(canonical("cornell"), Job(512, 512, 4), workers=2)
    assert set(threading.enumerate()) <= threads
    assert set(multiprocessing.active_children()) <= processes
