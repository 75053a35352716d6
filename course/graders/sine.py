"""Grades the extra on the sine: its operations, the spec's vectors, the worst arguments that there are."""

from __future__ import annotations

from typing import Any

import numpy as np

from wamnet.compiler.core.interpret import interpret
from wamnet.compiler.core.ir import Type
from wamnet.compiler.core.sine import POLYNOMIALS
from wamnet.compiler.core.verify import verify

from ..frame import Check, Wrong, expect, kind_of_number, numbers_of, vectors
from ..wire import Expression

KNOWN = {"input", "constant", "add", "subtract", "multiply", "floor", "minimum", "maximum", "negative"}
"""The operations that a sine may be made of."""

TRACE = Expression("lambda types: import_module('wamnet.compiler.core.trace').trace(student.sine, types)")
"""Traces the student's function."""


def near_zero(student: Any) -> None:
    """Where the polynomial only matters, and the first half turns."""
    x = np.array([0.0, 0.5, -1.0, 1.5, 3.0, 4.0, -4.0, 7.0, 10.0], np.float32)
    found = student.sine(x)
    kind_of_number("SIN-1", "sines of float32 arguments", found, np.float32)
    right = np.sin(x.astype(np.float64))
    k, low = np.floor(x / np.pi + 0.5), np.floor(x / np.pi)
    likely = [
        (right * np.where(k % 2, -1, 1), "sin(x) = (-1)^k sin(r): the sign of odd k is missing"),
        (-right, "the sign: even k is positive"),
        (np.cos(x.astype(np.float64)), "a cosine"),
        (
            np.sin(x - low * np.pi),
            "k is the nearest integer, floor(x / pi + 0.5), and its parity is the sign",
        ),
    ]
    bound = POLYNOMIALS[11].error
    text = "the polynomial holds for |r| <= pi / 2 only: k is the nearest integer to x / pi"
    if np.abs(np.asarray(found)[[0, 1, 3]] - right[[0, 1, 3]]).max() > bound:
        text = "the polynomial: r + r^3 (c1 + r^2 (c2 + ...)), all coefficients, by Horner"
    expect("SIN-1", "sines", found, right, bound, likely, text)


def simple(student: Any) -> None:
    """Traced, it has only simple operations, and is the same function."""
    program = verify(student.request(TRACE, {"x": Type()}), "of sine")
    others = sorted({node.op for node in program.nodes} - KNOWN)
    if others:
        text = "a kernel has no sine of its own here: +, -, *, np.floor, np.minimum, np.maximum"
        raise Wrong("SIN-1", "operations", "only simple ones", ", ".join(others), text)
    x = np.linspace(-20.0, 20.0, 1001, dtype=np.float32)
    found = interpret(program, {"x": x}, np.float32)["color"]
    text = "the function asks what its argument is"
    expect("SIN-1", "sines of the traced program", found, student.sine(x), 0.0, (), text)


def everywhere(student: Any) -> None:
    """The proven bound of degree 11, on a grid, and next to multiples of pi / 2, where r is hard to find."""
    near = (np.arange(-8100, 8100) * (np.pi / 2)).astype(np.float32)
    grid = np.linspace(-12800, 12800, 200_001, dtype=np.float32)
    x = np.concatenate([grid, near, np.nextafter(near, np.float32(0))])
    x = x[np.abs(x) <= 12800]
    found = numbers_of("SIN-3", "sines", student.sine(x), x.shape)
    error = np.abs(found.astype(np.float64) - np.sin(x.astype(np.float64)))
    worst = int(np.argmax(np.where(np.isnan(error), np.inf, error)))
    bound = POLYNOMIALS[11].error
    if not error[worst] <= bound:
        text = "subtract pi in its three parts, one after another: x - k * p1, then - k * p2, then - k * p3"
        if error[worst] < 8 * bound:
            text = "r + r * (z * q) loses less than r * (1 + z * q); and all six coefficients count"
        what = f"the error of sine({float(x[worst])!r})"
        raise Wrong("SIN-3", what, f"at most {bound:.3g}", f"{error[worst]:.3g}", text)
    most = float(np.abs(found).max())
    if not most <= 1.0:
        raise Wrong("SIN-4", "the largest sine", "at most 1", repr(most), "clamp the result to [-1, 1]")


def the_vectors(student: Any) -> None:
    """The cases sine."""
    vectors(
        "sine", lambda given: {"sin": student.sine(np.float32(given["x"]))}, likely="the clamp to [-1, 1]"
    )


CHECKS = (
    Check("small arguments", near_zero),
    Check("simple operations", simple),
    Check("the error everywhere", everywhere),
    Check("the spec's vectors", the_vectors),
)
"""In the order in which they explain a mistake best."""
