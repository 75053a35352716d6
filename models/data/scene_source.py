"""Scenes by the names that commands take: the one place where a scene is loaded.

1. A name is that of a canonical scene, with parameters, or of a scene file (.json) [`scene_source`].
2. A source returns its scene at a time; the scene of a file is static, and the same at each [`SceneSource`].
3. The SHA-256 of a file identifies its scene: frames, data sets and models carry it, so that a file that has
   changed is detected [`SCENE_FILE`].
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

from ...refimpl.errors import InputError, choice
from ...refimpl.light.scene import Scene, from_json
from ...refimpl.light.scenes import CANONICAL, canonical
from ...refimpl.reading import read_file

SCENE_FILE = "scene_sha256"
"""Name of the fact, in a frame's info, with the SHA-256 of the scene file that it was rendered from."""

SUFFIX = ".json"
"""End of the name of a scene file."""

Parameters = Mapping[str, float | tuple[float, ...]]
"""Parameters of a canonical scene by name."""


@dataclass(frozen=True)
class SceneSource:
    """A scene as a function of time: the canonical one of this name, or `still`, the scene of a file."""

    name: str
    parameters: Parameters = field(default_factory=dict)
    still: Scene | None = None

    @property
    def sha256(self) -> str:
        """Return the SHA-256 of the file; "" of a canonical scene."""
        return self.still.info[SCENE_FILE] if self.still is not None else ""

    def at(self, time_s: float | None = None) -> Scene:
        """Return the scene at a time in seconds; None: at the time that its parameters state, or 0."""
        if self.still is not None:
            return self.still
        return canonical(self.name, **{**self.parameters, **({} if time_s is None else {"time": time_s})})


def scene_source(name: str, parameters: Parameters | None = None) -> SceneSource:
    """Return the source that a command names; reject an unknown name, and a file without a scene."""
    path, parameters = Path(name), parameters or {}
    if path.suffix.lower() != SUFFIX:
        there = os.path.exists(name)  # noqa: PTH110 (Path.exists raises for a name that is too long)
        if name not in CANONICAL and (path.suffix or there):
            rule = "is neither a canonical scene nor a scene file"
            raise InputError("scene", name, rule, f"{choice(name, CANONICAL)}, or give a {SUFFIX} file")
        source = SceneSource(name, parameters)
        source.at()
        return source
    if parameters:
        rule = "a scene file has no parameters"
        raise InputError("option for the scene", ", ".join(parameters), rule, "change the file")
    content = read_file(path, "scene file", "check the name")
    try:
        scene = from_json(content)
    except InputError as error:
        raise InputError(f"{path}: {error.what}", error.value, error.rule, error.way_out) from None
    info = {**scene.info, SCENE_FILE: hashlib.sha256(content).hexdigest()}
    return SceneSource(scene.name, {}, replace(scene, info=info))
