"""Replace the target's sine and cosine with the emitted ones (sine.py), by tracing these."""

from __future__ import annotations

from ..ir import Builder, Node, Program
from ..sine import DEGREE, cosine, sine
from ..trace import Traced
from .rewrite import rewrite


def expand_sine(program: Program, degree: int = DEGREE) -> Program:
    """Return the program without `sin` and `cos`; polynomials of this degree do their work."""

    def rule(builder: Builder, node: Node, args: tuple[int, ...]) -> int | None:
        emitted = {"sin": sine, "cos": cosine}.get(node.op)
        return int(emitted(Traced(builder, args[0]), degree).index) if emitted else None

    return rewrite(program, rule)
