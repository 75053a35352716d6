"""ONNX Runtime as a peer: the network as a graph of operators 17, on its processor's provider.

Images come as rows with interleaved channels; the graph itself joins and turns them, so that turning counts.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...refimpl.errors import ExecutorUnavailable
from ...refimpl.network.activation import RELU, SINE
from ...refimpl.network.dataset import FEATURES
from ...refimpl.network.denoise import Model
from .contender import Contender, Opened, Tools, activation_in, told_as_missing
from .cost import layered
from .workload import Given

OPERATORS = 17
"""Version of the operators: the graph uses none that is newer."""

FORMAT = 8
"""Version of the file's form that goes with it."""

MODES = {"clamp": "edge", "zero": "constant"}
"""Border rules as modes of the operator Pad."""


NODES = {SINE: "Sin", RELU: "Relu"}
"""Activations as operators."""


def graph(model: Model) -> bytes:
    """Return the model in ONNX's form: images (H, W, C) by name to `result` (H, W, 3)."""
    from onnx import TensorProto, checker, helper, numpy_helper

    nodes: list[Any] = []
    constants: list[Any] = []

    def constant(name: str, value: Any) -> str:
        constants.append(numpy_helper.from_array(np.asarray(value), name))
        return name

    def node(kind: str, inputs: list[str], output: str, **attributes: Any) -> str:
        nodes.append(helper.make_node(kind, inputs, [output], **attributes))
        return output

    axis, size = constant("axis", np.array([0], np.int64)), model.window.size
    x = node("Concat", list(model.features), "joined", axis=2)
    x = node("Transpose", [x], "planes", perm=[2, 0, 1])
    x = node("Unsqueeze", [x, axis], "batch")
    before, after = model.window.before, model.window.after
    margins = constant("margins", np.array([0, 0, before, before, 0, 0, after, after], np.int64))
    x = node("Pad", [x, margins], "padded", mode=MODES[model.window.border])
    activate = activation_in("the ONNX graph", NODES, model)
    last = len(model.siren.weights) - 1
    for layer, (weight, bias) in enumerate(zip(model.siren.weights, model.siren.biases, strict=True)):
        side = 1 if layer else size
        form = weight.astype(np.float32).reshape(len(weight), side, side, -1).transpose(0, 3, 1, 2)
        named = [constant(f"w{layer}", form.copy()), constant(f"b{layer}", bias.astype(np.float32))]
        x = node("Conv", [x, *named], f"sum{layer}", kernel_shape=[side, side])
        if layer < last:
            omega = model.siren.omega_0_hidden if layer else model.siren.omega_0_first
            x = node("Mul", [x, constant(f"o{layer}", np.float32(omega))], f"angle{layer}")
            x = node(activate, [x], f"{model.siren.activation}{layer}")
    bounds = [constant("black", np.float32(0.0)), constant("white", np.float32(1.0))]
    x = node("Clip", [x, *bounds], "clipped")
    x = node("Squeeze", [x, axis], "alone")
    node("Transpose", [x], "result", perm=[1, 2, 0])

    def value(name: str, channels: int) -> Any:
        return helper.make_tensor_value_info(name, TensorProto.FLOAT, ["H", "W", channels])

    inputs = [value(name, FEATURES[name].channels) for name in model.features]
    whole = helper.make_graph(nodes, "denoiser", inputs, [value("result", 3)], constants)
    operators = [helper.make_opsetid("", OPERATORS)]
    made = helper.make_model(whole, opset_imports=operators, ir_version=FORMAT)
    checker.check_model(made)
    found: bytes = made.SerializeToString()
    return found


def run_graph(data: bytes, images: Mapping[str, NDArray[np.float32]]) -> tuple[str, NDArray[np.float32]]:
    """Return the runtime's name, and what a graph makes of images (H, W, C)."""
    try:
        import onnxruntime
    except ImportError:
        raise ExecutorUnavailable("onnxruntime is not installed: pip install 'wamnet[targets]'") from None
    session = onnxruntime.InferenceSession(data, providers=["CPUExecutionProvider"])
    return f"ONNX Runtime {onnxruntime.__version__}", session.run(None, dict(images))[0]


def _open(tools: Tools, model: Model, size: int) -> Opened:
    """Return a session of the graph."""
    with told_as_missing("onnxruntime"):
        import onnxruntime

        text = graph(model)
        session = onnxruntime.InferenceSession(text, providers=["CPUExecutionProvider"])

    def run(given: Given) -> NDArray[np.float32]:
        found: NDArray[np.float32] = session.run(None, dict(given.images))[0]
        return found

    device = f"ONNX Runtime {onnxruntime.__version__}, CPU provider"
    return Opened(run, device, layered(model, fuses=False))


CONTENDERS = (Contender("onnxruntime", "ONNX Runtime", _open, packages=("onnx", "onnxruntime")),)
"""The runtime with its default options."""
