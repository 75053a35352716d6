"""Numbers of a scene as inputs of its programs: time, camera and light colours without another kernel.

A world (refimpl/light/transport.py: World) and a camera's basis are tables of constants when paths are
traced. Here some of their numbers are inputs:

1. Scenes that differ in what shall move are laid out as worlds; what they have in common stays constant, each
   number that differs between any two of them becomes an input [`varying`]. Numbers that are equal in all the
   scenes share one (a light's radiance is in two tables).
2. [`SceneInputs.opened`] puts traced inputs into their places before a program is traced.
3. [`SceneInputs.values`] reads the numbers of a scene: in float64 computed, rounded once, as constants are.
   By definition, programs with these numbers as constants are those of the scene.

Scenes that differ in anything else (a primitive more, a box that is turned and one that is not) have
different programs, and are refused.
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

Laid = TypeVar("Laid")


@dataclass(frozen=True)
class SceneInputs:
    """Which numbers are inputs: by input, the places that it has.

    A place is a table's path, `world.lights.radiance` or `camera.position`, and an index into it, flat.
    """

    settings: Settings
    places: tuple[tuple[tuple[str, int], ...], ...]

    @property
    def names(self) -> tuple[str, ...]:
        """Return the inputs' names in programs, in order."""
        return tuple(f"{PREFIX}{number}" for number in range(len(self.places)))

    def values(self, scene: Scene) -> NDArray[np.float32]:
        """Return the numbers (n,) of a scene."""
        tables = dict(_tables(lay_out(scene, self.settings)))
        return np.array([tables[path].reshape(-1)[index] for (path, index), *_ in self.places], np.float32)

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


def varying(scenes: Sequence[Scene], settings: Settings) -> SceneInputs:
    """Return the inputs of scenes that differ only in numbers."""
    rows = [dict(_tables(lay_out(scene, settings))) for scene in scenes]
    facts = [[(path, *_kept(table)) for path, table in row.items()] for row in rows]
    for scene, fact in zip(scenes, facts, strict=True):
        if fact != facts[0]:
            raise CompileError(
                f"scene {scene.name}: it is laid out in another way at some of the times or colours that one "
                "kernel is to show: a kernel takes other numbers, not another layout; leave these out"
            )
    columns: dict[bytes, list[tuple[str, int]]] = {}
    for path, table in rows[0].items():
        if table.dtype != np.float32:
            continue
        together = np.stack([row[path].reshape(-1) for row in rows])
        for index, column in enumerate(together.T):
            if not np.array_equal(column.view(np.uint32), np.full(len(rows), column[:1].view(np.uint32))):
                columns.setdefault(column.tobytes(), []).append((path, index))
    return SceneInputs(settings, tuple(tuple(places) for places in columns.values()))


def _kept(table: NDArray[Any]) -> tuple[Any, ...]:
    """Return what two scenes must have in common of a table: its form, and its numbers if no floats."""
    return table.dtype, table.shape, None if table.dtype == np.float32 else table.tobytes()


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
