"""Replace the target's sine and cosine with the emitted ones (sine.py), by tracing these.

An exact program gets the sine in which no number is denormal.
"""

from __future__ import annotations

from ..ir import Builder, Node, Program
from ..sine import DEGREE, cosine, exact_sine, sine
from ..trace import Traced
from .rewrite import rewrite


def expand_sine(program: Program, degree: int = DEGREE) -> Program:
    """Return the program without `sin` and `cos`; polynomials of this degree do their work."""

    def rule(builder: Builder, node: Node, args: tuple[int, ...]) -> int | None:
        if program.exact and node.op == "sin":
            return int(exact_sine(Traced(builder, args[0])).index)
        emitted = {"sin": sine, "cos": cosine}.get(node.op)
        return int(emitted(Traced(builder, args[0]), degree).index) if emitted else None

    return rewrite(program, rule)
