"""A graph in ONNX's form as plain nodes: checked, and without what is constant.

1. The file is parsed and checked by the package onnx; weights outside of the file are refused [`read`].
2. Operators whose inputs are all constants are computed: exporters write shapes and margins so [`_folded`].
3. What is left are the nodes that the inputs reach, in the order of the graph [`Graph`].

Nothing in a file is trusted: sizes are limited before anything is computed.
"""

from __future__ import annotations

import math
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

MOST_INPUTS = 64
"""Most inputs of a graph."""

MOST_READ = 2**14
"""Most inputs of all nodes together."""

MOST_FOLDED = 2**12
"""Most elements of a constant that is computed: shapes and margins, not weights."""

MOST_WRITTEN = 2**22
"""Most elements of all constants that are computed: those that only move or change type may be weights."""

MOVED = ("Cast", "Identity", "Transpose")
"""Operators that exporters apply to weights."""

BROADCAST = ("Add", "Div", "Mul", "Sub")
"""Operators on constants that may return more elements than each operand has."""

FOLDED = {
    *("Concat", "Constant", "ConstantOfShape", "Floor", "Gather", "Neg", "Reshape", "Slice", "Squeeze"),
    *("Unsqueeze", *MOVED, *BROADCAST),
}
"""Operators on constants that are computed."""

CONSTANTS = {"value", "value_float", "value_floats", "value_int", "value_ints"}
"""Attributes of Constant that are read."""

FOLD = "export with constants folded"
"""The remedy where constants are not computed."""


@dataclass(frozen=True)
class GraphInput:
    """An input: its sizes (None: any), and the name of its elements' type, as NumPy has it."""

    sizes: tuple[int | None, ...]
    dtype: str


@dataclass(frozen=True)
class GraphNode:
    """One operator: names of what it reads ("" where an input is left out) and of its results."""

    op: str
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    attributes: Mapping[str, Any]
    name: str

    @property
    def output(self) -> str:
        """Return the name of the first result: others are for training."""
        return self.outputs[0]

    def __str__(self) -> str:
        return f"node {self.name} ({self.op})"

    def refuse(self, value: object, rule: str, way_out: str) -> NoReturn:
        """Raise: this node does something that no kernel can be made of."""
        raise InputError(str(self), value, rule, way_out)


@dataclass
class Graph:
    """Inputs by name, the nodes in order, the output's name, and constants."""

    inputs: Mapping[str, GraphInput]
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
        from google.protobuf.message import DecodeError
    except ImportError as error:
        missing = f"package {error.name} cannot be imported: pip install 'wamnet[full]'"
        raise ExecutorUnavailable(missing) from None
    way_out = "export the network again, all of it in one file"
    try:
        model = onnx.load_model_from_string(content)
        _check_inside(path, model)
        onnx.checker.check_model(model)
        return _plain(path, model)
    except InputError:
        raise
    except (*BROKEN, RuntimeError, DecodeError, onnx.checker.ValidationError) as error:
        rule = f"cannot be read as a graph: {error}"
        raise InputError("network", str(path), rule, way_out) from None


def _check_inside(path: Path, model: Any) -> None:
    """Refuse a graph that is large, or whose weights are in other files."""
    attributes = (each for node in model.graph.node for each in node.attribute)
    for tensor in (*model.graph.initializer, *(each.t for each in attributes if each.HasField("t"))):
        if tensor.data_location == tensor.EXTERNAL:
            rule = "its numbers are in another file, which is not read"
            raise InputError(f"{path}: tensor", tensor.name, rule, "export with the weights embedded")
    # Old files list weights among the inputs too.
    weights = {each.name for each in model.graph.initializer}
    for what, count, most in (
        ("nodes", len(model.graph.node), MOST_NODES),
        ("inputs of nodes", sum(len(each.input) for each in model.graph.node), MOST_READ),
        ("inputs", sum(each.name not in weights for each in model.graph.input), MOST_INPUTS),
    ):
        if count > most:
            raise InputError(f"{path}: {what}", count, f"at most {most}", "import a smaller network")


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
    inputs = {each.name: _input(each) for each in made.input if each.name not in constants}
    graph = Graph(inputs, [], made.output[0].name, constants, opset, model.producer_name)
    nodes, computed = [], 0
    for number, each in enumerate(made.node):
        values = {a.name: helper.get_attribute_value(a) for a in each.attribute}
        attributes = {key: v.decode() if isinstance(v, bytes) else v for key, v in values.items()}
        results = tuple(name for name in each.output if name)
        name = each.name or f"number {number}"
        node = GraphNode(each.op_type, tuple(each.input), results, attributes, name)
        if each.domain not in ("", "ai.onnx"):
            node.refuse(each.domain, "only ONNX's own operators are read", "export without others")
        if all(name in constants or not name for name in node.inputs):
            constants[node.output] = _folded(node, each, constants, opset)
            computed += constants[node.output].size
            if computed > MOST_WRITTEN:
                node.refuse(computed, f"at most {MOST_WRITTEN} elements of all computed constants", FOLD)
        else:
            nodes.append(node)
    graph.nodes = nodes
    return graph


def _input(value: Any) -> GraphInput:
    """Return an input's sizes and its type."""
    from onnx import helper

    tensor = value.type.tensor_type
    dtype = str(helper.tensor_dtype_to_np_dtype(tensor.elem_type)) if tensor.elem_type else "not a tensor"
    return GraphInput(
        tuple(axis.dim_value if axis.dim_value > 0 else None for axis in tensor.shape.dim), dtype
    )


def _folded(node: GraphNode, proto: Any, constants: Mapping[str, NDArray[Any]], opset: int) -> NDArray[Any]:
    """Return the result of an operator on constants."""
    from onnx import helper, numpy_helper
    from onnx.reference import ReferenceEvaluator

    operands = {name: constants[name] for name in node.inputs if name}
    if node.op not in FOLDED:
        node.refuse(", ".join(operands), "this operator on constants is not supported", FOLD)
    if node.op == "Constant":
        if not CONSTANTS.issuperset(node.attributes):
            node.refuse(", ".join(node.attributes), f"one of {', '.join(sorted(CONSTANTS))}", FOLD)
        if "value" in node.attributes:
            return np.asarray(numpy_helper.to_array(node.attributes["value"]))
    values = [helper.make_tensor_value_info(name, 1, None) for name in (*operands, node.output)]
    alone = helper.make_graph([proto], "constant", values[:-1], values[-1:])
    model = helper.make_model(alone, opset_imports=[helper.make_opsetid("", opset)])
    try:
        size = _size(node, list(operands.values()))
        if size > MOST_FOLDED and node.op not in MOVED:
            node.refuse(size, f"constants of at most {MOST_FOLDED} elements", FOLD)
        (result,) = ReferenceEvaluator(model).run(None, operands)
    except InputError:
        raise
    except (*BROKEN, RuntimeError) as error:
        node.refuse(str(error), "it cannot be computed", FOLD)
    return np.asarray(result)


def _size(node: GraphNode, operands: Sequence[NDArray[Any]]) -> int:
    """Return an upper bound of the elements that an operator on constants reads and returns."""
    size = sum(array.size for array in operands)
    if node.op in BROADCAST:
        size = max(size, math.prod(np.broadcast_shapes(*(array.shape for array in operands))))
    elif node.op == "Gather":
        size = max(size, operands[0].size * operands[1].size)
    elif node.op == "ConstantOfShape":
        size = math.prod(int(n) for n in operands[0])
    integers = all(array.dtype.kind in "iu" for array in operands)
    if node.op == "Div" and integers and any(np.any(array < 0) for array in operands):
        # ONNX's reference rounds such quotients down, and runtimes to 0.
        node.refuse("a negative integer", "only integers of at least 0 are divided", FOLD)
    return size
