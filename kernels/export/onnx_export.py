"""A model as an ONNX graph of operators 17 for images of any size, and its run by ONNX Runtime.

Images come as rows with interleaved channels; the graph itself joins and transposes them.
A network of integers is a graph in which no operation rounds: convolutions of integers in float32, the rest
in int64 and uint32, none of whose results leaves its kind of number.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...compiler.compile import AGAINST_WHOLE
from ...refimpl.errors import ExecutorUnavailable
from ...refimpl.network.activation import RELU, SINE
from ...refimpl.network.dataset import FEATURES
from ...refimpl.network.denoise import Model
from ...refimpl.network.whole import COLOUR_STEPS, SINES, TURN, Whole
from ..bench.contenders import activation_in

OPERATORS = 17
"""Version of the operators: the graph uses none that is newer."""

WHOLE_OPERATORS = 18
"""The same for a network of integers: this version has operators on bits."""

FORMAT = 8
"""Version of the file's form that goes with both."""

MODES = {"clamp": "edge", "zero": "constant"}
"""Border rules as modes of the operator Pad."""


NODES = {SINE: "Sin", RELU: "Relu"}
"""Activations as operators."""

TEXT = f"ONNX, operators {OPERATORS}: Conv and Sin nodes, dynamic height and width"
"""What a manifest says about the language."""

WHOLE_TEXT = (
    f"ONNX, operators {WHOLE_OPERATORS}: Conv nodes of integers in float32, the rest in "
    "int64 and uint32, dynamic height and width"
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

    def node(self, kind: str, inputs: list[str], output: str = "", **attributes: Any) -> str:
        """Add an operation, and return the name of its result."""
        from onnx import helper

        name = output or f"{kind}{len(self.nodes)}"
        self.nodes.append(helper.make_node(kind, inputs, [name], **attributes))
        return name

    def cast(self, x: str, kind: str) -> str:
        """Convert to float32, int64 or uint32; uint32 holds what is converted to it."""
        from onnx import helper

        return self.node("Cast", [x], to=helper.np_dtype_to_tensor_dtype(np.dtype(kind)))

    def words(self, kind: str, x: str, y: str | int) -> str:
        """Add an operation on uint32."""
        other = y if isinstance(y, str) else self.constant(f"word{y}", np.uint32(y))
        direction = {"direction": "RIGHT"} if kind == "BitShift" else {}
        return self.node(kind, [x, other], **direction)


def graph(model: Model) -> bytes:
    """Return the model in ONNX's form: images (H, W, C) by name to `result` (H, W, 3)."""
    try:
        from onnx import TensorProto, checker, helper
    except ImportError as error:
        raise ExecutorUnavailable(
            f"package {error.name} cannot be imported: pip install {error.name}"
        ) from None
    made = Nodes()
    axis, size = made.constant("axis", np.array([0], np.int64)), model.window.size
    x = made.node("Concat", list(model.features), "joined", axis=2)
    x = made.node("Transpose", [x], "planes", perm=[2, 0, 1])
    x = made.node("Unsqueeze", [x, axis], "batch")
    before, after = model.window.before, model.window.after
    margins = made.constant("margins", np.array([0, 0, before, before, 0, 0, after, after], np.int64))
    x = made.node("Pad", [x, margins], "padded", mode=MODES[model.window.border])
    network = model.siren
    x = _whole_layers(made, network, size, x) if isinstance(network, Whole) else _layers(made, model, x)
    x = made.node("Squeeze", [x, axis], "alone")
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


def _form(weight: NDArray[Any], side: int) -> NDArray[np.float32]:
    """Return a layer's weights (D_out, D_in) as those of a convolution (D_out, C, side, side)."""
    return weight.astype(np.float32).reshape(len(weight), side, side, -1).transpose(0, 3, 1, 2).copy()


def _layers(made: Nodes, model: Model, x: str) -> str:
    """Add the layers of a network of floats; return the name of its colours."""
    activate = activation_in("the ONNX graph", NODES, model)
    last = len(model.siren.weights) - 1
    for layer, (weight, bias) in enumerate(zip(model.siren.weights, model.siren.biases, strict=True)):
        side = 1 if layer else model.window.size
        form = made.constant(f"w{layer}", _form(weight, side))
        named = [form, made.constant(f"b{layer}", bias.astype(np.float32))]
        x = made.node("Conv", [x, *named], f"sum{layer}", kernel_shape=[side, side])
        if layer < last:
            omega = model.siren.omega_0_hidden if layer else model.siren.omega_0_first
            x = made.node("Mul", [x, made.constant(f"o{layer}", np.float32(omega))], f"angle{layer}")
            x = made.node(activate, [x], f"{model.siren.activation}{layer}")
    bounds = [made.constant("black", np.float32(0.0)), made.constant("white", np.float32(1.0))]
    return made.node("Clip", [x, *bounds], "clipped")


def _whole_layers(made: Nodes, network: Whole, size: int, x: str) -> str:
    """Add the layers of a network of integers [whole.py]; return the name of its colours.

    Sums are float32, which holds them; sum * factor + bias is below 2^49, and int64 holds it. In Mod a
    negative phase gets the divisor's sign, as in Python.
    """
    last = len(network.weights) - 1
    for layer, weight in enumerate(network.weights):
        side = 1 if layer else size
        form = made.constant(f"w{layer}", _form(weight, side))
        x = made.cast(made.node("Conv", [x, form], f"sum{layer}", kernel_shape=[side, side]), "int64")
        for kind, arrays in (("Mul", network.factors), ("Add", network.biases)):
            column = arrays[layer].astype(np.int64).reshape(-1, 1, 1)
            x = made.node(kind, [x, made.constant(f"{kind.lower()}{layer}", column)], f"{kind}_{layer}")
        if layer < last:
            phase = made.node("Mod", [x, made.constant("turn", np.int64(TURN))], f"phase{layer}")
            x = _whole_sine(made, made.cast(phase, "uint32"), network.amplitude)
    white = made.constant("white", np.int64(COLOUR_STEPS << network.fraction))
    units = made.node("Clip", [x, made.constant("black", np.int64(0)), white], "units")
    steps = made.words("BitShift", made.cast(units, "uint32"), network.fraction)
    step = made.constant("step", np.float32(1 / COLOUR_STEPS))
    return made.node("Mul", [made.cast(steps, "float32"), step])


def _whole_sine(made: Nodes, phases: str, amplitude: int) -> str:
    """Add the sine of phases below 2^24, operation by operation that of the reference, in uint32."""
    polynomial, words = SINES[amplitude], made.words
    c1, c3, c5 = (made.constant(f"word{c}", np.uint32(c)) for c in polynomial.coefficients)
    back = words("BitwiseAnd", words("BitShift", phases, 22), 1)
    turned = words("BitwiseXor", phases, words("Mul", back, 2**32 - 1))
    m = words("BitwiseAnd", words("BitShift", turned, 6), 0xFFFF)
    z = words("BitShift", words("Mul", m, m), 16)
    inner = words("Sub", c3, words("BitShift", words("Mul", z, c5), 16))
    q = words("Sub", c1, words("BitShift", words("Mul", z, inner), 16))
    raised = words("Add", words("Mul", m, q), 1 << (polynomial.shift - 1))
    magnitude = made.cast(words("BitShift", raised, polynomial.shift), "float32")
    half = made.cast(words("BitShift", phases, 23), "float32")
    two, one = made.constant("two", np.float32(2)), made.constant("one", np.float32(1))
    sign = made.node("Sub", [one, made.node("Mul", [half, two])])
    return made.node("Mul", [magnitude, sign])


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
