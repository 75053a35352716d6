"""The frame of a pass, and the short rewrites: sines and tables expanded, biases fused, vectors taken apart.

1. A pass copies a program node by node, and lets a rule put something else in a node's place [`rewrite`].
2. The target's sine and cosine become the emitted ones (sine.py), by tracing these [`expand_sine`].
3. The surfaces of a scene are numbered kind by kind, so most tables repeat one entry over long stretches: no
   surface but the lights emits. Such a table is a chain of selections, whose comparisons all tables share;
   lanes that look up different entries at once (16 paths in one work item) need no loads [`expand_tables`].
4. An affine node adds its bias itself: add(affine(x), b) becomes affine(x) with bias b [`fuse_bias`].
5. Programs of paths work with points, directions and colours, three numbers each. Apart, equal numbers are
   computed once (the rotation that all boxes of a group share), and numbers that nothing needs are dropped:
   a value becomes the list of its numbers; stack and component disappear into it, a parameter becomes
   constants. Only an input or an affine map that is a vector itself is still read number by number
   [`scalarize`].
6. What no output needs is removed; inputs stay, because they are the program's interface [`eliminate_dead`].
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from operator import is_

import numpy as np

from ..ir import Builder, Node, Program, Type, attributes, users
from ..ops import OPS
from ..sine import DEGREE, cosine, sine
from ..trace import Traced, constant_of

Rule = Callable[[Builder, Node, tuple[int, ...]], int | None]
"""(new program, old node, its operands in the new one) -> the index of what stands for it, None: a copy."""


def rewrite(program: Program, rule: Rule) -> Program:
    """Return the program with `rule` applied to every node, operands first; itself if no node is another."""
    builder = Builder()
    builder.parameters.update(program.parameters)
    moved: list[int] = []
    for node in program.nodes:
        args = tuple(moved[arg] for arg in node.args)
        builder.places = node.places
        index = rule(builder, node, args)
        moved.append(builder.add(node.on(args)) if index is None else index)
    if len(builder.nodes) == len(program.nodes) and all(map(is_, builder.nodes, program.nodes)):
        return program
    outputs = tuple((name, moved[index]) for name, index in program.outputs)
    return replace(program, nodes=tuple(builder.nodes), outputs=outputs)


def expand_sine(program: Program, degree: int = DEGREE) -> Program:
    """Return the program without `sin` and `cos`; polynomials of this degree do their work."""

    def rule(builder: Builder, node: Node, args: tuple[int, ...]) -> int | None:
        emitted = {"sin": sine, "cos": cosine}.get(node.op)
        return int(emitted(Traced(builder, args[0]), degree).index) if emitted else None

    return rewrite(program, rule)


MOST_STRETCHES = 6
"""Most stretches of equal entries of a table that is expanded: five selections cost less than the sixteen
loads of one look-up, more do not by much."""


def expand_tables(program: Program) -> Program:
    """Return the program with short chains of selections in place of look-ups."""
    return rewrite(program, _rule)


def _rule(builder: Builder, node: Node, args: tuple[int, ...]) -> int | None:
    """Return the last selection of the chain, from the table's last stretch to its first."""
    if node.op != "take":
        return None
    table = builder.parameters[str(node["table"])]
    changes = [i for i in range(1, len(table)) if table[i].tobytes() != table[i - 1].tobytes()]
    if len(changes) >= MOST_STRETCHES:
        return None
    dtype = node.type.dtype
    result = constant_of(builder, table[-1], dtype)
    for change in reversed(changes):
        place = constant_of(builder, np.int32(change), "int32")
        before = builder.add(Node("less", (args[0], place), Type("bool")))
        value = constant_of(builder, table[change - 1], dtype)
        result = builder.add(Node("select", (before, value, result), node.type))
    return result


def fuse_bias(program: Program) -> Program:
    """Return the program with every vector parameter that is added to one affine node moved into it."""
    readers = users(program)

    def rule(builder: Builder, node: Node, args: tuple[int, ...]) -> int | None:
        if node.op != "add":
            return None
        for product, vector, old in ((args[0], args[1], node.args[0]), (args[1], args[0], node.args[1])):
            affine, bias = builder.nodes[product], builder.nodes[vector]
            fits = affine.op == "affine" and affine.get("bias") is None and bias.op == "parameter"
            # A product that is read elsewhere too would be computed twice: leave it.
            if fits and len(readers[old]) == 1:
                named = attributes(**dict(affine.attributes), bias=bias["name"])
                return builder.add(replace(affine, attributes=named))
        return None

    return rewrite(program, rule)


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
        return tuple(constant_of(builder, each, "float32") for each in program.parameters[str(node["name"])])
    if OPS[node.op].elementwise or not node.type.shape:
        parts = range(node.type.shape[0] if node.type.shape else 1)
        spread = [operand * len(parts) if len(operand) == 1 else operand for operand in operands]
        return tuple(builder.add(node.on(tuple(operand[i] for operand in spread), number)) for i in parts)
    args = tuple(
        _joined(builder, operand, program.nodes[arg].type)
        for operand, arg in zip(operands, node.args, strict=True)
    )
    vector = builder.add(node.on(args))
    return tuple(
        builder.add(Node("component", (vector,), number, attributes(index=i)))
        for i in range(node.type.shape[0])
    )


def _joined(builder: Builder, numbers: tuple[int, ...], kind: Type) -> int:
    """Return the index of a value from its numbers."""
    return builder.add(Node("stack", numbers, kind)) if kind.shape else numbers[0]


def eliminate_dead(program: Program) -> Program:
    """Return the program with only the nodes and parameters that its outputs depend on; itself with all."""
    live = {index for _, index in program.outputs}
    for index in reversed(range(len(program.nodes))):
        if index in live:
            live.update(program.nodes[index].args)
    kept = [i for i, node in enumerate(program.nodes) if i in live or node.op == "input"]
    moved = {old: new for new, old in enumerate(kept)}
    nodes = tuple(program.nodes[i].on(tuple(moved[arg] for arg in program.nodes[i].args)) for i in kept)
    outputs = tuple((name, moved[index]) for name, index in program.outputs)
    used = {str(name) for node in nodes for key, name in node.attributes if key in OPS[node.op].parameters}
    parameters = {name: array for name, array in program.parameters.items() if name in used}
    if len(nodes) == len(program.nodes) and len(parameters) == len(program.parameters):
        return program
    return replace(program, nodes=nodes, outputs=outputs, parameters=parameters)
