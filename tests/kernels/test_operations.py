"""Each operation of the IR on each executor: a function of one pixel, on ordinary and on awkward numbers."""

from __future__ import annotations

import numpy as np
import pytest

from wamnet.compiler.compile import compile_program
from wamnet.compiler.core.interpret import interpret
from wamnet.compiler.core.ops import LOOPS, OPS
from wamnet.compiler.core.profiles import EMITTED_COSINE
from wamnet.compiler.proof.bounds import NO_BOUND
from wamnet.compiler.targets import language_named
from wamnet.refimpl import rng

W = np.array([[1.5, -2.0, 0.25, 3.0], [0.1, 0.2, -0.3, 0.7]], np.float32)
B = np.array([0.1, -0.2, 0.3, 1e-3], np.float32)

T = np.array([0.25, -3.0, 1e-3, 7.0, 0.5, 2.0, -1.0], np.float32)
K = np.array([5, -7, 123456789], np.int32)
F = np.array([True, False, True])


def words(x):
    """Return integers up to 2000."""
    return (np.absolute(x) * 1000.0).astype(np.uint32)


def index(x, limit):
    """Return an index below `limit`."""
    return np.minimum(np.floor(np.absolute(x[..., 0]) * 3.0).astype(np.int32), limit)


def look_up(table, x):
    i = index(x, len(table) - 1)
    return np.take(np.asarray(table, like=i), i)


def floats(truth):
    return np.where(truth, np.float32(1), np.float32(2))


def hashed(x):
    """Return four random numbers from four counters."""
    w = (np.absolute(x) * 2.0**20).astype(np.uint32) * np.uint32(4093)
    return np.stack(rng.uniforms(*(w[..., i] for i in range(4))), axis=-1)


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
    "power": lambda x: (np.absolute(x) + 0.003) ** (1 / 2.4) + (x + 2.5) ** 2.4,
    "exp": lambda x: np.exp(3.0 * x) + np.exp(-40.0 * np.absolute(x)),
    "sin": lambda x: np.sin(1000.0 * x),
    "stack": lambda x: np.stack([x[..., 3], 0.5 * x[..., 0], x[..., -2]], axis=-1),
    "component": lambda x: x[..., 2] * x[..., 1] + 1.0,
    "reciprocal": lambda x: np.reciprocal(x + 3.0),
    "cos": lambda x: np.cos(1.5 * x),
    "less": lambda x: floats(x < x[..., 1][..., None]),
    "less_equal": lambda x: floats(x <= 2.0),
    "greater": lambda x: floats(words(x) > np.uint32(700)),
    "greater_equal": lambda x: floats(words(x).astype(np.int32) >= 2000),
    "equal": lambda x: floats(x == 0.0),
    "not_equal": lambda x: floats(words(x) != words(x)[..., 2][..., None]),
    "logical_and": lambda x: floats((x > 0.0) & (x < 1.0)),
    "logical_or": lambda x: floats((x < 0.0) | (x > 1.0)[..., 1][..., None]),
    "logical_not": lambda x: floats(~(x < 0.0)),
    "bitwise_and": lambda x: (words(x) & words(x)[..., 1][..., None]).astype(np.float32),
    "bitwise_xor": lambda x: (words(x) ^ words(x)[..., 1][..., None]).astype(np.float32),
    "right_shift": lambda x: (words(x) >> np.uint32(3)).astype(np.float32),
    "select": lambda x: np.where(x < 0.5, x, np.maximum(words(x).astype(np.int32), 7).astype(np.float32)),
    "convert": lambda x: (x * 100.0).astype(np.int32).astype(np.float32),
    "take": lambda x: np.stack(
        [look_up(T, x), look_up(K, x).astype(np.float32), floats(look_up(F, x)), x[..., 1]], axis=-1
    ),
}
"""One function for each operation, named after it."""

EXACT = (
    *("less", "less_equal", "greater", "greater_equal", "equal", "not_equal", "logical_and", "logical_or"),
    *(
        "logical_not",
        "bitwise_and",
        "bitwise_xor",
        "right_shift",
        "select",
        "convert",
        "take",
        "minimum",
        "negative",
        "stack",
    ),
)
"""Cases that every executor computes to the bit: integers, decisions, and floats rounded once."""

AWKWARD = [0.0, -0.0, 1.0, -1.0, 2.0, -2.0, 1 / 3, 2 / 3, 1e-20, -1e-40, 0.66666669, 1.9999999]
"""Zeros of both signs, integers after scaling, denormals, neighbours of integers."""


@pytest.fixture(scope="module")
def image():
    random = np.random.default_rng(3)
    values = np.concatenate([random.uniform(-2, 2, 36), np.array(AWKWARD)])
    return random.permutation(np.repeat(values, 4)).reshape(6, 8, 4).astype(np.float32)


def test_every_operation_has_a_case():
    """Loops are only in kernels of paths: tests/kernels/test_tables.py."""
    assert set(CASES) == set(OPS) - set(LOOPS)


def test_operations_without_a_bound_are_tested_without_one():
    assert set(NO_BOUND) <= {*EXACT, "cos"}


@pytest.mark.product
@pytest.mark.parametrize("op", CASES)
def test_operation_on_executor(denoiser, kit, image, op):
    program = kit.program(CASES[op], {"a": 4})
    if {node.op for node in program.nodes} & set(NO_BOUND):
        assert op in {*EXACT, "cos", "greater", "greater_equal"}
        return  # exact, as the next test says, or without a promise
    assert op in {node.op for node in program.nodes}
    assert kit.excess(denoiser, program, {"a": image}) <= 1


@pytest.mark.parametrize("op", EXACT)
def test_operation_is_exact(denoiser, kit, image, op):
    image = np.where(np.abs(image) < 1e-30, np.float32(0), image)  # denormals may be flushed
    program = kit.program(CASES[op], {"a": 4})
    found = denoiser.run(compile_program(program, denoiser.name), {"a": image})
    (expected,) = interpret(program, {"window": image}).values()
    assert np.array_equal(found, expected)


def test_random_numbers_are_those_of_the_reference(denoiser, kit, image):
    program = kit.program(hashed, {"a": 4})
    found = denoiser.run(compile_program(program, denoiser.name), {"a": image})
    assert np.array_equal(found, hashed(image))
    assert len(np.unique(found)) > 100


def test_cosine_without_a_bound_is_near(denoiser, kit, image):
    """Every target's cosine is right to 2^-11 on [-pi, pi], and the emitted one to its contract."""
    program = kit.program(lambda x: np.cos(1.5 * x), {"a": 4})
    exact = np.cos((np.float32(1.5) * image).astype(np.float64))
    for profile, error in (("ieee", EMITTED_COSINE.error), ("native", 2.0**-11)):
        artifact = compile_program(program, language_named(denoiser.name).under(profile))
        assert artifact.manifest["bound"]["output"] is None
        assert np.max(np.abs(denoiser.run(artifact, {"a": image}) - exact)) <= error


def test_all_operations_compile_without_a_window_of_one(denoiser, kit):
    """A value that is read in loops, in straight code and by two affine maps, with a window of 2."""

    def function(x):
        first = np.sin(np.matmul(x, np.ones((3, 16), np.float32).T))
        again = np.matmul(x, np.full((3, 16), 0.5, np.float32).T)
        return first * again[..., 1][..., None] + x[..., 5][..., None]

    program = kit.program(function, {"a": 4}, size=2, border="zero")
    images = {"a": np.random.default_rng(4).uniform(-2, 2, (3, 5, 4)).astype(np.float32)}
    assert kit.excess(denoiser, program, images) <= 1


def test_constant_output(denoiser, kit):
    artifact = compile_program(kit.program(lambda x: 0.25, {"a": 1}), denoiser.name)
    found = denoiser.run(artifact, {"a": np.zeros((2, 3, 1), np.float32)})
    assert np.array_equal(found, np.full((2, 3, 1), 0.25, np.float32))
