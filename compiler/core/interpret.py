"""The meaning of a program: each node's NumPy definition, applied in order [`interpret`].

Lanes are leading axes: an input of type float32[n] is an array (..., n), a number an array (...). With
dtype=float64, in which floats are then computed, this is the reference that error bounds speak about; with
float32 it is one more executor. Integers and booleans are the same in both.

A value is dropped after its last use [`loops.last_reads`]: a picture's are large, and programs have hundreds.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from .ir import Gather, Node, Parameters, Program
from .loops import Loop, Part, last_reads, loops
from .ops import OPS
from .sums import parts

Array = NDArray[Any]


def interpret(
    program: Program, inputs: Mapping[str, Array], dtype: DTypeLike = np.float32
) -> dict[str, Array]:
    """Return each output (..., n) of the program for inputs (..., n), computed in `dtype`."""
    kind = np.dtype(dtype)
    parameters = {
        name: array.astype(element(str(array.dtype), kind), copy=False)
        for name, array in program.parameters.items()
    }
    values: list[Any] = [None] * len(program.nodes)
    ends, in_bodies = loops(program)
    unread = last_reads(program, ends)
    for index, node in enumerate(program.nodes):
        if index in ends:
            _run(ends[index], program, values, inputs, parameters, kind)
        if index not in in_bodies:
            values[index] = _value(node, program, values, inputs, parameters, kind)
        for old in unread[index]:
            values[old] = None
    return {name: values[index] for name, index in program.outputs}


def _run(
    loop: Loop, program: Program, values: list[Any], given: Mapping[str, Array], parameters: Any, kind: Any
) -> None:
    """Make the trips of a loop; the carried numbers are then its results."""

    def compute(indices: tuple[int, ...], at: int) -> None:
        for index in indices:
            node = program.nodes[index]
            if node.op in ("row", "branch"):
                values[index] = parameters[str(node["table"])][at]
            else:
                values[index] = _value(node, program, values, given, parameters, kind)

    def enters(branch: int) -> bool:
        assert loop.walk is not None
        compute(loop.walk.guard, branch)
        return bool(np.any(values[loop.walk.enters]))

    walk, plain = loop.walk, Part(loop.body, loop.after)
    rows = walk.rows(program.parameters, enters) if walk else ((plain, trip) for trip in range(loop.trips))
    for part, row in rows:
        compute(part.body, row)
        after = [values[index] for index in part.after]
        for index, value in zip(loop.carried, after, strict=True):
            values[index] = value


def _value(
    node: Node,
    program: Program,
    values: list[Any],
    given: Mapping[str, Array],
    parameters: Any,
    kind: np.dtype[Any],
) -> Any:
    """Return the value of one node in all lanes."""
    if node.op == "input":
        return np.asarray(given[str(node["name"])]).astype(element(node.type.dtype, kind), copy=False)
    if node.op == "constant":
        return element(node.type.dtype, kind).type(node["value"])
    if node.op == "parameter":
        return parameters[node["name"]]
    if node.op == "carried":
        return values[node.args[0]]
    if node.op == "loop":
        return values[node.args[int(node["index"])]]  # type: ignore[arg-type]
    operands = [_spread(values[arg], program.nodes[arg], node) for arg in node.args]
    of_window = node.op == "affine" and program.nodes[node.args[0]].op == "input"
    if of_window and kind == np.float32 and program.gather:
        return _in_parts(node, operands[0], parameters, program.gather)
    return apply(node, operands, parameters, kind)


def _in_parts(node: Node, x: Any, parameters: Any, gather: Gather) -> Any:
    """Return W x + b in float32 as kernels add it up: partial sums of each image's rows of taps [sums.py]."""
    weight = parameters[str(node["weight"])]
    found = parameters[str(node["bias"])] if node.get("bias") is not None else np.float32(0)
    for part in parts(gather, weight.shape[1]):
        found = found + np.matmul(x[..., part], weight[:, part].T)
    return found


def element(dtype: str, kind: np.dtype[Any]) -> np.dtype[Any]:
    """Return the element type in which values of `dtype` are held when floats are computed in `kind`."""
    return kind if dtype == "float32" else np.dtype(dtype)


def apply(node: Node, operands: list[Any], parameters: Parameters, kind: np.dtype[Any]) -> Any:
    """Return the operation's definition, with parameters in place of their names."""
    op = OPS[node.op]
    named: dict[str, Any] = {
        name: parameters[str(value)] if name in op.parameters else value for name, value in node.attributes
    }
    if "dtype" in named:
        named["dtype"] = element(named["dtype"], kind)
    return op.definition(*operands, **named)


def _spread(value: Any, operand: Node, node: Node) -> Any:
    """Let a number (...) meet the vectors (..., n) of an elementwise operation."""
    mixed = OPS[node.op].elementwise and node.type.shape and not operand.type.shape
    return value[..., None] if mixed and np.ndim(value) else value
