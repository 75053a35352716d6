"""The passes: what they change, what they leave, and that the meaning stays."""

from __future__ import annotations

import numpy as np
import pytest

from wamnet.compiler.interpret import interpret
from wamnet.compiler.ir import Type
from wamnet.compiler.passes import pipeline
from wamnet.compiler.passes.eliminate_dead import eliminate_dead
from wamnet.compiler.passes.expand_sine import expand_sine
from wamnet.compiler.passes.fold import fold
from wamnet.compiler.passes.fuse_bias import fuse_bias
from wamnet.compiler.sine import sine
from wamnet.compiler.trace import trace
from wamnet.refimpl.errors import CompileError

W = np.arange(9, dtype=np.float32).reshape(3, 3)
B = np.array([1, 2, 3], np.float32)
X = np.array([[0.0, -0.0, 1.5], [1e-40, -3.0, 2.0]], np.float32)


def traced(function):
    return trace(function, {"x": Type(shape=(3,))})


def ops(program):
    return [node.op for node in program.nodes]


def bits(program):
    return interpret(program, {"x": X})["color"].tobytes()


@pytest.mark.parametrize(
    "function",
    [
        lambda x: x * 1.0,
        lambda x: 1.0 * x,
        lambda x: x / 1.0,
        lambda x: x - 0.0,
        lambda x: x + -0.0,
        lambda x: -0.0 + x,
    ],
)
def test_fold_removes_what_does_nothing_to_any_bit(function):
    program = traced(function)
    folded = eliminate_dead(fold(program))
    assert ops(folded) == ["input"]
    assert bits(folded) == bits(program)


@pytest.mark.parametrize(
    "function",
    [lambda x: x + 0.0, lambda x: 0.0 - x, lambda x: x - -0.0, lambda x: 1.0 / x, lambda x: x * 2.0],
)
def test_fold_keeps_what_changes_a_bit(function):
    program = traced(function)
    assert ops(fold(program)) == ops(program)


def test_fold_computes_constants_in_float64():
    program = eliminate_dead(fold(traced(lambda x: x + (x[..., 0] * 0.0 + 1.0) * 0.0)))
    assert "multiply" in ops(program)
    program = trace(lambda x: x * np.sqrt(x.builder and _number(x, 2.0)), {"x": Type(shape=(3,))})
    (value,) = [node["value"] for node in eliminate_dead(fold(program)).nodes if node.op == "constant"]
    assert value == np.sqrt(2.0)


def _number(x, value):
    """Return a traced constant: Python would compute with a plain one itself."""
    from wamnet.compiler.trace import Traced, _operand

    return Traced(x.builder, _operand(x.builder, value))


def test_fold_leaves_what_is_not_finite():
    program = traced(lambda x: x * np.divide(_number(x, 1.0), 0.0))
    assert "divide" in ops(fold(program))


@pytest.mark.parametrize("function", [lambda x: x @ W.T + B, lambda x: B + x @ W.T])
def test_fuse_bias(function):
    program = traced(function)
    fused = eliminate_dead(fuse_bias(program))
    assert ops(fused) == ["input", "affine"]
    assert fused.nodes[1]["bias"] == "b0"
    assert bits(fused) == bits(program)


def test_fuse_bias_leaves_a_product_that_is_read_twice_and_a_second_bias():
    def twice(x):
        y = x @ W.T
        return (y + B) * y

    program = traced(twice)
    assert ops(fuse_bias(program)) == ops(program)
    assert ops(eliminate_dead(fuse_bias(traced(lambda x: (x @ W.T + B) + 2 * B)))).count("add") == 1


def test_expand_sine_emits_the_sine_of_sine_py():
    program = expand_sine(traced(lambda x: np.sin(x * 7.0)))
    assert "sin" not in ops(program)
    assert bits(program) == sine(X * np.float32(7)).tobytes()


def test_eliminate_dead_keeps_inputs_and_drops_parameters():
    program = trace(lambda x, y: (x @ W.T, x * 2.0)[1], {"x": Type(shape=(3,)), "y": Type()})
    small = eliminate_dead(program)
    assert ops(small) == ["input", "input", "constant", "multiply"]
    assert small.parameters == {}


def test_unknown_pass():
    with pytest.raises(CompileError, match="pass 'inline' does not exist; there are: fold, fuse_bias,"):
        pipeline.run(traced(lambda x: x), ["inline"])


def test_a_pass_that_breaks_the_program_is_named(monkeypatch):
    from dataclasses import replace

    monkeypatch.setitem(pipeline.PASSES, "fold", lambda program: replace(program, outputs=()))
    with pytest.raises(CompileError, match=r"after pass fold: outputs are \[\]"):
        pipeline.run(traced(lambda x: x), ["fold"])
