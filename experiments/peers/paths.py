"""Speed of path tracers: the NumPy reference, the kernels traced from it, and peers.

1. A scene by each renderer [`renderers`]: its first frame has all that happens once, as reading the scene
   and compiling, with empty caches of compilers [fresh.py]. A round ends when the frame is in memory: of
   kernels all layers and the variance, of peers only colours. Rounds have different seeds: their spread gives
   the error of a mean colour [`distance`].
2. A scene of many primitives [`crowd`], the same in every run, in all forms [`forms`]: what statements for
   each cost, and what tables with a loop or a tree do. Tracing and emitting are timed, then building by a
   driver without its caches on disk, until it has followed a first row of paths.

A sample is one path: at every vertex but the last a shadow ray and a scattering. The peer is Mitsuba 3, all
samples in one pass.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wamnet.compiler.artifact import Artifact
from wamnet.compiler.core.loops import LISTS, STATEMENTS, TREES, Forms
from wamnet.compiler.scenes.lower_scene import lower_scene
from wamnet.compiler.scenes.path_kernel import compile_path
from wamnet.kernels.devices.executor import Executor
from wamnet.kernels.devices.kernel import Part
from wamnet.kernels.devices.registry import open_executor
from wamnet.kernels.measure import Entry, Round
from wamnet.kernels.run.render_on import render_on
from wamnet.kernels.run.render_pool import render_parallel
from wamnet.models.data.scene_source import scene_source
from wamnet.refimpl import rng
from wamnet.refimpl.light.render import Job
from wamnet.refimpl.light.scene import (
    Box,
    Camera,
    Light,
    Matrix,
    Quad,
    Room,
    Scene,
    Sphere,
    Vector,
    primitives,
)
from wamnet.refimpl.light.transport import Settings

from . import table
from .peer_mitsuba import VARIANT

BUILT = ("opencl", "opengl", "c", *table.renderers)
"""What forms are measured of: executors whose kernels a driver or a compiler builds, and peers."""

BY = ("numpy", *BUILT)
"""What can render."""

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
        elif kind in table.renderers:
            ways[f"{kind}, {VARIANT}"] = partial(_peer, kind, scene, job)
        else:
            ways[kind] = partial(_kernel, kind, scene, job)
    found = ((text, way, list[float]()) for text, way in ways.items())
    return [Entry(name, partial(_noting, way, means), text, {"means": means}) for text, way, means in found]


def _noting(begin: Callable[[], Frames], means: list[float]) -> Round:
    """Return a round: a frame of its seed, whose mean colour is noted."""
    frames = begin()

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
    render = table.renderers[kind](scene, job.width, job.height, job.settings)
    return lambda seed: render(job.spp, seed)


def distance(entry: Entry, other: Entry) -> float | None:
    """Return how far a mean colour is from another's in standard errors; none without a spread."""
    means = [each.facts["means"] for each in (entry, other)]
    both = float(np.hypot(*(statistics.stdev(values) / len(values) ** 0.5 for values in means)))
    mean, its_mean = map(statistics.fmean, means)
    return (mean - its_mean) / both if both > 0.0 else None


# ---- forms of primitives -----------------------------------------------------------------------------------


def forms(executor: Executor, scene: Scene, part: Part) -> list[Entry]:
    """Return the forms of a scene, built, whose rounds follow a part of a picture.

    Facts: `source`; `trace_s` and `build_s`; `chosen`: the scene has this form on the executor's target.
    """

    def compiled(form: Forms) -> Artifact:
        return compile_path(lower_scene(scene, Settings(), form), executor.language, lanes=executor.lanes)

    def build(artifact: Artifact) -> None:
        executor.build(artifact)
        executor.trace(artifact, replace(part, rows=1, samples=1))

    chosen, found = compiled(executor.language.forms).source, dict[str, Entry]()
    few = primitives(scene) <= MOST_STATEMENTS + 1
    for form in FORMS if few else [form for form in FORMS if form != "unrolled"]:
        trace = partial(compiled, FORMS[form])
        entry = _form(form, trace, build, lambda artifact: executor.trace(artifact, part), chosen)
        found.setdefault(entry.facts["source"], entry)
    return [*found.values()]


def form_of_peer(name: str, scene: Scene, part: Part) -> Entry:
    """Return a peer's own form of a scene, as [`forms`] does; its fact `source` is empty."""
    shape = (scene, part.width, part.rows, Settings())
    follow = lambda render: render(part.samples, 0)  # noqa: E731
    return _form(VARIANT, lambda: table.renderers[name](*shape), follow, follow)


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


# ---- scenes of many primitives ----------------------------------------------------------------------------


def _uniform(number: int, block: int, low: float, high: float) -> NDArray[np.float64]:
    """Return four numbers in [low, high) of a primitive."""
    words = rng.uniforms(rng.counter(1), rng.counter(number), rng.counter(0), rng.counter(block))
    return low + (high - low) * np.concatenate(words).astype(np.float64)


def _vector(values: ArrayLike) -> Vector:
    """Return the first three of an array's numbers as a scene's vector."""
    x, y, z = (float(value) for value in np.asarray(values)[:3])
    return x, y, z


def _rotation(number: int) -> Matrix:
    """Return a rotation by a random unit quaternion: Shoemake, Graphics Gems III, 1992."""
    u, a, b, _ = _uniform(number, 3, 0.0, 1.0)
    x, y = np.sqrt(1 - u) * np.array([np.sin(2 * np.pi * a), np.cos(2 * np.pi * a)])
    z, w = np.sqrt(u) * np.array([np.sin(2 * np.pi * b), np.cos(2 * np.pi * b)])
    return (
        _vector([1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)]),
        _vector([2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)]),
        _vector([2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]),
    )


def _part(kind: str, number: int, size: float) -> Box | Sphere | Quad:
    """Return a primitive: a box with a rotation that all share or its own, a sphere, or a square."""
    place, color = _vector(_uniform(number, 0, -0.8, 0.8)), _vector(_uniform(number, 1, 0.2, 0.9))
    if kind == "spheres":
        return Sphere(place, 0.5 * size, color)
    if kind == "quads":
        u, v, _ = (size * np.array(row) for row in _rotation(number))
        return Quad(place, _vector(u), _vector(v), color)
    extent = _vector(0.6 * size * _uniform(number, 2, 0.3, 1.0))
    return Box(place, extent, color, _rotation(0 if kind == "shared" else number))


KINDS: Mapping[str, tuple[str, ...]] = {
    **{kind: (kind,) for kind in ("shared", "turned", "spheres", "quads")},
    "mixture": ("shared", "turned", "spheres", "quads"),
}
"""Kinds of primitives that take turns, by the name of the scene."""


def crowd(kind: str, count: int) -> Scene:
    """Return a room with a light and `count` primitives of a kind."""
    size, kinds = 0.6 / count ** (1 / 3), KINDS[kind]
    parts = [_part(kinds[i % len(kinds)], i + 1, size) for i in range(count)]
    return Scene(
        f"{kind} {count}",
        Camera((0.0, 0.0, 0.95), (0.0, 0.0, 0.0), vertical_fov_deg=70.0),
        Room((-1.0,) * 3, (1.0,) * 3, ((0.7,) * 3,) * 6),
        boxes=tuple(part for part in parts if isinstance(part, Box)),
        spheres=tuple(part for part in parts if isinstance(part, Sphere)),
        quads=tuple(part for part in parts if isinstance(part, Quad)),
        lights=(Light((-0.3, 0.99, -0.3), (0.6, 0.0, 0.0), (0.0, 0.0, 0.6), (1.0, 1.0, 1.0), 5.0),),
    )
