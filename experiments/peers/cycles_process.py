"""The process that renders by Cycles: a line of JSON is a question, and a line the answer [peer_cycles.py].

1. The first line has a scene, a size, samples, and edges of a path; the answer is Blender's version
   [`World`]. Further ones have a moment of the scene, a seed and a quality; the answer is seconds
   [`World.draw`].
2. Standard output is for answers: what Blender prints goes nowhere [`main`].
3. Transport is that of refimpl/light/transport.py: diffuse surfaces, samples of lights and of surfaces with
   weights, no clamping, all lights sampled; Cycles counts bounces after the first hit's light sample: edges
   of a path less two. Radiances and reflectances are linear RGB, as Blender's numbers are.
4. A wall whose outer side faces the camera is hidden from camera rays, and from no others: within a room that
   holds everything that is the same as a wall that is only there from inside. Lights emit from one side, by
   the node `Geometry`, output `Backfacing`; the other side is black.
5. The boxes share one mesh; each is an object, whose matrix is all that a moment changes. Blender's data stay
   between pictures (`use_persistent_data`).

Source: Blender's Python reference, `bpy.types.RenderSettings`, `Object`, `Material`; Cycles' manual.
"""

from __future__ import annotations

import importlib
import json
import math
import os
import sys
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from wamnet.refimpl.errors import WamnetError
from wamnet.refimpl.light.scene import Box, Camera, Scene, from_json
from wamnet.refimpl.light.shapes.quad import light_radiance
from wamnet_verify.parts import room_walls

CORNERS = [(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
"""Corners of the cube [-1, 1]^3."""

FACES = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
"""Its faces, by corners."""

ERRORS = (ImportError, OSError, RuntimeError, LookupError, AttributeError, TypeError, ValueError, WamnetError)
"""What Blender raises where it cannot do what is asked."""

CLIP = (1e-3, 1e6)
"""Nearest and farthest distance that the camera sees, in scene units."""


class World:
    """Blender's scene, set for pictures of one size."""

    def __init__(self, bpy: Any, given: Mapping[str, Any], folder: str) -> None:
        """Make it of the first question."""
        self._bpy, self._matrix = bpy, importlib.import_module("mathutils").Matrix
        bpy.ops.wm.read_factory_settings(use_empty=True)
        self._to, self._file = bpy.context.scene, str(Path(folder, "picture.exr"))
        self._size = int(given["size"])
        self._set_output()
        self._set_transport(int(given["spp"]), int(given["edges"]))
        scene = from_json(given["scene"])
        self._boxes = self._build(scene)

    def _set_output(self) -> None:
        """Ask for square pictures of single floats, uncompressed."""
        render = self._to.render
        render.engine, render.filepath, render.use_persistent_data = "CYCLES", self._file, True
        render.resolution_x = render.resolution_y = self._size
        render.resolution_percentage = 100
        form = render.image_settings
        form.file_format, form.color_mode, form.color_depth, form.exr_codec = "OPEN_EXR", "RGB", "32", "NONE"

    def _set_transport(self, spp: int, edges: int) -> None:
        """Ask for paths as ours, pixels by a box filter, and features as they come for the denoiser."""
        cycles = self._to.cycles
        cycles.device, cycles.samples, cycles.use_adaptive_sampling = "CPU", spp, False
        cycles.pixel_filter_type, cycles.filter_width, cycles.use_auto_tile = "BOX", 1.0, False
        cycles.max_bounces = cycles.diffuse_bounces = max(edges - 2, 0)
        cycles.min_light_bounces = 0
        cycles.sample_clamp_direct = cycles.sample_clamp_indirect = cycles.light_sampling_threshold = 0.0
        cycles.denoiser, cycles.denoising_use_gpu = "OPENIMAGEDENOISE", False
        cycles.denoising_input_passes, cycles.denoising_prefilter = "RGB_ALBEDO_NORMAL", "NONE"

    def _build(self, scene: Scene) -> list[Any]:
        """Make all objects; return those of the boxes."""
        eye = np.array(scene.camera.position)
        for wall, (corner, u, v) in enumerate(room_walls(scene.room) if scene.room else ()):
            assert scene.room is not None
            seen = float(np.dot(eye - corner, np.cross(u, v))) > 0.0
            self._quad(corner, u, v, self._matte(scene.room.reflectances[wall]), seen)
        for quad in scene.quads:
            self._quad(quad.corner, quad.edge_u, quad.edge_v, self._matte(quad.reflectance))
        for light in scene.lights:
            self._quad(light.corner, light.edge_u, light.edge_v, self._lamp(light_radiance(light)))
        self._see(scene.camera)
        world = self._bpy.data.worlds.new("world")
        self._to.world = world
        world.use_nodes = True
        world.node_tree.nodes["Background"].inputs["Color"].default_value = (*scene.background, 1.0)
        return self._cubes(scene)

    def _cubes(self, scene: Scene) -> list[Any]:
        """Make an object of each box, all of one mesh."""
        mesh = self._bpy.data.meshes.new("cube")
        mesh.from_pydata(CORNERS, [], FACES)
        mesh.materials.append(None)
        found = []
        for box in scene.boxes:
            cube = self._add("cube", mesh)
            cube.material_slots[0].link = "OBJECT"
            cube.material_slots[0].material = self._matte(box.reflectance)
            self._place(cube, box)
            found.append(cube)
        return found

    def _add(self, name: str, data: Any) -> Any:
        """Return a new object of the scene."""
        made = self._bpy.data.objects.new(name, data)
        self._to.collection.objects.link(made)
        return made

    def _quad(self, corner: Any, u: Any, v: Any, material: Any, seen: bool = True) -> None:
        """Make a parallelogram; `seen`: by the camera."""
        corner, u, v = (np.asarray(each, float) for each in (corner, u, v))
        mesh = self._bpy.data.meshes.new("quad")
        points = [tuple(map(float, point)) for point in (corner, corner + u, corner + u + v, corner + v)]
        mesh.from_pydata(points, [], [(0, 1, 2, 3)])
        mesh.materials.append(material)
        self._add("quad", mesh).visible_camera = seen

    def _place(self, cube: Any, box: Box) -> None:
        """Put a cube where a box is."""
        matrix = np.eye(4)
        matrix[:3, :3] = np.array(box.rotation).T * box.half_extent
        matrix[:3, 3] = box.center
        cube.matrix_world = self._matrix(matrix.tolist())

    def _see(self, camera: Camera) -> None:
        """Make the camera: it looks along its negative z."""
        data = self._bpy.data.cameras.new("camera")
        data.sensor_fit, data.angle = "VERTICAL", math.radians(camera.vertical_fov_deg)
        data.clip_start, data.clip_end = CLIP
        forward = np.subtract(camera.look_at, camera.position)
        forward = forward / np.linalg.norm(forward)
        right = np.cross(forward, camera.up)
        right = right / np.linalg.norm(right)
        matrix = np.eye(4)
        matrix[:3] = np.stack([right, np.cross(right, forward), -forward, camera.position], axis=1)
        made = self._add("camera", data)
        made.matrix_world = self._matrix(matrix.tolist())
        self._to.camera = made

    def _nodes(self) -> tuple[Any, Any, Any]:
        """Return a new material, its nodes, and what its surface is joined to."""
        material = self._bpy.data.materials.new("material")
        material.use_nodes = True
        tree = material.node_tree
        tree.nodes.clear()
        return material, tree, tree.nodes.new("ShaderNodeOutputMaterial").inputs["Surface"]

    def _matte(self, reflectance: Any) -> Any:
        """Return a diffuse material."""
        material, tree, surface = self._nodes()
        node = tree.nodes.new("ShaderNodeBsdfDiffuse")
        node.inputs["Color"].default_value = (*reflectance, 1.0)
        tree.links.new(node.outputs["BSDF"], surface)
        return material

    def _lamp(self, radiance: Any) -> Any:
        """Return a material that emits from its front, and is black behind."""
        material, tree, surface = self._nodes()
        kinds = ("Emission", "BsdfDiffuse", "MixShader", "NewGeometry")
        emits, black, mix, geometry = (tree.nodes.new(f"ShaderNode{kind}") for kind in kinds)
        emits.inputs["Color"].default_value = (*map(float, radiance), 1.0)
        emits.inputs["Strength"].default_value = 1.0
        black.inputs["Color"].default_value = (0.0, 0.0, 0.0, 1.0)
        tree.links.new(geometry.outputs["Backfacing"], mix.inputs[0])
        tree.links.new(emits.outputs["Emission"], mix.inputs[1])
        tree.links.new(black.outputs["BSDF"], mix.inputs[2])
        tree.links.new(mix.outputs["Shader"], surface)
        material.cycles.emission_sampling = "FRONT"
        return material

    def draw(self, asked: Mapping[str, Any]) -> tuple[float, ...]:
        """Make a picture; return the seconds of the scene's numbers, of rendering and of reading."""
        scene = from_json(asked["scene"])
        times = [time.perf_counter()]
        for cube, box in zip(self._boxes, scene.boxes, strict=True):
            self._place(cube, box)
        self._to.cycles.seed = int(asked["seed"])
        self._to.cycles.use_denoising = bool(asked["quality"])
        if asked["quality"]:
            self._to.cycles.denoising_quality = asked["quality"].upper()
        times.append(time.perf_counter())
        self._bpy.ops.render.render(write_still=True)
        times.append(time.perf_counter())
        pixels = self._read()
        times.append(time.perf_counter())
        if "keep" in asked:
            pixels.tofile(asked["keep"])
        return tuple(float(second) for second in np.diff(times))

    def _read(self) -> Any:
        """Return the numbers (4 H W,) of the file, rows from the bottom."""
        image = self._bpy.data.images.load(self._file)
        pixels = np.empty(4 * self._size**2, np.float32)
        image.pixels.foreach_get(pixels)
        self._bpy.data.images.remove(image)
        return pixels


def main(folder: str) -> None:
    """Answer questions until there are no more."""
    answers = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    world: World | None = None
    for line in sys.stdin:
        asked = json.loads(line)
        try:
            if world is None:
                bpy = importlib.import_module("bpy")
                world, answer = World(bpy, asked, folder), {"version": bpy.app.version_string}
            else:
                answer = {"seconds": world.draw(asked)}
        except ERRORS as error:  # the one who asked says it
            lines = str(error).strip().splitlines() or [type(error).__name__]
            answer = {"wrong": lines[0]}
        answers.write(json.dumps(answer) + "\n")
        answers.flush()


if __name__ == "__main__":
    main(sys.argv[1])
