"""ONNX Runtime as a peer: the exported graph, on its processor's provider; transposing images counts.

In 8 bits the graph is quantised by ONNX Runtime's own tool, weights by channel, with the first frame that is
given as its calibration: convolutions are of bytes, sines of floats.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wamnet.kernels.bench.contenders import Opened, Tools
from wamnet.kernels.bench.workload import Given
from wamnet.kernels.export.onnx_export import graph
from wamnet.refimpl.network.denoise import Model

from .common import Peer, layered, told_as_missing

CALIBRATION_PX = 256
"""Width and height of the part of the frame that ranges are measured on."""

Run = Callable[[Given], NDArray[np.float32]]
"""From a frame to a picture."""


def quantised(model: Model, frame: Given) -> bytes:
    """Return the model's graph in 8 bits, its ranges measured on a frame."""
    from onnxruntime.quantization import CalibrationDataReader, QuantFormat, QuantType, quantize_static
    from onnxruntime.quantization.shape_inference import quant_pre_process

    part = {name: image[:CALIBRATION_PX, :CALIBRATION_PX] for name, image in frame.images.items()}

    class One(CalibrationDataReader):  # type: ignore[misc]
        """The frame, once."""

        def __init__(self) -> None:
            self.left = [part]

        def get_next(self) -> Any:
            """Return the next inputs, or None."""
            return self.left.pop() if self.left else None

    with tempfile.TemporaryDirectory() as folder:
        given, prepared, made = (Path(folder) / name for name in ("given", "prepared", "made"))
        given.write_bytes(graph(model))
        quant_pre_process(given, prepared, skip_symbolic_shape=True)
        quantize_static(
            prepared,
            made,
            One(),
            quant_format=QuantFormat.QDQ,
            op_types_to_quantize=["Conv"],
            per_channel=True,
            activation_type=QuantType.QUInt8,
            weight_type=QuantType.QInt8,
        )
        return made.read_bytes()


def at_first(make: Callable[[Given], Run]) -> Run:
    """Return a run that is made of the first frame."""
    made: list[Run] = []

    def run(given: Given) -> NDArray[np.float32]:
        if not made:
            made.append(make(given))
        return made[0](given)

    return run


def _open(name: str, tools: Tools, model: Model, size: int) -> Opened:
    """Return a session of the graph, of that in 8 bits for `onnxruntime:int8`."""
    with told_as_missing(name):
        import onnxruntime

        def session(graph_: bytes) -> Run:
            made = onnxruntime.InferenceSession(graph_, providers=["CPUExecutionProvider"])
            return lambda given: made.run(None, dict(given.images))[0]

        device = f"ONNX Runtime {onnxruntime.__version__}, CPU provider"
        if name.endswith("int8"):
            run = at_first(lambda given: session(quantised(model, given)))
        else:
            run = session(graph(model))
    return Opened(run, device, layered(model, fuses=False))


CONTENDERS = (
    Peer("onnxruntime", "ONNX Runtime", partial(_open, "onnxruntime"), packages=("onnx", "onnxruntime")),
    Peer(
        "onnxruntime:int8",
        "ONNX Runtime in 8 bits",
        partial(_open, "onnxruntime:int8"),
        variant=None,
        packages=("onnx", "onnxruntime"),
    ),
)
"""The runtime with its default options. In 8 bits it computes another function: only quality is compared."""
