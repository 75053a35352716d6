"""A shot as JSON of three.js, Object/Scene format 4: what `THREE.ObjectLoader` reads, for path tracers of it.

1. Surfaces are BufferGeometry in world space with normals, their material MeshPhysicalMaterial. Lamps, walls
   and bodies have a front only (`side` 0); other sheets have two. What emits is a surface.
2. The format's colours are of eight bits for a screen. Reflectances are exact nonetheless: white, times the
   colours of vertices, which are linear floats. An emission is the levels of which a multiple is nearest
   [`levels_of`], times `emissiveIntensity`; one that is farther off than [`LEVEL_SLACK`] is not expressed.
3. Matte is a surface of `specularIntensity` 0. Metal and mirrors are `metalness` 1; the roughness is the root
   of alpha. Their colour fades to white at grazing angles by Schlick's formula, which is profile
   `schlick-metals`. Glass transmits all, and has a thickness: without one it would be a film. The format has
   its index n as `reflectivity` 2.5 (n - 1) / (n + 1), which is at most 1. Tinted glass is not expressed.
4. A sky is a texture of linear floats, background and environment at once.
5. Size, samples, depth and seed of a shot are in `userData` of the scene.

Source: three.js' manual of ObjectLoader, MeshPhysicalMaterial, PerspectiveCamera and Texture.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

import numpy as np

from wamnet.refimpl.encoding import LEVELS, srgb_decode

from .cases import Shot
from .parts import (
    GLASS,
    MATTE,
    Mesh,
    NotExpressed,
    matrix_of,
    meshes_of,
    parts_of,
    physical,
    request_of,
)

WHITE_LEVELS = 0xFFFFFF
"""A colour of 1 in all channels."""

LEVEL_SLACK = 5e-4
"""Most that an emission may be off, in its largest channel: a quarter of the slack of an answer."""

LARGEST_IOR = 7.0 / 3.0
"""The index of reflectivity 1."""

FRONT, BOTH = 0, 2
"""Values of `side`."""

EQUIRECTANGULAR, REPEAT, CLAMP, NEAREST, RGBA, FLOATS = 303, 1000, 1001, 1003, 1023, 1015
"""Constants of textures: the mapping, how coordinates repeat, the filter, the channels, and their type."""

SKY_SIZE = (4, 2)
"""Width and height of a sky's texture; all texels are alike."""

PLANES = {"near": 1e-4, "far": 1e4}
"""Distances of a camera's planes, which path tracers do not read."""


def write(shot: Shot, seed: int) -> str:
    """Return the file of a shot for a seed; raises NotExpressed."""
    meshes = meshes_of(parts_of(shot.scene))
    asked = request_of(shot, seed)
    scene: dict[str, Any] = {"uuid": "scene", "type": "Scene", "name": shot.name, "userData": asked}
    data: dict[str, Any] = {
        "metadata": {"version": 4.6, "type": "Object", "generator": "wamnet"},
        "geometries": [_geometry(i, mesh) for i, mesh in enumerate(meshes)],
        "materials": [_material(i, mesh) for i, mesh in enumerate(meshes)],
    }
    if any(shot.scene.background):
        data |= _sky(shot.scene.background)
        scene |= {"background": "sky", "environment": "sky"}
    parts = [
        {"uuid": f"part {i}", "type": "Mesh", "geometry": f"geometry {i}", "material": f"material {i}"}
        for i in range(len(meshes))
    ]
    view = {"fov": shot.scene.camera.vertical_fov_deg, "aspect": 1.0, "zoom": 1.0, **PLANES}
    matrix = matrix_of(shot.scene.camera)
    camera = {"uuid": "camera", "type": "PerspectiveCamera", **view, "matrix": matrix}
    scene["children"] = [*parts, camera]
    return json.dumps(data | {"object": scene}, allow_nan=False) + "\n"


def _sky(radiance: Sequence[float]) -> dict[str, Any]:
    """Return a texture that is the same everywhere."""
    width, height = SKY_SIZE
    texels = [*map(float, radiance), 1.0] * (width * height)
    image = {"data": texels, "width": width, "height": height, "type": "Float32Array"}
    texture = {
        "uuid": "sky",
        "image": "sky image",
        "mapping": EQUIRECTANGULAR,
        "wrap": [REPEAT, CLAMP],
        "minFilter": NEAREST,
        "magFilter": NEAREST,
        "format": RGBA,
        "type": FLOATS,
        "colorSpace": "srgb-linear",
        "generateMipmaps": False,
    }
    return {"textures": [texture], "images": [{"uuid": "sky image", "url": image}]}


def _geometry(number: int, mesh: Mesh) -> dict[str, Any]:
    """Return points, normals, colours and corners."""
    colors = np.tile(np.array(mesh.look.reflectance, np.float32), (len(mesh.points), 1))
    arrays = {"position": mesh.points, "normal": mesh.normals, "color": colors}
    attributes = {
        name: {"itemSize": 3, "type": "Float32Array", "array": array.ravel().tolist(), "normalized": False}
        for name, array in arrays.items()
    }
    index = {"type": "Uint32Array", "array": mesh.corners.ravel().tolist()}
    return {
        "uuid": f"geometry {number}",
        "type": "BufferGeometry",
        "data": {"attributes": attributes, "index": index},
    }


def _material(number: int, mesh: Mesh) -> dict[str, Any]:
    """Return a material, all of whose numbers that are not three's own are said."""
    look = mesh.look
    emissive, intensity = levels_of(look.emission)
    rough, metallic = physical(look)
    found = {
        "uuid": f"material {number}",
        "type": "MeshPhysicalMaterial",
        "color": WHITE_LEVELS,
        "vertexColors": True,
        "roughness": rough,
        "metalness": metallic,
        "emissive": emissive,
        "emissiveIntensity": intensity,
        "specularIntensity": 0.0 if look.kind == MATTE else 1.0,
        "side": FRONT if mesh.front else BOTH,
    }
    if look.kind == GLASS:
        if look.number > LARGEST_IOR:
            raise NotExpressed(f"index above {LARGEST_IOR:.4g}")
        reflectivity = 2.5 * (look.number - 1.0) / (look.number + 1.0)
        found |= {"transmission": 1.0, "reflectivity": reflectivity, "thickness": mesh.thick}
    return found


def levels_of(emission: Sequence[float]) -> tuple[int, float]:
    """Return three levels of eight bits as one number, and the intensity that makes them an emission.

    Of all levels of the largest channel the one is taken for which the others are nearest to theirs. Raises
    NotExpressed where that is off by more than LEVEL_SLACK of the largest.
    """
    largest = max(emission)
    if largest <= 0.0:
        return 0, 1.0
    linear = srgb_decode(np.arange(LEVELS + 1) / LEVELS)
    shares = np.array(emission) / largest
    wanted = shares * linear[1:, None]
    nearest = np.argmin(np.abs(linear - wanted[..., None]), axis=-1)
    errors = np.abs(linear[nearest] / linear[1:, None] - shares).max(axis=-1)
    # The brightest of the best.
    best = LEVELS - 1 - int(np.argmin(errors[::-1]))
    if errors[best] > LEVEL_SLACK:
        raise NotExpressed(f"emission of {', '.join(f'{c:g}' for c in emission)} in eight-bit levels")
    red, green, blue = map(int, nearest[best])
    return red << 16 | green << 8 | blue, float(largest / linear[best + 1])
