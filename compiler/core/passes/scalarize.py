"""Take vectors apart: every operation on a vector becomes one on each of its numbers.

Programs of paths work with points, directions and colours, three numbers each. Apart, equal numbers are
computed once (the rotation that all boxes of a group share), and numbers that nothing needs are dropped.

1. A value becomes the list of its numbers [`_numbers`]: stack and component disappear into it, a parameter
   becomes constants.
2. Only an input or an affine map that is a vector itself is still read number by number.
"""

from __future__ import annotations

from dataclasses import replace

from ..ir import Builder, Node, Program, Type, attributes
from ..ops import OPS


def scalarize(program: Program) -> Program:
    """Return the program with numbers in place of vectors."""
    builder = Builder()
    builder.parameters.update(program.parameters)
    numbers: list[tuple[int, ...]] = []
    for node in program.nodes:
        builder.places = node.places
        numbers.append(_numbers(builder, program, node, [numbers[arg] for arg in node.args]))
    outputs = tuple(
        (name, _joined(builder, numbers[index], program.nodes[index].type)) for name, index in program.outputs
    )
    return replace(program, nodes=tuple(builder.nodes), outputs=outputs)


def _numbers(
    builder: Builder, program: Program, node: Node, operands: list[tuple[int, ...]]
) -> tuple[int, ...]:
    """Return the new indices of a node's numbers, given those of its operands."""
    number = Type(node.type.dtype)
    if node.op == "stack":
        return tuple(operand[0] for operand in operands)
    if node.op == "component":
        return (operands[0][int(node["index"])],)  # type: ignore[arg-type]
    if node.op == "parameter":
        values = program.parameters[str(node["name"])]
        return tuple(
            builder.add(Node("constant", (), number, attributes(value=float(value)))) for value in values
        )
    if OPS[node.op].elementwise or not node.type.shape:
        parts = range(node.type.shape[0] if node.type.shape else 1)
        spread = [operand * len(parts) if len(operand) == 1 else operand for operand in operands]
        return tuple(
            builder.add(replace(node, type=number, args=tuple(operand[i] for operand in spread)))
            for i in parts
        )
    args = tuple(
        _joined(builder, operand, program.nodes[arg].type)
        for operand, arg in zip(operands, node.args, strict=True)
    )
    vector = builder.add(replace(node, args=args))
    return tuple(
        builder.add(Node("component", (vector,), number, attributes(index=i)))
        for i in range(node.type.shape[0])
    )


def _joined(builder: Builder, numbers: tuple[int, ...], kind: Type) -> int:
    """Return the index of a value from its numbers."""
    return builder.add(Node("stack", numbers, kind)) if kind.shape else numbers[0]
