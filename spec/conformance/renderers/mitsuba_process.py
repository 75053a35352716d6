"""The process that renders by Mitsuba 3; its arguments are SCENE SEEDS OUTPUTS.

SEEDS and OUTPUTS are lists with commas: a picture each. An output ending in .npz gets the layers by name,
one in .png the display-encoded picture by Mitsuba's own conversion.
"""

from __future__ import annotations

import importlib
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

CHANNELS = {"albedo": "RGB", "normal": "XYZ", "depth": "T", "position": "XYZ"}
"""Last letters of the channels of each layer."""


def layers_of(image: Any, names: list[str]) -> Mapping[str, Any]:
    """Return the layers (H, W, C) of an image (H, W, n) whose first three channels are colour."""
    found = {"color": image[..., :3]}
    for layer, letters in CHANNELS.items():
        wanted = [f"{layer}.{letter}" for letter in letters]
        if all(name in names for name in wanted):
            found[layer] = np.stack([image[..., names.index(name)] for name in wanted], axis=-1)
    return found


def main(scene: str, seeds: str, outputs: str) -> None:
    """Render a scene with each seed."""
    mi: Any = importlib.import_module("mitsuba")
    mi.set_variant("scalar_rgb")
    loaded = mi.load_file(scene)
    # The film drops the alpha that the integrator names.
    names = [name for name in loaded.integrator().aov_names() if not name.endswith(".A")]
    for seed, output in zip(seeds.split(","), outputs.split(","), strict=True):
        image = mi.render(loaded, seed=int(seed))
        if Path(output).suffix == ".png":
            mi.util.write_bitmap(output, image[..., :3], write_async=False)
        else:
            np.savez(output, **layers_of(np.array(image), names))


if __name__ == "__main__":
    main(*sys.argv[1:])
