"""Remove what no output needs; inputs stay, because they are the program's interface."""

from __future__ import annotations

from dataclasses import replace

from ..ir import Program
from ..ops import OPS


def eliminate_dead(program: Program) -> Program:
    """Return the program with only the nodes and parameters that its outputs depend on."""
    live = {index for _, index in program.outputs}
    for index in reversed(range(len(program.nodes))):
        if index in live:
            live.update(program.nodes[index].args)
    kept = [i for i, node in enumerate(program.nodes) if i in live or node.op == "input"]
    moved = {old: new for new, old in enumerate(kept)}
    nodes = tuple(
        replace(program.nodes[i], args=tuple(moved[arg] for arg in program.nodes[i].args)) for i in kept
    )
    outputs = tuple((name, moved[index]) for name, index in program.outputs)
    used = {str(name) for node in nodes for key, name in node.attributes if key in OPS[node.op].parameters}
    parameters = {name: array for name, array in program.parameters.items() if name in used}
    return replace(program, nodes=nodes, outputs=outputs, parameters=parameters)
