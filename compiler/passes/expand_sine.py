"""Put the emitted sine (sine.py) in the place of every sine, by tracing it like any other function."""

from __future__ import annotations

from ..ir import Builder, Node, Program
from ..sine import sine
from ..trace import Traced
from .rewrite import rewrite


def expand_sine(program: Program) -> Program:
    """Return the program without `sin`."""

    def rule(builder: Builder, node: Node, args: tuple[int, ...]) -> int | None:
        return int(sine(Traced(builder, args[0])).index) if node.op == "sin" else None

    return rewrite(program, rule)
