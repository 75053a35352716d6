"""A kernel's lines beside the lines of the reference that they came from.

1. A program that was traced with `keep_places` knows for each node the lines of the reference that made it
   [`ir.Node.places`]; passes copy them to what they put in a node's place.
2. A kernel of the plain schedule names the nodes in its text: `t12 = ` and `v12` belong to node 12, and so
   does what follows the comment `%12: ...` [emit.py]; a path kernel has a block for each of its programs,
   with the comment `arrive: ...` at its head [emit_path.py].
3. [`lines_of`] reads that, and gives each line of the kernel its node's places. What no node made (the
   loops over pixels, windows and samples) has none: that is the skeleton.
4. [`as_text`] prints the kernel in the order of its text, under each line of the reference what it became.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby

from .ir import Program

STATEMENT = re.compile(r"\bt(\d+) = ")
"""A statement that computes a node."""

READ = re.compile(r"\bt(\d+)\b")
"""A statement that hands on a node's value."""

GROUP = re.compile(r"/\* %(\d+)(?: to %\d+)?: ")
"""A comment that opens the statements of a node, or of several that share a loop."""

PART = re.compile(r"/\* (\w+): ")
"""A comment that opens the block of a program."""

SKELETON = "the kernel's own: loops, addresses, declarations"
"""What a listing says of lines that come from no line of the reference."""


@dataclass(frozen=True)
class Line:
    """A line of a kernel, the program that it belongs to, and the lines of the reference, callers first."""

    text: str
    part: str = ""
    places: tuple[str, ...] = ()


def lines_of(source: str, programs: Mapping[str, Program]) -> list[Line]:
    """Return the lines of a kernel from the programs that it was emitted from, by the name of their block.

    The program of a kernel without blocks has the name "".
    """
    found, part, group = [], "", -1
    for text in source.splitlines():
        if (opened := PART.search(text)) and opened[1] in programs:
            part, group = opened[1], -1
        elif opened := GROUP.search(text):
            group = int(opened[1])
        elif text.lstrip().startswith("/*"):
            group, part = -1, part if "" in programs else ""
        statement = STATEMENT.search(text) or READ.search(text)
        index = int(statement[1]) if statement else group
        nodes = programs[part].nodes if part in programs else ()
        places = nodes[index].places if 0 <= index < len(nodes) and text.strip() else ()
        found.append(Line(text, part, places))
    return found


def within(place: str, path: str, first: int, last: int) -> bool:
    """Tell whether a place is on one of the lines `first` to `last` of a file."""
    file, _, line = place.rpartition(":")
    return file == path and first <= int(line) <= last


def as_text(lines: Sequence[Line], read: Callable[[str], str]) -> str:
    """Return a listing as text; `read` gives the text of a place.

    A line of the reference has its place before it, and what it became is indented below it.
    """
    shown = []
    for place, group in groupby(lines, lambda line: line.places[-1] if line.places else ""):
        shown.append(f"{place}: {read(place).strip()}" if place else SKELETON)
        shown += [f"    | {line.text}".rstrip() for line in group]
    return "\n".join(shown) + "\n"
