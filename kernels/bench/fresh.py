"""What the first run of all costs, in a process of its own whose caches of compiled code are empty folders.

A contender opens and makes a small frame; a second process does the same with the same folders, and tells
whether caches on disk save compiling [`first_runs`]. Packages are imported and the device is open by then.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from ...refimpl.network.denoise import Model
from ..measure import environment
from ..orphans import Worker, WorkerEnded
from .contenders import Tools, chosen, of_machine
from .workload import given, noise

CACHES = ("POCL_CACHE_DIR", "MESA_SHADER_CACHE_DIR", "TORCHINDUCTOR_CACHE_DIR", "XDG_CACHE_HOME", "HOME")
"""Variables that say where PoCL, Mesa, PyTorch, tinygrad, Dr.Jit and others keep what they have compiled."""

FRAME_PX = 64
"""Width and height of a denoiser's frame: what is compiled does not depend on it."""

SECONDS_AT_MOST = 180
"""When a process counts as hanging."""


def first_runs(name: str, model: Model, size: int) -> tuple[float | None, float | None]:
    """Return the seconds to a first frame with empty caches, and in a later process with the same ones.

    `size`: the width of the benchmark's pictures, by which names are given. None: it fails.
    """
    with empty_caches():
        return in_process(_denoiser, name, model, size), in_process(_denoiser, name, model, size)


@contextmanager
def empty_caches(names: Sequence[str] = CACHES) -> Iterator[None]:
    """Let compilers find nothing that they have compiled before.

    A process must not launch its first OpenCL kernel within and another afterwards: pyopencl opens a cache in
    the home folder at the first one, and keeps it open.
    """
    with tempfile.TemporaryDirectory() as folder:
        places = {name: str(Path(folder, name.lower())) for name in names}
        for place in places.values():
            Path(place).mkdir()
        with environment(places):
            yield


def in_process(work: Callable[..., float], *arguments: object) -> float | None:
    """Return the seconds that a function returns in a process of its own; None where it fails."""
    worker = Worker()
    try:
        return float(worker.call(SECONDS_AT_MOST, work, *arguments))
    except WorkerEnded:
        return None
    finally:
        worker.close()


def _denoiser(name: str, model: Model, size: int) -> float:
    """Return the seconds in which a contender opens and makes a small frame."""
    frame = given(model, noise(FRAME_PX))
    with Tools() as tools:
        (contender,) = chosen(of_machine(tools, size), [name], [])
        contender.prepare(tools)
        start = time.perf_counter()
        contender.open(tools, model, FRAME_PX).run(frame)
        return time.perf_counter() - start
