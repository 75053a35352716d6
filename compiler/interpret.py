"""The meaning of a program: each node's NumPy definition, applied in order [`interpret`].

Lanes are leading axes: an input of type float32[n] is an array (..., n), a number an array (...). With
dtype=float64 this is the reference that error bounds speak about; with float32 it is one more executor.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from .ir import Node, Parameters, Program
from .ops import OPS

Array = NDArray[np.floating[Any]]


def interpret(
    program: Program, inputs: Mapping[str, Array], dtype: DTypeLike = np.float32
) -> dict[str, Array]:
    """Return each output (..., n) of the program for inputs (..., n), computed in `dtype`."""
    parameters = {name: array.astype(dtype) for name, array in program.parameters.items()}
    given = {name: np.asarray(array).astype(dtype, copy=False) for name, array in inputs.items()}
    values: list[Any] = []
    for node in program.nodes:
        values.append(_value(node, program, values, given, parameters, np.dtype(dtype).type))
    return {name: values[index] for name, index in program.outputs}


def _value(
    node: Node, program: Program, values: list[Any], given: Mapping[str, Array], parameters: Any, kind: type
) -> Any:
    """Return the value of one node in all lanes."""
    if node.op == "input":
        return given[str(node["name"])]
    if node.op == "constant":
        return kind(node["value"])
    if node.op == "parameter":
        return parameters[node["name"]]
    return apply(node, [_spread(values[arg], program.nodes[arg], node) for arg in node.args], parameters)


def apply(node: Node, operands: list[Any], parameters: Parameters) -> Any:
    """Return the operation's definition, with parameters in place of their names."""
    op = OPS[node.op]
    named = {name: parameters[str(v)] if name in op.parameters else v for name, v in node.attributes}
    return op.definition(*operands, **named)


def _spread(value: Any, operand: Node, node: Node) -> Any:
    """Let a number (...) meet the vectors (..., n) of an elementwise operation."""
    mixed = OPS[node.op].elementwise and node.type.shape and not operand.type.shape
    return value[..., None] if mixed and np.ndim(value) else value
