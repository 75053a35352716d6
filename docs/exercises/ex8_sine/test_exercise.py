"""Grades exercise 8: what it is made of, the spec's vectors, and the worst arguments that there are."""

from __future__ import annotations

import numpy as np

from wamnet.compiler.core.ir import Type
from wamnet.compiler.core.sine import POLYNOMIALS
from wamnet.compiler.core.trace import trace

KNOWN = {"input", "constant", "add", "subtract", "multiply", "floor", "minimum", "maximum", "negative"}
"""The operations that a sine may be made of."""


def test_it_is_made_of_simple_operations(student):
    program = trace(student.sine, {"x": Type()})
    others = sorted({node.op for node in program.nodes} - KNOWN)
    assert not others, f"a kernel's own sine is not made of {', '.join(others)}"


def test_the_vectors(student, hold_to_vectors):
    hold_to_vectors("sine", lambda given: {"sin": student.sine(np.float32(given["x"]))})


def test_its_error_everywhere(student):
    """The proven bound of degree 11, on a grid, and next to multiples of pi / 2, where r is hard to find."""
    near = (np.arange(-8100, 8100) * (np.pi / 2)).astype(np.float32)
    x = np.concatenate(
        [np.linspace(-12800, 12800, 200_001, dtype=np.float32), near, np.nextafter(near, np.float32(0))]
    )
    x = x[np.abs(x) <= 12800]
    found = student.sine(x)
    assert found.dtype == np.float32, f"single precision in, {found.dtype} out"
    error = np.abs(found.astype(np.float64) - np.sin(x.astype(np.float64)))
    worst = int(np.argmax(np.where(np.isnan(error), np.inf, error)))
    bound = POLYNOMIALS[11].error
    assert error[worst] <= bound, (
        f"sine({float(x[worst])!r}) is off by {error[worst]:.3g}; at most {bound:.3g}"
    )
    assert np.all(np.abs(found) <= 1.0), "a sine is beyond 1"
