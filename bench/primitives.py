"""Many primitives: what statements for each cost, and what tables with a loop do.

    python bench/primitives.py
    python bench/primitives.py --executors opengl --kinds turned --counts 30 100

For scenes of 10 to 300 primitives in a room, each traced in both forms ("unrolled", "looped"): lines and
size of the source, seconds to trace and emit it, seconds until the driver has built it (its caches on disk
are turned off) and has followed a first row of paths, and million samples a second then. The forms take
turns, so that drift of the machine's speed meets both alike; rates are medians, with the least and greatest.
A sample is one path with up to five scatterings, each with a shadow ray. A star marks the form that is chosen
for a scene of so many primitives (compiler/scenes/path_kernel.py: most_unrolled).
"""

from __future__ import annotations

import argparse
import os
import statistics
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from wamnet.cli.reports import machine
from wamnet.compiler.scenes.lower_scene import lower_scene, primitives
from wamnet.compiler.scenes.path_kernel import PathArtifact, compile_path, most_unrolled
from wamnet.kernels import open_executor
from wamnet.kernels.devices.executor import Executor, Part
from wamnet.refimpl import vectors
from wamnet.refimpl.light.scene import Box, Camera, Light, Matrix, Quad, Room, Scene, Sphere, Vector
from wamnet.refimpl.light.transport import Settings

FORMS = {"unrolled": None, "looped": 0}
"""Most primitives that are unrolled, by the name of the form."""

NO_CACHES = {
    "POCL_KERNEL_CACHE": "0",
    "MESA_SHADER_CACHE_DISABLE": "true",
    "MESA_GLSL_CACHE_DISABLE": "true",
}
"""Environment in which drivers reuse no kernel that they built before."""


@dataclass
class Kernel:
    """A kernel and what was measured of it."""

    scene: str
    form: str
    artifact: PathArtifact
    trace_s: float
    build_s: float
    chosen: bool
    rates: list[float] = field(default_factory=list)


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure and print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--executors", nargs="+", default=["opencl", "opengl"], choices=["opencl", "opengl"])
    parser.add_argument("--kinds", nargs="+", default=["mixture"], choices=list(KINDS))
    parser.add_argument("--counts", nargs="+", type=int, default=[10, 30, 100, 300])
    parser.add_argument("--size", type=int, default=128, help="width and height in pixels")
    parser.add_argument("--spp", type=int, default=4, help="samples per pixel")
    parser.add_argument("--repeats", type=int, default=5)
    given = parser.parse_args(arguments)
    os.environ.update(NO_CACHES)
    facts = [f"{name} {value}" for name, value in machine.describe().items()]
    print(", ".join([*facts, f"NumPy {np.__version__}", f"{given.size}x{given.size}, {given.spp} spp"]))
    print("\n| by | scene | form | lines | kB | trace, s | build, s | Msamples/s | range |")
    print("|---|---|---|---|---|---|---|---|---|")
    part = Part(given.size, given.size, 0, given.size, 0, given.spp, 0)
    for name in given.executors:
        with open_executor(name) as executor:
            for kind in given.kinds:
                for count in given.counts:
                    _compare(executor, crowd(kind, count), part, given.repeats)


def _compare(executor: Executor, scene: Scene, part: Part, repeats: int) -> None:
    """Measure both forms of a scene, and print their rows."""
    kernels = [_built(executor, scene, form, part) for form in FORMS]
    for _ in range(repeats):
        for kernel in kernels:
            start = time.perf_counter()
            executor.trace(kernel.artifact, part)
            samples = part.width * part.rows * part.samples
            kernel.rates.append(samples / (time.perf_counter() - start) / 1e6)
    for kernel in kernels:
        lines, kilobytes = kernel.artifact.source.count("\n"), len(kernel.artifact.source.encode()) / 1000
        star = "*" if kernel.chosen else ""
        print(
            f"| {executor.name} | {kernel.scene} | {kernel.form}{star} | {lines:,} | {kilobytes:,.0f} "
            f"| {kernel.trace_s:.2f} | {kernel.build_s:.2f} | {statistics.median(kernel.rates):.2f} "
            f"| {min(kernel.rates):.2f} - {max(kernel.rates):.2f} |",
            flush=True,
        )


def _built(executor: Executor, scene: Scene, form: str, part: Part) -> Kernel:
    """Trace, emit and build a kernel in one form."""
    start = time.perf_counter()
    programs = lower_scene(scene, Settings(), FORMS[form])
    artifact = compile_path(programs, executor.name, lanes=executor.lanes)
    traced = time.perf_counter()
    executor.build(artifact)
    executor.trace(artifact, replace(part, rows=1, samples=1))
    built = time.perf_counter()
    chosen = (primitives(scene) <= most_unrolled(executor.name)) == (form == "unrolled")
    return Kernel(scene.name, form, artifact, traced - start, built - traced, chosen)


# ---- scenes --------------------------------------------------------------------------------------------

Random = np.random.Generator


def crowd(kind: str, count: int) -> Scene:
    """Return a room with a light and `count` primitives of a kind, the same in every run."""
    random = np.random.default_rng(1)
    rotation = _rotation(random)
    size = 0.6 / count ** (1 / 3)
    parts = [KINDS[kind][i % len(KINDS[kind])](random, size, rotation) for i in range(count)]
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
    """Return an array (3,) as a scene's vector."""
    x, y, z = (float(value) for value in values)
    return x, y, z


def _rotation(random: Random) -> Matrix:
    """Return a rotation by a random unit quaternion."""
    w, x, y, z = (q := random.normal(size=4)) / np.sqrt(q @ q)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return _vector(rows[0]), _vector(rows[1]), _vector(rows[2])


def _place(random: Random) -> Vector:
    return _vector(random.uniform(-0.8, 0.8, 3))


def _color(random: Random) -> Vector:
    return _vector(random.uniform(0.2, 0.9, 3))


def shared(random: Random, size: float, rotation: Matrix) -> Box:
    """Return a box with the rotation that all of them share."""
    extent = _vector(0.6 * size * random.uniform(0.3, 1.0, 3))
    return Box(_place(random), extent, _color(random), rotation)


def turned(random: Random, size: float, rotation: Matrix) -> Box:
    """Return a box with a rotation of its own."""
    return shared(random, size, _rotation(random))


def sphere(random: Random, size: float, rotation: Matrix) -> Sphere:
    """Return a sphere."""
    return Sphere(_place(random), 0.5 * size, _color(random))


def quad(random: Random, size: float, rotation: Matrix) -> Quad:
    """Return a square."""
    u, other = random.normal(size=(2, 3))
    u, v = (size * vectors.normalize(edge) for edge in (u, np.cross(u, other)))
    return Quad(_place(random), _vector(u), _vector(v), _color(random))


Maker = Callable[[Random, float, Matrix], Box | Sphere | Quad]

KINDS: dict[str, tuple[Maker, ...]] = {
    "shared": (shared,),
    "turned": (turned,),
    "spheres": (sphere,),
    "quads": (quad,),
    "mixture": (shared, turned, sphere, quad),
}
"""Kinds of primitives that take turns, by the name of the scene."""


if __name__ == "__main__":
    main()
