"""Replace look-ups in tables of few different stretches with selections.

The surfaces of a scene are numbered kind by kind, so most tables repeat one entry over long stretches: no
surface but the lights emits. Such a table is a chain of selections, whose comparisons all tables share; lanes
that look up different entries at once (16 paths in one work item) need no loads. Tables with more stretches
stay tables.
"""

from __future__ import annotations

import numpy as np

from ..ir import Builder, Node, Program, Type
from .fold import constant_of
from .rewrite import rewrite

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
