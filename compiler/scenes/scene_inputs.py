"""Numbers of a scene as inputs of its programs: time, camera and light colours without another kernel.

A world (refimpl/light/transport.py: World) and a camera's basis are tables of constants when paths are
traced. Here some of their numbers are inputs:

1. Scenes that differ in what shall move are laid out as worlds; what they have in common stays constant, each
   number that differs between any two of them becomes an input [`varying`]. Numbers that are equal in all the
   scenes share one (a light's radiance is in two tables).
2. [`SceneInputs.opened`] puts traced inputs into their places before a program is traced.
3. [`SceneInputs.values`] reads the numbers of a scene: in float64 computed, rounded once, as constants are.
   By definition, programs with these numbers as constants are those of the scene.
4. A scene that is the first one with its own numbers in the inputs' places has the same programs
   [`SceneInputs.fits`]; one that differs in more numbers takes more inputs [`SceneInputs.widened`].

Scenes that differ in anything else (a primitive more, a box that is turned and one that is not) have another
layout [`layout_of`] and different programs, and are refused.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass, replace
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from ...refimpl.errors import CompileError
from ...refimpl.light import transport
from ...refimpl.light.camera import camera_basis
from ...refimpl.light.scene import Scene
from ...refimpl.light.transport import Settings

PREFIX = "scene_"
"""How the inputs' names begin in programs: `scene_0`, `scene_1`, ..."""

ROWS, SHARED = "world.geometry.groups.", ".rotation"
"""How the paths of the tables of primitives begin, and how that of a rotation ends that a group shares."""

Laid = TypeVar("Laid")

Tables = Mapping[str, NDArray[Any]]
"""The tables of a scene by path."""


Places = tuple[tuple[str, int], ...]
"""Places of one number: a table's path, `world.lights.radiance` or `camera.position`, and a flat index."""


@dataclass(frozen=True)
class SceneInputs:
    """Which numbers are inputs: by input, the places that it has."""

    settings: Settings
    places: tuple[Places, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """Return the inputs' names in programs, in order."""
        return tuple(f"{PREFIX}{number}" for number in range(len(self.places)))

    def values(self, scene: Scene) -> NDArray[np.float32]:
        """Return the numbers (n,) of a scene."""
        return self.read(tables_of(scene, self.settings))

    def read(self, tables: Tables) -> NDArray[np.float32]:
        """Return the numbers (n,) of a scene that is laid out."""
        return np.array([tables[path].reshape(-1)[index] for (path, index), *_ in self.places], np.float32)

    def fits(self, first: Tables, other: Tables) -> bool:
        """Tell whether a scene is the first one with its own numbers in the places of the inputs."""
        if layout_of(first) != layout_of(other):
            return False
        filled = {path: np.array(table).reshape(-1) for path, table in first.items()}
        for places, number in zip(self.places, self.read(other), strict=True):
            for path, index in places:
                filled[path][index] = number
        return all(table.tobytes() == other[path].tobytes() for path, table in filled.items())

    def move_rows(self, tables: Tables) -> bool:
        """Tell whether an input is in a table that has a row for each of a group's primitives."""
        paths = {path for places in self.places for path, _ in places if path.startswith(ROWS)}
        return any(not (path.endswith(SHARED) and tables[path].ndim == 2) for path in paths)

    def widened(self, rows: Sequence[Tables]) -> SceneInputs:
        """Return inputs for scenes of one layout too, the first of which these inputs were found with.

        Places that shared an input share one still if they are equal in all the scenes.
        """
        known = {place: number for number, places in enumerate(self.places) for place in places}
        columns: dict[tuple[int, bytes], list[tuple[str, int]]] = {}
        for path, table in rows[0].items():
            if table.dtype != np.float32:
                continue
            together = np.stack([row[path].reshape(-1) for row in rows])
            bits = together.view(np.uint32)
            moves = np.any(bits != bits[0], axis=0)
            for index, column in enumerate(together.T):
                number = known.get((path, index), -1)
                if moves[index] or number >= 0:
                    columns.setdefault((number, column.tobytes()), []).append((path, index))
        return SceneInputs(self.settings, tuple(tuple(places) for places in columns.values()))

    def opened(self, laid: Laid, given: Mapping[str, Any]) -> Laid:
        """Return a world and camera with the given traced inputs in their places."""
        moving: dict[str, dict[int, Any]] = {}
        for name, places in zip(self.names, self.places, strict=True):
            for path, index in places:
                moving.setdefault(path, {})[index] = given[name]
        return _replaced(laid, "", moving)  # type: ignore[no-any-return]


def lay_out(scene: Scene, settings: Settings) -> dict[str, Any]:
    """Return the tables that paths are traced with, in float32."""
    return {
        "world": transport.build(scene, settings, np.float32),
        "camera": camera_basis(scene.camera, np.float32),
    }


def tables_of(scene: Scene, settings: Settings) -> Tables:
    """Return the tables of a scene by path; what is not a table is one whose bytes are its text."""
    return flattened(lay_out(scene, settings))


def flattened(laid: Mapping[str, Any]) -> Tables:
    """Return the tables of what [`lay_out`] returns by path."""
    return dict(_tables(laid))


def layout_of(tables: Tables) -> tuple[Any, ...]:
    """Return what scenes must have in common to be of one kernel: all but their floats."""
    return tuple(
        (path, table.dtype, table.shape, None if table.dtype == np.float32 else table.tobytes())
        for path, table in tables.items()
    )


def varying(scenes: Sequence[Scene], settings: Settings) -> SceneInputs:
    """Return the inputs of scenes that differ only in numbers."""
    rows = [tables_of(scene, settings) for scene in scenes]
    layout = layout_of(rows[0])
    for scene, row in zip(scenes, rows, strict=True):
        if layout_of(row) != layout:
            raise CompileError(
                f"scene {scene.name}: its layout differs at some of the requested times or colours; a "
                "kernel takes other parameter values, but not another layout; leave these out"
            )
    return SceneInputs(settings, ()).widened(rows)


def _tables(value: Any, path: str = "") -> Iterator[tuple[str, NDArray[Any]]]:
    """Yield the tables of a world by path; what is not a table is one whose bytes are its text."""
    for name, part in _parts(value):
        yield from _tables(part, f"{path}.{name}" if path else name)
    if isinstance(value, np.ndarray | np.number):
        yield path, np.asarray(value)
    elif not _parts(value):
        yield path, np.frombuffer(repr(value).encode(), np.uint8)


def _parts(value: Any) -> list[tuple[str, Any]]:
    """Return the named parts of a dataclass, a tuple or a mapping, none of anything else."""
    if isinstance(value, Mapping):
        return list(value.items())
    if is_dataclass(value) and not isinstance(value, type | Settings):
        return [(field.name, getattr(value, field.name)) for field in fields(value)]
    if isinstance(value, tuple):
        names = getattr(value, "_fields", range(len(value)))
        return [(str(name), part) for name, part in zip(names, value, strict=True)]
    return []


def _replaced(value: Any, path: str, moving: Mapping[str, Mapping[int, Any]]) -> Any:
    """Return a world with entries of its tables replaced; such a table holds objects."""
    if path in moving:
        table = np.array(np.asarray(value), dtype=object)
        flat = table.reshape(-1)
        for index, entry in moving[path].items():
            flat[index] = entry
        return table
    parts = {
        name: _replaced(part, f"{path}.{name}" if path else name, moving) for name, part in _parts(value)
    }
    if not parts or all(parts[name] is part for name, part in _parts(value)):
        return value
    if isinstance(value, Mapping):
        return parts
    if is_dataclass(value) and not isinstance(value, type):
        return replace(value, **parts)
    return type(value)(*parts.values()) if hasattr(value, "_fields") else tuple(parts.values())
