"""Cases of layers: what a denoiser reads beside the colour, on one wall that is seen at an angle.

A wall through the origin is seen by a camera whose axes are not those of the world, so that both kinds of
normals differ; distances are requested in a corner of the picture, where those along the ray and along the
view differ. Materials take turns on it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from wamnet.refimpl.light.camera import camera_basis
from wamnet.refimpl.light.materials import Conductor, Dielectric, Material, Mirror
from wamnet.refimpl.light.scene import Box, Camera, Light, Quad, Scene
from wamnet.refimpl.light.shapes.shape import Vector

from . import answers
from .case import Question, Shot

NORMAL: Vector = (0.48, 0.6, 0.64)
"""Unit normal of the wall: 0.2304 + 0.36 + 0.4096 = 1."""

TANGENT: Vector = (0.8, 0.0, -0.6)
"""A unit vector in the wall."""

CAMERA = Camera((3.36, 1.8, 0.48), (0.0, 0.0, 0.0), vertical_fov_deg=40.0)
"""Three units along the normal and 2.4 along the tangent: 39 degrees to the wall, which fills the picture."""

WALL_SIZE = 64
"""Pixels along each side of these pictures: small ones, for a renderer may look at one point of each only."""

CORNER = (0, 0, 1, 1)
"""The pixel in a corner of the picture: in a block of several, answers would differ."""

IN_PIXEL = 0.015
"""Slack of distances, and half of that of points: at the corner distances change by 1.6 and 0.9 per cent a
pixel along its sides, points by twice that, and a layer that is not a mean over a pixel is of any point of
it. Distances along the view are 11 per cent off."""

MATTE: Vector = (0.2, 0.5, 0.8)
"""Reflectance of a matte wall: its channels differ."""

GOLD: Vector = (1.0, 0.78, 0.34)
"""Reflectance of metal: neither white, nor that of the matte wall."""

SILVER: Vector = (0.88, 0.88, 0.88)
"""Reflectance of a mirror."""

WHITE: Vector = (1.0, 1.0, 1.0)
"""Reflectance of clear glass."""

HALF = 20.0
"""Half of the wall's edges."""


def wall(reflectance: Vector, material: Material | None = None, turned: bool = False) -> Quad:
    """Return the wall; `turned`: its own side is the one that is not seen."""
    u, v = np.cross(TANGENT, NORMAL), np.array(TANGENT)
    u, v = (v, u) if turned else (u, v)
    corner = -HALF * (u + v)
    return Quad(_vector(corner), _vector(2 * HALF * u), _vector(2 * HALF * v), reflectance, material=material)


def _vector(values: object) -> Vector:
    """Return three floats."""
    x, y, z = (float(value) for value in np.asarray(values))
    return (x, y, z)


def _shot(name: str, **parts: object) -> Shot:
    """Return a picture with layers."""
    scene = Scene(name, CAMERA, **parts)  # type: ignore[arg-type]
    return Shot(name, scene, WALL_SIZE, spp=4, layers=True)


def walls() -> Iterator[Question]:
    """Yield the layers of a matte wall."""
    shot = _shot("layers-wall", quads=(wall(MATTE),))
    basis = camera_basis(CAMERA)
    in_camera = [float(np.dot(NORMAL, axis)) for axis in (basis.right, basis.up, -basis.forward)]
    yield Question("albedo-matte", "albedo", shot, MATTE, "the reflectance", "albedo")
    views = {"camera-normals": _vector(in_camera)}
    yield Question("normal", "normals", shot, NORMAL, "the wall's normal", "normal", intents=views)
    turned = _shot("layers-turned", quads=(wall(MATTE, turned=True),))
    source = "the wall's normal on the side of the ray, whatever the order of its corners"
    yield Question("normal-turned", "normals", turned, NORMAL, source, "normal", intents=views)
    distance, along, point = answers.plane_hits(CAMERA, WALL_SIZE, CORNER, np.array(NORMAL))
    source = "rays against a plane, the mean over the block's pixels"
    intents = {"depth-along-view": (along,)}
    yield Question("depth", "depth", shot, (distance,), source, "depth", CORNER, IN_PIXEL, intents)
    yield Question("position", "position", shot, _vector(point), source, "position", CORNER, 2 * IN_PIXEL)


def materials() -> Iterator[Question]:
    """Yield the albedo of what is not matte."""
    kinds: Mapping[str, tuple[Vector, Material]] = {
        "metal": (GOLD, Conductor(0.3)),
        "mirror": (SILVER, Mirror()),
        "glass": (WHITE, Dielectric(1.5)),
    }
    for name, (reflectance, material) in kinds.items():
        if name == "glass":
            # A slab whose upper side is the wall's plane.
            rows = (_vector(np.cross(TANGENT, NORMAL)), TANGENT, NORMAL)
            center = _vector(-0.5 * np.array(NORMAL))
            slab = Box(center, (HALF, HALF, 0.5), reflectance, rows, material=material)
            shot = _shot(f"layers-{name}", boxes=(slab,))
        else:
            shot = _shot(f"layers-{name}", quads=(wall(reflectance, material),))
        intents = {"white-albedo": WHITE, "diffuse-albedo": (0.0, 0.0, 0.0)}
        yield Question(
            f"albedo-{name}", "albedo", shot, reflectance, "the reflectance", "albedo", intents=intents
        )


def nothing() -> Iterator[Question]:
    """Yield the layers where nothing is hit."""
    shot = _shot("layers-miss", background=(0.5, 0.5, 0.5))
    zero, source = (0.0, 0.0, 0.0), "there is no surface"
    for layer in ("albedo", "normal"):
        yield Question(f"miss-{layer}", "misses", shot, zero, source, layer)
    intents = {"far-misses": None}
    yield Question("miss-depth", "misses", shot, (0.0,), source, "depth", intents=intents)


def lamps() -> Iterator[Question]:
    """Yield the normal of a lamp."""
    u, v = np.cross(TANGENT, NORMAL), np.array(TANGENT)
    shines = Light(_vector(-2.0 * (u + v)), _vector(4.0 * u), _vector(4.0 * v), (1.0, 1.0, 1.0), 10.0)
    shot = _shot("layers-lamp", lights=(shines,))
    middle = (24, 24, 16, 16)
    yield Question("normal-lamp", "normals", shot, NORMAL, "a lamp is a surface", "normal", middle)


GROUPS = (walls, materials, nothing, lamps)
"""What yields questions about layers."""
