"""How an operation is added: a row, a rule for its bound, and its words in the languages."""

import numpy as np

from wamnet.compiler.compile import compile_program
from wamnet.compiler.core import trace
from wamnet.compiler.core.interpret import interpret
from wamnet.compiler.core.ir import Gather, Image, Type
from wamnet.compiler.core.ops import OPS, _row
from wamnet.compiler.core.profiles import EMITTED_SINE
from wamnet.compiler.languages.dialect import Dialect
from wamnet.compiler.languages.glsl import GLSL
from wamnet.compiler.languages.opencl import OpenCL
from wamnet.compiler.proof import bounds
from wamnet.refimpl.network.window import Window


def _trunc(context, operands):
    """As a floor, on both sides of 0: off by the integers between both values."""
    (a,) = operands
    steps = np.trunc(a.high + a.read) - np.trunc(a.low - a.read)
    return bounds.Enclosure(np.trunc(a.low), np.trunc(a.high), np.minimum(steps, np.ceil(a.read)))


def test_a_row_a_rule_and_words_are_all_that_a_new_operation_needs(monkeypatch):
    """np.trunc, which the project does not have; tracer and dialects read their tables when imported."""
    monkeypatch.setitem(OPS, "trunc", _row("trunc", np.trunc, 1))
    monkeypatch.setitem(trace._UFUNCS, np.trunc, "trunc")
    monkeypatch.setitem(bounds.RULES, "trunc", _trunc)
    for dialect in (Dialect, OpenCL, GLSL):
        monkeypatch.setitem(dialect.operations, "trunc", "trunc({0})")
    gather = Gather(Window(1, "clamp"), (Image("a", 3, -2.0, 2.0),))
    program = trace.trace(lambda x: np.trunc(1.5 * x), {"window": Type(shape=(3,))}, gather)
    x = np.array([[-1.9, 0.5, 1.4]], np.float32)
    (found,) = interpret(program, {"window": x}, np.float64).values()
    assert found.tolist() == [[-2.0, 0.0, 2.0]]
    (bound,) = bounds.at_inputs(program, {"window": x.astype(np.float64)}, EMITTED_SINE).values()
    assert (bound < 1.0).all(), "no argument is near an integer: the kernel has the same"
    for target in ("opencl", "opengl"):
        kernel = compile_program(program, target)
        assert "trunc(" in kernel.source
        assert all(np.isfinite(kernel.manifest["bound"]["output"]))
