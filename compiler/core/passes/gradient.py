"""The derivative of a program by its parameters: reverse mode, by the slopes of each operation [ops.py].

1. Walk from the output to the inputs [`gradient`]. A value's slope is the derivative of the loss by the
   value: the output's is given, those of operands follow by the chain rule. Slopes of a value with several
   readers add up. Values that depend on no parameter need none.
2. In one lane an affine map y = W x + b with slope dy gives dx = W^T dy, one more affine map, dW = dy x^T and
   db = dy. The derivative of a loss over many lanes is their sum [`Sum`], which is not a node: a program
   works on each lane by itself. So the program gets dy and x as outputs, and the sum is kept beside it.

Source: the chain rule in reverse order, as in Griewank and Walther, "Evaluating Derivatives", 2008, section
3.2. tests/compiler/passes/test_gradient.py compares it with the backward pass written by hand in
refimpl/network/siren.py, and each rule with central differences.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ....refimpl.errors import CompileError
from ..ir import Builder, Program, attributes
from ..ops import OPS
from ..trace import Traced, emit

TRANSPOSED = ".T"
"""What the name of a transposed matrix ends in."""


@dataclass(frozen=True)
class Sum:
    """The derivative by `parameter`: over the lanes, the sum of outputs left right^T, or of `left`."""

    parameter: str
    left: str
    right: str | None = None


def gradient(program: Program, output: str, slope: str) -> tuple[Program, tuple[Sum, ...]]:
    """Return the program with what the derivatives are made of, and one sum for each parameter.

    `slope` is the output that holds the derivative of the loss by `output`.
    """
    ends = dict(program.outputs)
    if program.nodes[ends[output]].type != program.nodes[ends[slope]].type:
        raise CompileError(f"outputs {output!r} and {slope!r} have different types; they must be equal")
    walk = _Walk(program)
    walk.slopes[ends[output]] = Traced(walk.builder, ends[slope])
    for index in range(ends[output], -1, -1):
        if index in walk.slopes and walk.needs[index]:
            walk.visit(index)
    missing = set(program.parameters) - set(walk.sums)
    if missing:
        raise CompileError(f"the output does not depend on {', '.join(sorted(missing))}")
    made = replace(
        program,
        nodes=tuple(walk.builder.nodes),
        outputs=(*program.outputs, *walk.outputs),
        parameters=dict(walk.builder.parameters),
    )
    return made, tuple(walk.sums[name] for name in program.parameters)


class _Walk:
    """What is known on the way from the output to the inputs: the slopes of values, and the sums so far."""

    def __init__(self, program: Program) -> None:
        self.program, self.builder = program, Builder()
        self.needs: list[bool] = []  # for each node, whether a parameter takes part in its value
        for node in program.nodes:
            self.builder.add(node)
            self.needs.append(bool(OPS[node.op].parameters) or any(self.needs[arg] for arg in node.args))
        self.builder.parameters.update(program.parameters)
        self.slopes: dict[int, Traced] = {}
        self.outputs: list[tuple[str, int]] = []
        self.sums: dict[str, Sum] = {}

    def visit(self, index: int) -> None:
        """Pass the slope of a value on to its operands, and to its parameters."""
        node, d = self.program.nodes[index], self.slopes[index]
        if node.op == "parameter":
            self._sum(str(node["name"]), d)
        elif node.op == "affine":
            self._sum(str(node["weight"]), d, node.args[0])
            if node.get("bias") is not None:
                self._sum(str(node["bias"]), d)
            if self.needs[node.args[0]]:
                # The transposed matrix has a name of its own, so that it can follow W.
                name = f"{node['weight']}{TRANSPOSED}"
                transposed = np.ascontiguousarray(self.builder.parameters[str(node["weight"])].T)
                self.builder.parameters[name] = transposed
                through = emit(self.builder, "affine", d, **dict(attributes(weight=name)))
                self._add(index, node.args[0], through)
        else:
            slopes = OPS[node.op].slopes
            if slopes is None:
                supported = ", ".join(("affine", "parameter", *(op.name for op in OPS.values() if op.slopes)))
                raise CompileError(f"{node.op} has no derivative rule; supported: {supported}")
            parts = slopes(d, Traced(self.builder, index), *(Traced(self.builder, arg) for arg in node.args))
            for arg, part in zip(node.args, parts, strict=True):
                if self.needs[arg]:
                    self._add(index, arg, part)

    def _add(self, index: int, arg: int, part: Traced) -> None:
        """Add to the slope of an operand."""
        if part.type != self.program.nodes[arg].type:
            op = self.program.nodes[index].op
            raise CompileError(f"%{index} {op}: a scalar that depends on weights meets a vector")
        self.slopes[arg] = self.slopes[arg] + part if arg in self.slopes else part

    def _sum(self, parameter: str, left: Traced, right: int | None = None) -> None:
        """Note the derivative by a parameter: the sum over the lanes of left right^T, or of left."""
        if parameter in self.sums:
            raise CompileError(f"parameter {parameter} is used twice: its derivative has no single sum")
        factors = {"left": left.index} if right is None else {"left": left.index, "right": right}
        names = {side: f"{parameter}.{side}" for side in factors}
        self.outputs += [(names[side], factor) for side, factor in factors.items()]
        self.sums[parameter] = Sum(parameter, names["left"], names.get("right"))
