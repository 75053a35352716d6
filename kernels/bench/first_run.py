"""What the first run of all costs, and the first one of a later process: do caches on disk save compiling?

1. A process of its own opens a contender and makes one small frame, with every cache of compiled code in an
   empty folder: nothing was ever compiled [`CACHES`].
2. A second process does the same with the same folder [`first_runs`].

Each measures from the moment when packages are imported and the device is open; run as a module it is that
process [`main`].
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from ...models.model_file import load_model, save_model
from ...refimpl.network.denoise import Model
from .contender import Tools
from .contenders import chosen, of_machine
from .workload import given, noise

CACHES = (
    "POCL_CACHE_DIR",
    "MESA_SHADER_CACHE_DIR",
    "TORCHINDUCTOR_CACHE_DIR",
    "XDG_CACHE_HOME",
    "HOME",
)
"""Variables that say where PoCL, Mesa, PyTorch, tinygrad and others keep what they have compiled."""

FRAME_PX = 64
"""Width and height of the frame: what is compiled does not depend on it."""

SECONDS_AT_MOST = 180
"""When a process counts as hanging."""


def first_runs(name: str, model: Model, size: int) -> tuple[float | None, float | None]:
    """Return the seconds to a first frame with empty caches, and in a later process with the same ones.

    `size`: the width of the benchmark's pictures, by which names are given.
    """
    with prepared(model, CACHES) as (path, places):
        found = [in_process(__name__, (name, path, str(size)), places) for _ in range(2)]
    return found[0], found[1]


@contextmanager
def prepared(model: Model, caches: Sequence[str]) -> Iterator[tuple[str, dict[str, str]]]:
    """Yield the path of a model's file, and an empty folder for each cache by its variable."""
    with tempfile.TemporaryDirectory() as folder:
        places = {variable: str(Path(folder, variable.lower())) for variable in caches}
        for place in places.values():
            Path(place).mkdir()
        path = Path(folder, "model.safetensors")
        save_model(path, model)
        yield str(path), places


def in_process(module: str, arguments: Sequence[str], places: dict[str, str]) -> float | None:
    """Return the seconds that a module, run as a process with these caches, prints; None where it fails."""
    try:
        done = subprocess.run(
            [sys.executable, "-m", module, *arguments],
            env=os.environ | places,
            capture_output=True,
            text=True,
            timeout=SECONDS_AT_MOST,
            stdin=subprocess.DEVNULL,
            check=True,
        )
        return float(json.loads(done.stdout.splitlines()[-1])["seconds"])
    except (subprocess.SubprocessError, ValueError, KeyError, IndexError):
        return None


def main(arguments: Sequence[str]) -> None:
    """Open the contender NAME for the model in FILE, make a frame, and print the seconds as JSON.

    SIZE is that of the benchmark that names it.
    """
    name, path, size = arguments
    model = load_model(path)
    shown = given(model, noise(FRAME_PX))
    with Tools() as tools:
        (contender,) = chosen(of_machine(tools, int(size)), [name], [])
        contender.prepare(tools)
        start = time.perf_counter()
        contender.open(tools, model, FRAME_PX).run(shown)
        seconds = time.perf_counter() - start
    sys.stdout.write(json.dumps({"seconds": seconds}) + "\n")


if __name__ == "__main__":
    main(sys.argv[1:])
