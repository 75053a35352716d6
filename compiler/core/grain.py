"""No number of an exact program is denormal: a proof for each program, one rule an operation [`RULES`].

Targets keep numbers below 2**-126 or flush them to zero, as they like (PoCL and C keep them, Mesa flushes
them), so a program that is to have the same bits on all must never hold one. Two things are known of a value
[`Size`]: all that is not 0 in it is at least 2**least, and is a whole multiple of 2**grain.

1. A float32 that is at least 2**e is a multiple of 2**(e - 23), its last digit's place; a multiple of 2**g
   that is not 0 is at least 2**g.
2. A product of numbers of at least 2**a and 2**b is at least 2**(a + b), before and after rounding. It is a
   multiple of the product of both grains; rounding keeps that: it drops digits, or nothing is to be dropped.
3. A sum of multiples of 2**g is one, rounded or not, whatever cancels. So no sum is denormal if its terms are
   multiples of 2**-126: that is what bounds sums of hundreds of terms at no cost [`_affine`].
4. What an exact program reads, images and weights, is 0 or at least LEAST, as its sines are 0 or at least
   half of that (sine.py): products are at least 2**-81, sums multiples of 2**-104.

Operations that are not here are rounded differently by different targets, or not proven: refused.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from ...refimpl.errors import CompileError
from .ir import LEAST, Node, Program

NORMAL = -126
"""Exponent of the smallest float32 that no target flushes."""

DIGITS = 23
"""Binary digits of a float32 behind its first one."""

SINE_ARGUMENT = -124
"""Exponent of the smallest argument of a sine, other than 0, for which its proof holds (sine.py)."""


@dataclass(frozen=True)
class Size:
    """Numbers that are 0, or at least 2**least and multiples of 2**grain; infinite where all are 0."""

    least: float
    grain: float

    @classmethod
    def of(cls, values: object) -> Size:
        """Return the size of float32 numbers (...)."""
        magnitudes = np.abs(np.asarray(values, np.float32).astype(np.float64).ravel())
        magnitudes = magnitudes[magnitudes > 0]
        if not magnitudes.size:
            return cls(math.inf, math.inf)
        least = math.frexp(float(magnitudes.min()))[1] - 1
        if magnitudes.size > 1:
            return cls(least, least - DIGITS)
        exact = Fraction(float(magnitudes[0]))
        twos = (exact.numerator & -exact.numerator).bit_length() - 1
        return cls(least, twos - (exact.denominator.bit_length() - 1))


@dataclass(frozen=True)
class Context:
    """What a rule may look at beside its operands."""

    program: Program
    index: int

    @property
    def node(self) -> Node:
        """Return the node that the rule is asked about."""
        return self.program.nodes[self.index]

    def held(self, size: Size, what: str) -> Size:
        """Return the size of a result, or refuse one that may be denormal."""
        if size.least >= NORMAL:
            return size
        raise CompileError(
            f"{self.node.op} (%{self.index}) may have {what} as small as 2^{size.least:g}, which targets "
            f"flush to zero or not: profile exact needs 2^{NORMAL} at least; use larger factors, or profile "
            "ieee"
        )


Rule = Callable[[Context, list[Size]], Size]

READ = Size(math.log2(LEAST), math.log2(LEAST) - DIGITS)
"""Numbers of images, and weights."""

SINE = Size(READ.least - 1, READ.least - 1 - DIGITS)
"""What exact_sine gives."""


def _either(context: Context, operands: list[Size]) -> Size:
    """One of the operands, or both side by side."""
    return Size(min(o.least for o in operands), min(o.grain for o in operands))


def _chosen(context: Context, operands: list[Size]) -> Size:
    """One of the operands behind the condition."""
    return _either(context, operands[1:])


def _product(a: Size, b: Size) -> Size:
    """Step 2."""
    least = a.least + b.least
    return Size(least, max(a.grain + b.grain, least - DIGITS))


def _multiply(context: Context, operands: list[Size]) -> Size:
    """Step 2."""
    return context.held(_product(*operands), "products")


def _add(context: Context, operands: list[Size]) -> Size:
    """Step 3."""
    grain = min(o.grain for o in operands)
    return context.held(Size(grain, grain), "sums")


def _affine(context: Context, operands: list[Size]) -> Size:
    """Products by step 2, their sum with the bias by step 3."""
    parameters, node = context.program.parameters, context.node
    terms = [_product(operands[0], Size.of(parameters[str(node["weight"])]))]
    context.held(terms[0], "products")
    if node.get("bias") is not None:
        terms.append(Size.of(parameters[str(node["bias"])]))
    return _add(context, terms)


def _sin(context: Context, operands: list[Size]) -> Size:
    """The emitted sine's, whose proof needs arguments that are not too small."""
    if operands[0].least < SINE_ARGUMENT:
        context.held(Size(operands[0].least - 2, operands[0].grain), "quotients of an argument and pi")
    return SINE


TRUTH = ("less", "less_equal", "greater", "greater_equal", "equal", "not_equal")
"""Decisions: no numbers come out."""

LOGIC = ("logical_and", "logical_or", "logical_not")
"""Decisions from decisions."""

RULES: Mapping[str, Rule] = {
    "input": lambda context, operands: READ,
    "constant": lambda context, operands: context.held(Size.of(context.node["value"]), "a value"),
    "parameter": lambda context, operands: Size.of(context.program.parameters[str(context.node["name"])]),
    "affine": _affine,
    "add": _add,
    "subtract": _add,
    "multiply": _multiply,
    **dict.fromkeys(("negative", "absolute", "minimum", "maximum", "stack", "component"), _either),
    "floor": lambda context, operands: Size(0, 0),
    "sin": _sin,
    "select": _chosen,
    **dict.fromkeys((*TRUTH, *LOGIC), lambda context, operands: Size(math.inf, math.inf)),
}
"""One rule an operation."""


def sizes(program: Program) -> list[Size]:
    """Return the size of each value of an exact program with its sines, or refuse it."""
    found: list[Size] = []
    for index, node in enumerate(program.nodes):
        if node.op not in RULES or node.type.dtype not in ("float32", "bool"):
            what = node.op if node.op not in RULES else f"{node.op} of {node.type.dtype}"
            raise CompileError(
                f"{what} (%{index}) need not have the same bits on all targets: profile exact holds programs "
                f"of floats and {', '.join(RULES)}; use profile ieee"
            )
        found.append(RULES[node.op](Context(program, index), [found[arg] for arg in node.args]))
    return found
