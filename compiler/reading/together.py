"""Loops whose turns have nothing to do with each other: all turns are run at once, as one vector.

    for (int i = 0; i < n; ++i) { float a = f(x[i]); y[i] = a; }

1. Statements declare a number, or write element i of an array; of i they have nothing else than elements i of
   arrays, and of functions those that treat a vector number by number [`read_loop`].
2. Two names of arrays are of two memories, or of the same elements [`Loop.apart`]: no turn reads what another
   one writes. Other names are of one number each, which no turn changes.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from .field import Number, wide
from .memory import Memory, Pointer
from .syntax import Tree

if TYPE_CHECKING:
    from .machine import Machine

ELEMENTWISE = {
    "min", "fmin", "fminf", "max", "fmax", "fmaxf", "floor", "floorf", "fabs", "fabsf", "clamp",
    *(f"as_{kind}{n}" for kind in ("int", "float") for n in ("", 4, 8, 16)),
}  # fmt: skip
"""Functions that treat a vector number by number."""


@dataclass
class Loop:
    """A loop over `variable`: what it declares, the names from outside, arrays, and widths of its types."""

    variable: str
    turns: Tree
    statements: list[Tree]
    inside: set[str] = field(default_factory=set)
    outside: set[str] = field(default_factory=set)
    arrays: list[Tree] = field(default_factory=list)
    widths: set[int] = field(default_factory=set)

    def takes(self, statement: Tree) -> bool:
        """Return whether a statement may run for all turns at once."""
        if statement[0] == "declare":
            variable, tree = statement[1:]
            array = variable.sizes or variable.shared or variable.type.pointer
            known = variable.name in self.inside | {self.variable}
            if array or known or tree is None or not self.reads(tree):
                return False
            self.inside.add(variable.name)
            self.widths.add(variable.type.width)
            return True
        written = statement[0] == "do" and statement[1][:2] == ("assign", "") and statement[1][2][0] == "at"
        return written and all(self.reads(tree) for tree in statement[1][2:])

    def reads(self, tree: Tree) -> bool:
        """Return whether an expression has in each turn what is that turn's."""
        form, *given = tree
        if form == "at":
            self.arrays.append(given[0])
            return given[1] == ("name", self.variable) and name_of(given[0]) not in self.inside | {""}
        if form == "name":
            self.outside |= {given[0]} - self.inside
            return bool(given[0] != self.variable)
        if form == "cast":
            self.widths.add(given[0].width)
            return not given[0].pointer and self.reads(given[1])
        if form == "call":
            return name_of(given[0]) in ELEMENTWISE and all(map(self.reads, given[1]))
        if form in ("binary", "choice") or (form == "unary" and given[0] in "-+!"):
            return all(map(self.reads, given if form == "choice" else given[1:]))
        return bool(form == "number")

    def apart(self, machine: Machine) -> int:
        """Return how many turns it has, if they have nothing to do with each other; else 0."""
        turns = machine.value(self.turns)
        held = [machine.forms[tree[0]](*tree[1:]) for tree in self.arrays]
        places: dict[int, tuple[Any, int]] = {}
        for one in held:
            array = isinstance(one, Pointer) and isinstance(one.memory, Memory) and len(one.sizes) == 1
            if not array or type(turns) is not int or not 1 < turns <= (one.sizes[0] or 0):
                return 0
            place = one.offset, one.width
            if type(one.offset) is not int or places.setdefault(id(one.memory), place) != place:
                return 0
        values = [machine.value(("name", name)) for name in self.outside]
        single = all(isinstance(one, (int, Number)) and wide(one) == 1 for one in values)
        return turns if single and len({width for _, width in places.values()} | self.widths) == 1 else 0


def name_of(tree: Tree) -> str:
    """Return the name of a variable, or of what one is a member of; nothing for other expressions."""
    if tree[0] == "of":
        tree = tree[1]
    return str(tree[1]) if tree[0] == "name" else ""


def read_loop(start: Tree, condition: Tree, step: Tree, body: Tree) -> Loop | None:
    """Return a loop of statements that may run for all turns at once; None for any other."""
    if start[0] != "declare" or start[2] != ("number", "0") or body[0] != "block":
        return None
    i = ("name", start[1].name)
    if condition[:3] != ("binary", "<", i) or step != ("step", "++", i):
        return None
    loop = Loop(start[1].name, condition[3], body[1])
    own = loop.reads(condition[3]) and all(map(loop.takes, body[1]))
    shown = loop.inside & {name_of(tree) for tree in loop.arrays}
    return loop if own and loop.arrays and not shown else None
