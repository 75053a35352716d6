"""The frame of a pass: copy a program node by node, and let a rule put something else in a node's place."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from ..ir import Builder, Node, Program

Rule = Callable[[Builder, Node, tuple[int, ...]], int | None]
"""(new program, old node, its operands in the new one) -> the index of what stands for it, None: a copy."""


def rewrite(program: Program, rule: Rule) -> Program:
    """Return the program with `rule` applied to every node, operands first."""
    builder = Builder()
    builder.parameters.update(program.parameters)
    moved: list[int] = []
    for node in program.nodes:
        args = tuple(moved[arg] for arg in node.args)
        builder.places = node.places
        index = rule(builder, node, args)
        kept = node if args == node.args else replace(node, args=args)
        moved.append(builder.add(kept) if index is None else index)
    outputs = tuple((name, moved[index]) for name, index in program.outputs)
    return replace(program, nodes=tuple(builder.nodes), outputs=outputs)
