"""The meaning of a program: each node's NumPy definition, applied in order [`interpret`].

A program runs in other domains as well, such as ranges [`run`].

Lanes are leading axes: an input of type float32[n] is an array (..., n), a number an array (...). With
dtype=float64, in which floats are then computed, this is the reference that error bounds speak about; with
float32 it is one more executor. Integers and booleans are the same in both.

A value is dropped after its last use [`loops.last_reads`]: a picture's are large, and programs have hundreds.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from .ir import Gather, Node, Parameters, Program
from .loops import Loop, Walk, last_reads, loops
from .ops import OPS
from .sums import parts

Array = NDArray[Any]


Rule = Callable[[Node, list[Any], int], Any]
"""(node, its operands, the row of a trip's tables) -> its value, whatever values are."""


def run(program: Program, rule: Rule, enters: Callable[[Any], bool] | None = None) -> dict[str, Any]:
    """Return each output of the program in the domain whose values `rule` makes, node by node.

    `enters` tells of a walk's condition whether any lane enters a node; without it all rows are read, as
    those that are left out change nothing.
    """
    values: list[Any] = [None] * len(program.nodes)
    ends, in_bodies = loops(program)
    unread = last_reads(program, ends)

    def compute(indices: Iterable[int], row: int = 0) -> None:
        for index in indices:
            node = program.nodes[index]
            operands = [values[arg] for arg in node.args]
            if node.op in ("carried", "loop"):
                at = int(node["index"]) if node.op == "loop" else 0  # type: ignore[arg-type]
                values[index] = operands[at]
            else:
                values[index] = rule(node, operands, row)

    def entered(walk: Walk, branch: int) -> bool:
        compute(walk.guard, branch)
        return enters is not None and enters(values[walk.enters])

    def turn(loop: Loop) -> None:
        """Make the trips of a loop; the carried numbers are then its results."""
        for part, row in loop.rows(program.parameters, entered if enters else None):
            compute(part.body, row)
            after = [values[index] for index in part.after]
            for index, value in zip(loop.carried, after, strict=True):
                values[index] = value

    for index in range(len(program.nodes)):
        if index in ends:
            turn(ends[index])
        if index not in in_bodies:
            compute([index])
        for old in unread[index]:
            values[old] = None
    return {name: values[index] for name, index in program.outputs}


def interpret(
    program: Program, inputs: Mapping[str, Array], dtype: DTypeLike = np.float32
) -> dict[str, Array]:
    """Return each output (..., n) of the program for inputs (..., n), computed in `dtype`."""
    kind = np.dtype(dtype)
    parameters = {
        name: array.astype(element(str(array.dtype), kind), copy=False)
        for name, array in program.parameters.items()
    }

    def value(node: Node, operands: list[Any], row: int) -> Any:
        """Return the value of one node in all lanes."""
        if node.op == "input":
            return np.asarray(inputs[str(node["name"])]).astype(element(node.type.dtype, kind), copy=False)
        if node.op == "constant":
            return element(node.type.dtype, kind).type(node["value"])
        if node.op == "parameter":
            return parameters[str(node["name"])]
        if node.op in ("row", "branch"):
            return parameters[str(node["table"])][row]
        spread = [_spread(x, program.nodes[arg], node) for x, arg in zip(operands, node.args, strict=True)]
        of_window = node.op == "affine" and program.nodes[node.args[0]].op == "input"
        if of_window and kind == np.float32 and program.gather:
            return _in_parts(node, spread[0], parameters, program.gather)
        return apply(node, spread, parameters, kind)

    return run(program, value, lambda condition: bool(np.any(condition)))


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
    assert op.definition, op.name
    return op.definition(*operands, **named)


def _spread(value: Any, operand: Node, node: Node) -> Any:
    """Let a number (...) meet the vectors (..., n) of an elementwise operation."""
    mixed = OPS[node.op].elementwise and node.type.shape and not operand.type.shape
    return value[..., None] if mixed and np.ndim(value) else value
