"""What the first picture of all costs: a process of its own, which finds nothing that was ever compiled.

1. All caches of compiled code, and that of tuned schedules, are empty folders [`CACHES`].
2. The process opens a device, compiles a scene's pipeline, and reads its first picture; the seconds begin
   when packages are imported [`first_picture`]. Run as a module it is that process [`main`].
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Sequence
from pathlib import Path

from ...models.data.scene_source import scene_source
from ...models.model_file import load_model
from ...refimpl.network.denoise import Model
from ..cache import FOLDER_VARIABLE
from ..devices.registry import open_executor
from ..run.pipeline import Pipeline
from . import first_run

CACHES = (*first_run.CACHES, FOLDER_VARIABLE)
"""Variables that say where compiled code, and what was measured of it, are kept."""


def first_picture(executor: str, model: Model, scene: str, size: int) -> float | None:
    """Return the seconds to the first picture (size, size) of a scene; None where that fails."""
    with first_run.prepared(model, CACHES) as (path, places):
        return first_run.in_process(__name__, (executor, path, scene, str(size)), places)


def main(arguments: Sequence[str]) -> None:
    """Make a picture SIZE wide of SCENE by EXECUTOR and the model in FILE, and print the seconds as JSON."""
    name, path, scene, size = arguments
    model, pixels = load_model(Path(path)), int(size)
    start = time.perf_counter()
    with (
        open_executor(name) as executor,
        Pipeline(executor, scene_source(scene).at(), model, (pixels, pixels)) as pipeline,
    ):
        pipeline.run()
        seconds = time.perf_counter() - start
    sys.stdout.write(json.dumps({"seconds": seconds}) + "\n")


if __name__ == "__main__":
    main(sys.argv[1:])
