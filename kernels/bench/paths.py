"""Speed of path tracers: the NumPy reference, the kernels traced from it, and peers.

1. A scene by each renderer [`renderers`]: its first frame has all that happens once, as reading the scene
   and compiling, with empty caches of compilers [fresh.py]. A round ends when the frame is in memory: of
   kernels all layers and the variance, of peers only colours. Rounds have different seeds: their spread gives
   the error of a mean colour [`distance`].
2. A scene of many primitives [crowd.py] in all forms [`forms`]: what statements for each cost, and what
   tables with a loop or a tree do. Tracing and emitting are timed, then building by a driver without its
   caches on disk, until it has followed a first row of paths.

A sample is one path: at every vertex but the last a shadow ray and a scattering. The peer is Mitsuba 3, all
samples in one pass.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from ...compiler.artifact import Artifact
from ...compiler.core.loops import LISTS, STATEMENTS, TREES, Forms
from ...compiler.scenes.lower_scene import lower_scene
from ...compiler.scenes.path_kernel import compile_path
from ...models.data.scene_source import scene_source
from ...refimpl.light.render import Job
from ...refimpl.light.scene import Scene, primitives
from ...refimpl.light.transport import Settings
from ..devices.executor import Executor
from ..devices.kernel import Part
from ..devices.registry import open_executor
from ..measure import Entry, Round
from ..run.render_on import render_on
from ..run.render_pool import render_parallel
from . import peers

PEERS = ("mitsuba",)
"""Renderers that are peers."""

BUILT = ("opencl", "opengl", "c", *PEERS)
"""What forms are measured of: executors whose kernels a driver or a compiler builds, and peers."""

BY = ("numpy", *BUILT)
"""What can render."""

VARIANT = "llvm_ad_rgb"
"""Mitsuba's variant: compiled, on vectors and all cores."""

Frames = Callable[[int], Any]
"""Makes the frame of a seed."""

FORMS = {"unrolled": STATEMENTS, "looped": LISTS, "tree": TREES}
"""What primitives become, by the name of the form; a tree is there where it seems to pay."""

NO_CACHES = {
    "POCL_KERNEL_CACHE": "0",
    "MESA_SHADER_CACHE_DISABLE": "true",
    "MESA_GLSL_CACHE_DISABLE": "true",
}
"""Environment in which drivers reuse no kernel that they built before."""

MOST_STATEMENTS = 300
"""Most primitives that are measured as statements: a driver takes minutes for those of more."""


def renderers(name: str, job: Job, by: Sequence[str], workers: Sequence[int]) -> list[Entry]:
    """Return what renders a scene, in the order of `by`; the fact `means` has each round's mean colour."""
    scene, ways = scene_source(name).at(), dict[str, Callable[[], Frames]]()
    for kind in by:
        if kind == "numpy":
            for count in workers:
                text = f"numpy, {count} process{'es' if count > 1 else ''}"
                ways[text] = partial(_reference, scene, job, count)
        elif kind in PEERS:
            ways[f"{kind}, {VARIANT}"] = partial(_peer, kind, scene, job)
        else:
            ways[kind] = partial(_kernel, kind, scene, job)
    return [_entry(name, text, way) for text, way in ways.items()]


def _entry(scene: str, text: str, begin: Callable[[], Frames]) -> Entry:
    """Return what makes frames of a scene, whose mean colours are noted."""
    means: list[float] = []
    return Entry(scene, lambda: _noting(begin(), means), text, {"means": means})


def _noting(frames: Frames, means: list[float]) -> Round:
    """Return a round: a frame of its seed, whose mean colour is noted."""

    def work(seed: int) -> float:
        start = time.perf_counter()
        colors = frames(seed)
        seconds = time.perf_counter() - start
        if seed:
            means.append(float(np.mean(colors, dtype=np.float64)))
        return seconds

    return work


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


def distance(entry: Entry, other: Entry) -> float | None:
    """Return how far a mean colour is from another's in standard errors; none without a spread."""
    (mean, error), (its_mean, its_error) = (mean_and_error(each.facts["means"]) for each in (entry, other))
    both = float(np.hypot(error, its_error))
    return (mean - its_mean) / both if both > 0.0 else None


def mean_and_error(values: Sequence[float]) -> tuple[float, float]:
    """Return the mean of two or more numbers, and its standard error."""
    return statistics.fmean(values), statistics.stdev(values) / len(values) ** 0.5


# ---- forms of primitives -----------------------------------------------------------------------------------


def forms(executor: Executor | None, name: str, scene: Scene, part: Part) -> list[Entry]:
    """Return the forms of a scene, built, whose rounds follow a part of a picture; of a peer its own.

    Facts: `source`, empty for a peer; `trace_s` and `build_s`; `chosen`: the scene has this form on the
    executor's target.
    """
    if executor is None:
        shape = (scene, part.width, part.rows, Settings())
        follow = lambda render: render(part.samples, 0)  # noqa: E731
        return [_form(VARIANT, lambda: peers.table().renderers[name](*shape), follow, follow)]
    chosen = _compiled(executor, scene, executor.language.forms).source
    few, found = primitives(scene) <= MOST_STATEMENTS + 1, dict[str, Entry]()
    for form in FORMS if few else [form for form in FORMS if form != "unrolled"]:

        def build(artifact: Artifact) -> None:
            executor.build(artifact)
            executor.trace(artifact, replace(part, rows=1, samples=1))

        compiled = partial(_compiled, executor, scene, FORMS[form])
        entry = _form(form, compiled, build, lambda artifact: executor.trace(artifact, part), chosen)
        found.setdefault(entry.facts["source"], entry)
    return [*found.values()]


def _form(
    name: str,
    trace: Callable[[], Any],
    build: Callable[[Any], Any],
    follow: Callable[[Any], Any],
    chosen: str | None = None,
) -> Entry:
    """Return a form that is traced and then built, which are timed; its rounds follow paths."""
    start = time.perf_counter()
    made = trace()
    traced = time.perf_counter()
    build(made)
    source = getattr(made, "source", "")
    times = {"trace_s": traced - start, "build_s": time.perf_counter() - traced}
    facts = {"source": source, **times, "chosen": source == chosen}
    return Entry(name, facts=facts, round=lambda _number: follow(made))


def _compiled(executor: Executor, scene: Scene, forms: Forms) -> Artifact:
    """Return the kernel of a scene for an executor."""
    return compile_path(lower_scene(scene, Settings(), forms), executor.language, lanes=executor.lanes)
