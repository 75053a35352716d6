"""Render a frame of a Blender file as wamnet reads it: `python frame.py FILE.blend FRAME OUT.exr [PERCENT]`.

With the package bpy, or by `blender -b -P frame.py -- FILE.blend FRAME OUT.exr`. One sample a pixel, all
passes that a denoiser reads, OpenEXR MultiLayer of half floats; all else is as the file has it.
"""

import sys

import bpy

PASSES = ("combined", "z", "normal", "position")
"""Passes of a view layer; Denoising Data beside them is Cycles' own."""


def switch_on(scene):
    """Switch the passes on in all view layers, and off what would change the noise."""
    scene.cycles.samples = 1
    scene.cycles.use_denoising = scene.cycles.use_adaptive_sampling = False
    for layer in scene.view_layers:
        for name in PASSES:
            setattr(layer, f"use_pass_{name}", True)
        layer.cycles.denoising_store_passes = True
    form = scene.render.image_settings
    if hasattr(form, "media_type"):
        form.media_type = "MULTI_LAYER_IMAGE"  # since Blender 5.0
    form.file_format, form.color_depth = "OPEN_EXR_MULTILAYER", "16"


if __name__ == "__main__":
    given = sys.argv[sys.argv.index("--") + 1 if "--" in sys.argv else 1 :]
    if len(given) not in (3, 4):
        sys.exit("usage: frame.py FILE.blend FRAME OUT.exr [PERCENT]")
    bpy.ops.wm.open_mainfile(filepath=given[0], load_ui=False, use_scripts=False)
    scene = bpy.context.scene
    switch_on(scene)
    if len(given) == 4:
        scene.render.resolution_percentage = int(given[3])
    scene.frame_set(int(given[1]))
    scene.render.filepath = given[2]
    bpy.ops.render.render(write_still=True)
