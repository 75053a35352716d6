"""In which form a scene's primitives become code: statements, tables with a loop, or tables with a tree.

1. What a ray pays for one row of a group is the operations of a trip, traced from the reference and weighed
   [`row_cost`]: a turned box costs six boxes that share a rotation.
2. Primitives that cost few operations together are statements each [`as_statements`]; code for
   more leaves the processor's first cache, and takes long to build.
3. The others are tables and loops, and a tree has those groups, from one of the first to the last, for which
   a walk is expected to cost less than their loops [`planted`]. What a target gains from is in targets.py
   [core/loops.py: Forms].

The tree is a bounding hierarchy: tables, and a walk with the bits of the list.

1. Boxes that hold the primitives, widened by what rounding can do [`holding`], are split by the surface area
   heuristic down to single primitives, and joined again where that costs less [`plant`]. The tree is a table
   of boxes, depth first, with the rows of each leaf and the node that follows where a box is missed [`Tree`].
2. A ray, or some rays together, walk along the tree and read the rows of the boxes that they enter, nearer
   than what they have met so far [`walk`]. Rows of several kinds of primitives are parts of one tree.
3. Of primitives at the same distance the list takes the first; the walk meets them in another order and
   takes the one with the least id [`Walked`]. A shadow ray that has met anything enters nothing more.

Surface area heuristic: MacDonald and Booth, "Heuristics for Ray Tracing Using Space Subdivision", 1990. Skip
links: Smits, "Efficiency Issues for Ray Tracing", 1998. Chances are those of several rays at once, of which
any makes all of them enter: 1 - (1 - p)^n [`TOGETHER`].
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...refimpl import vectors
from ...refimpl.light.intersection import Geometry
from ...refimpl.light.scene import WALLS, Scene
from ...refimpl.light.shapes import kinds
from ...refimpl.light.shapes.box import slabs
from ...refimpl.light.shapes.shape import MISS, Extent, Group, Met, Take, Values, inverse
from ...refimpl.vectors import Directions, Floats, Normals, Points
from ..core.ir import Node, Program, Type
from ..core.loops import Forms, Part, Walk, loops
from ..core.ops import OPS
from ..core.passes import pipeline
from ..core.trace import Traced, trace, walk_rows

Array = NDArray[Any]

WIDENING = 64 * 2.0**-24
"""How far a box reaches beyond what it holds, relative to the scene's largest coordinate M, times the spread
of a shape (shape.py: Extent). With u = 2^-24 and coordinates up to M, distances are below 4 M (the diagonal
of a cube of side 2 M is 3.5 M).

A hit at the computed distance t is the point o + t d. Each formula is sums and products of such coordinates,
whose rounding moves that point off the shape by a few u times 4 M: a box turns a ray (sums of three
products, 3 u of M a coordinate) and tests slabs (3 u of 4 M); a quad's plane is met up to 3 u of 4 M off it,
and its edges are found as far off divided by the sine between them, the spread; a sphere's quadratic has a
residual of a few u times its terms, f.f - r.r and the root times the half chord, which moves a point by as
many u of |f| + r. So 24 u M and less.

The test of a node's box computes (c - o) / d -+ h / |d| with four roundings (of the difference, the
reciprocal, the product, the sum): as for an exact ray and slabs that are moved by 4 u (|c - o| + h), up to
16 u M; Ize, "Robust BVH Ray Traversal", 2013, has the same argument for distances. A component of d that is
raised to 1e-15 moves a point by far less than u M. Together 40 u M; 64 leaves a margin."""

TOGETHER = 16
"""Rays of which the builder thinks as a group, as many as PoCL's vectors hold: a node that some of them are
likely to enter is not worth its test. With trees for single rays 300 spheres take 1.2 times as long."""

VISIT = 60.0
"""Cost of a visit to a node, in operations: 23 of its test, and what mispredicted branches take."""


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


@dataclass(frozen=True)
class Tree:
    """n nodes, depth first: boxes by centres and halves (n, 3) in float32, skip (n,), first (parts, n + 1).

    Leaf i has the rows first[k, i] to first[k, i + 1] - 1 of part k, in its `orders`. `cost` is what a walk
    is expected to cost, in operations.
    """

    centers: Array
    halves: Array
    skip: Array
    first: Array
    orders: tuple[Array, ...]
    cost: float

    def walk(self) -> Walk:
        """Return the order of nodes and rows as a loop has it; parts are named by their numbers."""
        parts = tuple(Part((number,), ()) for number in range(len(self.first)))
        return Walk(0, (), "first", "skip", parts)


# ---- building ---------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Node:
    """A subtree: its box, the chance that rays enter it, members of a leaf, else what is below; its cost."""

    low: Array
    high: Array
    chance: float
    members: Array
    below: tuple[_Node, ...]
    cost: float


def plant(low: Array, high: Array, costs: Array, parts: Sequence[int]) -> Tree:
    """Return the tree of N boxes (N, 3), which cost (N,) operations when they are met.

    `parts` are the numbers of rows of each part, which follow one another.
    """
    whole = _area(low.min(axis=0), high.max(axis=0))

    def chance(node_low: Array, node_high: Array) -> float:
        share = min(float(_area(node_low, node_high) / whole), 1.0)
        return float(1.0 - (1.0 - share) ** TOGETHER)

    def grow(members: Array) -> _Node:
        box = low[members].min(axis=0), high[members].max(axis=0)
        here = chance(*box)
        leaf = _Node(*box, here, members, (), float(costs[members].sum()) * here)
        if len(members) == 1:
            return leaf
        below = tuple(grow(half) for half in _halves(low, high, members))
        cost = sum(VISIT * here + node.cost for node in below)
        return leaf if leaf.cost <= cost else _Node(*box, here, members[:0], below, cost)

    roots = _paying((grow(np.arange(len(low))),), 1.0)
    return _laid(list(_depth_first(roots)), parts, _expected(roots, 1.0))


def _area(low: Array, high: Array) -> Array:
    """Return half the surface (...) of boxes (..., 3)."""
    x, y, z = np.moveaxis(high - low, -1, 0)
    area: Array = x * y + y * z + z * x
    return area


def _halves(low: Array, high: Array, members: Array) -> tuple[Array, Array]:
    """Return the two halves that the surface area heuristic finds, along any axis."""
    best, found = np.inf, (members[:1], members[1:])
    counts = np.arange(1, len(members))
    for axis in range(3):
        rows = members[np.argsort((low[members] + high[members])[:, axis], kind="stable")]
        # Of the boxes around the first 1, 2, ... N - 1 of N, from either end.
        left, right = (
            _area(np.minimum.accumulate(low[order]), np.maximum.accumulate(high[order]))[:-1]
            for order in (rows, rows[::-1])
        )
        costs = left * counts + (right * counts)[::-1]
        at = int(np.argmin(costs))
        if costs[at] < best:
            best, found = costs[at], (rows[: at + 1], rows[at + 1 :])
    return found


def _paying(nodes: tuple[_Node, ...], above: float) -> tuple[_Node, ...]:
    """Return nodes, those below instead of one whose test costs more than it saves.

    Its test is made where what is above is entered; it saves the tests below where it is missed.
    """
    kept: list[_Node] = []
    for node in nodes:
        below = _paying(node.below, node.chance)
        if below and len(below) * (above - node.chance) < above:
            kept += below
        else:
            kept.append(replace(node, below=below))
    return tuple(kept)


def _expected(nodes: tuple[_Node, ...], above: float) -> float:
    """Return the expected cost of nodes that are visited with the chance `above`."""
    return sum(
        VISIT * above + (_expected(node.below, node.chance) if node.below else node.cost) for node in nodes
    )


def _depth_first(nodes: tuple[_Node, ...]) -> Iterator[tuple[_Node, int]]:
    """Yield nodes, each before those below it, with their numbers."""
    for node in nodes:
        below = list(_depth_first(node.below))
        yield node, 1 + len(below)
        yield from below


def _laid(nodes: list[tuple[_Node, int]], parts: Sequence[int], cost: float) -> Tree:
    """Return the tables of nodes, each with the number of nodes that it is with those below it."""
    low, high = (np.array([getattr(node, end) for node, _ in nodes]) for end in ("low", "high"))
    centers = (0.5 * (low + high)).astype(np.float32)
    halves = np.maximum(high - centers, centers - low).astype(np.float32)
    ends = np.cumsum([0, *parts])
    orders, first = [], []
    for start, end in pairwise(ends):
        members = [np.sort(n.members[(n.members >= start) & (n.members < end)]) - start for n, _ in nodes]
        first.append(np.cumsum([0, *map(len, members)]))
        orders.append(np.concatenate(members))
    return Tree(
        centers,
        np.nextafter(halves, np.float32(np.inf)),
        np.array([i + count for i, (_, count) in enumerate(nodes)], np.int32),
        np.array(first, np.int32),
        tuple(orders),
        cost,
    )


def holding(scene: Scene) -> tuple[Array, Array] | None:
    """Return the corners (N, 3) of boxes that hold each primitive's hits; None where a kind has none."""
    found = [part.extent for kind in kinds() for part in kind.parts(scene)]
    extents: list[Extent] = [extent for extent in found if extent is not None]
    if not found or len(extents) < len(found):
        return None
    low, high = (np.array([extent[end] for extent in extents]) for end in (0, 1))
    room = () if scene.room is None else (scene.room.low, scene.room.high)
    size = np.abs(np.concatenate([low, high, [scene.camera.position], *([corner] for corner in room)])).max()
    slack = WIDENING * size * np.array([[extent.spread] for extent in extents])
    return low - slack, high + slack


# ---- walking ----------------------------------------------------------------------------------------------


def walk(
    parts: Sequence[tuple[Callable[..., Any], Sequence[Array]]],
    start: tuple[Any, ...],
    enters: Callable[..., Any],
    tree: Tree,
) -> Any:
    """Return what `start`, values (...), becomes by values = step(values, *row) where any lane enters.

    parts: (step, tables) of each part; enters(values, center, half) (...). Traced values become a loop.
    """
    rows = [
        (step, [table[order] for table in tables])
        for (step, tables), order in zip(parts, tree.orders, strict=True)
    ]
    boxes = (tree.centers, tree.halves)
    if any(isinstance(value, Traced) for value in start):
        return walk_rows(rows, start, enters, boxes, tree.first, tree.skip)
    values = start
    met = tree.walk().rows(
        {"first": tree.first, "skip": tree.skip},
        lambda node: np.any(enters(values, *(table[node] for table in boxes))),
    )
    for part, row in met:
        step, tables = rows[part.body[0]]
        values = step(values, *(table[row] for table in tables))
    return values


@dataclass(frozen=True)
class _Recorder:
    """A value that is folded over rows by writing down how, for a walk."""

    parts: list[Any]

    def __fold_rows__(self, step: Any, tables: Any, start: Any) -> Any:
        self.parts.append((step, tables))
        return start


@dataclass(frozen=True)
class Walked(Group):
    """A group whose rows are in a tree with those of `members`; the first of them has the tree."""

    group: Group
    members: tuple[Group, ...]
    tree: Tree | None

    @property
    def first_id(self) -> int:  # type: ignore[override]
        """The first of the group's surface ids."""
        return self.group.first_id

    def __len__(self) -> int:
        """Return the number of shapes."""
        return len(self.group)

    @property
    def fronts(self) -> Any:
        """The normals of shapes that have a front."""
        return self.group.fronts

    def normal(self, met: Met) -> Normals:
        """Return the group's normals (..., 3)."""
        return self.group.normal(met)

    def fold(
        self, origin: Points, direction: Directions, take: Take, values: Values, reach: Floats | None = None
    ) -> Values:
        """Return the values after take(values, distance, id) of the nearest shape of all members.

        values[0] is the least distance so far. Of a shadow ray, which has a reach, any shape that is
        nearer is as good, and has a distance below all of them.
        """
        if self.tree is None:
            return values
        reciprocal = inverse(direction)

        def enters(values: Any, center: Any, half: Any) -> Any:
            enter, leave = slabs(center, half, origin, reciprocal)
            return np.maximum(vectors.largest(enter), 0.0) <= np.minimum(vectors.smallest(leave), values[0])

        def parts(step: Take) -> list[Any]:
            found: list[Any] = []
            for member in self.members:
                member.fold(origin, direction, step, (_Recorder(found),))
            return found

        if reach is not None:
            (t,) = walk(parts(_any), (reach,), enters, self.tree)
            # Not the reach where nothing was met: no range can tell that it is not below itself.
            shadowed: Values = take(values, np.where(t < 0.0, t, np.full_like(t, MISS)), np.int32(0))
            return shadowed
        nothing = np.full_like(values[0], -1, dtype=np.int32)
        t, surface = walk(parts(_nearest), (values[0], nothing), enters, self.tree)
        nearest: Values = take(values, t, surface)
        return nearest


def _nearest(values: Any, t_new: Any, surface_new: Any) -> Any:
    """Keep the nearest, of equals the one with the least id; what was met before the walk has the id -1."""
    t, surface = values
    closer = (t_new < t) | ((t_new == t) & (surface_new < surface))
    return np.minimum(t, t_new), np.where(closer, surface_new, surface)


def _any(values: Any, t_new: Any, _: Any) -> Any:
    """Keep that something is nearer than the reach: as a distance below all others."""
    return (np.where(t_new < values[0], np.full_like(values[0], -MISS), values[0]),)


def walked(geometry: Geometry, scene: Scene, costs: Sequence[float], members: range) -> Geometry | None:
    """Return the geometry with the groups of these places in a tree; None where they have no bounds.

    `costs` are the operations that a row of each group takes. Groups of a tree follow one another, so that
    what has equal distances is found in the order of ids.
    """
    boxes = holding(scene)
    if boxes is None:
        return None
    inside = geometry.groups[members.start : members.stop]
    start = inside[0].first_id - (len(WALLS) if scene.room is not None else 0)
    sizes = [len(group) for group in inside]
    low, high = (ends[start : start + sum(sizes)] for ends in boxes)
    rows = np.repeat([costs[i] for i in members], sizes)
    tree = plant(low, high, rows, sizes)
    groups = list(geometry.groups)
    for place, group in zip(members, inside, strict=True):
        groups[place] = Walked(group, inside, tree if place == members.start else None)
    return replace(geometry, groups=tuple(groups))


# ---- which form -------------------------------------------------------------------------------------------


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
