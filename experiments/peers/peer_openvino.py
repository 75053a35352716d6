"""OpenVINO as a peer, with the graph that ONNX Runtime has: in float32, in bfloat16, and in 8 bits.

It chooses bfloat16 by itself on processors that have it; here each way says what it computes in. The graph in
8 bits is made by ONNX Runtime's tool. Kernels are OpenVINO's own.
"""

from __future__ import annotations

import tempfile
from functools import partial
from pathlib import Path

from wamnet.kernels.bench.contenders import FULL, Opened, Tools
from wamnet.kernels.bench.workload import Given
from wamnet.kernels.export.onnx_export import graph
from wamnet.refimpl.network.denoise import Model

from .common import Peer, layered, told_as_missing
from .peer_onnxruntime import Run, at_first, quantised


def _open(name: str, precision: str, tools: Tools, model: Model, size: int) -> Opened:
    """Return OpenVINO with a graph, that in 8 bits for `openvino:int8`, and its floats in a precision."""
    with told_as_missing(name):
        import openvino

        core = openvino.Core()

        def make(given: Given) -> Run:
            with tempfile.TemporaryDirectory() as folder:
                path = Path(folder) / "model.onnx"
                path.write_bytes(quantised(model, given) if name.endswith("int8") else graph(model))
                found = core.read_model(path)
            found.reshape({name: image.shape for name, image in given.images.items()})
            ready = core.compile_model(found, "CPU", {"INFERENCE_PRECISION_HINT": precision})
            return lambda given: next(iter(ready(dict(given.images)).values()))

        device = f"OpenVINO {openvino.__version__.split('-')[0]}, CPU"
    return Opened(at_first(make), device, layered(model, fuses=False))


CONTENDERS = tuple(
    Peer(name, text, partial(_open, name, precision), variant, packages=packages)
    for name, text, precision, variant, packages in (
        ("openvino", "OpenVINO", "f32", FULL, ("onnx", "openvino")),
        ("openvino:bf16", "OpenVINO in bfloat16", "bf16", None, ("onnx", "openvino")),
        (
            "openvino:int8",
            "the same graph in OpenVINO",
            "f32",
            None,
            ("onnx", "onnxruntime", "openvino"),
        ),
    )
)
"""The runtime in three precisions. In the last two it computes another function: only quality is compared."""
