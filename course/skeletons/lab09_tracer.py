"""An intermediate representation of one pixel, and a tracer from NumPy to it.

A program is a list of nodes; a node names its operands by their indices, which are below its own. Tracing is
calling: the function is called once with values that write down what is done to them. NumPy hands every
ufunc on such a value to `__array_ufunc__`, and np.where to `__array_function__`; Python's operators come from
NDArrayOperatorsMixin. The same operation on the same operands is the same node: look it up before you add
one [value numbering]. Constants are kept as they are given, so that float32 stays float32, where IR-6 keeps
all in float64; 0.0 and -0.0, and 1 and 1.0, are different constants. `trace` keeps what nobody uses: dropping
it is the work of `live`.

What is not in OPS is refused with TypeError. So is `if a > 0` on a traced value: Python asks its `__bool__`,
and without one it takes every value as true, silently. Tutorial: page 7. Clauses: IR-1, IR-2, IR-3,
IR-5, IR-6.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.lib.mixins import NDArrayOperatorsMixin

OPS: dict[str, Callable[..., Any]] = {
    "add": np.add,
    "subtract": np.subtract,
    "multiply": np.multiply,
    "divide": np.divide,
    "negative": np.negative,
    "absolute": np.absolute,
    "sqrt": np.sqrt,
    "floor": np.floor,
    "sin": np.sin,
    "cos": np.cos,
    "minimum": np.minimum,
    "maximum": np.maximum,
    "less": np.less,
    "greater": np.greater,
    "select": np.where,
    "bitwise_xor": np.bitwise_xor,
    "right_shift": np.right_shift,
}
"""The operations by name; `select` is np.where."""


class Node(NamedTuple):
    """One operation of OPS, an `input` whose value is its name, or a `const` whose value is a number."""

    op: str
    args: tuple[int, ...] = ()
    value: Any = None


class Program(NamedTuple):
    """Nodes in the order of evaluation, inputs first, and the index of the output."""

    nodes: tuple[Node, ...]
    output: int


class Traced(NDArrayOperatorsMixin):
    """A value of the program that is being traced: `nodes` is the list to which nodes are added."""

    def __init__(self, nodes: list[Node], index: int) -> None:
        self.nodes, self.index = nodes, index

    def __array_ufunc__(self, ufunc: Any, method: str, *operands: Any, **options: Any) -> Traced:
        """Return the traced result of a ufunc on operands, some of which are traced values."""
        raise NotImplementedError("__array_ufunc__")

    def __array_function__(self, function: Any, types: Any, args: Any, options: Any) -> Traced:
        """Return the traced result of np.where."""
        raise NotImplementedError("__array_function__")


def trace(function: Callable[..., Any], names: Sequence[str]) -> Program:
    """Return the program of a function of so many inputs, by calling it once."""
    raise NotImplementedError("trace")


def evaluate(program: Program, given: Mapping[str, Any]) -> Any:
    """Return what a program computes (...) for inputs (...) by name: node by node, with OPS."""
    raise NotImplementedError("evaluate")


def live(program: Program) -> Program:
    """Return the program without nodes that the output does not need, indices renumbered; inputs stay."""
    raise NotImplementedError("live")


def text(program: Program) -> str:
    """Return one line a node, then the output:

    %0 = input a
    %1 = const 2.0
    %2 = multiply %0 %1
    output %2

    A constant is shown by repr(value). Every line ends with a line's end, the last one too.
    """
    raise NotImplementedError("text")
