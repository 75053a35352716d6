"""Grades exercise 9: the program after the pass is well formed, shorter, and gives the same bits."""

from __future__ import annotations

import numpy as np
import pytest

from wamnet.compiler.core.interpret import interpret
from wamnet.compiler.core.ir import Type
from wamnet.compiler.core.passes.eliminate_dead import eliminate_dead
from wamnet.compiler.core.trace import trace
from wamnet.compiler.core.verify import verify

FUNCTIONS = {
    "a + (-b)": (lambda a, b: a + (-b), ["subtract"]),
    "(-a) + b": (lambda a, b: (-a) + b, ["subtract"]),
    "a + b": (lambda a, b: a + b, ["add"]),
    "a - (-b)": (lambda a, b: a - (-b), ["negative", "subtract"]),
    "(-b) * (a + (-b))": (lambda a, b: (-b) * (a + (-b)), ["multiply", "negative", "subtract"]),
    "(a + (-b)) + (-(a * b))": (lambda a, b: (a + (-b)) + (-(a * b)), ["multiply", "subtract", "subtract"]),
}
"""Functions, and the operations that are left of each."""


@pytest.mark.parametrize("text", FUNCTIONS)
def test_a_function(student, text):
    function, wanted = FUNCTIONS[text]
    program = trace(function, {"a": Type(), "b": Type()})
    found = eliminate_dead(verify(student.subtract(program), f"after the pass, {text}"))
    ops = sorted(node.op for node in found.nodes if node.op != "input")
    assert ops == wanted, f"{text} became {', '.join(ops)}; {', '.join(wanted)} expected"
    numbers = np.array([0.0, -0.0, 1.5, -2.25, 1e30, np.inf], np.float32)
    a, b = (part.ravel() for part in np.meshgrid(numbers, numbers))
    with np.errstate(invalid="ignore", over="ignore"):
        before, after = (interpret(p, {"a": a, "b": b}, np.float32)["color"] for p in (program, found))
    same = (before == after) & (np.signbit(before) == np.signbit(after)) | (
        np.isnan(before) & np.isnan(after)
    )
    assert np.all(same), f"{text} gives other numbers after the pass"
