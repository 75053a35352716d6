"""A shot as a Python script for LuxCore (pyluxcore) that renders it: `python SCENE.py SEEDS OUTPUTS`.

1. SEEDS and OUTPUTS are lists with commas; an output is an .npz with layers by name, or a .png by LuxCore's
   own pipeline of pictures for a screen (gamma correction only).
2. Engine PATHCPU, sampler RANDOM, no clamp, no roulette before the last bounce, a box filter of one pixel.
3. Spheres are meshes with normals of their own. Emitters shine to their front: what emits on both sides is
   two sheets back to back. Rough metal is not expressed: LuxCore's `metal2` takes complex indices.

Source: LuxCore's reference of properties of scenes and of render configurations.
"""

from __future__ import annotations

from .cases import Shot
from .parts import GLASS, MATTE, METAL, MIRROR, Look, NotExpressed, axes_of, parts_of, script


def write(shot: Shot, seed: int) -> str:
    """Return the script of a shot; the seed is an argument of the script. Raises NotExpressed."""
    del seed
    camera = shot.scene.camera
    lines = [
        f"SIZE, SPP, DEPTH, LAYERS = {shot.size}, {shot.spp}, {shot.depth}, {shot.layers}",
        f"parse('scene.camera', type='perspective', lookat__orig={list(camera.position)}, "
        f"lookat__target={list(camera.look_at)}, up={list(camera.up)}, "
        f"fieldofview={camera.vertical_fov_deg!r}, autovolume__enable=False, cliphither=1e-4, clipyon=1e4)",
    ]
    if any(shot.scene.background):
        lines.append(
            f"parse('scene.lights.sky', type='constantinfinite', color={list(shot.scene.background)}, "
            "gain=[1.0, 1.0, 1.0])"
        )
    parts = parts_of(shot.scene)
    for sheet in parts.sheets:
        look = _look(sheet.look)
        sides = (side.corners.tolist() for side in sheet.sides)
        lines += [f"mesh({points}, [(0, 1, 2), (0, 2, 3)], {look})" for points in sides]
    lines += [f"box({axes_of(box).tolist()}, {_look(look)})" for box, look in parts.boxes]
    lines += [f"ball({ball.center}, {ball.radius!r}, {_look(look)})" for ball, look in parts.spheres]
    return script("luxcore", lines)


def _look(look: Look) -> dict[str, object]:
    """Return the properties of a material."""
    if look.kind == METAL:
        raise NotExpressed("white rough metal")
    color = list(look.reflectance)
    every: dict[str, dict[str, object]] = {
        MATTE: {"type": "matte", "kd": color},
        MIRROR: {"type": "mirror", "kr": color},
        GLASS: {"type": "glass", "kr": color, "kt": color, "interiorior": look.number, "exteriorior": 1.0},
    }
    found = every[look.kind]
    if look.emits:
        found |= {"emission": list(map(float, look.emission)), "emission__gain": [1.0, 1.0, 1.0]}
    return found
