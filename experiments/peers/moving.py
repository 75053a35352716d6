"""Whole pictures of a scene that moves, as one would make them otherwise: a renderer, then a denoiser.

1. A maker is opened for a scene and a size; then it gets each picture's scene and makes it [`Maker`]. What
   can be kept from picture to picture is kept: the renderer's scene, compiled code, the denoiser's filter.
2. It has the ways that are measured by what a table calls them [`Maker.ways`]: whole pictures, and parts.
   A way takes the next moment by itself; one that returns a number has measured itself, in seconds.
3. Mitsuba's vertices are replaced where a shape has changed, and so are its emitters; another
   camera, room, background or reflectance loads the scene again [`MitsubaOidn.show`].

All have one path a pixel of as many edges as ours, pixels by a box filter, albedo and normal of the first hit
by the same path, and Open Image Denoise with these as they come (`cleanAux` off).
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wamnet.refimpl.frame import Frame
from wamnet.refimpl.light.scene import Scene
from wamnet.refimpl.light.transport import Settings

from . import peer_mitsuba
from .common import Ways
from .peer_mitsuba import VARIANT
from .peer_oidn import Kept

DENOISED = ("fast", "high")
"""Qualities of Open Image Denoise that are measured."""

SHAPES = {"boxes": "box", "spheres": "sphere", "quads": "quad", "lights": "light"}
"""Shapes that may differ from picture to picture, and what their names in Mitsuba's scene begin with."""


class MitsubaOidn:
    """Mitsuba 3, whose scene is kept and changed, followed by Open Image Denoise."""

    def __init__(self, scene: Scene, size: int, settings: Settings | None = None, spp: int = 1) -> None:
        """Open both for pictures (size, size); ExecutorUnavailable says what is missing."""
        self._mi = peer_mitsuba.open_mitsuba(VARIANT)
        self._size, self._spp, self._settings = size, spp, settings or Settings()
        self._filters = {quality: Kept((size, size), quality) for quality in DENOISED}
        self._load(scene)

    @property
    def about(self) -> str:
        """Return in words what it is."""
        return f"Mitsuba {self._mi.__version__}, {VARIANT}, and Open Image Denoise"

    def _load(self, scene: Scene) -> None:
        """Load a scene."""
        made = peer_mitsuba.export(self._mi, scene, self._size, self._size, self._settings)
        layers = "albedo:albedo,normal:sh_normal"
        made["integrator"] = {"type": "aov", "aovs": layers, "image": made["integrator"]}
        self._scene, self._loaded = scene, self._mi.load_dict(made)
        self._parameters = self._mi.traverse(self._loaded)

    def show(self, scene: Scene) -> None:
        """Continue with another scene: new numbers where only shapes differ, else a new load."""
        if not _alike(scene, self._scene):
            self._load(scene)
            return
        made = peer_mitsuba.export(self._mi, scene, self._size, self._size, self._settings)
        for name in _changed(scene, self._scene, made):
            for key, value in self._mi.traverse(self._mi.load_dict(made[name])):
                if not key.startswith("bsdf."):  # Mitsuba joins equal ones under one name
                    self._parameters[f"{name}.{key}"] = value
        self._parameters.update()
        self._scene = scene

    def render(self, seed: int) -> Frame:
        """Return colour, albedo and normal (H, W, 3) of the scene."""
        image = peer_mitsuba.render(self._mi, self._loaded, self._spp, seed)
        return Frame(
            {name: image[..., 3 * k : 3 * k + 3] for k, name in enumerate(("color", "albedo", "normal"))}
        )

    def denoise(self, frame: Frame, quality: str) -> NDArray[np.float32]:
        """Return the denoised radiance (H, W, 3)."""
        return self._filters[quality](frame)

    def ways(self, shots: Sequence[Scene]) -> Ways:
        """Return whole pictures by each quality, and their parts."""
        turn, seeds = itertools.cycle(shots), itertools.count()
        frame = self.render(next(seeds))

        def whole(quality: str) -> Callable[[], None]:
            def made() -> None:
                self.show(next(turn))
                self.denoise(self.render(next(seeds)), quality)

            return made

        def part(quality: str) -> Callable[[], None]:
            return lambda: _nothing(self.denoise(frame, quality))

        return {
            **{f"whole picture, denoised {quality}": whole(quality) for quality in DENOISED},
            "of it: the scene's numbers": lambda: self.show(next(turn)),
            "of it: paths and features": lambda: _nothing(self.render(next(seeds))),
            **{f"of it: denoising, {quality}": part(quality) for quality in DENOISED},
        }

    def close(self) -> None:
        """Give the filters back."""
        for kept in self._filters.values():
            kept.close()


def _nothing(value: Any) -> None:
    """Take what a way returns: it would be read as seconds."""


def _alike(scene: Scene, other: Scene) -> bool:
    """Return whether two scenes differ in places and emission of their shapes only, and have as many."""
    same = all(len(getattr(scene, kind)) == len(getattr(other, kind)) for kind in SHAPES)
    return (
        same
        and _colours(scene) == _colours(other)
        and replace(scene, **{kind: getattr(other, kind) for kind in SHAPES}) == other
    )


def _colours(scene: Scene) -> list[Any]:
    """Return the reflectances and the materials of all shapes; lights have none."""
    return [(part.reflectance, part.material) for part in (*scene.boxes, *scene.spheres, *scene.quads)]


def _changed(scene: Scene, other: Scene, made: Mapping[str, Any]) -> list[str]:
    """Return the names in Mitsuba's scene of the shapes that differ."""
    found = []
    for kind, word in SHAPES.items():
        pairs = zip(getattr(scene, kind), getattr(other, kind), strict=True)
        starts = [f"{word}_{at}" for at, (new, old) in enumerate(pairs) if new != old]
        found += [name for name in made for start in starts if name == start or name.startswith(f"{start}_")]
    return found
