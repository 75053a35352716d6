"""Grades the extra on a pass: after it a program is well formed, shorter, and gives the same bits."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from wamnet.compiler.core.interpret import interpret
from wamnet.compiler.core.ir import Program, Type
from wamnet.compiler.core.passes.rewrite import eliminate_dead
from wamnet.compiler.core.trace import trace
from wamnet.compiler.core.verify import verify
from wamnet.refimpl.errors import CompileError

from ..frame import Check, Wrong, equal
from ..wire import Expression

MORE = "only additions of a negation change"
"""The explanation of a program that has changed more."""

OLD = "operands are those in the new program: args, not node.args"
"""The explanation of operands that are those of the old program."""

FUNCTIONS = {
    "a + (-b)": ("subtract", "an addition whose operand is a negation becomes a subtraction"),
    "(-a) + b": ("subtract", "the negation may be the first operand too: b - a"),
    "a + b": ("add", MORE),
    "a + a * b": ("add, multiply", MORE),
    "a - (-b)": ("negative, subtract", "only additions change, not subtractions"),
    "(-a) * b": ("multiply, negative", "only additions change, not products"),
    "(-b) * (a + (-b))": ("multiply, negative, subtract", "a negation that another node reads stays"),
    "(a - b) * (a + (-b)) + (-(a * b))": ("multiply, multiply, subtract, subtract", OLD),
    "(a + (-b)) + (-(a * b))": ("multiply, subtract, subtract", OLD),
}
"""Functions, the operations that are left of each in the order of their names, and the likeliest mistake."""


def _check(text: str) -> Callable[[Any], None]:
    """Return the check of one function."""
    wanted, likely = FUNCTIONS[text]

    def run(student: Any) -> None:
        program = trace(Expression(f"lambda a, b: {text}"), {"a": Type(), "b": Type()})
        made = student.subtract(program)
        if not isinstance(made, Program):
            raise Wrong("IR-8", text, "a program", type(made).__name__, "return rewrite(program, rule)")
        try:
            found = eliminate_dead(verify(made, f"after the pass, {text}"))
        except CompileError as error:
            raise Wrong(
                "IR-2", text, "a program that is well formed", str(error), "args, not node.args"
            ) from None
        ops = ", ".join(sorted(node.op for node in found.nodes if node.op != "input"))
        equal("IR-8", f"what is left of {text}", ops, wanted, likely)
        numbers = np.array([0.0, -0.0, 1.5, -2.25, 1e30, np.inf], np.float32)
        a, b = (part.ravel() for part in np.meshgrid(numbers, numbers))
        before, after = (interpret(p, {"a": a, "b": b}, np.float32)["color"] for p in (program, found))
        nan = np.isnan(before) & np.isnan(after)
        same = (before == after) & (np.signbit(before) == np.signbit(after)) | nan
        if not np.all(same):
            at = int(np.flatnonzero(~same)[0])
            what = f"{text} at a = {a[at]:g}, b = {b[at]:g}"
            turned = "the operands are exchanged: the one without the negation comes first"
            raise Wrong("IR-8", what, f"{before[at]:g}", f"{after[at]:g}", turned)

    return run


CHECKS = tuple(Check(text, _check(text)) for text in FUNCTIONS)
"""One for each function."""
