"""A model as an ONNX graph of operators 17 for images of any size, and its run by ONNX Runtime.

Images come as rows with interleaved channels; the graph itself joins and transposes them. Its nodes are those
of the model's program [compiler/core/lower.py], one by one [`NODES`]: an affine map is a Conv. That of a
network of integers has no operation that rounds: convolutions of integers in float32, the rest in int32 and
uint32, whose results wrap around.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...compiler.core.ir import Node, Program
from ...compiler.core.lower import lower
from ...compiler.core.passes import pipeline
from ...compiler.proof.evidence import AGAINST
from ...compiler.schedules.common import kernel_gather
from ...refimpl.errors import ExecutorUnavailable
from ...refimpl.network.dataset import FEATURES
from ...refimpl.network.denoise import Model

OPERATORS = 17
"""Version of the operators: the graph uses none that is newer."""

WHOLE_OPERATORS = 18
"""The same for a network of integers: this version has operators on bits."""

FORMAT = 8
"""Version of the file's form that goes with both."""

MODES = {"clamp": "edge", "zero": "constant"}
"""Border rules as modes of the operator Pad."""

NODES = {
    "add": "Add",
    "bitwise_and": "BitwiseAnd",
    "bitwise_xor": "BitwiseXor",
    "convert": "Cast",
    "maximum": "Clip",
    "minimum": "Clip",
    "multiply": "Mul",
    "right_shift": "BitShift",
    "sin": "Sin",
    "subtract": "Sub",
}
"""Operations of programs as operators; a maximum and a minimum are with a constant."""

TEXT = f"ONNX, operators {OPERATORS}: Conv and Sin nodes, dynamic height and width"
"""What a manifest says about the language."""

WHOLE_TEXT = (
    f"ONNX, operators {WHOLE_OPERATORS}: Conv nodes of integers in float32, the rest in "
    "int32 and uint32, dynamic height and width"
)
"""The same for a network of integers."""

ASSUMES = "the runtime's Conv adds up products in float32: no transform of the window, no shorter products"
"""What a network of integers rests on: ONNX says what a Conv is, not how it is computed."""


class Nodes:
    """The nodes and constants of a graph that is being written."""

    def __init__(self) -> None:
        self.nodes: list[Any] = []
        self.constants: dict[str, Any] = {}

    def constant(self, name: str, value: Any) -> str:
        """Add a constant once, and return its name."""
        from onnx import numpy_helper

        self.constants[name] = numpy_helper.from_array(np.asarray(value), name)
        return name

    def node(self, kind: str, inputs: list[str], output: str, **attributes: Any) -> str:
        """Add an operation, and return the name of its result."""
        from onnx import helper

        self.nodes.append(helper.make_node(kind, inputs, [output], **attributes))
        return output


def graph(model: Model) -> bytes:
    """Return the model in ONNX's form: images (H, W, C) by name to `result` (H, W, 3)."""
    try:
        from onnx import TensorProto, checker, helper
    except ImportError as error:
        raise ExecutorUnavailable(
            f"package {error.name} cannot be imported: pip install {error.name}"
        ) from None
    made, program = Nodes(), pipeline.run(lower(model), pipeline.COMMON)
    axis = made.constant("axis", np.array([0], np.int64))
    x = made.node("Concat", list(model.features), "joined", axis=2)
    x = made.node("Transpose", [x], "planes", perm=[2, 0, 1])
    x = made.node("Unsqueeze", [x, axis], "batch")
    before, after = model.window.before, model.window.after
    margins = made.constant("margins", np.array([0, 0, before, before, 0, 0, after, after], np.int64))
    values = [made.node("Pad", [x, margins], "padded", mode=MODES[model.window.border])]
    for index, node in enumerate(program.nodes[1:], 1):
        values.append(_value(made, program, index, node, values))
    x = made.node("Squeeze", [values[program.outputs[0][1]], axis], "alone")
    made.node("Transpose", [x], "result", perm=[1, 2, 0])

    def value(name: str, channels: int) -> Any:
        return helper.make_tensor_value_info(name, TensorProto.FLOAT, ["H", "W", channels])

    inputs = [value(name, FEATURES[name].channels) for name in model.features]
    constants = list(made.constants.values())
    whole = helper.make_graph(made.nodes, "denoiser", inputs, [value("result", 3)], constants)
    operators = [helper.make_opsetid("", WHOLE_OPERATORS if model.is_whole else OPERATORS)]
    found = helper.make_model(whole, opset_imports=operators, ir_version=FORMAT)
    checker.check_model(found)
    data: bytes = found.SerializeToString()
    return data


def _value(made: Nodes, program: Program, index: int, node: Node, values: list[str]) -> str:
    """Return the name of a node's value in the graph: a constant, or the result of what is added for it."""
    from onnx import helper

    given, name = [values[arg] for arg in node.args], f"{node.op}{index}"
    if node.op == "constant":
        return made.constant(name, np.array(node["value"], node.type.dtype))
    if node.op == "parameter":
        return made.constant(name, program.parameters[str(node["name"])].astype(np.float32)[:, None, None])
    if node.op == "affine":
        # The window is read by the first one; all others are of a pixel.
        gather = kernel_gather(program)
        rows, columns = (gather.rows, gather.columns) if node.args == (0,) else (1, 1)
        weight = program.parameters[str(node["weight"])].astype(np.float32)
        form = weight.reshape(len(weight), rows, columns, -1).transpose(0, 3, 1, 2).copy()
        named = [made.constant(f"weight{index}", form)]
        if bias := node.get("bias"):
            named.append(made.constant(f"bias{index}", program.parameters[str(bias)].astype(np.float32)))
        return made.node("Conv", [*given, *named], name, kernel_shape=[rows, columns])
    if node.op not in NODES:
        raise ExecutorUnavailable(f"the ONNX graph has no implementation of {node.op}")
    kind, options = NODES[node.op], {}
    if kind == "Cast":
        options["to"] = helper.np_dtype_to_tensor_dtype(np.dtype(str(node["dtype"])))
    elif kind == "Mul":  # a runtime joins a Conv with the constant behind it
        given.sort(key=made.constants.__contains__)
    elif kind == "BitShift":
        options["direction"] = "RIGHT"
    elif node.op == "minimum" and program.nodes[node.args[0]].op == "maximum":
        given = [*made.nodes.pop().input, given[1]]  # both ends in one
    elif node.op == "minimum":
        given.insert(1, "")
    return made.node(kind, given, name, **options)


def run_graph(data: bytes, images: Mapping[str, NDArray[np.float32]]) -> tuple[str, NDArray[np.float32]]:
    """Return the runtime's name, and what a graph makes of images (H, W, C)."""
    try:
        import onnxruntime
    except ImportError:
        raise ExecutorUnavailable("onnxruntime is not installed: pip install onnxruntime") from None
    session = onnxruntime.InferenceSession(data, providers=["CPUExecutionProvider"])
    return f"ONNX Runtime {onnxruntime.__version__}", session.run(None, dict(images))[0]


def promise(model: Model) -> dict[str, Any]:
    """Return what a manifest says about language, profile and bound."""
    if model.is_whole:
        return {
            "language": WHOLE_TEXT,
            "profile": {"name": "ieee", "text": "no operation rounds"},
            "bound": {"output": [0.0] * len(model.siren.biases[-1]), "against": AGAINST[1]},
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
