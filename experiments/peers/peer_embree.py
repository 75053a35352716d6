"""Embree as a peer: paths that one would write by hand in C, in packets of 16 rays, on all cores.

1. The program is embree_paths.c beside this file. [`Embree`] compiles it, gives it a scene as a file of
   numbers [`scene_bytes`], and asks it for pictures by a line of text each; the process ends with the object.
2. A scene is matte surfaces, lamps and a room [`peer_mitsuba.check_matte`]. Boxes are
   12 triangles each, as `cube` of Mitsuba; a camera outside a room sees it from where its rays enter.
3. Rays and shadow rays are Embree's; what is done between is loops over the packet's lanes in plain C.

Embree: https://www.embree.org, the manual of version 3; in Debian the package libembree-dev.
"""

from __future__ import annotations

import struct
import subprocess
import tempfile
import weakref
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wamnet.refimpl.errors import ExecutorUnavailable
from wamnet.refimpl.light.camera import camera_basis
from wamnet.refimpl.light.scene import Box, Light, Quad, Scene
from wamnet.refimpl.light.shapes.quad import light_radiance, quad_area_pdf
from wamnet.refimpl.light.transport import Settings
from wamnet_verify.parts import room_walls

from . import peer_mitsuba

SOURCE = Path(__file__).with_name("embree_paths.c")
"""The program."""

COMPILED = ("-std=gnu11", "-O3", "-march=native", "-ffast-math", "-fopenmp")
"""How it is compiled: for this processor, and free to reorder sums, as Embree is."""

LINKED = ("-lembree3", "-lm")
"""What it needs."""

FARTHEST = 1e30
"""Coordinate of a room that is not there."""


class Embree:
    """The program with a scene, for pictures of one size."""

    about = "Embree 3, packets of 16 rays, by hand in C"

    def __init__(self, scene: Scene, width: int, height: int, settings: Settings | None = None) -> None:
        """Compile and start it; ExecutorUnavailable says what is missing, InputError what is not exported."""
        settings = settings or Settings()
        peer_mitsuba.check_matte(scene, settings, "Embree")
        self._shape = (height, width, 3)
        with tempfile.TemporaryDirectory(prefix="wamnet-embree-") as name:
            folder = Path(name)
            program, file = folder / "paths", folder / "scene"
            _compile(program)
            file.write_bytes(scene_bytes(scene, width, height, settings.max_depth + 1))
            self._process = subprocess.Popen(
                [program, file], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE
            )
            self._end = weakref.finalize(self, _end, self._process)
            self.render(1, 0)  # when it answers, it has read the file

    def render(self, spp: int, seed: int) -> NDArray[np.float32]:
        """Return the mean colours (H, W, 3), rows from the top."""
        process = self._process
        assert process.stdin is not None
        assert process.stdout is not None
        assert process.stderr is not None
        with suppress(BrokenPipeError):  # it has ended: reading says so
            process.stdin.write(f"{spp} {seed}\n".encode())
            process.stdin.flush()
        size = 4 * int(np.prod(self._shape))
        data = process.stdout.read(size)
        if len(data) < size:
            said = process.stderr.read().decode(errors="replace").strip()
            raise ExecutorUnavailable(f"embree: its program has ended ({said or 'without a word'})")
        return np.frombuffer(data, np.float32).reshape(self._shape)

    def close(self) -> None:
        """End the process."""
        self._end()


def _end(process: subprocess.Popen[bytes]) -> None:
    """End a process that reads until there is no more, and close its pipes."""
    for pipe in (process.stdin, process.stdout, process.stderr):
        if pipe is not None:
            with suppress(BrokenPipeError):  # it has ended, and what it was asked is still in the pipe
                pipe.close()
    process.kill()
    process.wait()


def _compile(program: Path) -> None:
    """Compile the program; say what is missing."""
    command = ["cc", *COMPILED, str(SOURCE), "-o", str(program), *LINKED]
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=False)
    except OSError:
        raise ExecutorUnavailable("embree: no C compiler; install one (Debian: gcc)") from None
    if done.returncode:
        told = " ".join(done.stderr.split())[:200]
        raise ExecutorUnavailable(
            f"embree: its program does not compile ({told}); Debian: apt-get install libembree-dev"
        )


# ---- the scene ---------------------------------------------------------------------------------------------


def scene_bytes(scene: Scene, width: int, height: int, edges: int) -> bytes:
    """Return a scene as embree_paths.c reads it."""
    basis, room = camera_basis(scene.camera, np.float32), scene.room
    walls = room_walls(room) if room is not None else []
    flat: tuple[Quad | Light, ...] = (*scene.quads, *scene.lights)
    quads = [*walls, *((quad.corner, quad.edge_u, quad.edge_v) for quad in flat)]
    rows = surfaces(scene)
    counts = (len(scene.boxes), len(quads), len(scene.spheres), len(scene.lights), len(rows))
    head = [
        *(basis.position, basis.right, basis.up, basis.forward, [basis.tan_half_fov], scene.background),
        *((room.low, room.high) if room is not None else ((-FARTHEST,) * 3, (FARTHEST,) * 3)),
    ]
    shapes = [*map(_box_corners, scene.boxes), *(_quad_corners(*quad) for quad in quads)]
    shapes += [np.array([*ball.center, ball.radius]) for ball in scene.spheres]
    numbers = [*head, *shapes, *rows, *lamps(scene)]
    packed = np.concatenate([np.ravel(np.asarray(part, np.float32)) for part in numbers])
    return struct.pack("<8i", width, height, edges, *counts) + packed.astype("<f4").tobytes()


def _box_corners(box: Box) -> NDArray[np.float64]:
    """Return the corners (8, 3); bits 0, 1, 2 of a corner's number are its sides of the three axes."""
    signs = np.array([[(k >> axis & 1) * 2.0 - 1.0 for axis in range(3)] for k in range(8)])
    corners: NDArray[np.float64] = np.array(box.center) + (signs * box.half_extent) @ np.array(box.rotation)
    return corners


def _quad_corners(corner: Any, edge_u: Any, edge_v: Any) -> NDArray[np.float64]:
    """Return the corners (4, 3) in their order around a quad."""
    c, u, v = np.array(corner), np.array(edge_u), np.array(edge_v)
    return np.array([c, c + u, c + u + v, c + v])


def surfaces(scene: Scene) -> list[tuple[float, ...]]:
    """Return reflectance, emission, and the lamp or -1 of each surface: boxes, quads, spheres."""

    def row(reflectance: Any, emission: Any, lamp: float = -1.0) -> tuple[float, ...]:
        return (*reflectance, *emission, lamp)

    room = scene.room
    return [
        *(row(box.reflectance, box.emission) for box in scene.boxes),
        *(row(share, room.emission) for share in (room.reflectances if room is not None else ()) if room),
        *(row(quad.reflectance, quad.emission) for quad in scene.quads),
        *(row((0.0,) * 3, light_radiance(light), k) for k, light in enumerate(scene.lights)),
        *(row(ball.reflectance, ball.emission) for ball in scene.spheres),
    ]


def lamps(scene: Scene) -> list[Any]:
    """Return the lamps' numbers; one is picked in proportion to its power times its mean colour."""
    powers = np.array([light.power * sum(light.color) for light in scene.lights])
    shares = powers / powers.sum() if powers.size else powers
    rows = []
    for light, share, total in zip(scene.lights, shares, np.cumsum(shares), strict=True):
        normal = np.cross(light.edge_u, light.edge_v)
        area = 1.0 / quad_area_pdf(light)
        row = (*light.corner, *light.edge_u, *light.edge_v, *(normal / area), *light_radiance(light))
        rows.append((*row, area, share, total, 0.0, 0.0))
    return rows
