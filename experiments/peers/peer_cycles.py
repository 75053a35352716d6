"""Cycles, Blender's renderer, with its Open Image Denoise as a peer: whole pictures of a scene that moves.

1. Blender runs in a process of its own [`cycles_process.py`]: it prints to standard output, keeps its state
   per process, and may want another NumPy. [`Cycles`] gives it a scene's JSON a picture, and gets the seconds
   of each part, measured there: numbers of the scene, rendering with denoising, and reading the picture.
2. The picture is an uncompressed OpenEXR file in a folder that is in memory where there is one [`MEMORY`]:
   Blender gives no other way to numbers without a window.
3. [`check`] refuses what has no counterpart: anything but matte boxes and quads, lights and a room.

Its rendering is one call, denoising within: the part without is that of pictures that are not denoised.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Sequence
from importlib.util import find_spec
from itertools import count, cycle
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wamnet.models.lines import LineProcess
from wamnet.refimpl.errors import ExecutorUnavailable, InputError
from wamnet.refimpl.light.scene import Scene, to_json
from wamnet.refimpl.light.transport import Settings

from . import peer_mitsuba
from .common import Ways
from .moving import DENOISED

MEMORY = Path("/dev/shm")
"""Folder in memory of Linux."""

PARTS = ("numbers", "rendering", "reading")
"""What is measured of a picture, in its order."""


def check(scene: Scene, settings: Settings) -> None:
    """Refuse a scene or settings that Cycles would show differently."""
    peer_mitsuba.check_matte(scene, settings, "Cycles")
    wall = scene.room is not None and any(scene.room.emission)
    if scene.spheres or wall or any(any(part.emission) for part in (*scene.boxes, *scene.quads)):
        rule = "only matte boxes, quads and walls that do not emit, and lights, are given to Cycles"
        raise InputError("scene", scene.name, rule, "measure minicubes or cornell")


class Cycles:
    """Blender's process with a scene; a moment of it that differs in boxes only is new numbers."""

    def __init__(self, scene: Scene, size: int, settings: Settings | None = None, spp: int = 1) -> None:
        """Start it for pictures (size, size) of so many samples; ExecutorUnavailable says what is missing."""
        settings = settings or Settings()
        check(scene, settings)
        if find_spec("bpy") is None:
            raise ExecutorUnavailable("cycles: the package bpy is not installed; pip install --no-deps bpy")
        self._size, self._numbers = size, count()
        where = MEMORY if MEMORY.is_dir() else None
        self._folder = tempfile.TemporaryDirectory(prefix="wamnet-cycles-", dir=where)
        command = [sys.executable, "-m", f"{__package__}.cycles_process", self._folder.name]
        self._process = LineProcess(command, "cycles: Blender's process has ended; try import bpy by itself")
        given = {"size": size, "spp": spp, "edges": settings.max_depth + 1, "scene": to_json(scene)}
        self._version = str(self._asked(given)["version"])

    @property
    def about(self) -> str:
        """Return in words what it is."""
        return f"Cycles of Blender {self._version}, and its Open Image Denoise"

    def _asked(self, question: dict[str, Any]) -> dict[str, Any]:
        """Return what the process answers; one that has ended is reported."""
        try:
            found = self._process.ask(question)
        except ExecutorUnavailable:
            self.close()
            raise
        if "wrong" in found:
            raise ExecutorUnavailable(f"cycles: {found['wrong']}")
        return found

    def draw(self, scene: Scene, seed: int, quality: str = "") -> tuple[float, ...]:
        """Make a picture, denoised if a quality is named; return the seconds of [`PARTS`]."""
        answer = self._asked({"scene": to_json(scene), "seed": seed, "quality": quality})
        return tuple(float(second) for second in answer["seconds"])

    def picture(self, scene: Scene, seed: int, quality: str = "") -> NDArray[np.float32]:
        """Return the linear radiance (H, W, 3), rows from the top."""
        path = Path(self._folder.name, "picture.f32")
        self._asked({"scene": to_json(scene), "seed": seed, "quality": quality, "keep": str(path)})
        return np.fromfile(path, np.float32).reshape(self._size, self._size, 4)[::-1, :, :3]

    def ways(self, shots: Sequence[Scene]) -> Ways:
        """Return whole pictures by each quality, and what they take without denoising."""
        turn = cycle(shots)

        def whole(quality: str) -> Any:
            return lambda: sum(self.draw(next(turn), next(self._numbers), quality))

        return {
            **{f"whole picture, denoised {quality}": whole(quality) for quality in DENOISED},
            "whole picture, not denoised": whole(""),
        }

    def close(self) -> None:
        """End the process."""
        self._process.end()
        self._folder.cleanup()
