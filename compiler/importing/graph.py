"""A graph in ONNX's form as plain nodes: checked, and without what is constant.

1. The file is parsed and checked by the package onnx; weights outside of the file are refused [`read`].
2. Operators whose inputs are all constants are computed: exporters write shapes and margins so [`_folded`].
3. What is left are the nodes that the inputs reach, in the order of the graph [`Graph`].

Nothing in a file is believed: sizes are limited before anything is computed.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from ...refimpl.errors import ExecutorUnavailable, InputError
from ...refimpl.reading import BROKEN, read_file

OPSETS = (7, 22)
"""Oldest and newest version of the operators whose meaning this reader knows."""

MOST_NODES = 1000
"""Most nodes of a graph: small networks have tens."""

MOST_FOLDED = 2**12
"""Most numbers of constants that are computed: shapes and margins, not weights. Two make 2^22 at most."""

FOLDED = {
    *("Cast", "Concat", "Constant", "Div", "Floor", "Gather", "Identity", "Mul", "Neg", "Reshape", "Add"),
    *("Slice", "Squeeze", "Sub", "Transpose", "Unsqueeze"),
}
"""Operators on constants that are computed: none makes more numbers than it is given, up to broadcasting."""


@dataclass(frozen=True)
class GraphNode:
    """One operator: names of what it reads ("" where an input is left out) and of its result."""

    op: str
    inputs: tuple[str, ...]
    output: str
    attributes: Mapping[str, Any]
    name: str

    def __str__(self) -> str:
        return f"node {self.name} ({self.op})"

    def refuse(self, value: object, rule: str, way_out: str) -> NoReturn:
        """Raise: this node does something that no kernel can be made of."""
        raise InputError(str(self), value, rule, way_out)


@dataclass
class Graph:
    """Inputs by name with their sizes (None: any), the nodes in order, the output's name, and constants."""

    inputs: Mapping[str, tuple[int | None, ...]]
    nodes: Sequence[GraphNode]
    output: str
    constants: dict[str, NDArray[Any]] = field(default_factory=dict)
    opset: int = 0
    producer: str = ""


def read(path: Path) -> Graph:
    """Return the graph in a file, or say in one line what about it cannot be read."""
    content = read_file(path, "network", "give a file in ONNX's form (.onnx)")
    try:
        import onnx
    except ImportError as error:
        told = f"package {error.name} cannot be imported: pip install 'wamnet[targets]'"
        raise ExecutorUnavailable(told) from None
    way_out = "export the network again, all of it in one file"
    try:
        model = onnx.load_model_from_string(content)
        _check_inside(path, model)
        onnx.checker.check_model(model)
        return _plain(path, model)
    except InputError:
        raise
    except (*BROKEN, RuntimeError, _decoding(), onnx.checker.ValidationError) as error:
        rule = f"it cannot be read as a graph ({error})"
        raise InputError("network", str(path), rule, way_out) from None


def _decoding() -> type[Exception]:
    """Return the error of a file that is not in the form of protobuf."""
    from google.protobuf.message import DecodeError

    found: type[Exception] = DecodeError
    return found


def _check_inside(path: Path, model: Any) -> None:
    """Refuse a graph that is large, or whose weights are in other files."""
    tensors = [*model.graph.initializer, *(t for n in model.graph.node for t in _tensors(n))]
    for tensor in tensors:
        if tensor.data_location == tensor.EXTERNAL:
            rule = "its numbers are in another file, which is not read"
            raise InputError(f"{path}: tensor", tensor.name, rule, "export with the weights inside")
    if len(model.graph.node) > MOST_NODES:
        rule = f"at most {MOST_NODES}"
        raise InputError(f"{path}: nodes", len(model.graph.node), rule, "import a smaller network")


def _tensors(node: Any) -> list[Any]:
    """Return the tensors among a node's attributes."""
    return [each.t for each in node.attribute if each.HasField("t")]


def _plain(path: Path, model: Any) -> Graph:
    """Return a parsed file as plain nodes."""
    from onnx import helper, numpy_helper

    made = model.graph
    versions = {each.domain: each.version for each in model.opset_import}
    opset = versions.get("", versions.get("ai.onnx", 0))
    if not OPSETS[0] <= opset <= OPSETS[1]:
        rule = f"this reader knows {OPSETS[0]} to {OPSETS[1]}"
        raise InputError(f"{path}: version of the operators", opset, rule, "export with opset_version=17")
    if len(made.output) != 1:
        names = ", ".join(each.name for each in made.output)
        raise InputError(f"{path}: outputs", names, "exactly one", "export a network with one output")
    constants = {each.name: numpy_helper.to_array(each) for each in made.initializer}
    inputs = {each.name: _sizes(each) for each in made.input if each.name not in constants}
    graph = Graph(inputs, [], made.output[0].name, constants, opset, model.producer_name)
    nodes = []
    for number, each in enumerate(made.node):
        attributes = {a.name: helper.get_attribute_value(a) for a in each.attribute}
        node = GraphNode(
            each.op_type, tuple(each.input), each.output[0], attributes, each.name or f"number {number}"
        )
        if each.domain not in ("", "ai.onnx"):
            node.refuse(each.domain, "only ONNX's own operators are read", "export without others")
        if all(name in constants or not name for name in node.inputs):
            constants[node.output] = _folded(node, each, constants, opset)
        else:
            nodes.append(node)
    graph.nodes = nodes
    return graph


def _sizes(value: Any) -> tuple[int | None, ...]:
    """Return the sizes of an input, None where any will do."""
    axes = value.type.tensor_type.shape.dim
    return tuple(axis.dim_value if axis.HasField("dim_value") else None for axis in axes)


def _folded(node: GraphNode, proto: Any, constants: Mapping[str, NDArray[Any]], opset: int) -> NDArray[Any]:
    """Return what an operator on constants is."""
    from onnx import helper, numpy_helper
    from onnx.reference import ReferenceEvaluator

    given = {name: constants[name] for name in node.inputs if name}
    if node.op == "Constant" and "value" in node.attributes:
        return np.asarray(numpy_helper.to_array(node.attributes["value"]))
    if node.op == "ConstantOfShape":
        (shape,) = given.values()
        if np.prod(shape.astype(np.float64)) > MOST_FOLDED or np.any(shape < 0):
            node.refuse(shape.tolist(), f"at most {MOST_FOLDED} numbers", "export with constants folded")
    elif node.op not in FOLDED:
        node.refuse(
            ", ".join(given), "this operator on constants is not known", "export with constants folded"
        )
    sizes = [array.size for array in given.values()]
    if sum(sizes) > MOST_FOLDED and node.op not in ("Identity", "Transpose", "Cast"):
        node.refuse(sum(sizes), f"constants of at most {MOST_FOLDED} numbers", "export with constants folded")
    values = [helper.make_tensor_value_info(name, 1, None) for name in (*given, node.output)]
    alone = helper.make_graph([proto], "constant", values[:-1], values[-1:])
    made = helper.make_model(alone, opset_imports=[helper.make_opsetid("", opset)])
    try:
        (found,) = ReferenceEvaluator(made).run(None, given)
    except (*BROKEN, RuntimeError) as error:
        node.refuse(str(error), "it cannot be computed", "export with constants folded")
    return np.asarray(found)
