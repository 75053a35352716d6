"""A shot as a Python script for LuxCore (pyluxcore) that renders it: `python SCENE.py SEEDS OUTPUTS`.

1. SEEDS and OUTPUTS are lists with commas; an output is an .npz with layers by name, or a .png by LuxCore's
   own pipeline of pictures for a screen (gamma correction only).
2. Engine PATHCPU, sampler RANDOM, no clamp, no roulette before the last bounce, a box filter of one pixel.
3. Spheres are meshes with normals of their own. Emitters shine to their front: what emits on both sides is
   two sheets back to back. Rough metal is not expressed: LuxCore's `metal2` takes complex indices.

Source: LuxCore's reference of properties of scenes and of render configurations.
"""

from __future__ import annotations

import numpy as np

from .case import Shot
from .parts import GLASS, MATTE, METAL, MIRROR, Look, NotExpressed, Sheet, axes_of, parts_of

SUFFIX = ".py"
"""Of the file's name."""

APART = 1e-4
"""Distance of the two sides of what emits on both, in its shorter edge."""

HEAD = """\
import math
import sys
import time

import numpy as np
import pyluxcore

CUBE = [(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
FACES = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
CUBES = [(a, b, c) for a, b, c, d in FACES] + [(a, c, d) for a, b, c, d in FACES]

pyluxcore.Init()
SCENE = pyluxcore.Scene()
COUNT = [0]


def parse(prefix, **values):
    found = pyluxcore.Properties()
    for name, value in values.items():
        found.Set(pyluxcore.Property(prefix + "." + name.replace("__", "."), value))
    SCENE.Parse(found)


def mesh(points, triangles, look, normals=None):
    COUNT[0] += 1
    name = f"part{COUNT[0]}"
    points = [tuple(map(float, point)) for point in points]
    SCENE.DefineMesh("mesh" + name, points, triangles, normals, None, None, None)
    parse("scene.materials.look" + name, **look)
    parse("scene.objects." + name, shape="mesh" + name, material="look" + name)


def box(axes, look):
    axes = np.array(axes)
    mesh(np.array(CUBE) @ axes[:, :3].T + axes[:, 3], CUBES, look)


def ball(center, radius, look, rings=128, segments=256):
    theta = np.pi * np.arange(rings + 1) / rings
    phi = 2 * np.pi * np.arange(segments) / segments
    x, z = np.outer(np.sin(theta), np.cos(phi)), np.outer(np.sin(theta), np.sin(phi))
    unit = np.stack([x, np.outer(np.cos(theta), np.ones(segments)), z], -1).reshape(-1, 3)
    triangles = []
    for i in range(rings):
        for j in range(segments):
            a, b = i * segments + j, i * segments + (j + 1) % segments
            if i > 0:
                triangles.append((a, b, b + segments))
            if i < rings - 1:
                triangles.append((a, b + segments, a + segments))
    normals = [tuple(map(float, normal)) for normal in unit]
    mesh(np.array(center) + radius * unit, triangles, look, normals)


"""
"""What every script begins with."""

TAIL = """

KINDS = {"color": "RGB", "albedo": "ALBEDO", "normal": "AVG_SHADING_NORMAL"}
KINDS |= {"depth": "DEPTH", "position": "POSITION"}
CHANNELS = {"depth": 1}


def render(seed, output):
    screen = output.endswith(".png")
    wanted = KINDS if LAYERS else {"color": "RGB"}
    given = {
        "renderengine.type": "PATHCPU",
        "renderengine.seed": int(seed) + 1,
        "sampler.type": "RANDOM",
        "batch.haltspp": [SPP],
        "native.threads.count": 2,
        "film.width": SIZE,
        "film.height": SIZE,
        "film.filter.type": "BOX",
        "film.filter.width": 0.5,
        "film.imagepipelines.0.0.type": "GAMMA_CORRECTION" if screen else "NOP",
        "path.pathdepth.total": DEPTH + 1,
        "path.pathdepth.diffuse": DEPTH + 1,
        "path.pathdepth.glossy": DEPTH + 1,
        "path.pathdepth.specular": DEPTH + 1,
        "path.russianroulette.depth": DEPTH + 1,
        "path.clamping.variance.maxvalue": 0.0,
    }
    for number, kind in enumerate(["RGB_IMAGEPIPELINE", *wanted.values()]):
        given[f"film.outputs.{number}.type"] = kind
        given[f"film.outputs.{number}.filename"] = f"{number}.exr"
        if kind == "RGB_IMAGEPIPELINE":
            given[f"film.outputs.{number}.index"] = 0
    found = pyluxcore.Properties()
    for name, value in given.items():
        found.Set(pyluxcore.Property(name, value))
    session = pyluxcore.RenderSession(pyluxcore.RenderConfig(found, SCENE))
    session.Start()
    while not session.HasDone():
        time.sleep(0.01)
        session.UpdateStats()
    session.Stop()
    film = session.GetFilm()

    def read(kind, channels):
        values = np.zeros(SIZE * SIZE * channels, np.float32)
        film.GetOutputFloat(getattr(pyluxcore.FilmOutputType, kind), values, 0)
        return values.reshape(SIZE, SIZE, channels)[::-1]

    if screen:
        from PIL import Image

        levels = np.floor(255 * np.clip(read("RGB_IMAGEPIPELINE", 3), 0, 1) + 0.5)
        Image.fromarray(levels.astype(np.uint8)).save(output)
    else:
        np.savez(output, **{layer: read(kind, CHANNELS.get(layer, 3)) for layer, kind in wanted.items()})


for seed, output in zip(sys.argv[1].split(","), sys.argv[2].split(",")):
    render(seed, output)
"""
"""What every script ends with."""


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
        lines += [f"mesh({points}, [(0, 1, 2), (0, 2, 3)], {look})" for points in _sides(sheet)]
    lines += [f"box({axes_of(box).tolist()}, {_look(look)})" for box, look in parts.boxes]
    lines += [f"ball({ball.center}, {ball.radius!r}, {_look(look)})" for ball, look in parts.spheres]
    return HEAD + "\n".join(lines) + "\n" + TAIL


def _sides(sheet: Sheet) -> list[list[list[float]]]:
    """Return the corners of a sheet, and where it emits on both sides those of its back too."""
    corners = sheet.corners
    if not sheet.look.emits or sheet.front:
        return [corners.tolist()]
    normal = np.cross(sheet.edge_u, sheet.edge_v)
    apart = normal / np.linalg.norm(normal) * 0.5 * APART
    return [(corners + apart).tolist(), (corners[::-1] - apart).tolist()]


def _look(look: Look) -> dict[str, object]:
    """Return the properties of a material."""
    if look.emits and look.kind != MATTE:
        raise NotExpressed(f"{look.kind} that emits")
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
