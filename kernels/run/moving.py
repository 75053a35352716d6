"""One path kernel for scenes that differ in numbers: which kernel a scene has, and which numbers it is given.

1. Scenes of one layout are a family [`_Family`], whose kernel has the numbers in which they differ as inputs
   (compiler/scenes/scene_inputs.py). A scene that fits the kernel needs no other: its numbers are read from
   its tables [`MovingPaths.of`].
2. One that differs in more numbers widens the inputs, and the kernel is compiled once more; one of another
   layout begins another family, with a kernel of constants. So has each scene whose numbers a kernel of the
   target cannot be given (compiler/scenes/path_kernel.py: can_move).
3. Who knows the scenes that are to come names them at first: their families are found before anything is
   compiled, and each has one kernel in all.

By definition a kernel with inputs that is given a scene's numbers draws what the kernel of that scene draws.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...compiler.artifact import Artifact
from ...compiler.scenes.path_kernel import can_move
from ...compiler.scenes.scene_inputs import SceneInputs, Tables, layout_of, tables_of
from ...compiler.targets import Language
from ...refimpl.light.scene import Scene
from ...refimpl.light.transport import Settings

Compiler = Callable[[Scene, SceneInputs], Artifact]
"""(scene, its numbers that are inputs) -> the kernel."""


@dataclass(frozen=True)
class Moment:
    """A kernel that draws a scene, and the scene's numbers (n,) that it is given."""

    kernel: Artifact
    numbers: NDArray[np.float32]


@dataclass
class _Family:
    """Scenes of one layout: the first one with its tables, the inputs, and the kernel when it is compiled.

    `moves` says whether a kernel takes the inputs, once it is known.
    """

    scene: Scene
    tables: Tables
    inputs: SceneInputs
    kernel: Artifact | None = None
    moves: bool | None = None


class MovingPaths:
    """The kernels of scenes on a target; `compiled` makes one, `moving` are scenes to come, or inputs."""

    def __init__(
        self,
        language: Language,
        compiled: Compiler,
        settings: Settings,
        moving: Sequence[Scene] | SceneInputs = (),
    ) -> None:
        self._language, self._compiled, self._settings = language, compiled, settings
        self._families: dict[tuple[object, ...], _Family] = {}
        self._inputs = moving if isinstance(moving, SceneInputs) else SceneInputs(settings, ())
        if not isinstance(moving, SceneInputs):
            self._find(moving)

    def of(self, scene: Scene) -> Moment:
        """Return a scene's kernel, compiled if there is none that it fits, and its numbers."""
        tables = tables_of(scene, self._settings)
        layout = layout_of(tables)
        if layout not in self._families:
            inputs = SceneInputs(self._settings, ()) if self._families else self._inputs
            self._families[layout] = _Family(scene, tables, inputs)
        family = self._families[layout]
        if not family.inputs.fits(family.tables, tables):
            family.inputs = family.inputs.widened([family.tables, tables])
            family.kernel = family.moves = None
        if family.moves is None:
            family.moves = can_move(self._language, family.scene, family.tables, family.inputs)
        if not family.moves:
            return Moment(self._compiled(scene, SceneInputs(self._settings, ())), np.zeros(0, np.float32))
        if family.kernel is None:
            family.kernel = self._compiled(family.scene, family.inputs)
        return Moment(family.kernel, family.inputs.read(tables))

    def _find(self, scenes: Sequence[Scene]) -> None:
        """Make a family for each layout of some scenes, with the numbers in which they differ as inputs."""
        rows: dict[tuple[object, ...], list[Tables]] = {}
        for scene in scenes:
            tables = tables_of(scene, self._settings)
            layout = layout_of(tables)
            rows.setdefault(layout, []).append(tables)
            self._families.setdefault(layout, _Family(scene, tables, self._inputs))
        for layout, alike in rows.items():
            self._families[layout].inputs = self._inputs.widened(alike)
