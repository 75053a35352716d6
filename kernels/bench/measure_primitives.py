"""Many primitives: what statements for each cost, and what tables with a loop or a tree do.

1. Scenes of some primitives in a room [`crowd`] are traced in all forms ("unrolled", "looped", "tree").
2. Tracing and emitting are timed, then building by a driver without its caches on disk, until it has
   followed a first row of paths [`built`].
3. The forms take turns, so that drift of the machine's speed affects all alike [`compare`]; rates are in
   million samples a second.

A sample is one path with up to five scatterings, each with a shadow ray.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...compiler.core.loops import LISTS, STATEMENTS, TREES, Forms
from ...compiler.scenes.lower_scene import lower_scene
from ...compiler.scenes.path_kernel import PathArtifact, compile_path, forms_of
from ...refimpl import rng
from ...refimpl.light.scene import (
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
from ...refimpl.light.transport import Settings
from ..devices.executor import Executor
from ..devices.kernel import Part
from . import peers
from .measure_render import BY_HAND, VARIANT

FORMS = {"unrolled": STATEMENTS, "looped": LISTS, "tree": TREES}
"""What primitives become, by the name of the form; a tree is there where it seems to pay."""

NO_CACHES = {
    "POCL_KERNEL_CACHE": "0",
    "MESA_SHADER_CACHE_DISABLE": "true",
    "MESA_GLSL_CACHE_DISABLE": "true",
}
"""Environment in which drivers reuse no kernel that they built before."""

PEERS = ("mitsuba", *BY_HAND)
"""What is measured beside them: renderers. Those of Mitsuba and Embree have trees, Numba's has lists."""

EXECUTORS = ("opencl", "opengl", "c", *PEERS)
"""What is measured: executors whose kernels a driver or a compiler builds, and peers."""

MOST_STATEMENTS = 300
"""Most primitives that are measured as statements: a driver takes minutes for those of more."""


@dataclass
class Kernel:
    """A kernel, how it follows a picture's paths, and what was measured; `source` is empty for a peer.

    `chosen`: the scene has this form on the executor's target.
    """

    scene: str
    form: str
    source: str
    follow: Callable[[], Any]
    trace_s: float
    build_s: float
    chosen: bool = False
    rates: list[float] = field(default_factory=list)


def compare(executor: Executor, scene: Scene, part: Part, repeats: int) -> list[Kernel]:
    """Return the forms of a scene, measured on a part of a picture: a tree only where there is one."""
    chosen = _compiled(executor, scene, forms_of(executor.name)).source
    forms = [form for form in FORMS if form != "unrolled" or primitives(scene) <= MOST_STATEMENTS + 1]
    found: dict[str, Kernel] = {}
    for kernel in (built(executor, scene, form, part) for form in forms):
        found.setdefault(kernel.source, replace(kernel, chosen=kernel.source == chosen))
    return timed(list(found.values()), part, repeats)


def peer(name: str, scene: Scene, part: Part, repeats: int) -> list[Kernel]:
    """Return a peer on a scene; what it builds is built by the first picture."""
    start = time.perf_counter()
    render = peers.table().renderers[name](scene, part.width, part.rows, Settings())
    form, follow = VARIANT if name == "mitsuba" else "by hand", partial(render, part.samples, 0)
    traced = time.perf_counter()
    follow()
    made = Kernel(scene.name, form, "", follow, traced - start, time.perf_counter() - traced)
    return timed([made], part, repeats)


def timed(kernels: list[Kernel], part: Part, repeats: int) -> list[Kernel]:
    """Let kernels take turns, and note their rates."""
    for _ in range(repeats):
        for kernel in kernels:
            start = time.perf_counter()
            kernel.follow()
            samples = part.width * part.rows * part.samples
            kernel.rates.append(samples / (time.perf_counter() - start) / 1e6)
    return kernels


def built(executor: Executor, scene: Scene, form: str, part: Part) -> Kernel:
    """Trace, emit and build a kernel in one form."""
    start = time.perf_counter()
    artifact = _compiled(executor, scene, FORMS[form])
    traced = time.perf_counter()
    executor.build(artifact)
    executor.trace(artifact, replace(part, rows=1, samples=1))
    done = time.perf_counter()
    follow = partial(executor.trace, artifact, part)
    return Kernel(scene.name, form, artifact.source, follow, traced - start, done - traced)


def _compiled(executor: Executor, scene: Scene, forms: Forms) -> PathArtifact:
    """Return the kernel of a scene for an executor."""
    return compile_path(lower_scene(scene, Settings(), forms), executor.name, lanes=executor.lanes)


# ---- scenes ------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Draws:
    """The random numbers of one primitive: a function of its number, the same in every run."""

    number: int

    def uniform(self, block: int, low: float, high: float) -> NDArray[np.float64]:
        """Return four numbers in [low, high)."""
        words = rng.uniforms(rng.counter(1), rng.counter(self.number), rng.counter(0), rng.counter(block))
        return low + (high - low) * np.concatenate(words).astype(np.float64)

    def place(self) -> Vector:
        """Return a point in the room."""
        return _vector(self.uniform(0, -0.8, 0.8))

    def color(self) -> Vector:
        """Return a reflectance."""
        return _vector(self.uniform(1, 0.2, 0.9))

    def extent(self) -> NDArray[np.float64]:
        """Return three parts (3,) of a size."""
        return self.uniform(2, 0.3, 1.0)[:3]

    def rotation(self) -> Matrix:
        """Return a rotation by a random unit quaternion: Shoemake, Graphics Gems III, 1992."""
        u, a, b, _ = self.uniform(3, 0.0, 1.0)
        x, y = np.sqrt(1 - u) * np.array([np.sin(2 * np.pi * a), np.cos(2 * np.pi * a)])
        z, w = np.sqrt(u) * np.array([np.sin(2 * np.pi * b), np.cos(2 * np.pi * b)])
        return (
            _vector([1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)]),
            _vector([2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)]),
            _vector([2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]),
        )


def crowd(kind: str, count: int) -> Scene:
    """Return a room with a light and `count` primitives of a kind, the same in every run."""
    rotation = Draws(0).rotation()
    size = 0.6 / count ** (1 / 3)
    makers = KINDS[kind]
    parts = [makers[i % len(makers)](Draws(i + 1), size, rotation) for i in range(count)]
    return Scene(
        f"{kind} {count}",
        Camera((0.0, 0.0, 0.95), (0.0, 0.0, 0.0), vertical_fov_deg=70.0),
        Room((-1.0,) * 3, (1.0,) * 3, ((0.7,) * 3,) * 6),
        boxes=tuple(part for part in parts if isinstance(part, Box)),
        spheres=tuple(part for part in parts if isinstance(part, Sphere)),
        quads=tuple(part for part in parts if isinstance(part, Quad)),
        lights=(Light((-0.3, 0.99, -0.3), (0.6, 0.0, 0.0), (0.0, 0.0, 0.6), (1.0, 1.0, 1.0), 5.0),),
    )


def _vector(values: Any) -> Vector:
    """Return the first three of an array's numbers as a scene's vector."""
    x, y, z = (float(value) for value in values[:3])
    return x, y, z


def shared(draws: Draws, size: float, rotation: Matrix) -> Box:
    """Return a box with the rotation that all of them share."""
    return Box(draws.place(), _vector(0.6 * size * draws.extent()), draws.color(), rotation)


def turned(draws: Draws, size: float, rotation: Matrix) -> Box:
    """Return a box with a rotation of its own."""
    return shared(draws, size, draws.rotation())


def sphere(draws: Draws, size: float, rotation: Matrix) -> Sphere:
    """Return a sphere."""
    return Sphere(draws.place(), 0.5 * size, draws.color())


def quad(draws: Draws, size: float, rotation: Matrix) -> Quad:
    """Return a square: two rows of a rotation are its edges."""
    u, v, _ = (size * np.array(row) for row in draws.rotation())
    return Quad(draws.place(), _vector(u), _vector(v), draws.color())


Maker = Callable[[Draws, float, Matrix], Box | Sphere | Quad]

KINDS: Mapping[str, tuple[Maker, ...]] = {
    "shared": (shared,),
    "turned": (turned,),
    "spheres": (sphere,),
    "quads": (quad,),
    "mixture": (shared, turned, sphere, quad),
}
"""Kinds of primitives that take turns, by the name of the scene."""
