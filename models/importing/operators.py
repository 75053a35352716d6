"""ONNX's operators: which nodes are taken, and the result of each.

1. An operator, attribute or value of one that has no row is rejected [`run`]: names, types and numbers of
   inputs of its version have been checked before [graph.py].
2. The row's handler returns the operator's result as a field, or rejects the node [values.py, axes.py].
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ...refimpl.errors import InputError
from ...refimpl.reading import BROKEN
from .axes import AXES
from .graph import GraphNode
from .reader import AGAIN, Reader
from .rules import INFERENCE, NONE, Operator
from .values import VALUES

OPERATORS: Mapping[str, Operator] = {**VALUES, **AXES}
"""All operators that are imported."""


def run(reader: Reader, node: GraphNode) -> None:
    """Add the result of a node."""
    operator = OPERATORS.get(node.op)
    if operator is None:
        rule = f"supported are {', '.join(sorted(OPERATORS))}"
        node.refuse(node.op, rule, "export the network without it, or compute it outside")
    for name, value in node.attributes.items():
        allowed = operator.attributes.get(name, NONE)
        if not allowed.holds(value):
            node.refuse(f"{name}={value}", f"{name} must be {allowed.text}", allowed.remedy)
    if len(node.outputs) > operator.outputs:
        node.refuse(", ".join(node.outputs), "further outputs are for training", INFERENCE)
    operands = [reader.fields[name] for name in node.inputs if name in reader.fields]
    if any(x.integer for x in operands) and not operator.integers:
        node.refuse("integers", "it would round or wrap integers", "Cast the input to float32 first")
    try:
        with np.errstate(all="ignore"):
            result = operator.handler(reader, node)
    except InputError:
        raise
    except (*BROKEN, RuntimeError) as error:
        node.refuse(f"{type(error).__name__}: {error}", "its inputs or attributes do not fit", AGAIN)
    reader.add(node, result)
