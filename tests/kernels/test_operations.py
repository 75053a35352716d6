"""Each operation of the IR on each executor: a function of one pixel, on ordinary and on awkward numbers."""

from __future__ import annotations

import numpy as np
import pytest

from wamnet.compiler.compile import compile_program
from wamnet.compiler.ops import OPS

W = np.array([[1.5, -2.0, 0.25, 3.0], [0.1, 0.2, -0.3, 0.7]], np.float32)
B = np.array([0.1, -0.2, 0.3, 1e-3], np.float32)

CASES = {
    "input": lambda x: x,
    "constant": lambda x: x * 0.1,
    "parameter": lambda x: np.maximum(x, B),
    "affine": lambda x: np.matmul(np.matmul(x, W.T), W),
    "add": lambda x: x + x[..., 1][..., None],
    "subtract": lambda x: x - x[..., 2][..., None],
    "multiply": lambda x: x * x[..., 3][..., None],
    "divide": lambda x: x / (x[..., 0] + 3.0)[..., None],
    "negative": lambda x: -x,
    "absolute": lambda x: np.absolute(x),
    "minimum": lambda x: np.minimum(x, x[..., 0][..., None]),
    "maximum": lambda x: np.clip(x, -0.5, x[..., 1][..., None]),
    "floor": lambda x: np.floor(x * 1.5),
    "sqrt": lambda x: np.sqrt(np.absolute(x)),
    "sin": lambda x: np.sin(1000.0 * x),
    "stack": lambda x: np.stack([x[..., 3], 0.5 * x[..., 0], x[..., -2]], axis=-1),
    "component": lambda x: x[..., 2] * x[..., 1] + 1.0,
}
"""One function for each operation, named after it."""

AWKWARD = [0.0, -0.0, 1.0, -1.0, 2.0, -2.0, 1 / 3, 2 / 3, 1e-20, -1e-40, 0.66666669, 1.9999999]
"""Zeros of both signs, whole numbers after scaling, denormals, neighbours of whole numbers."""


@pytest.fixture(scope="module")
def image():
    random = np.random.default_rng(3)
    values = np.concatenate([random.uniform(-2, 2, 36), np.array(AWKWARD)])
    return random.permutation(np.repeat(values, 4)).reshape(6, 8, 4).astype(np.float32)


def test_every_operation_has_a_case():
    assert set(CASES) == set(OPS)


@pytest.mark.parametrize("op", CASES)
def test_operation_on_executor(executor, kit, image, op):
    program = kit.program(CASES[op], {"a": 4})
    assert op in {node.op for node in program.nodes}
    assert kit.excess(executor, program, {"a": image}) <= 1


def test_all_operations_compile_without_a_window_of_one(executor, kit):
    """A value that is read in loops, in straight code and by two affine maps, with a window of 2."""

    def function(x):
        first = np.sin(np.matmul(x, np.ones((3, 16), np.float32).T))
        again = np.matmul(x, np.full((3, 16), 0.5, np.float32).T)
        return first * again[..., 1][..., None] + x[..., 5][..., None]

    program = kit.program(function, {"a": 4}, size=2, border="zero")
    images = {"a": np.random.default_rng(4).uniform(-2, 2, (3, 5, 4)).astype(np.float32)}
    assert kit.excess(executor, program, images) <= 1


def test_constant_output(executor, kit):
    artifact = compile_program(kit.program(lambda x: 0.25, {"a": 1}), executor.name)
    found = executor.run(artifact, {"a": np.zeros((2, 3, 1), np.float32)})
    assert np.array_equal(found, np.full((2, 3, 1), 0.25, np.float32))
