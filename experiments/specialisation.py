"""What it saves that a kernel models only what its scene needs: each canonical scene, and the same laden.

    python experiments/specialisation.py
    python experiments/specialisation.py --executors opencl --scenes minicubes,empty --repeats 3

A laden scene has, in addition to its own, a primitive of every shape and material that there is, behind the
camera and out of reach of its light, and a black sky where it has none [`laden`]: what a kernel would hold
that is made for all scenes. Both kernels are traced, emitted and built in the same way, and take turns
[`measured`]. Print a Markdown table: operations of a path's programs, lines of the text, seconds until a
driver without its caches has built it, million samples a second, and how many times faster a scene's own is.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from lab.tables import markdown

from wamnet.compiler.scenes.lower_scene import lower_scene
from wamnet.compiler.scenes.path_kernel import compile_path, forms_of
from wamnet.kernels import open_executor
from wamnet.kernels.bench.measure_primitives import NO_CACHES
from wamnet.kernels.devices.executor import Executor
from wamnet.kernels.devices.kernel import Part
from wamnet.kernels.measure import environment
from wamnet.refimpl.light.materials import MATERIALS, Dielectric
from wamnet.refimpl.light.scene import Box, Quad, Scene, Sky, Sphere, Vector
from wamnet.refimpl.light.scenes import CANONICAL, canonical
from wamnet.refimpl.light.transport import Settings

HEADS = (
    "by", "scene", "operations", "laden", "lines", "laden", "build, s", "laden", "Msamples/s", "laden",
    "times faster",
)  # fmt: skip

BEHIND = 1000.0
"""How far behind the camera the first stub is, in scene units; each is as far from the next as it is wide."""

EDGE = 1e-3
"""Size of a stub: it covers 1e-6 of the angle of a pixel, if a path looks back at all."""

TURNED = ((0.36, 0.48, -0.8), (-0.8, 0.6, 0.0), (0.48, 0.64, 0.6))
"""A rotation about no axis of the scene: its rows are orthonormal, in decimals."""

GREY = (0.5, 0.5, 0.5)
"""Reflectance of a stub."""

DARK = Sky((0.0,) * 3, (0.0,) * 3, (0.0,) * 3)
"""A sky that sends nothing."""

TIME_S = 0.45
"""Moment of the scenes that move: their boxes are turned."""


def laden(scene: Scene) -> Scene:
    """Return a scene with one more primitive of every shape and material, out of sight, and with a sky."""
    x, y, z = scene.camera.position
    boxes, spheres, quads = list(scene.boxes), list(scene.spheres), list(scene.quads)
    for number, material in enumerate(kind() for kind in MATERIALS.values()):
        at: Vector = (x + 4.0 * EDGE * number, y, z + BEHIND)
        boxes.append(Box(at, (EDGE, EDGE, EDGE), GREY, TURNED, material=material))
        spheres.append(Sphere((at[0], y + 4.0 * EDGE, at[2]), EDGE, GREY, material=material))
        corner = (at[0], y - 4.0 * EDGE, at[2])
        if not isinstance(material, Dielectric):  # light passes only into closed bodies
            quads.append(Quad(corner, (EDGE, 0.0, 0.0), (0.0, EDGE, 0.0), GREY, material=material))
    return replace(
        scene,
        boxes=tuple(boxes),
        spheres=tuple(spheres),
        quads=tuple(quads),
        environment=scene.environment or replace(DARK, **_same(scene.background)),
        background=(0.0, 0.0, 0.0),
    )


def _same(radiance: Vector) -> dict[str, Vector]:
    """Return the colours of a sky that is the same everywhere."""
    return dict.fromkeys(("zenith", "horizon", "ground"), radiance)


def measured(executor: Executor, scene: Scene, part: Part, repeats: int) -> list[str]:
    """Return a row of the table, without its first two columns."""
    kernels, facts = [], []
    for each in (scene, laden(scene)):
        programs = lower_scene(each, Settings(), forms_of(executor.name))
        kernel = compile_path(programs, executor.name, lanes=executor.lanes)
        begun = time.perf_counter()
        executor.build(kernel)
        executor.trace(kernel, replace(part, rows=1, samples=1))
        built = time.perf_counter() - begun
        operations = sum(
            node.op not in ("input", "constant") for p in programs.parts.values() for node in p.nodes
        )
        kernels.append(kernel)
        facts.append((f"{operations:,}", f"{kernel.source.count(chr(10)):,}", f"{built:.2f}"))
    times: list[list[float]] = [[], []]
    for _ in range(repeats):
        for kernel, taken in zip(kernels, times, strict=True):
            begun = time.perf_counter()
            executor.trace(kernel, part)
            taken.append(time.perf_counter() - begun)
    samples = part.width * part.rows * part.samples / 1e6
    own, other = (samples / statistics.median(taken) for taken in times)
    shown = [text for both in zip(*facts, strict=True) for text in both]
    return [*shown, f"{own:.2f}", f"{other:.2f}", f"{own / other:.1f}"]


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--executors", default="opencl,c", help="what runs the kernels")
    parser.add_argument("--scenes", default=",".join(CANONICAL), help="canonical scenes")
    parser.add_argument("--size", type=int, default=256, help="width and height of the picture, in pixels")
    parser.add_argument("--repeats", type=int, default=5, help="turns that both kernels take")
    options = parser.parse_args(arguments)
    rows: list[list[Any]] = []
    with environment(NO_CACHES):
        for name in options.executors.split(","):
            with open_executor(name) as executor:
                for scene in options.scenes.split(","):
                    made = canonical(scene, time=TIME_S)
                    part = Part(options.size, options.size, 0, options.size, 0, 4, 0)
                    rows.append([name, scene, *measured(executor, made, part, options.repeats)])
    print(markdown(HEADS, rows))


if __name__ == "__main__":
    main()
