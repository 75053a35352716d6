"""Loops in a program: which nodes are a loop's body, by what they depend on.

A loop number l over the rows of constant tables is made of these kinds of nodes (ops.py):

1. `carried` {index, loop}: a number that goes from trip to trip; its operand is what it starts from.
2. `row` {loop, table}: the table's entry of the trip, the same in all lanes.
3. `loop` {index, loop, trips}: carried number `index` after all trips; its operands are all carried numbers,
   and then what each of them becomes in a trip.
4. A *walk* is a loop that may leave out rows, and has several parts with rows of different tables [`Walk`].
   Its `loop` nodes say for each part what the carried numbers become, then have a boolean, and name the
   tables of a tree, `first` and `skip`; `branch` {loop, table} is a table's entry of the tree's node.

The body is what depends on a carried number or a row [`bodies`]. What does not is computed once, before the
loop, wherever it was written: nothing has to be hoisted, and passes that copy node by node need not know of
loops. Those that execute or print a program walk through it and meet each loop at its first result
[`loops`]. Loops do not nest, and only a loop's results are read outside its body: the verifier checks both.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

from .ir import Node, Parameters, Program

FEW = 500.0
"""Most operations of a scene's primitives, weighed, that become statements each.

On PoCL, 6 of any kind are within a few percent of each other in both forms, and loops are level or faster
from 12 on, for spheres by a third, whose roots are calls that save all registers. The 27 boxes of
`minicubes` share slabs, and are a fifth faster as statements: of those it is SHARING
(`wamnet bench primitives --kinds shared,turned,spheres,quads --counts 6,12,24`)."""

SHARING = 1500.0
"""The same where statements share a tenth of their operations or more, as boxes on a grid share slabs."""


@dataclass(frozen=True)
class Forms:
    """The forms of a scene's primitives from which a target gains (compiler/scenes/hierarchy.py).

    `few`: most operations of all primitives together that become statements each, `sharing`: of those that
    statements share; None: any number. `trees`: whether walks along trees cost about what their operations
    do; else loops read all rows.
    """

    few: float | None = FEW
    sharing: float = SHARING
    trees: bool = False


USUAL = Forms()
"""The forms of a target that says nothing."""

STATEMENTS, LISTS, TREES = Forms(None), Forms(0.0, 0.0), Forms(0.0, 0.0, True)
"""For tests and measurements: statements for every scene, loops, and trees where they seem to pay."""


def bodies(program: Program) -> Sequence[frozenset[int]]:
    """Return, for each node, the loops in whose bodies it is: none or one in a verified program."""
    nowhere = frozenset[int]()
    inside: list[frozenset[int]] = []
    if not any(node.op in ("carried", "row", "branch") for node in program.nodes):
        return [nowhere] * len(program.nodes)
    for node in program.nodes:
        # Few nodes are in a loop, and a union of empty sets takes as long as any.
        found = nowhere.union(*(loops for arg in node.args if (loops := inside[arg])))
        if node.op in ("carried", "row", "branch"):
            found |= {loop_number(node)}
        inside.append(found - {loop_number(node)} if node.op == "loop" else found)
    return inside


def loop_number(node: Node) -> int:
    """Return the number of the loop to which a node belongs."""
    return int(node["loop"])  # type: ignore[arg-type]


def is_walk(node: Node) -> bool:
    """Tell whether a loop's result is that of a walk."""
    return node.get("skip") is not None


def groups_of(node: Node) -> list[tuple[int, ...]]:
    """Return a loop's carried numbers, and what they become in a trip of each part, as indices."""
    args = node.args[:-1] if is_walk(node) else node.args
    count = len(args) // (1 + int(node.get("parts") or 1))  # type: ignore[arg-type]
    return [args[i : i + count] for i in range(0, len(args), max(count, 1))]


@dataclass(frozen=True)
class Part:
    """What is done with a row: the nodes that are computed, in order, and what the carried numbers become."""

    body: tuple[int, ...]
    after: tuple[int, ...]


@dataclass(frozen=True)
class Walk:
    """How a loop walks along a tree, whose nodes are numbered depth first, and which rows it may leave out.

    At node i, where `enters` holds in any lane, the rows first[k, i] to first[k, i + 1] - 1 of each part k
    are read, and node i + 1 is the next; where it holds in none the next is skip[i], behind all nodes below
    i. A row of node i or below changes nothing in a lane in which `enters` does not hold: who builds the tree
    sees to it, and so no result depends on which lanes go together. `guard` are the nodes that `enters`
    needs, in order; `first` (parts, nodes + 1) is stored flat.
    """

    enters: int
    guard: tuple[int, ...]
    first: str
    skip: str
    parts: tuple[Part, ...]

    def rows(self, parameters: Parameters, enters: Callable[[int], Any]) -> Iterator[tuple[Part, int]]:
        """Yield the rows that are read, with their parts; enters(i) tells whether any lane enters node i."""
        skip = parameters[self.skip]
        first = parameters[self.first].reshape(len(self.parts), len(skip) + 1).tolist()
        node = 0
        while node < len(skip):
            if enters(node):
                for part, ends in zip(self.parts, first, strict=True):
                    yield from ((part, row) for row in range(ends[node], ends[node + 1]))
                node += 1
            else:
                node = int(skip[node])

    def all_rows(self, parameters: Parameters) -> Iterator[tuple[Part, int]]:
        """Yield all rows, part by part."""
        first = parameters[self.first].reshape(len(self.parts), -1)
        for part, ends in zip(self.parts, first, strict=True):
            yield from ((part, row) for row in range(ends[-1]))


@dataclass(frozen=True)
class Loop:
    """A loop as a walk through the nodes meets it: at the first of its results."""

    number: int
    trips: int
    carried: tuple[int, ...]
    after: tuple[int, ...]
    body: tuple[int, ...]
    walk: Walk | None = None

    def rows(
        self, parameters: Parameters, enters: Callable[[Walk, int], bool] | None = None
    ) -> Iterator[tuple[Part, int]]:
        """Yield what is done in the trips, and with which row; of a walk without `enters` all rows."""
        if self.walk is None:
            return ((Part(self.body, self.after), trip) for trip in range(self.trips))
        if enters is None:
            return self.walk.all_rows(parameters)
        return self.walk.rows(parameters, partial(enters, self.walk))


def loops(program: Program) -> tuple[dict[int, Loop], frozenset[int]]:
    """Return the loops by the index of their first results, and the indices of all nodes in bodies.

    Carried numbers, which are there before the first trip, are in no body.
    """
    inside = bodies(program)
    kept = [i for i, node in enumerate(program.nodes) if inside[i] and node.op != "carried"]
    found: dict[int, Loop] = {}
    for index, node in enumerate(program.nodes):
        if node.op == "loop" and loop_number(node) not in {loop.number for loop in found.values()}:
            number = loop_number(node)
            body = tuple(i for i in kept if number in inside[i] and i < index)
            walk = _walk(program, node, body) if is_walk(node) else None
            carried, after, *_ = groups_of(node)
            found[index] = Loop(number, int(node["trips"]), carried, after, body, walk)  # type: ignore[arg-type]
    return found, frozenset(kept)


def _walk(program: Program, node: Node, body: Sequence[int]) -> Walk:
    """Return the walk of which a node is a result."""
    enters, groups = node.args[-1], groups_of(node)
    parts = tuple(Part(_needed(program, body, after), after) for after in groups[1:])
    return Walk(enters, _needed(program, body, (enters,)), str(node["first"]), str(node["skip"]), parts)


def _needed(program: Program, body: Sequence[int], wanted: Sequence[int]) -> tuple[int, ...]:
    """Return those nodes of a body that some values are or depend on, in order."""
    needed = set(wanted)
    for index in reversed(body):
        if index in needed:
            needed.update(program.nodes[index].args)
    return tuple(index for index in body if index in needed)


def last_reads(program: Program, ends: Mapping[int, Loop]) -> list[list[int]]:
    """Return, for each node, the values that are not read after it: their arrays can be forgotten.

    `ends` is what [`loops`] returns: a loop's body reads, in all trips, where the loop is met.
    """
    reads = list(range(len(program.nodes)))
    for end, loop in ends.items():
        for index in loop.body:
            reads[index] = end
    last = reads.copy()
    for index, node in enumerate(program.nodes):
        for arg in node.args:
            last[arg] = max(last[arg], reads[index])
    forgotten: list[list[int]] = [[] for _ in last]
    for index in set(range(len(last))).difference(index for _, index in program.outputs):
        forgotten[last[index]].append(index)
    return forgotten
