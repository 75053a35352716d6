"""Speed of the renderer: samples a second of the NumPy reference, of the kernels traced from it, of a peer.

    python bench/render.py --size 512 --spp 2 --repeats 5
    python bench/render.py --scenes minicubes --by numpy opencl opengl mitsuba --workers 2 --spp 16

1. Each way to render makes its first frame [`Way.begin`]: reading the scene, compiling and all that happens
   once count there, with empty caches of compilers [`empty_caches`].
2. Then they take turns, so that drift of the machine's speed affects all of them alike. A turn ends when the
   frame is in memory as an array. Kernels write all layers and the variance, the peer only colours.
3. Printed are the machine, the median and the range, samples a second, and their ratio to the last way's;
   then how far each way's mean colour is from the first's, in standard errors that come from the spread of
   the turns, whose seeds differ.

A sample is one path with up to --depth edges: at every vertex but the last a shadow ray and a scattering. The
peer is Mitsuba 3, variant llvm_ad_rgb (vectors, both cores, Embree), all samples in one pass.
"""

from __future__ import annotations

import argparse
import os
import statistics
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import mitsuba_scene
import numpy as np

from wamnet.cli.reports import machine
from wamnet.kernels import open_executor, render_on
from wamnet.kernels.run.render_pool import render_parallel
from wamnet.refimpl.light.render import Job
from wamnet.refimpl.light.scene import Scene
from wamnet.refimpl.light.scenes import CANONICAL, canonical
from wamnet.refimpl.light.transport import Settings

Frames = Callable[[int], Any]
"""From a seed to the colours (H, W, 3) of a frame."""

CACHES = {"POCL_CACHE_DIR": "pocl", "MESA_SHADER_CACHE_DIR": "mesa", "HOME": "home"}
"""Variables that say where PoCL, Mesa and Dr.Jit (in the home folder) keep what they have compiled."""


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


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure and print the tables."""
    given = _parsed(arguments)
    job = Job(given.size, given.size, given.spp, settings=Settings(max_depth=given.depth - 1))
    with empty_caches():
        ways = [way for scene in given.scenes for way in _ways(scene, job, given.by, given.workers)]
        for way in ways:
            way.first()
        for turn in range(given.repeats):
            for way in ways:
                way.turn(turn + 1)
    facts = [
        *(f"{name} {value}" for name, value in machine.describe().items()),
        f"NumPy {np.__version__}",
        f"{given.size}x{given.size}, {given.spp} spp, {given.depth} edges",
    ]
    print(", ".join(facts) + "\n")
    for scene in given.scenes:
        _print([way for way in ways if way.scene == scene], given.size**2 * given.spp)


def _parsed(arguments: Sequence[str] | None) -> argparse.Namespace:
    """Return the options."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--scenes", nargs="+", default=["minicubes", "cornell"], choices=list(CANONICAL))
    parser.add_argument("--workers", nargs="+", type=int, default=[1, len(os.sched_getaffinity(0))])
    known = ["numpy", "opencl", "opengl", "mitsuba"]
    parser.add_argument("--by", "--executors", nargs="+", default=["numpy"], choices=known)
    parser.add_argument("--size", type=int, default=512, help="width and height in pixels")
    parser.add_argument("--spp", type=int, default=2, help="samples per pixel")
    parser.add_argument("--depth", type=int, default=6, help="most edges of a path, from the camera on")
    parser.add_argument("--repeats", type=int, default=5)
    return parser.parse_args(arguments)


@contextmanager
def empty_caches() -> Iterator[None]:
    """Let compilers find nothing that they have compiled before."""
    before = {name: os.environ.get(name) for name in CACHES}
    with tempfile.TemporaryDirectory() as folder:
        for name, part in CACHES.items():
            path = Path(folder, part)
            path.mkdir()
            os.environ[name] = str(path)
        yield
    for name, value in before.items():
        if value is None:
            del os.environ[name]
        else:
            os.environ[name] = value


# ---- ways to render ----------------------------------------------------------------------------------------


def _ways(name: str, job: Job, by: Sequence[str], workers: Sequence[int]) -> list[Way]:
    """Return the ways to render a canonical scene, in the order of `by`."""
    scene, ways = canonical(name), []
    for kind in by:
        if kind == "numpy":
            for count in dict.fromkeys(workers):
                text = f"numpy, {count} process{'es' if count > 1 else ''}"
                ways.append(Way(name, text, lambda count=count: _reference(scene, job, count)))
        elif kind == "mitsuba":
            ways.append(Way(name, "mitsuba, llvm_ad_rgb", lambda: _peer(scene, job)))
        else:
            ways.append(Way(name, kind, lambda kind=kind: _kernel(kind, scene, job)))
    return ways


def _reference(scene: Scene, job: Job, workers: int) -> Frames:
    """Return how the reference makes frames; start-up of processes counts in each."""
    return lambda seed: render_parallel(scene, replace(job, seed=seed), workers=workers).frame["color"]


def _kernel(name: str, scene: Scene, job: Job) -> Frames:
    """Return how a kernel makes frames."""
    executor = open_executor(name)
    return lambda seed: render_on(executor, scene, replace(job, seed=seed)).frame["color"]


def _peer(scene: Scene, job: Job) -> Frames:
    """Return how Mitsuba makes frames."""
    mi = mitsuba_scene.open_mitsuba("llvm_ad_rgb")
    loaded = mi.load_dict(mitsuba_scene.export(mi, scene, job.width, job.height, job.settings))
    return lambda seed: mitsuba_scene.render(mi, loaded, job.spp, seed)


# ---- tables ------------------------------------------------------------------------------------------------


def _print(ways: Sequence[Way], samples: int) -> None:
    """Print the table of one scene, and how well its means agree."""
    last = statistics.median(ways[-1].seconds)
    ratio = f"times {ways[-1].name}"
    print(f"| scene | by | first frame, s | s, median | s, range | samples/s | {ratio} |")
    print("|---|---|---|---|---|---|---|")
    for way in ways:
        median = statistics.median(way.seconds)
        spread = f"{min(way.seconds):.2f} - {max(way.seconds):.2f}"
        row = [way.scene, way.name, f"{way.first_s:.2f}", f"{median:.2f}", spread]
        print(f"| {' | '.join(row)} | {samples / median:,.0f} | {last / median:.2f} |")
    print()
    for text in _agreement(ways):
        print(text)


def _agreement(ways: Sequence[Way]) -> list[str]:
    """Return how far the mean colours are from that of the first way."""
    if len(ways[0].means) < 2:
        return []
    texts = []
    mean, error = _mean_and_error(ways[0].means)
    for way in ways[1:]:
        other, its_error = _mean_and_error(way.means)
        both = np.hypot(error, its_error)
        distance = f"{(other - mean) / both:+.1f} errors" if both > 0.0 else "no spread"
        texts.append(f"{way.name}: mean colour {other:.6f}, {ways[0].name}'s {mean:.6f}: {distance}")
    return [*texts, ""]


def _mean_and_error(values: Sequence[float]) -> tuple[float, float]:
    """Return the mean and its standard error."""
    return statistics.fmean(values), statistics.stdev(values) / len(values) ** 0.5


if __name__ == "__main__":
    main()
