"""Put the emitted sine and cosine (sine.py) in the place of the target's, by tracing them.

An exact program gets the sine in which no number is denormal.
"""

from __future__ import annotations

from ..ir import Builder, Node, Program
from ..sine import cosine, exact_sine, sine
from ..trace import Traced
from .rewrite import rewrite


def expand_sine(program: Program) -> Program:
    """Return the program without `sin` and `cos`."""

    def rule(builder: Builder, node: Node, args: tuple[int, ...]) -> int | None:
        emitted = {"sin": exact_sine if program.exact else sine, "cos": cosine}.get(node.op)
        return int(emitted(Traced(builder, args[0])).index) if emitted else None

    return rewrite(program, rule)
