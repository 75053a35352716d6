"""OpenVINO as a peer: it reads the graph in 8 bits that ONNX Runtime's tool makes. Kernels are its own."""

from __future__ import annotations

import tempfile
from pathlib import Path

from ....refimpl.network.denoise import Model
from ..contender import Contender, Opened, Tools, told_as_missing
from ..cost import layered
from ..workload import Given
from .peer_onnxruntime import Run, at_first, quantised


def _open(tools: Tools, model: Model, size: int) -> Opened:
    """Return OpenVINO with the same graph."""
    with told_as_missing("openvino:int8"):
        import openvino

        core = openvino.Core()

        def make(given: Given) -> Run:
            with tempfile.TemporaryDirectory() as folder:
                path = Path(folder) / "model.onnx"
                path.write_bytes(quantised(model, given))
                found = core.read_model(path)
            found.reshape({name: image.shape for name, image in given.images.items()})
            # Floats stay floats: processors with bfloat16 would use that by themselves.
            ready = core.compile_model(found, "CPU", {"INFERENCE_PRECISION_HINT": "f32"})
            return lambda given: next(iter(ready(dict(given.images)).values()))

        device = f"OpenVINO {openvino.__version__.split('-')[0]}, CPU"
    return Opened(at_first(make), device, layered(model, fuses=False))


CONTENDERS = (
    Contender(
        "openvino:int8",
        "the same graph in OpenVINO",
        _open,
        variant=None,
        packages=("onnx", "onnxruntime", "openvino"),
    ),
)
"""The runtime with floats kept as floats. It computes another function: only quality is compared."""
