"""Kinds of files and of texts that stand for records: cameras, models, scenes; good, damaged and hostile.

What fails for a camera makes every scene and model fail: JSON (RDG-2) and records (RDG-3) are read alike.
"""

from __future__ import annotations

import base64
import hashlib
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ....models import model_file
from ....refimpl.light import scene as scene_module
from ....refimpl.light.scene import Camera, Scene
from ....refimpl.network.denoise import Model
from ....refimpl.reading import parse_json, to_dataclass
from .tables import kind


def _camera(inputs: Mapping[str, Any]) -> dict[str, Any]:
    """Return the numbers of a camera."""
    data = parse_json(inputs["text"], "camera", "fix the text")
    camera = to_dataclass(Camera, data, "camera", largest=scene_module.LARGEST_NUMBER)
    scene_module.validate(Scene("camera", camera))
    vectors = {name: np.array(getattr(camera, name)) for name in ("position", "look_at", "up")}
    return {**vectors, "vertical_fov_deg": np.float64(camera.vertical_fov_deg)}


def _scene(inputs: Mapping[str, Any]) -> dict[str, Any]:
    """Return what a scene's text stands for."""
    return {"digest": scene_module.scene_digest(scene_module.from_json(inputs["text"]))}


def model_from(content: bytes) -> Model:
    """Return the model in a file's content."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "model.safetensors"
        path.write_bytes(content)
        return model_file.load_model(path)


def digest(model: Model) -> str:
    """Return the SHA-256 of all parameters as little-endian float64: layer by layer weights, then biases."""
    parts = (p for pair in zip(model.siren.weights, model.siren.biases, strict=True) for p in pair)
    return hashlib.sha256(b"".join(np.ascontiguousarray(p, "<f8").tobytes() for p in parts)).hexdigest()


def _model(inputs: Mapping[str, Any]) -> dict[str, Any]:
    """Return what a file holds."""
    model = model_from(base64.b64decode(inputs["content"]))
    return {
        "digest": digest(model),
        "widths": np.array(model.siren.widths),
        "features": ",".join(model.features),
        "window": model.window.size,
        "border": model.window.border,
        "omega_0": np.array([model.siren.omega_0_first, model.siren.omega_0_hidden]),
    }


KINDS = (kind("file.camera", _camera), kind("file.model", _model), kind("file.scene", _scene))
"""The kinds of files and of texts."""
