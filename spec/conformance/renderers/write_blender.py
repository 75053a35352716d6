"""A shot as a Python script for Blender (bpy) that renders it by Cycles.

The script is run by `python SCENE.py SEEDS OUTPUTS`, or `blender -b -P SCENE.py -- SEEDS OUTPUTS`.

1. SEEDS and OUTPUTS are lists with commas, a picture each. An output ending in .png is a picture for a
   screen by the view transform Standard; any other is OpenEXR with the layers that denoisers read.
2. Transport has no clamp, no light threshold, caustics of both kinds, and as many bounces as the shot
   wants; the filter of pixels is a box. `--as-it-comes` behind OUTPUTS leaves Blender's defaults for all of
   these.
3. Metal and mirrors are the node `Glossy BSDF` (GGX, alpha being the square of Blender's roughness), glass is
   `Glass BSDF`. A lamp is black behind, by the node `Geometry`, output `Backfacing`.

Source: Blender's Python reference, `bpy.types.RenderSettings`, `Object`, `Material`; Cycles' manual.
"""

from __future__ import annotations

import math

from .cases import Shot
from .parts import GLASS, METAL, Look, axes_of, frame_of, parts_of, script


def write(shot: Shot, seed: int) -> str:
    """Return the script of a shot; the seed is an argument of the script. Raises NotExpressed."""
    del seed
    camera = shot.scene.camera
    lines = [
        f"settings({shot.size}, {shot.spp}, {shot.depth}, {shot.layers})",
        f"camera({frame_of(camera).tolist()}, {math.radians(camera.vertical_fov_deg)!r})",
        f"background({shot.scene.background})",
    ]
    parts = parts_of(shot.scene)
    for sheet in parts.sheets:
        look = _look(sheet.look, sheet.front)
        lines.append(f"mesh({sheet.corners.tolist()}, [(0, 1, 2, 3)], {look})")
    for box, of_box in parts.boxes:
        lines.append(f"mesh(CUBE, FACES, {_look(of_box)}, {axes_of(box).tolist()})")
    for sphere, of_sphere in parts.spheres:
        lines.append(f"ball({sphere.center}, {sphere.radius!r}, {_look(of_sphere)})")
    return script("blender", lines)


def _look(look: Look, front: bool = False) -> str:
    """Return the call that makes a material."""
    number = math.sqrt(look.number) if look.kind == METAL else look.number if look.kind == GLASS else 0.0
    emission = tuple(map(float, look.emission))
    return f"material({look.kind!r}, {tuple(look.reflectance)}, {number!r}, {emission}, {front})"
