"""In which form a scene's primitives become code: statements, tables with a loop, or tables with a tree.

1. What a ray pays for one row of a group is the operations of a trip, traced from the reference and weighed
   [`row_cost`]: a turned box costs six boxes that share a rotation.
2. Primitives that cost few operations together are statements each [`as_statements`]; code for
   more leaves the processor's first cache, and takes long to build.
3. The others are tables and loops, and a tree [hierarchy.py] has those groups, from one of the first to the
   last, for which a walk is expected to cost less than their loops [`planted`].

What a target gains from is in targets.py [core/loops.py: Forms].
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from ...refimpl import vectors
from ...refimpl.light.intersection import Geometry
from ...refimpl.light.scene import Scene
from ...refimpl.light.shapes.shape import Group
from ..core.ir import Node, Program, Type
from ..core.loops import Forms, loops
from ..core.ops import OPS
from ..core.passes import pipeline
from ..core.trace import trace
from .hierarchy import Walked, walked

WEIGHTS: Mapping[str, float] = {"divide": 16.0, "sqrt": 16.0}
"""Operations that take longer, by their rounding (ops.py): on 16 floats at once a division takes 16 cycles
and a root 19 where two sums or products are begun in each."""

FREE = ("input", "constant", "row", "carried", "loop")
"""Nodes without an operation of a trip; a row is read along with its first use."""

RAY = {f"{name}_{axis}": Type() for name in ("origin", "direction") for axis in "xyz"}
"""Inputs of the program whose operations are counted."""

PASSES = ("scalarize", "fold_float32", "eliminate_dead")
"""What the program goes through before its operations are counted."""

SHARED = 0.9
"""Share of a list's operations that statements may have at most to be worth their code."""

BEGINNINGS = 3
"""Groups, from the first on, with which a tree may begin: boxes are the first, and those that share a
rotation are so cheap that a list of them is often the better."""

LEAST_ROWS = 16
"""Fewest rows of which a tree is planted to see what it would cost."""


def row_cost(group: Group) -> float:
    """Return the operations of a ray against one shape of a group."""
    program = _met([group], 0)
    # Numbers that all rows share are constants; a loop of one row is all outside of its body.
    (loop,) = loops(program)[0].values()
    return _weight(program.nodes[index] for index in loop.body) if len(group) > 1 else _weight(program.nodes)


def list_cost(geometry: Geometry) -> float:
    """Return the operations of a ray against all rows of all groups."""
    return sum(row_cost(group) * len(group) for group in geometry.groups)


def as_statements(geometry: Geometry, forms: Forms) -> bool:
    """Tell whether all primitives become statements: few, or some that share operations."""
    if forms.few is None:
        return True
    cost = list_cost(geometry)
    if cost <= forms.few or cost > forms.sharing:
        return cost <= forms.few
    return _weight(_met(geometry.groups, None).nodes) <= SHARED * cost


def _met(groups: Sequence[Group], most_unrolled: int | None) -> Program:
    """Return the program that finds the nearest distance of a ray to groups."""

    def nearer(values: Any, t: Any, _: Any) -> Any:
        return (np.minimum(values[0], t),)

    def met(*ray: Any) -> Any:
        values = (ray[0],)
        for group in groups:
            values = group.fold(vectors.vector(*ray[:3]), vectors.vector(*ray[3:]), nearer, values)
        return values[0]

    return pipeline.run(trace(met, RAY, most_unrolled=most_unrolled), PASSES)


def _weight(nodes: Iterable[Node]) -> float:
    """Return the weighed number of operations."""
    return sum(WEIGHTS.get(OPS[node.op].rounding, 1.0) for node in nodes if node.op not in FREE)


def planted(geometry: Geometry, scene: Scene) -> Geometry:
    """Return the geometry with those groups in a tree for which a walk costs least, if any."""
    costs = [row_cost(group) for group in geometry.groups]
    best, found = 0.0, geometry
    for begin in range(min(len(costs), BEGINNINGS)):
        members = range(begin, len(costs))
        rows = [len(geometry.groups[i]) for i in members]
        candidate = walked(geometry, scene, costs, members) if sum(rows) >= LEAST_ROWS else None
        if candidate is None:
            break
        saved = sum(costs[i] * count for i, count in zip(members, rows, strict=True)) - tree_cost(candidate)
        if saved > best:
            best, found = saved, candidate
    return found


def tree_cost(geometry: Geometry) -> float:
    """Return the operations that a ray's walk along the geometry's tree is expected to take, or 0."""
    trees = [group.tree for group in geometry.groups if isinstance(group, Walked) and group.tree]
    return sum(tree.cost for tree in trees)
