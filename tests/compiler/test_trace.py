"""Tracing: which program a function gives, and what is said of a function that cannot be traced."""

import math
import tracemalloc

import numpy as np
import pytest

from wamnet.compiler.core.interpret import interpret
from wamnet.compiler.core.ir import Type, text
from wamnet.compiler.core.trace import TRACEABLE, trace
from wamnet.refimpl.errors import CompileError

W = np.arange(6, dtype=np.float32).reshape(2, 3)
B = np.array([1, 2], np.float32)


def traced(function, shape=(3,)):
    return trace(function, {"x": Type(shape=shape)})


def ops(program):
    return [node.op for node in program.nodes]


@pytest.mark.parametrize("n", [1, 2, 7, 8, 9, 17, 30])
def test_a_sum_has_the_order_of_numpy(n):
    """To the bit, in float32, with numbers of many sizes."""
    x = (10.0 ** np.random.default_rng(n).uniform(-3, 3, (500, n))).astype(np.float32)
    program = traced(lambda x: np.sum(x, axis=-1, keepdims=True), (n,))
    assert np.array_equal(interpret(program, {"x": x})["color"], np.sum(x, axis=-1))


def test_vectors_and_numbers_are_joined():
    x = np.random.default_rng(0).uniform(size=(5, 3))
    program = traced(lambda x: np.concatenate([x, x[..., 1], -x], axis=-1))
    assert np.array_equal(interpret(program, {"x": x}, np.float64)["color"], np.hstack([x, x[:, 1:2], -x]))


def test_the_same_operation_is_made_once():
    program = traced(lambda x: np.sin(x) * np.sin(x) + np.matmul(np.sin(x), W.T)[..., 0][..., None])
    assert ops(program).count("sin") == 1
    program = traced(lambda x: np.matmul(x, W.T) + np.matmul(x, W.copy().T))
    assert list(program.parameters) == ["W0"]


def test_zeros_of_both_signs_are_two_constants():
    """IR-6."""
    assert ops(traced(lambda x: np.maximum(x, 0.0) + -0.0)).count("constant") == 2


def test_clip_stack_components_and_operators():
    def function(x):
        return np.stack([np.clip(x, -1, 1)[..., 0], -abs(x)[..., -1], x[..., 1] / np.float32(2)], axis=-1)

    program = traced(function)
    x = np.random.default_rng(0).normal(size=(5, 3)).astype(np.float32)
    assert np.array_equal(interpret(program, {"x": x})["color"], function(x))


def test_several_outputs_and_the_shape_in_one_lane():
    def function(x):
        assert (x.shape, x.ndim) == ((3,), 1)
        return {"a": x + 1.0, "b": x[..., 0]}

    program = traced(function)
    x = np.zeros((4, 3), np.float32)
    found = interpret(program, {"x": x})
    assert np.array_equal(found["a"], x + 1)
    assert found["b"].shape == (4,)


def test_integers_decisions_and_tables():
    table = np.array([3, -1, 7, 7], np.int32)

    def function(x):
        count = np.zeros_like(x[..., 0], dtype=np.int32)
        for i in range(3):
            count = count + np.where(x[..., i] >= 0.25, np.int32(1), np.int32(0))
        looked_up = np.take(np.asarray(table, like=count), np.minimum(count, 3))
        word = (looked_up.astype(np.uint32) * np.uint32(2654435761) ^ np.uint32(7)) >> np.uint32(9)
        vector = np.moveaxis(np.stack((word.astype(np.float32), x[..., 1], x[..., 0] ** 2)), 0, -1)
        inside = (vector > -1.0) & ~(vector == 0.0) | (count < 1)[..., None]
        return np.where(inside, vector, np.full_like(vector, 0.5) * np.reciprocal(3.0 + np.ones_like(vector)))

    program = traced(function)
    x = np.random.default_rng(0).normal(size=(50, 3)).astype(np.float32)
    assert np.array_equal(interpret(program, {"x": x})["color"], function(x))
    assert {node.type.dtype for node in program.nodes} == {"float32", "int32", "uint32", "bool"}
    assert "T0: int32[4]" in text(program)


def test_a_number_beside_an_integer_is_one():
    program = traced(lambda x: np.where(x > 0.0, x.astype(np.int32), 2).astype(np.float32))
    assert interpret(program, {"x": np.array([3.5, -1.0], np.float32)})["color"].tolist() == [3.0, 2.0]


def test_float64_means_floats_alone():
    program = traced(lambda x: np.where(x > 0.0, (x * 3.0).astype(np.int32).astype(np.float32), x / 3.0))
    found = interpret(program, {"x": np.array([1.0, -1.0, 0.5])}, np.float64)["color"]
    assert found.dtype == np.float64
    assert found.tolist() == [3.0, -1.0 / 3.0, 1.0]


@pytest.mark.parametrize(
    ("function", "message"),
    [
        (lambda x: np.clip(x, min=0, max=1), r"np\.clip with these arguments cannot"),
        (np.log, r"np\.log cannot be traced"),
        (np.sum, r"np\.sum without axis=-1 and keepdims=True cannot be traced"),
        (lambda x: np.concatenate([x, 1.0], axis=-1), r"a float among the parts .* cannot be traced"),
        (lambda x: np.concatenate([x, x]), r"np\.concatenate with axis=0 .* cannot be traced"),
        (np.add.reduce, r"np\.add\.reduce with .* cannot be traced"),
        (lambda x: np.add(x, x, where=False), r"np\.add with \['where'\] cannot"),
        (lambda x: x if x > 0 else -x, r"a decision \(if, while, and, or\) on a value cannot"),
        (lambda x: x if x else -x, r"a decision \(if, while, and, or\) on a value cannot"),
        (lambda x: list(x), "iteration over a value cannot"),
        (lambda x: np.asarray(x), "conversion to an array cannot"),
        (lambda x: x.sum(), r"the array method \.sum cannot"),
        (lambda x: x[0], "indexing with 0 cannot"),
        (lambda x: x[np.array([0, 1])], r"indexing with array\(\[0, 1\]\) cannot"),
        (lambda x: x[..., True], r"indexing with \(Ellipsis, True\) cannot"),
        (lambda x: math.sin(x), r"conversion to a Python float .* cannot"),
        (lambda x: [1, 2][x], "conversion to a Python integer cannot"),
        (lambda x: len(x), r"len\(\) cannot"),
        (lambda x: x + True, "a bool as an operand of numbers cannot"),
        (lambda x: x[..., None], r"indexing with \(Ellipsis, None\) cannot"),
        (lambda x: x[..., 3], r"component: component 3 does not exist in an operand of type float32\[3\]"),
        (lambda x: W @ x, r"np\.matmul of anything but a traced vector and a constant matrix"),
        (lambda x: x @ W, r"affine: weight of shape \(3, 2\) does not take an operand of type float32\[3\]"),
        (lambda x: x + B, r"add: operands must be of one shape or numbers, not float32\[3\], float32\[2\]"),
        (lambda x: x + W, r"a parameter used as a value must be a vector, not of shape \(2, 3\)"),
        (lambda x: np.stack([x, x], axis=-1), r"stack takes numbers, not float32\[3\], float32\[3\]"),
        (lambda x: np.stack([x[..., 0]]), r"np\.stack with axis=0"),
        (lambda x: x * np.inf, "a constant must be a float that is finite in float32, not inf"),
        (lambda x: x * 1e39, "not 1e"),
        (lambda x: x + "1", r"operand"),
        (lambda x: x + x.astype(np.int32), r"add: operands must all be float32 or all int32 or all uint32"),
        (lambda x: x.astype(np.int32) + 0.5, r"not int32\[3\], float32"),
        (lambda x: x.astype(np.uint32) + np.int32(1), r"not uint32\[3\], int32"),
        (lambda x: x.astype(np.uint32) - -1, r"a constant must be an integer that uint32 holds, not -1"),
        (lambda x: x.astype(np.int32) * np.int64(1), r"an int64 as an operand"),
        (lambda x: x.astype(np.int32) / 2, r"divide: operands must all be float32, not int32"),
        (lambda x: x.astype(np.float64), r"numbers are converted to float32, int32, uint32, not to float64"),
        (lambda x: x.astype(np.int32) >> 1, r"right_shift: operands must all be uint32, not int32"),
        (lambda x: (x > 0.0) + 1.0, r"add: operands must all be .*, not bool\[3\], float32"),
        (lambda x: x.astype(np.int32) & 1, r"bitwise_and: operands must all be uint32, not int32"),
        (lambda x: (x > 0.0) & x, r"logical_and: operands must all be bool, not bool\[3\], float32"),
        (lambda x: ~x.astype(np.uint32), r"logical_not: operands must all be bool"),
        (lambda x: np.where(x, x, x), r"select: operands must all be bool, not float32\[3\]"),
        (lambda x: np.where(x > 0.0, x, x > 0.0), r"select: operands must all be .*, not float32\[3\], bool"),
        (lambda x: np.where(x > 0.0, 1.0, 0.0), r"np\.where between two Python numbers .* cannot"),
        (lambda x: np.where(x > 0.0), r"np\.where with these arguments cannot"),
        (
            lambda x: x**3,
            r"a power other than x \*\* 1, x \*\* 2 and x \*\* y with a positive float y cannot",
        ),
        (lambda x: x**-0.5, r"a power other than"),
        (lambda x: 2**x, r"a power other than"),
        (lambda x: x + np.stack([x[..., 0]] * 3), r"np\.stack with axis=0 outside of np\.moveaxis"),
        (lambda x: np.moveaxis(np.stack([x[..., 0]] * 3), 0, 1), r"np\.moveaxis of anything but"),
        (lambda x: np.moveaxis(x, 0, -1), r"np\.moveaxis of anything but"),
        (lambda x: np.zeros_like(x, dtype=np.int64), r"np\.full_like with dtype int64 cannot"),
        (
            lambda x: np.asarray(W, like=x),
            r"np\.asarray\(\.\.\., like=x\) of anything but a constant array of one",
        ),
        (lambda x: np.take(x, 0), r"np\.take from anything but np\.asarray\(table, like=index\)"),
        (
            lambda x: np.take(np.asarray(B, like=x), x),
            r"take: a table of shape \(2,\) does not take an index of",
        ),
        (lambda x: x * np.array([0.1, 1, 1]), r"float64, shape \(3,\), has values beyond float32"),
    ],
)
def test_what_cannot_be_traced_is_named_with_its_place(function, message):
    with pytest.raises(CompileError, match=message) as caught:
        traced(function)
    assert "test_trace.py:" in str(caught.value)


def test_the_message_lists_what_can_be_traced():
    with pytest.raises(CompileError, match=r"np\.log cannot be traced; use only") as caught:
        traced(np.log)
    assert all(name in str(caught.value) for name in TRACEABLE)


# ---- what the interpreter holds --------------------------------------------------------------------------

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
