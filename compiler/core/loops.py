"""Loops in a program: which nodes are a loop's body, by what they depend on.

A loop number l over the rows of constant tables is made of three kinds of nodes (ops.py):

1. `carried` {index, loop}: a number that goes from trip to trip; its operand is what it starts from.
2. `row` {loop, table}: the table's entry of the trip, the same in all lanes.
3. `loop` {index, loop, trips}: carried number `index` after all trips; its operands are all carried numbers,
   and then what each of them becomes in a trip.

The body is what depends on a carried number or a row [`bodies`]. What does not is computed once, before the
loop, wherever it was written: nothing has to be hoisted, and passes that copy node by node need not know of
loops. Those that execute or print a program walk through it and meet each loop at its first result
[`loops`]. Loops do not nest, and only a loop's results are read outside its body: the verifier checks both.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from .ir import Node, Program

MOST_UNROLLED = 32
"""Most primitives of a scene that become statements each, unless a target has another number (targets.py).

On PoCL, at 10 statements are up to a tenth faster; at 30 they are level for boxes that share a rotation and
for quads, and a third slower for mixtures; at 100 they are 1.3 to 1.8 times slower, their code having left
the processor's first cache, and take 2 to 6 s to trace and build instead of 0.5. 32 keeps the 29 of
`minicubes` statements (`wamnet bench primitives`)."""


def bodies(program: Program) -> Sequence[frozenset[int]]:
    """Return, for each node, the loops in whose bodies it is: none or one in a verified program."""
    inside: list[frozenset[int]] = []
    for node in program.nodes:
        found = frozenset[int]().union(*(inside[arg] for arg in node.args))
        if node.op in ("carried", "row"):
            found |= {loop_number(node)}
        inside.append(found - {loop_number(node)} if node.op == "loop" else found)
    return inside


def loop_number(node: Node) -> int:
    """Return the number of the loop to which a node belongs."""
    return int(node["loop"])  # type: ignore[arg-type]


def split(node: Node) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """Return a loop's carried numbers, and what they become in a trip, as indices."""
    half = len(node.args) // 2
    return node.args[:half], node.args[half:]


@dataclass(frozen=True)
class Loop:
    """A loop as a walk through the nodes meets it: at the first of its results."""

    number: int
    trips: int
    carried: tuple[int, ...]
    after: tuple[int, ...]
    body: tuple[int, ...]


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
            found[index] = Loop(number, int(node["trips"]), *split(node), body)  # type: ignore[arg-type]
    return found, frozenset(kept)


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
