"""A model as an ONNX graph: convolutions and sines of operators 17, any size of picture.

A network of integers is a graph of operators 18 in which nothing rounds [`promise`].
"""

from __future__ import annotations

from typing import Any

from ...compiler.compile import AGAINST_WHOLE
from ...refimpl.errors import ExecutorUnavailable
from ...refimpl.network.dataset import FEATURES
from ...refimpl.network.denoise import Model
from ..bench.peers import peer_onnxruntime

TEXT = f"ONNX, operators {peer_onnxruntime.OPERATORS}: Conv and Sin nodes, dynamic height and width"
"""What a manifest says about the language."""

WHOLE_TEXT = (
    f"ONNX, operators {peer_onnxruntime.WHOLE_OPERATORS}: Conv nodes of integers in float32, the rest in "
    "int64 and uint32, dynamic height and width"
)
"""The same for a network of integers."""

ASSUMES = "the runtime's Conv adds up products in float32: no transform of the window, no shorter products"
"""What a network of integers rests on: ONNX says what a Conv is, not how it is computed."""


def graph(model: Model) -> bytes:
    """Return the graph, or say which package is missing."""
    try:
        return peer_onnxruntime.graph(model)
    except ImportError as error:
        raise ExecutorUnavailable(
            f"package {error.name} cannot be imported: pip install {error.name}"
        ) from None


def promise(model: Model) -> dict[str, Any]:
    """Return what a manifest says about language, profile and bound."""
    if model.is_whole:
        return {
            "language": WHOLE_TEXT,
            "profile": {"name": "ieee", "text": "no operation rounds"},
            "bound": {"output": [0.0] * len(model.siren.biases[-1]), "against": AGAINST_WHOLE},
            "assumes": ASSUMES,
        }
    return {
        "language": TEXT,
        "profile": {"name": "native", "text": "the runtime's own sine, of which ONNX promises nothing"},
        "bound": {"output": None, "against": "nothing: a runtime may compute Sin as it likes"},
        "assumes": "",
    }


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
