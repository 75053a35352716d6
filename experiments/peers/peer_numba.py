"""Numba as a peer: a path tracer as one would write it by hand in Python, compiled by LLVM, on all threads.

1. A scene becomes tables of numbers [`tables_of`]; every ray tries all primitives [`_nearest`]. Boxes that
   share a rotation share the turned ray: it is turned once for each rotation.
2. One function follows one path [`_path`], another shares out rows to threads [`_picture`]. All are compiled
   for this processor, free to reorder sums.
3. Transport is that of refimpl/light/transport.py for matte scenes, as in the program for Embree
   [embree_paths.c]: a lamp and a direction at each surface, weighted by the power heuristic, no roulette.

Numba: Lam, Pitrou and Seibert, "Numba: A LLVM-based Python JIT Compiler", LLVM-HPC 2015.
"""

from __future__ import annotations

import math
from importlib.metadata import version
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wamnet.refimpl.errors import ExecutorUnavailable
from wamnet.refimpl.light.camera import camera_basis
from wamnet.refimpl.light.scene import Light, Quad, Scene
from wamnet.refimpl.light.shapes.quad import quad_row
from wamnet.refimpl.light.transport import Settings

from . import peer_mitsuba
from .peer_embree import FARTHEST, lamps, surfaces

PI = np.float32(math.pi)
"""Pi in the type of all numbers here."""

NEAR = np.float32(1e-4)
"""How far from its surface a ray starts, in scene units."""

F0, F1, F2 = np.float32(0.0), np.float32(1.0), np.float32(2.0)
"""Constants of float32: those of Python would make sums of float64."""


class Numba:
    """The compiled functions with a scene, for pictures of one size."""

    def __init__(self, scene: Scene, width: int, height: int, settings: Settings | None = None) -> None:
        """Compile them; ExecutorUnavailable says that Numba is missing, InputError what is not exported."""
        settings = settings or Settings()
        peer_mitsuba.check_matte(scene, settings, "Numba")
        try:
            import numba
        except ImportError:
            raise ExecutorUnavailable("numba: the package is not installed; pip install numba") from None
        self.about = f"Numba {version('numba')}, by hand in Python"
        self._tables, self._picture = tables_of(scene), _picture(numba)
        self._sizes = (width, height, settings.max_depth + 1)
        self.render(1, 0)

    def render(self, spp: int, seed: int) -> NDArray[np.float32]:
        """Return the mean colours (H, W, 3), rows from the top."""
        width, height, edges = self._sizes
        image = np.zeros((height, width, 3), np.float32)
        self._picture(image, spp, seed, edges, *self._tables)
        return image


def tables_of(scene: Scene) -> tuple[NDArray[Any], ...]:
    """Return camera, background, room, rotations with their boxes, quads, spheres, surfaces and lamps."""
    basis, room = camera_basis(scene.camera, np.float32), scene.room
    low, high = (room.low, room.high) if room is not None else ((-FARTHEST,) * 3, (FARTHEST,) * 3)
    camera = [*basis.position, *basis.right, *basis.up, *basis.forward, basis.tan_half_fov]
    turns = list(dict.fromkeys(box.rotation for box in scene.boxes))
    boxes = [
        (*(np.array(box.rotation) @ box.center), *box.half_extent, turns.index(box.rotation))
        for box in scene.boxes
    ]
    flat: tuple[Quad | Light, ...] = (*scene.quads, *scene.lights)
    quads = [np.ravel(quad_row(quad)) for quad in flat]
    spheres = [(*ball.center, ball.radius) for ball in scene.spheres]
    inside = [1.0] if room is not None else [0.0]
    parts = (camera, scene.background, [*low, *high, *inside], np.ravel(turns))
    rows = ((boxes, 7), (quads, 12), (spheres, 4), (surfaces(scene), 7), (lamps(scene), 20))
    tables = [np.array(rows_, np.float32).reshape(-1, width) for rows_, width in rows]
    return (*(np.array(part, np.float32) for part in parts), *tables)


# ---- what a ray meets --------------------------------------------------------------------------------------
# Functions of numbers, which Numba compiles; each is made by a function that knows Numba.


def _boxes(jit: Any) -> Any:
    """Return the function that finds the nearest box before `far`: distance, number or -1, axis."""

    def meet(ox, oy, oz, dx, dy, dz, far, turns, boxes):
        found, axis, turn = -1, 0, -1
        ax = ay = az = ix = iy = iz = F0
        for k in range(boxes.shape[0]):
            if int(boxes[k, 6]) != turn:
                turn = int(boxes[k, 6])
                t = turns[9 * turn : 9 * turn + 9]
                ax, ix = t[0] * ox + t[1] * oy + t[2] * oz, F1 / (t[0] * dx + t[1] * dy + t[2] * dz)
                ay, iy = t[3] * ox + t[4] * oy + t[5] * oz, F1 / (t[3] * dx + t[4] * dy + t[5] * dz)
                az, iz = t[6] * ox + t[7] * oy + t[8] * oz, F1 / (t[6] * dx + t[7] * dy + t[8] * dz)
            mx, my, mz = (boxes[k, 0] - ax) * ix, (boxes[k, 1] - ay) * iy, (boxes[k, 2] - az) * iz
            rx, ry, rz = abs(boxes[k, 3] * ix), abs(boxes[k, 4] * iy), abs(boxes[k, 5] * iz)
            x, y, z = mx - rx, my - ry, mz - rz
            near = max(x, y, z)
            if near > NEAR and near < far and near <= min(mx + rx, my + ry, mz + rz):
                far, found = near, k
                axis = 0 if x >= y and x >= z else (1 if y >= z else 2)
        return far, found, axis

    return jit(meet)


def _quads(jit: Any) -> Any:
    """Return the function that finds the nearest quad before `far`: distance, number or -1."""

    def meet(ox, oy, oz, dx, dy, dz, far, quads):
        found = -1
        for k in range(quads.shape[0]):
            q = quads[k]
            x, y, z = ox - q[0], oy - q[1], oz - q[2]
            t = -(x * q[9] + y * q[10] + z * q[11]) / (dx * q[9] + dy * q[10] + dz * q[11])
            x, y, z = x + t * dx, y + t * dy, z + t * dz
            u, v = x * q[3] + y * q[4] + z * q[5], x * q[6] + y * q[7] + z * q[8]
            if t > NEAR and t < far and min(u, v) >= F0 and max(u, v) <= F1:
                far, found = t, k
        return far, found

    return jit(meet)


def _spheres(jit: Any) -> Any:
    """Return the function that finds the nearest sphere before `far`: distance, number or -1."""

    def meet(ox, oy, oz, dx, dy, dz, far, spheres):
        found = -1
        for k in range(spheres.shape[0]):
            x, y, z = spheres[k, 0] - ox, spheres[k, 1] - oy, spheres[k, 2] - oz
            b = x * dx + y * dy + z * dz
            x, y, z = x - b * dx, y - b * dy, z - b * dz
            square = spheres[k, 3] * spheres[k, 3] - (x * x + y * y + z * z)
            t = b - math.sqrt(max(square, F0))
            if square > F0 and t > NEAR and t < far:
                far, found = t, k
        return far, found

    return jit(meet)


def _walls(jit: Any) -> Any:
    """Return the function that finds where a ray leaves the room: distance and wall."""

    def leave(ox, oy, oz, dx, dy, dz, room):
        x = ((room[3] if dx > F0 else room[0]) - ox) / dx
        y = ((room[4] if dy > F0 else room[1]) - oy) / dy
        z = ((room[5] if dz > F0 else room[2]) - oz) / dz
        t = min(x, y, z)
        if t == x:
            return t, 1 if dx > F0 else 0
        if t == y:
            return t, 3 if dy > F0 else 2
        return t, 5 if dz > F0 else 4

    return jit(leave)


def _nearest(jit: Any) -> Any:
    """Return the function that finds what a ray meets: distance, surface or -1, normal against it."""
    boxes_met, quads_met, spheres_met, leave = _boxes(jit), _quads(jit), _spheres(jit), _walls(jit)

    def nearest(ox, oy, oz, dx, dy, dz, room, turns, boxes, quads, spheres):
        walls = 6 if room[6] > F0 else 0
        t, surface, nx, ny, nz = np.float32(FARTHEST), -1, F0, F0, F0
        if walls > 0:
            t, wall = leave(ox, oy, oz, dx, dy, dz, room)
            surface, sign, axis = boxes.shape[0] + wall, F1 if wall % 2 == 0 else -F1, wall // 2
            nx, ny = sign if axis == 0 else F0, sign if axis == 1 else F0
            nz = sign if axis == 2 else F0
        t, k, axis = boxes_met(ox, oy, oz, dx, dy, dz, t, turns, boxes)
        if k >= 0:
            row = 9 * int(boxes[k, 6]) + 3 * axis
            surface, nx, ny, nz = k, turns[row], turns[row + 1], turns[row + 2]
        t, k = quads_met(ox, oy, oz, dx, dy, dz, t, quads)
        if k >= 0:
            surface, nx, ny, nz = boxes.shape[0] + walls + k, quads[k, 9], quads[k, 10], quads[k, 11]
        t, k = spheres_met(ox, oy, oz, dx, dy, dz, t, spheres)
        if k >= 0:
            surface, r = boxes.shape[0] + walls + quads.shape[0] + k, F1 / spheres[k, 3]
            nx, ny = (ox + t * dx - spheres[k, 0]) * r, (oy + t * dy - spheres[k, 1]) * r
            nz = (oz + t * dz - spheres[k, 2]) * r
        sign = -F1 if nx * dx + ny * dy + nz * dz > F0 else F1
        return t, surface, sign * nx, sign * ny, sign * nz

    return jit(nearest)


def _hidden(jit: Any) -> Any:
    """Return the function that tells whether anything is between a point and a distance along a ray."""
    boxes_met, quads_met, spheres_met = _boxes(jit), _quads(jit), _spheres(jit)

    def hidden(ox, oy, oz, dx, dy, dz, far, turns, boxes, quads, spheres):
        return (
            boxes_met(ox, oy, oz, dx, dy, dz, far, turns, boxes)[1] >= 0
            or quads_met(ox, oy, oz, dx, dy, dz, far, quads)[1] >= 0
            or spheres_met(ox, oy, oz, dx, dy, dz, far, spheres)[1] >= 0
        )

    return jit(hidden)


# ---- a path ------------------------------------------------------------------------------------------------


def _random(jit: Any) -> Any:
    """Return the function that gives the next state and number in [0, 1): PCG's output, O'Neill, 2014."""

    def draw(state):
        # A product of two uint32 is a uint64 to Numba.
        state = np.uint32(state * np.uint32(747796405) + np.uint32(2891336453))
        word = np.uint32(
            ((state >> ((state >> np.uint32(28)) + np.uint32(4))) ^ state) * np.uint32(277803737)
        )
        word = np.uint32((word >> np.uint32(22)) ^ word)
        return state, np.float32(word >> np.uint32(8)) * np.float32(2.0**-24)

    return jit(draw)


def _camera(jit: Any) -> Any:
    """Return the function that gives a camera ray: whether it meets the room, its origin there, direction."""

    def ray(column, row, u, v, width, height, camera, room):
        c = camera
        x = (F2 * (np.float32(column) + u) - np.float32(width)) / np.float32(height) * c[12]
        y = (np.float32(height) - F2 * (np.float32(row) + v)) / np.float32(height) * c[12]
        dx, dy, dz = c[9] + x * c[3] + y * c[6], c[10] + x * c[4] + y * c[7], c[11] + x * c[5] + y * c[8]
        scale = F1 / math.sqrt(dx * dx + dy * dy + dz * dz)
        dx, dy, dz = dx * scale, dy * scale, dz * scale
        ax, bx = (room[0] - c[0]) / dx, (room[3] - c[0]) / dx
        ay, by = (room[1] - c[1]) / dy, (room[4] - c[1]) / dy
        az, bz = (room[2] - c[2]) / dz, (room[5] - c[2]) / dz
        enter, leave = max(min(ax, bx), min(ay, by), min(az, bz)), min(max(ax, bx), max(ay, by), max(az, bz))
        t = enter * (F1 + NEAR) if enter <= leave and enter > F0 else F0
        return enter <= leave, c[0] + t * dx, c[1] + t * dy, c[2] + t * dz, dx, dy, dz

    return jit(ray)


def _lamp(jit: Any) -> Any:
    """Return the function that samples a lamp: direction, distance, factor of its radiance, and its row."""

    def sample(x, y, z, nx, ny, nz, pick, a, b, lights):
        k = 0
        while k + 1 < lights.shape[0] and pick >= lights[k, 17]:
            k += 1
        q = lights[k]
        wx, wy = q[0] + a * q[3] + b * q[6] - x, q[1] + a * q[4] + b * q[7] - y
        wz = q[2] + a * q[5] + b * q[8] - z
        square = wx * wx + wy * wy + wz * wz
        distance = math.sqrt(square)
        wx, wy, wz = wx / distance, wy / distance, wz / distance
        cosine, its = nx * wx + ny * wy + nz * wz, -(q[9] * wx + q[10] * wy + q[11] * wz)
        if cosine <= F0 or its <= F0:
            return wx, wy, wz, distance, F0, k
        pdf, own = q[16] * square / (its * q[15]), cosine / PI
        return wx, wy, wz, distance, own * pdf / (pdf * pdf + own * own), k

    return jit(sample)


def _direction(jit: Any) -> Any:
    """Return the function that samples a direction by the cosine; the axes are Duff et al.'s, 2017."""

    def sample(nx, ny, nz, u, v):
        sign = F1 if nz >= F0 else -F1
        f = -F1 / (sign + nz)
        g, r, z, angle = nx * ny * f, math.sqrt(u), math.sqrt(F1 - u), F2 * PI * v
        rx, ry = r * math.cos(angle), r * math.sin(angle)
        dx = rx * (F1 + sign * nx * nx * f) + ry * g + z * nx
        dy = rx * sign * g + ry * (sign + ny * ny * f) + z * ny
        return dx, dy, -rx * sign * nx - ry * ny + z * nz, z / PI

    return jit(sample)


def _weight(jit: Any) -> Any:
    """Return the function that weights what a surface emits: 1 unless a lamp sample could find it too."""

    def weight(surface, pdf, t, dx, dy, dz, looks, lights):
        if looks[surface, 6] < F0:
            return F1
        q = lights[int(looks[surface, 6])]
        cosine = -(q[9] * dx + q[10] * dy + q[11] * dz)
        if cosine <= F0:
            return F0
        other = q[16] * t * t / (cosine * q[15])
        return F1 if pdf < F0 else pdf * pdf / (pdf * pdf + other * other)

    return jit(weight)


def _path(jit: Any) -> Any:
    """Return the function that follows one path from its camera ray; it gives its colour and the state."""
    nearest, hidden, draw, weight = _nearest(jit), _hidden(jit), _random(jit), _weight(jit)
    lamp, direction = _lamp(jit), _direction(jit)

    def path(
        state, ox, oy, oz, dx, dy, dz, edges, background, room, turns, boxes, quads, spheres, looks, lights
    ):
        red = green = blue = F0
        r = g = b = F1
        pdf = -F1
        for edge in range(edges):
            t, s, nx, ny, nz = nearest(ox, oy, oz, dx, dy, dz, room, turns, boxes, quads, spheres)
            if s < 0:
                red, green, blue = (
                    red + r * background[0],
                    green + g * background[1],
                    blue + b * background[2],
                )
                break
            w = weight(s, pdf, t, dx, dy, dz, looks, lights)
            red, green, blue = (
                red + w * r * looks[s, 3],
                green + w * g * looks[s, 4],
                blue + w * b * looks[s, 5],
            )
            if edge + 1 == edges or looks[s, 0] + looks[s, 1] + looks[s, 2] == F0:
                break
            ox, oy, oz = ox + t * dx, oy + t * dy, oz + t * dz
            r, g, b = r * looks[s, 0], g * looks[s, 1], b * looks[s, 2]
            state, pick = draw(state)
            state, u = draw(state)
            state, v = draw(state)
            if lights.shape[0] > 0:
                wx, wy, wz, far, w, k = lamp(ox, oy, oz, nx, ny, nz, pick, u, v, lights)
                far -= F2 * NEAR
                if w > F0 and not hidden(ox, oy, oz, wx, wy, wz, far, turns, boxes, quads, spheres):
                    red, green = red + w * r * lights[k, 12], green + w * g * lights[k, 13]
                    blue += w * b * lights[k, 14]
            state, u = draw(state)
            state, v = draw(state)
            dx, dy, dz, pdf = direction(nx, ny, nz, u, v)
        return state, red, green, blue

    return jit(path)


def _picture(numba: Any) -> Any:
    """Return the function that adds up the paths of all pixels (H, W, 3)."""
    jit = numba.njit(fastmath=True, error_model="numpy")
    path, ray, draw = _path(jit), _camera(jit), _random(jit)

    def picture(
        image, spp, seed, edges, camera, background, room, turns, boxes, quads, spheres, looks, lights
    ):
        height, width, _ = image.shape
        for row in numba.prange(height):
            for column in range(width):
                state, _u = draw(
                    np.uint32(np.uint32(seed) * np.uint32(0x9E3779B9) + np.uint32(row * width + column))
                )
                state, _u = draw(np.uint32(state ^ np.uint32(row * width + column)))
                for _sample in range(spp):
                    state, u = draw(state)
                    state, v = draw(state)
                    meets, ox, oy, oz, dx, dy, dz = ray(column, row, u, v, width, height, camera, room)
                    red, green, blue = background[0], background[1], background[2]
                    if meets:
                        state, red, green, blue = path(
                            state,
                            ox,
                            oy,
                            oz,
                            dx,
                            dy,
                            dz,
                            edges,
                            background,
                            room,
                            turns,
                            boxes,
                            quads,
                            spheres,
                            looks,
                            lights,
                        )
                    image[row, column, 0] += red / np.float32(spp)
                    image[row, column, 1] += green / np.float32(spp)
                    image[row, column, 2] += blue / np.float32(spp)

    return numba.njit(fastmath=True, error_model="numpy", parallel=True)(picture)
