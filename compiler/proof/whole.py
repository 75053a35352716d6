"""Programs in which no operation rounds, which the checker of their certificates tells [integer_checker.py].

The interpreter, every kernel and every schedule that only reorders sums compute the same numbers, whatever a
compiler does with floats: fuses, reorders, flushes, rounds in another mode. They have the same bits where no
output is a zero that may have either sign [`has_one_zero`].
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..core import ir
from ..core.ir import Program

if TYPE_CHECKING:
    from .integer_checker import Range


class Rounds(Exception):
    """A sentence that says which operation of a program may round, or leave its kind of number."""


def ranges(program: Program) -> tuple[list[Range], dict[str, list[float]]]:
    """Return what the checker knows of each value, and the sums of magnitudes, or raise [`Rounds`]."""
    if program.gather is None or not program.gather.whole:
        raise Rounds("the images do not hold integers")
    from . import integer_checker
    from .evidence import Refused

    arrays = {name: array.astype(np.float64) for name, array in program.parameters.items()}
    try:
        return integer_checker.ranges(ir.text(program), arrays)
    except Refused as error:
        raise Rounds(str(error)) from error


def known(program: Program) -> list[tuple[Any, Any, int]]:
    """Return the least and the largest of each value's numbers, integer multiples of 2**grain, and grain."""
    units = [(np.array([low, high], np.float64), grain) for low, high, grain in ranges(program)[0]]
    return [(*(ends * 2.0**grain), grain) for ends, grain in units]


def has_one_zero(program: Program) -> bool:
    """Return whether the outputs of a program in which nothing rounds are the same to the bit, zeros too.

    A product of floats has one zero where neither factor is below 0; a sum has two, as x - x shows.
    """
    found, two = known(program), list[bool]()
    for node in program.nodes:
        args, floats = [two[arg] for arg in node.args], node.type.dtype == "float32"
        positive = not any(args) and all(found[arg][0].min() >= 0 for arg in node.args)
        if node.op in ("input", "affine"):
            two.append(True)
        elif node.op in ("minimum", "maximum", "convert"):
            two.append(any(args))
        else:
            several = node.op in ("add", "subtract") or (node.op == "multiply" and not positive)
            two.append(floats and several)
    return not any(two[index] for _, index in program.outputs)


def holds(program: Program) -> bool:
    """Return whether no operation of a program rounds: then all devices compute the same bits."""
    try:
        ranges(program)
    except Rounds:
        return False
    return True
