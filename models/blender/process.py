"""The process that renders a Blender file: a line of JSON is a question, a marked line the answer.

1. It runs in Blender (`blender --background --python process.py`) or in a Python that has the package bpy,
   and imports nothing of this project: Blender's Python does not have it [`main`].
2. The first question names a file, and perhaps one of its view layers; the answer is what the file says of
   its animation [`Film`]. The scripts in a file are not run.
3. Further questions name a frame, samples, a seed, a percentage and a file; the answer is that the file is
   there: multi-layer OpenEXR of single floats, with the passes that denoisers read [`Film.render`].
4. What a picture looks like stays as the file has it: the filter of pixels, motion blur, clamps, bounces,
   light groups, other passes. What would make noise another one is set: no denoising, no adaptive samples,
   no limit of time, the seed of the question [`Film._prepare`].
5. Standard output is for answers: what Blender prints goes nowhere, or comes before the mark.

Source: Blender's Python reference, `bpy.types.RenderSettings`, `ViewLayer`, `ImageFormatSettings`.
"""

from __future__ import annotations

import importlib
import json
import os
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

MARK = "wamnet: "
"""What each answer begins with."""

OTHERS = (ImportError, OSError, LookupError, AttributeError, TypeError)
"""What Blender raises where it cannot do what is requested, beside errors of values and of rendering."""

FORM = "OPEN_EXR_MULTILAYER"
"""Blender's name of the format with all passes."""


class Film:
    """An opened file: one scene, one view layer, one camera, an animation."""

    def __init__(self, bpy: Any, given: Mapping[str, Any]) -> None:
        """Open the file of the first question; RuntimeError and ValueError say why it cannot be rendered."""
        self._bpy = bpy
        bpy.ops.wm.open_mainfile(filepath=given["file"], load_ui=False, use_scripts=False)
        self._scene = bpy.context.scene
        if self._scene.render.engine != "CYCLES":
            raise ValueError(f"its render engine is {self._scene.render.engine}, and only Cycles has samples")
        if self._scene.camera is None:
            raise ValueError("its scene has no camera")
        self._layer = self._chosen(given["view_layer"])
        self._percent = self._scene.render.resolution_percentage
        self._prepare()

    def _chosen(self, name: str) -> Any:
        """Return the view layer of a name, or the only one that is rendered; switch the others off."""
        layers = list(self._scene.view_layers)
        known = ", ".join(layer.name for layer in layers)
        found = [layer for layer in layers if (layer.name == name if name else layer.use)]
        if len(found) != 1:
            which = f"no view layer {name}" if name else f"{len(found)} view layers that are rendered"
            raise ValueError(f"it has {which}, of {known}: name one with --view-layer")
        for layer in layers:
            layer.use = layer == found[0]
        return found[0]

    def _prepare(self) -> None:
        """Switch the passes on, and off what would make the noise another one."""
        render, cycles, layer = self._scene.render, self._scene.cycles, self._layer
        cycles.use_denoising = cycles.use_adaptive_sampling = cycles.use_animated_seed = False
        cycles.time_limit, cycles.use_auto_tile = 0.0, False
        layer.samples = 0
        layer.use_pass_combined = layer.use_pass_z = layer.use_pass_normal = layer.use_pass_position = True
        layer.cycles.denoising_store_passes = True
        render.use_compositing = render.use_sequencer = render.use_border = render.use_multiview = False
        render.use_persistent_data = True
        form = render.image_settings
        if hasattr(form, "media_type"):
            form.media_type = "MULTI_LAYER_IMAGE"  # since Blender 5.0
        form.file_format, form.color_depth, form.exr_codec = FORM, "32", "ZIP"

    def about(self) -> dict[str, Any]:
        """Return what the file says of its animation."""
        scene, render = self._scene, self._scene.render
        return {
            "version": self._bpy.app.version_string,
            "scene": scene.name,
            "view_layer": self._layer.name,
            "first": scene.frame_start,
            "last": scene.frame_end,
            "step": scene.frame_step,
            "fps": render.fps / render.fps_base,
            "width": render.resolution_x * self._percent // 100,
            "height": render.resolution_y * self._percent // 100,
            "pixel_filter": scene.cycles.pixel_filter_type,
            "device": scene.cycles.device,
        }

    def render(self, asked: Mapping[str, Any]) -> dict[str, Any]:
        """Render a frame to the named file; with a prefilter Blender denoises it by Open Image Denoise."""
        scene, render, cycles = self._scene, self._scene.render, self._scene.cycles
        scene.frame_set(int(asked["frame"]))
        render.resolution_percentage = self._percent
        if asked["percent"] != 100:
            render.resolution_x, render.resolution_y = int(asked["width"]), int(asked["height"])
            render.resolution_percentage = 100
        cycles.samples, cycles.seed = int(asked["spp"]), int(asked["seed"])
        cycles.use_denoising = bool(prefilter := asked.get("prefilter", ""))
        if prefilter:
            cycles.denoiser, cycles.denoising_use_gpu = "OPENIMAGEDENOISE", False
            cycles.denoising_input_passes, cycles.denoising_prefilter = "RGB_ALBEDO_NORMAL", prefilter
            cycles.denoising_quality = "HIGH"
        render.filepath = asked["to"]
        self._bpy.ops.render.render(write_still=True)
        if not Path(asked["to"]).is_file():
            raise RuntimeError("Blender has rendered, and written no file")
        return {}


def main() -> None:
    """Answer questions until there are no more."""
    answers = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    film: Film | None = None
    for line in sys.stdin:
        asked = json.loads(line)
        try:
            if film is None:
                film = Film(importlib.import_module("bpy"), asked)
                answer = film.about()
            else:
                answer = film.render(asked)
        except (ValueError, RuntimeError, *OTHERS) as error:  # the one who asked says it
            lines = str(error).strip().splitlines() or [type(error).__name__]
            answer = {"wrong": lines[0].removeprefix("Error: ")}
        answers.write(MARK + json.dumps(answer) + "\n")
        answers.flush()


if __name__ == "__main__":
    main()
