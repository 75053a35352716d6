"""Speed of the renderer: samples a second of the NumPy reference, of the kernels traced from it, of a peer.

1. Each way to render makes its first frame [`Way.first`]: reading the scene, compiling and all that happens
   once count there, with empty caches of compilers [`empty_caches`].
2. Then they take turns, so that drift of the machine's speed affects all of them alike [`measured`]. A turn
   ends when the frame is in memory as an array. Kernels write all layers and the variance, the peer only
   colours.
3. Turns have different seeds: their spread gives the error of a way's mean colour [`distance`].

A sample is one path: at every vertex but the last a shadow ray and a scattering. The peer is Mitsuba 3,
variant llvm_ad_rgb (vectors, all cores, Embree), all samples in one pass. Others are written by
hand: a program in C with Embree's packets of 16 rays, and functions compiled by Numba.
"""

from __future__ import annotations

import statistics
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from ...models.data.scene_source import scene_source
from ...refimpl.light.render import Job
from ...refimpl.light.scene import Scene
from ..devices.registry import open_executor
from ..measure import environment
from ..run.render_on import render_on
from ..run.render_pool import render_parallel
from . import peers

Frames = Callable[[int], Any]
"""From a seed to the colours (H, W, 3) of a frame."""

CACHES = {"POCL_CACHE_DIR": "pocl", "MESA_SHADER_CACHE_DIR": "mesa", "HOME": "home"}
"""Variables that say where PoCL, Mesa and Dr.Jit (in the home folder) keep what they have compiled."""

BY = ("numpy", "opencl", "opengl", "c", "mitsuba", "embree", "numba")
"""What can render."""

BY_HAND = ("embree", "numba")
"""Path tracers that were written as peers, for scenes of matte surfaces."""

VARIANT = "llvm_ad_rgb"
"""Mitsuba's variant: compiled, on vectors and all cores."""


@dataclass
class Way:
    """One way to render a scene: how it begins, and what was measured."""

    scene: str
    name: str
    begin: Callable[[], Frames]
    frames: Frames | None = None
    first_s: float = 0.0
    seconds: list[float] = field(default_factory=list)
    means: list[float] = field(default_factory=list)

    def first(self) -> None:
        """Make the first frame."""
        start = time.perf_counter()
        self.frames = self.begin()
        self.frames(0)
        self.first_s = time.perf_counter() - start

    def turn(self, seed: int) -> None:
        """Make another frame."""
        assert self.frames is not None
        start = time.perf_counter()
        colors = self.frames(seed)
        self.seconds.append(time.perf_counter() - start)
        self.means.append(float(np.mean(colors, dtype=np.float64)))


def ways_of(name: str, job: Job, by: Sequence[str], workers: Sequence[int]) -> list[Way]:
    """Return the ways to render a scene, in the order of `by`."""
    scene, ways = scene_source(name).at(), []
    for kind in by:
        if kind == "numpy":
            for count in dict.fromkeys(workers):
                text = f"numpy, {count} process{'es' if count > 1 else ''}"
                ways.append(Way(name, text, partial(_reference, scene, job, count)))
        elif kind == "mitsuba":
            ways.append(Way(name, f"mitsuba, {VARIANT}", partial(_peer, kind, scene, job)))
        elif kind in BY_HAND:
            ways.append(Way(name, f"{kind}, by hand", partial(_peer, kind, scene, job)))
        else:
            ways.append(Way(name, kind, partial(_kernel, kind, scene, job)))
    return ways


def measured(ways: Sequence[Way], repeats: int, done: Callable[[], None] = lambda: None) -> None:
    """Make the frames of all ways: the first ones, then the turns; `done` is called after each frame."""
    with empty_caches():
        for way in ways:
            way.first()
            done()
        for turn in range(repeats):
            for way in ways:
                way.turn(turn + 1)
                done()


def distance(way: Way, other: Way) -> float | None:
    """Return how far a way's mean colour is from another's in standard errors; none without a spread."""
    (mean, error), (its_mean, its_error) = (mean_and_error(each.means) for each in (way, other))
    both = float(np.hypot(error, its_error))
    return (mean - its_mean) / both if both > 0.0 else None


def mean_and_error(values: Sequence[float]) -> tuple[float, float]:
    """Return the mean of two or more numbers, and its standard error."""
    return statistics.fmean(values), statistics.stdev(values) / len(values) ** 0.5


@contextmanager
def empty_caches() -> Iterator[None]:
    """Let compilers find nothing that they have compiled before.

    A process must not launch its first OpenCL kernel within and another afterwards: pyopencl opens a cache in
    the home folder at the first one, and keeps it open.
    """
    with tempfile.TemporaryDirectory() as folder:
        for part in CACHES.values():
            Path(folder, part).mkdir()
        with environment({name: str(Path(folder, part)) for name, part in CACHES.items()}):
            yield


# ---- ways to render ----------------------------------------------------------------------------------------


def _reference(scene: Scene, job: Job, workers: int) -> Frames:
    """Return how the reference makes frames; start-up of processes counts in each."""
    return lambda seed: render_parallel(scene, replace(job, seed=seed), workers=workers).frame["color"]


def _kernel(name: str, scene: Scene, job: Job) -> Frames:
    """Return how a kernel makes frames."""
    executor = open_executor(name)
    return lambda seed: render_on(executor, scene, replace(job, seed=seed)).frame["color"]


def _peer(kind: str, scene: Scene, job: Job) -> Frames:
    """Return how another renderer makes frames."""
    render = peers.table().renderers[kind](scene, job.width, job.height, job.settings)
    return lambda seed: render(job.spp, seed)
