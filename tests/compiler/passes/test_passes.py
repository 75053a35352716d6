"""The passes: what they change, what they leave, and that the meaning stays."""

import numpy as np
import pytest

from wamnet.compiler.core.interpret import interpret
from wamnet.compiler.core.ir import Type
from wamnet.compiler.core.passes import pipeline
from wamnet.compiler.core.passes.fold import fold, fold_float32
from wamnet.compiler.core.passes.rewrite import (
    eliminate_dead,
    expand_sine,
    expand_tables,
    fuse_bias,
    scalarize,
)
from wamnet.compiler.core.sine import cosine, sine
from wamnet.compiler.core.trace import trace
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
    from wamnet.compiler.core.trace import Traced, _operand

    return Traced(x.builder, _operand(x.builder, value))


@pytest.mark.parametrize("number", [1.0, 0.0])
def test_fold_leaves_what_is_not_finite(number):
    program = traced(lambda x: x * np.divide(_number(x, number), 0.0))
    assert "divide" in ops(fold(program))


def test_fold_float32_rounds_after_each_operation():
    program = traced(lambda x: x * (_number(x, 0.1) + 0.2 * _number(x, 0.3)))
    folded = eliminate_dead(fold_float32(program))
    (value,) = [node["value"] for node in folded.nodes if node.op == "constant"]
    assert value == float(np.float32(0.1) + np.float32(0.2) * np.float32(0.3))
    assert bits(folded) == bits(program)


@pytest.mark.parametrize(
    ("function", "left"),
    [
        (lambda x: np.where(x < 1.0, x, x), ["input"]),
        (lambda x: np.where(_number(x, True), x, -x), ["input"]),
        (lambda x: np.where(_number(x, False), x, -x), ["input", "negative"]),
        (lambda x: np.negative(-x), ["input"]),
        (lambda x: np.where(~~(x < 0.0), x, -x), ["input", "constant", "less", "negative", "select"]),
        (lambda x: np.where((x < 0.0)[..., 0] & _number(x, False), x, -x), ["input", "negative"]),
        (lambda x: np.where((x < 0.0)[..., 0] | _number(x, True), x, -x), ["input"]),
        (lambda x: x[..., 0].astype(np.int32) + 0 * 1, ["input", "component", "convert"]),
        (
            lambda x: np.where((x < 0.0)[..., 0], _number(x, True), (x > 1.0)[..., 1]),
            ["input", "constant", "less", "component", "constant", "greater", "component", "logical_or"],
        ),
        (
            lambda x: np.where((x < 0.0)[..., 0], (x > 1.0)[..., 1], _number(x, False)),
            ["input", "constant", "less", "component", "constant", "greater", "component", "logical_and"],
        ),
        (lambda x: _look_up(np.full(4, 2.5, np.float32), x[..., 0].astype(np.int32)), ["input", "constant"]),
        (lambda x: _look_up(B, _number(x, np.int32(2))), ["input", "constant"]),
    ],
)
def test_fold_decides_what_is_known(function, left):
    program = traced(function)
    folded = eliminate_dead(fold(program))
    assert ops(folded) == left
    found, expected = (interpret(p, {"x": X})["color"] for p in (folded, program))
    assert np.array_equal(np.broadcast_to(found, np.shape(expected)), expected)


def _look_up(table, index):
    return np.take(np.asarray(table, like=index), index)


def test_scalarize_takes_vectors_apart_and_shares_what_is_equal():
    def function(x):
        turned = np.stack([(B * x)[..., i] + x[..., 0] for i in range(3)], axis=-1)
        return np.where(turned > 1.0, turned, (B * x + x[..., 0][..., None]) * 2.0)

    program = traced(function)
    apart = eliminate_dead(fold(scalarize(program)))
    assert all(not node.type.shape for node in apart.nodes if node.op not in ("input", "stack"))
    assert ops(apart).count("stack") == 1  # only the output
    # The first component of B is 1; the sums are there once, though they were written in two ways.
    assert ops(apart).count("multiply") == 2 + 3
    assert ops(apart).count("add") == 3
    assert apart.parameters == {}
    assert bits(apart) == bits(program)


def test_scalarize_keeps_an_affine_map():
    program = traced(lambda x: (x * 2.0) @ W.T + B)
    assert bits(scalarize(program)) == bits(program)
    assert ops(scalarize(program)).count("affine") == 1


@pytest.mark.parametrize(
    ("table", "selections"),
    [([4, 4, 4, 1], 1), ([0, 0, 2, 2, 0], 2), ([1, 2, 3, 4, 5, 6], 5), ([1, 2, 3, 4, 5, 6, 7], None)],
)
def test_expand_tables(table, selections):
    table = np.array(table, np.float32)
    program = trace(lambda i: _look_up(table, i), {"i": Type("int32")})
    expanded = eliminate_dead(expand_tables(program))
    index = np.arange(len(table), dtype=np.int32)
    assert np.array_equal(interpret(expanded, {"i": index})["color"], table)
    assert ops(expanded).count("select") == (selections or 0)
    assert ("take" in ops(expanded)) == (selections is None)


def test_expanded_tables_share_their_comparisons():
    tables = [np.array(t, np.float32) for t in ([1, 1, 2], [5, 5, 9])]
    program = trace(lambda i: _look_up(tables[0], i) + _look_up(tables[1], i), {"i": Type("int32")})
    assert ops(expand_tables(program)).count("less") == 1


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
    program = expand_sine(traced(lambda x: np.sin(x * 7.0) + np.cos(x)))
    assert not {"sin", "cos"} & set(ops(program))
    assert bits(program) == (sine(X * np.float32(7)) + cosine(X)).tobytes()


def test_eliminate_dead_keeps_inputs_and_drops_parameters():
    program = trace(lambda x, y: (x @ W.T, x * 2.0)[1], {"x": Type(shape=(3,)), "y": Type()})
    small = eliminate_dead(program)
    assert ops(small) == ["input", "input", "constant", "multiply"]
    assert small.parameters == {}


def test_unknown_pass():
    with pytest.raises(
        CompileError, match=r"pass 'inline': unknown \(.*choose one of fold, fold_float32, scalarize,"
    ):
        pipeline.run(traced(lambda x: x), ["inline"])


def test_a_pass_that_breaks_the_program_is_named(monkeypatch):
    from dataclasses import replace

    monkeypatch.setitem(pipeline.PASSES, "fold", lambda program: replace(program, outputs=()))
    with pytest.raises(CompileError, match=r"after pass fold: outputs are \[\]"):
        pipeline.run(traced(lambda x: x), ["fold"])


@pytest.mark.parametrize("name", [*pipeline.PASSES])
def test_a_program_that_a_pass_leaves_is_not_copied(name):
    """A second run changes nothing: it returns the program itself, which is not verified again."""
    names = ("fold", "fold_float32", name, "fold", "fold_float32", "eliminate_dead")
    once = pipeline.run(traced(lambda x: np.sin(x) * W[0] + B), names)
    assert pipeline.run(once, names[3:]) is once
