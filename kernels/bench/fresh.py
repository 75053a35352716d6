"""What the first run of all costs, in a process of its own whose caches of compiled code are empty folders.

1. A denoiser: a contender opens and makes a small frame; a second process does the same with the same
   folders, and tells whether caches on disk save compiling [`first_runs`].
2. A scene: a process compiles a pipeline and reads its first picture [`first_picture`].

Each measures from the moment when packages are imported, and for a denoiser the device is open. Run as a
module it is that process [`main`].
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from ...models.data.scene_source import scene_source
from ...models.model_file import load_model, save_model
from ...refimpl.network.denoise import Model
from ..cache import FOLDER_VARIABLE
from ..devices.registry import open_executor
from ..measure import environment
from ..run.pipeline import Pipeline
from .contenders import Tools, chosen, of_machine
from .workload import given, noise

CACHES = ("POCL_CACHE_DIR", "MESA_SHADER_CACHE_DIR", "TORCHINDUCTOR_CACHE_DIR", "XDG_CACHE_HOME", "HOME")
"""Variables that say where PoCL, Mesa, PyTorch, tinygrad, Dr.Jit and others keep what they have compiled."""

FRAME_PX = 64
"""Width and height of a denoiser's frame: what is compiled does not depend on it."""

SECONDS_AT_MOST = 180
"""When a process counts as hanging."""


def first_runs(name: str, model: Model, size: int) -> tuple[float | None, float | None]:
    """Return the seconds to a first frame with empty caches, and in a later process with the same ones.

    `size`: the width of the benchmark's pictures, by which names are given. None: it fails.
    """
    never, later = _in_processes(2, model, CACHES, "denoiser", name, size)
    return never, later


def first_picture(executor: str, model: Model, scene: str, size: int) -> float | None:
    """Return the seconds to the first picture (size, size) of a scene; None where that fails."""
    return _in_processes(1, model, (*CACHES, FOLDER_VARIABLE), "pipeline", executor, size, scene)[0]


@contextmanager
def empty_caches(names: Sequence[str] = CACHES) -> Iterator[Path]:
    """Let compilers find nothing that they have compiled before; yield a folder for more.

    A process must not launch its first OpenCL kernel within and another afterwards: pyopencl opens a cache in
    the home folder at the first one, and keeps it open.
    """
    with tempfile.TemporaryDirectory() as folder:
        places = {name: str(Path(folder, name.lower())) for name in names}
        for place in places.values():
            Path(place).mkdir()
        with environment(places):
            yield Path(folder)


def _in_processes(count: int, model: Model, caches: Sequence[str], *arguments: object) -> list[float | None]:
    """Return the seconds that this module prints as a process, one after another with the same caches."""
    with empty_caches(caches) as folder:
        path = folder / "model.safetensors"
        save_model(path, model)
        return [_in_process([str(path), *map(str, arguments)]) for _ in range(count)]


def _in_process(arguments: Sequence[str]) -> float | None:
    """Return the seconds that a process prints; None where it fails."""
    command = [sys.executable, "-m", __name__, *arguments]
    try:
        done = subprocess.run(
            command, capture_output=True, timeout=SECONDS_AT_MOST, stdin=subprocess.DEVNULL, check=True
        )
        return float(json.loads(done.stdout.splitlines()[-1])["seconds"])
    except (subprocess.SubprocessError, ValueError, KeyError, IndexError):
        return None


def main(path: str, kind: str, name: str, size: str, scene: str = "") -> None:
    """Make a frame by the contender or the executor NAME and the model in PATH; print the seconds as JSON."""
    model, pixels = load_model(Path(path)), int(size)
    start = time.perf_counter()
    if kind == "pipeline":
        shown, shape = scene_source(scene).at(), (pixels, pixels)
        with open_executor(name) as executor, Pipeline(executor, shown, model, shape) as pipeline:
            pipeline.run()
            seconds = time.perf_counter() - start
    else:
        frame = given(model, noise(FRAME_PX))
        with Tools() as tools:
            (contender,) = chosen(of_machine(tools, pixels), [name], [])
            contender.prepare(tools)
            start = time.perf_counter()
            contender.open(tools, model, FRAME_PX).run(frame)
            seconds = time.perf_counter() - start
    sys.stdout.write(json.dumps({"seconds": seconds}) + "\n")


if __name__ == "__main__":
    main(*sys.argv[1:])
