"""What the interpreter holds while it runs; what it computes, all other tests ask."""

from __future__ import annotations

import tracemalloc

import numpy as np

from wamnet.compiler.core.interpret import interpret
from wamnet.compiler.core.ir import Type
from wamnet.compiler.core.trace import trace

STEPS = 40
"""Operations one after another."""


def test_values_are_dropped_after_their_last_use():
    """Two numbers a step, of which the next needs one; all of them once took gigabytes of a benchmark."""

    def chain(x):
        for _ in range(STEPS):
            x = np.sin(x) + 1.0
        return x

    program = trace(chain, {"x": Type(shape=())})
    given = np.zeros(2**18, np.float32)
    tracemalloc.start()
    try:
        (found,) = interpret(program, {"x": given}).values()
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert found.shape == given.shape
    # The operand, the result, and a temporary of an operation.
    assert peak < 4 * given.nbytes
