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

from .case import Shot
from .parts import GLASS, MATTE, METAL, Look, NotExpressed, axes_of, frame_of, parts_of

SUFFIX = ".py"
"""Of the file's name."""

HEAD = """\
import sys

import bpy
from mathutils import Matrix

CUBE = [(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
FACES = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]

bpy.ops.wm.read_factory_settings(use_empty=True)
SCENE = bpy.context.scene
ARGUMENTS = sys.argv[sys.argv.index("--") + 1 if "--" in sys.argv else 1 :]


def add(data, matrix=None):
    made = bpy.data.objects.new("part", data)
    if matrix is not None:
        made.matrix_world = Matrix([*matrix, (0, 0, 0, 1)])
    SCENE.collection.objects.link(made)
    return made


def mesh(points, faces, look, matrix=None):
    made = bpy.data.meshes.new("part")
    made.from_pydata(points, [], faces)
    made.materials.append(look)
    add(made, matrix)


def ball(center, radius, look):
    bpy.ops.mesh.primitive_uv_sphere_add(segments=256, ring_count=128, radius=radius, location=center)
    made = bpy.context.object
    bpy.ops.object.shade_smooth()
    made.data.materials.append(look)


def material(kind, color, number, emission, front):
    made = bpy.data.materials.new("look")
    made.use_nodes = True
    tree = made.node_tree
    tree.nodes.clear()
    surface = tree.nodes.new("ShaderNodeOutputMaterial").inputs["Surface"]

    def node(name, color):
        found = tree.nodes.new("ShaderNode" + name)
        found.inputs["Color"].default_value = (*color, 1.0)
        return found

    if any(emission):
        strength = max(emission)
        shown = node("Emission", [channel / strength for channel in emission])
        shown.inputs["Strength"].default_value = strength
        if any(color):
            both = tree.nodes.new("ShaderNodeAddShader")
            tree.links.new(shown.outputs[0], both.inputs[0])
            tree.links.new(node("BsdfDiffuse", color).outputs[0], both.inputs[1])
            shown = both
        elif front:
            made.cycles.emission_sampling = "FRONT"
            mix, side = (tree.nodes.new("ShaderNode" + name) for name in ("MixShader", "NewGeometry"))
            tree.links.new(side.outputs["Backfacing"], mix.inputs[0])
            tree.links.new(shown.outputs[0], mix.inputs[1])
            tree.links.new(node("BsdfDiffuse", (0.0, 0.0, 0.0)).outputs[0], mix.inputs[2])
            shown = mix
    elif kind == "matte":
        shown = node("BsdfDiffuse", color)
    elif kind == "glass":
        shown = node("BsdfGlass", color)
        shown.inputs["Roughness"].default_value = 0.0
        shown.inputs["IOR"].default_value = number
    else:
        shown = node("BsdfAnisotropic", color)
        shown.distribution = "GGX"
        shown.inputs["Roughness"].default_value = number
    tree.links.new(shown.outputs[0], surface)
    return made


def camera(matrix, angle):
    data = bpy.data.cameras.new("camera")
    data.sensor_fit, data.angle = "VERTICAL", angle
    data.clip_start, data.clip_end = 1e-3, 1e4
    SCENE.camera = add(data, matrix)


def background(color):
    world = bpy.data.worlds.new("world")
    SCENE.world = world
    world.use_nodes = True
    strength = max(color) or 1.0
    node = world.node_tree.nodes["Background"]
    node.inputs["Color"].default_value = (*[channel / strength for channel in color], 1.0)
    node.inputs["Strength"].default_value = strength


def settings(size, spp, depth, layers):
    render, cycles = SCENE.render, SCENE.cycles
    render.engine = "CYCLES"
    render.resolution_x = render.resolution_y = size
    render.resolution_percentage = 100
    SCENE.view_settings.view_transform = "Standard"
    cycles.device, cycles.samples, cycles.use_adaptive_sampling = "CPU", spp, False
    cycles.use_denoising = False
    if layers:
        view = SCENE.view_layers[0]
        view.use_pass_position = view.use_pass_z = view.use_pass_normal = True
        view.cycles.denoising_store_passes = True
    if "--as-it-comes" in ARGUMENTS:
        return
    cycles.pixel_filter_type, cycles.filter_width = "BOX", 1.0
    cycles.max_bounces = cycles.diffuse_bounces = cycles.glossy_bounces = depth
    cycles.transmission_bounces = cycles.transparent_max_bounces = depth
    cycles.min_light_bounces = cycles.min_transparent_bounces = 0
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = cycles.light_sampling_threshold = 0.0
    cycles.caustics_reflective = cycles.caustics_refractive = True
    cycles.blur_glossy = 0.0


def render(seed, output):
    SCENE.cycles.seed = int(seed)
    form = SCENE.render.image_settings
    if output.endswith(".png"):
        form.file_format, form.color_mode, form.color_depth = "PNG", "RGB", "8"
        SCENE.render.dither_intensity = 0.0
    else:
        if hasattr(form, "media_type"):
            form.media_type = "MULTI_LAYER_IMAGE"
        form.file_format, form.color_depth = "OPEN_EXR_MULTILAYER", "32"
    SCENE.render.filepath = output
    bpy.ops.render.render(write_still=True)


"""
"""What every script begins with."""

TAIL = """
for seed, output in zip(ARGUMENTS[0].split(","), ARGUMENTS[1].split(",")):
    render(seed, output)
"""
"""What every script ends with."""


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
    return HEAD + "\n".join(lines) + "\n" + TAIL


def _look(look: Look, front: bool = False) -> str:
    """Return the call that makes a material."""
    if look.emits and look.kind != MATTE:
        raise NotExpressed(f"{look.kind} that emits")
    number = math.sqrt(look.number) if look.kind == METAL else look.number if look.kind == GLASS else 0.0
    emission = tuple(map(float, look.emission))
    return f"material({look.kind!r}, {tuple(look.reflectance)}, {number!r}, {emission}, {front})"
