"""A model as an ONNX graph: convolutions and sines of operators 17, any size of picture."""

from __future__ import annotations

from typing import Any

from ...refimpl.errors import ExecutorUnavailable
from ...refimpl.network.dataset import FEATURES
from ...refimpl.network.denoise import Model
from ..bench import peer_onnxruntime

TEXT = f"ONNX, operators {peer_onnxruntime.OPERATORS}: Conv and Sin nodes, dynamic height and width"
"""What a manifest says about the language."""


def graph(model: Model) -> bytes:
    """Return the graph, or say which package is missing."""
    try:
        return peer_onnxruntime.graph(model)
    except ImportError as error:
        raise ExecutorUnavailable(
            f"package {error.name} cannot be imported: pip install 'wamnet[targets]'"
        ) from None


def kernel(model: Model) -> dict[str, Any]:
    """Return what a manifest says about the graph."""
    images = [
        {
            "name": name,
            "access": "read",
            "type": "float32",
            "shape": ["height", "width", FEATURES[name].channels],
            "slot": f"input {name}",
        }
        for name in model.features
    ]
    result = {"name": "result", "access": "write", "type": "float32", "shape": ["height", "width", 3]}
    return {
        "role": "denoise",
        "files": ["denoise/denoise.onnx"],
        "entry_point": "denoiser",
        "bindings": [*images, {**result, "slot": "output result"}],
        "arguments": "inputs by name, (height, width, channels) of float32; the output in the same form",
    }
