"""Two scenes for Blender, made by code: `python scenes.py hall hall.blend`, with the package bpy.

Or by Blender: `blender -b --factory-startup -P scenes.py -- yard yard.blend`. A number behind the file's name
moves the whole path of the camera sideways, by metres.

Each is a film of 48 frames: meshes, image textures, things that turn and move, a camera that travels.
Nothing is downloaded, and the same code makes the same scene.
"""

import math
import random
import sys

import bpy
from mathutils import Vector

FRAMES = 48
TEXELS = 128


# ---- textures --------------------------------------------------------------------------------------------


def picture(name, color_at):
    """Make an image whose texel (u, v), both in [0, 1), has the colour that a function says."""
    image = bpy.data.images.new(name, TEXELS, TEXELS, float_buffer=False)
    numbers = []
    for row in range(TEXELS):
        for column in range(TEXELS):
            numbers += [*color_at((column + 0.5) / TEXELS, (row + 0.5) / TEXELS), 1.0]
    image.pixels = numbers
    image.pack()
    return image


def tiles(light, dark, count, joint):
    """Tiles in two colours, each a little different, with dark joints."""
    shade = random.Random(7)
    shades = [[shade.uniform(0.85, 1.0) for _ in range(count)] for _ in range(count)]

    def color_at(u, v):
        row, column = int(v * count), int(u * count)
        near = min(u * count % 1.0, v * count % 1.0)
        base = (0.08, 0.08, 0.08) if near < joint else light if (row + column) % 2 else dark
        return [channel * shades[row][column] for channel in base]

    return color_at


def bricks(rows, columns):
    """Bricks in bond, of many reds, between pale joints."""
    shade = random.Random(3)
    reds = [[shade.uniform(0.6, 1.0) for _ in range(columns + 1)] for _ in range(rows)]

    def color_at(u, v):
        row = int(v * rows)
        along = u * columns + 0.5 * (row % 2)
        if v * rows % 1.0 < 0.12 or along % 1.0 < 0.06:
            return 0.55, 0.52, 0.48
        red = reds[row][int(along)]
        return 0.55 * red, 0.2 * red, 0.13 * red

    return color_at


def stripes(colors, waves):
    """Bands that wave, in turn of the colours."""

    def color_at(u, v):
        place = v * len(colors) * 2 + 0.3 * math.sin(2.0 * math.pi * waves * u)
        return colors[math.floor(place) % len(colors)]

    return color_at


# ---- materials and things --------------------------------------------------------------------------------


def matte(name, color=None, image=None, scale=1.0, rough=0.7):
    """A surface of one colour or of an image that is repeated."""
    made = bpy.data.materials.new(name)
    made.use_nodes = True
    nodes, links = made.node_tree.nodes, made.node_tree.links
    surface = nodes["Principled BSDF"]
    surface.inputs["Roughness"].default_value = rough
    if image is None:
        surface.inputs["Base Color"].default_value = (*color, 1.0)
        return made
    texture, mapping, place = (
        nodes.new(kind) for kind in ("ShaderNodeTexImage", "ShaderNodeMapping", "ShaderNodeTexCoord")
    )
    texture.image, texture.interpolation = image, "Closest"
    mapping.inputs["Scale"].default_value = (scale, scale, scale)
    links.new(place.outputs["UV"], mapping.inputs["Vector"])
    links.new(mapping.outputs["Vector"], texture.inputs["Vector"])
    links.new(texture.outputs["Color"], surface.inputs["Base Color"])
    return made


def put(material, smooth=False):
    """Give the object that was just made a material, and return it."""
    made = bpy.context.object
    made.data.materials.append(material)
    if smooth:
        for polygon in made.data.polygons:
            polygon.use_smooth = True
    return made


def block(center, size, material, turn=0.0):
    """A box, with a UV map that has the same texels on each side."""
    bpy.ops.mesh.primitive_cube_add(size=1.0, location=center, rotation=(0.0, 0.0, turn))
    made = put(material)
    made.scale = size
    return made


def floor(side, material):
    """A square on the ground."""
    bpy.ops.mesh.primitive_plane_add(size=side)
    return put(material)


def ball(center, radius, material):
    """A smooth ball."""
    bpy.ops.mesh.primitive_uv_sphere_add(segments=48, ring_count=24, radius=radius, location=center)
    return put(material, smooth=True)


def column(center, radius, height, material):
    """An upright cylinder."""
    bpy.ops.mesh.primitive_cylinder_add(vertices=32, radius=radius, depth=height, location=center)
    return put(material, smooth=True)


def head(center, size, material):
    """Blender's monkey, its surface subdivided."""
    bpy.ops.mesh.primitive_monkey_add(size=size, location=center)
    bpy.ops.object.modifier_add(type="SUBSURF")
    return put(material, smooth=True)


def tree(center, height, bark, leaves):
    """A trunk and three cones, at (x, y)."""
    column((*center, 0.2 * height), 0.05 * height, 0.4 * height, bark)
    for level in range(3):
        size = (0.34 - 0.08 * level) * height
        at = (*center, (0.45 + 0.2 * level) * height)
        bpy.ops.mesh.primitive_cone_add(vertices=24, radius1=size, depth=0.32 * height, location=at)
        put(leaves, smooth=True)


def lamp(kind, name, energy, color, place, towards=(0.0, 0.0, 0.0), size=0.0):
    """A lamp; `size`: metres of an area, radians of a sun."""
    data = bpy.data.lights.new(name, kind)
    data.energy, data.color = energy, color
    if kind == "AREA":
        data.size = size
    elif kind == "SUN":
        data.angle = size
    made = bpy.data.objects.new(name, data)
    bpy.context.scene.collection.objects.link(made)
    made.location = place
    made.rotation_euler = (Vector(towards) - Vector(place)).to_track_quat("-Z", "Y").to_euler()
    return made


def camera(path, towards, lens, aside):
    """A camera that is `aside` of path(t) and looks at towards(t), for t in [0, 1)."""
    made = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    bpy.context.scene.collection.objects.link(made)
    bpy.context.scene.camera, made.data.lens = made, lens
    made.rotation_mode = "QUATERNION"
    for frame in range(1, FRAMES + 1):
        t = (frame - 1) / FRAMES
        place, seen = Vector(path(t)) + Vector((aside, 0.0, 0.0)), Vector(towards(t))
        made.location, made.rotation_quaternion = place, (seen - place).to_track_quat("-Z", "Y")
        made.keyframe_insert("location", frame=frame)
        made.keyframe_insert("rotation_quaternion", frame=frame)


def move(thing, place=None, turn=None):
    """Let a thing be at place(t), and be turned by turn(t) radians about the vertical."""
    for frame in range(1, FRAMES + 1):
        t = (frame - 1) / FRAMES
        if place is not None:
            thing.location = place(t)
            thing.keyframe_insert("location", frame=frame)
        if turn is not None:
            thing.rotation_euler = (0.0, 0.0, turn(t))
            thing.keyframe_insert("rotation_euler", frame=frame)


def sky(color, strength):
    """Light from everywhere."""
    world = bpy.data.worlds.new("sky")
    bpy.context.scene.world = world
    world.use_nodes = True
    background = world.node_tree.nodes["Background"]
    background.inputs["Color"].default_value = (*color, 1.0)
    background.inputs["Strength"].default_value = strength


# ---- the scenes ------------------------------------------------------------------------------------------


def hall(aside):
    """A hall with columns, heads that turn, and a ball that rolls, lit by two lamps and a dim sky."""
    ground = matte("ground", image=picture("tiles", tiles((0.8, 0.75, 0.65), (0.25, 0.3, 0.4), 8, 0.06)))
    wall = matte("wall", image=picture("bricks", bricks(16, 8)), scale=3.0)
    bands = matte(
        "bands", image=picture("bands", stripes([(0.8, 0.3, 0.2), (0.85, 0.8, 0.7), (0.2, 0.4, 0.6)], 3))
    )
    stone, jade = matte("stone", (0.7, 0.68, 0.6)), matte("jade", (0.15, 0.5, 0.3), rough=0.4)
    floor(12.0, ground)
    for place, size in (
        ((0.0, 6.0, 2.0), (12.0, 0.2, 4.0)),
        ((-6.0, 0.0, 2.0), (0.2, 12.0, 4.0)),
        ((6.0, 0.0, 2.0), (0.2, 12.0, 4.0)),
    ):
        block(place, size, wall)
    block((0.0, 0.0, 4.1), (12.0, 12.0, 0.2), stone)
    for x in (-3.0, 3.0):
        for y in (-1.0, 2.5):
            column((x, y, 2.0), 0.35, 4.0, stone)
    block((0.0, 2.5, 0.4), (1.2, 1.2, 0.8), bands)
    move(head((0.0, 2.5, 1.5), 1.2, jade), turn=lambda t: 2.0 * math.pi * t)
    move(head((-1.8, 0.6, 0.45), 0.9, stone), turn=lambda t: -2.0 * math.pi * t + 1.0)
    move(ball((0.0, 0.0, 0.5), 0.5, bands), place=lambda t: (2.2 - 2.6 * t, 0.2 + 0.8 * t, 0.5))
    lamp("AREA", "ceiling", 260.0, (1.0, 0.9, 0.75), (0.5, 0.5, 3.9), (0.5, 0.5, 0.0), 2.0)
    lamp("AREA", "side", 120.0, (0.6, 0.75, 1.0), (-4.5, -3.5, 3.0), (0.0, 1.5, 1.0), 1.0)
    sky((0.4, 0.5, 0.7), 0.15)
    camera(
        lambda t: (3.4 - 5.2 * t, -4.6 + 0.5 * math.sin(math.pi * t), 1.7 + 0.4 * t),
        lambda t: (0.1 * t, 1.6, 1.1),
        28.0,
        aside,
    )


def yard(aside):
    """A yard under a sun: a wall, trees, blocks, and a wheel of balls that turns."""
    paving = matte(
        "paving", image=picture("paving", tiles((0.5, 0.48, 0.45), (0.42, 0.4, 0.36), 6, 0.05)), scale=4.0
    )
    wall = matte("wall", image=picture("bricks", bricks(12, 8)), scale=4.0)
    bands = matte("bands", image=picture("bands", stripes([(0.9, 0.75, 0.2), (0.2, 0.25, 0.6)], 2)))
    bark, leaves = matte("bark", (0.25, 0.15, 0.08)), matte("leaves", (0.12, 0.35, 0.1), rough=0.9)
    red, white = matte("red", (0.7, 0.12, 0.1), rough=0.3), matte("white", (0.8, 0.8, 0.78))
    floor(30.0, paving)
    block((0.0, 5.0, 1.2), (14.0, 0.4, 2.4), wall)
    block((-5.5, 1.5, 1.0), (0.4, 7.0, 2.0), wall)
    for place, height in (((-3.6, 3.4), 3.6), ((3.8, 3.2), 4.4), ((5.4, 0.8), 3.0)):
        tree(place, height, bark, leaves)
    block((1.6, 1.8, 0.5), (1.6, 1.0, 1.0), white, 0.5)
    block((1.6, 1.8, 1.25), (0.9, 0.7, 0.5), bands, 0.1)
    for k in range(5):
        thing = ball((0.0, 0.0, 0.0), 0.32, red if k % 2 else bands)
        angle = 2.0 * math.pi * k / 5
        move(
            thing,
            place=lambda t, a=angle: (
                -1.8 + 1.1 * math.cos(a + 2.0 * math.pi * t),
                1.0 + 1.1 * math.sin(a + 2.0 * math.pi * t),
                0.5 + 0.3 * math.sin(2.0 * a + 4.0 * math.pi * t),
            ),
        )
    lamp("SUN", "sun", 3.5, (1.0, 0.93, 0.8), (6.0, -5.0, 8.0), size=0.03)
    sky((0.45, 0.6, 0.9), 0.6)
    camera(
        lambda t: (-2.6 + 5.0 * t, -5.4 + 0.4 * math.cos(2.0 * math.pi * t), 1.5 + 0.7 * t),
        lambda t: (-0.3 + 0.4 * t, 1.8, 0.9),
        30.0,
        aside,
    )


def film(name):
    """Set up 48 frames of a small film."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.name, scene.render.engine = name, "CYCLES"
    scene.frame_start, scene.frame_end, scene.render.fps = 1, FRAMES, 24
    scene.render.resolution_x, scene.render.resolution_y = 384, 288
    scene.cycles.max_bounces = scene.cycles.diffuse_bounces = 4
    scene.cycles.device = "CPU"


if __name__ == "__main__":
    given = sys.argv[sys.argv.index("--") + 1 if "--" in sys.argv else 1 :]
    if len(given) not in (2, 3) or given[0] not in ("hall", "yard"):
        sys.exit("usage: scenes.py hall|yard FILE.blend [METRES]")
    film(given[0])
    {"hall": hall, "yard": yard}[given[0]](float(given[2]) if len(given) == 3 else 0.0)
    bpy.ops.wm.save_as_mainfile(filepath=given[1], compress=True)
