"""A program that answers as Blender does (models/blender/process.py), for machines without Blender.

Its film has ten frames; a picture's colour is that of its frame, samples and seed, and one pixel misses.
`BLENDER_FAULT` makes it end early (`end`), or refuse the file (`refuse`).
"""

import json
import os
import sys
from pathlib import Path

import numpy as np
import OpenEXR

MISS = 1e10
"""What Blender writes as the depth of a pixel that hits nothing."""

ABOUT = {
    "version": "9.9",
    "scene": "stand-in",
    "view_layer": "View",
    "first": 1,
    "last": 10,
    "step": 1,
    "fps": 10.0,
    "width": 40,
    "height": 20,
    "pixel_filter": "BOX",
    "device": "CPU",
}


def channels(asked):
    """Return the channels of a picture."""
    height, width = asked["height"], asked["width"]
    rng = np.random.default_rng([asked["frame"], asked["spp"], asked["seed"]])

    def plane(low=0.0, high=1.0):
        return rng.uniform(low, high, (height, width)).astype(np.float32)

    depth = plane(1.0, 9.0)
    depth[0, 0] = MISS
    found = {f"View.Combined.{name}": plane() for name in "RGBA"}
    found |= {f"View.Noisy Image.{name}": found[f"View.Combined.{name}"] for name in "RGBA"}
    found |= {f"View.Denoising Albedo.{name}": plane() for name in "RGB"}
    found |= {f"View.Denoising Normal.{name}": plane() for name in "XYZ"}
    found |= {f"View.Normal.{name}": plane(-0.5, 0.5) for name in "XYZ"}
    found |= {f"View.Position.{name}": plane(-3.0, 3.0) for name in "XYZ"}
    found |= {f"View.Combined_key.{name}": plane() for name in "RGB"}
    return {**found, "View.Depth.Z": depth}


def main():
    """Print as Blender prints, and answer."""
    sys.stdout.write("Blender 9.9\nRead prefs: nothing\n")
    sys.stderr.write("a warning of a driver\n")
    fault = os.environ.get("BLENDER_FAULT", "")
    for count, line in enumerate(sys.stdin):
        asked, answer = json.loads(line), ABOUT
        if count == 0 and fault == "refuse":
            answer = {"wrong": "its scene has no camera."}
        elif count == 0:
            assert Path(asked["file"]).is_file()
        else:
            if fault == "end" and count == 3:
                sys.exit(11)
            form = {"type": OpenEXR.scanlineimage, "compression": OpenEXR.ZIP_COMPRESSION}
            OpenEXR.File(form, channels(asked)).write(asked["to"])
            answer = {}
        sys.stdout.write(f"wamnet: {json.dumps(answer)}\nFra:1 Mem:12M\n")
        sys.stdout.flush()


if __name__ == "__main__":
    main()
