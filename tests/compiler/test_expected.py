"""The reference and the bound of an artifact at given images: blocks of rows, constants, refusals."""

from __future__ import annotations

import numpy as np
import pytest

from wamnet.compiler import bounds
from wamnet.compiler import expected as module
from wamnet.compiler.compile import DENOISERS, analysed, compile_program, sine_contract
from wamnet.compiler.expected import expected
from wamnet.compiler.interpret import interpret
from wamnet.refimpl.errors import CompileError

CHANNELS = {"a": 2, "b": 1}
"""The images' channels."""


@pytest.fixture
def images():
    random = np.random.default_rng(1)
    return {name: random.uniform(-2, 2, (9, 7, n)).astype(np.float32) for name, n in CHANNELS.items()}


@pytest.mark.parametrize("border", ["clamp", "zero"])
@pytest.mark.parametrize("profile", ["ieee", "exact"])
def test_it_is_the_interpreter_and_the_rules(kit, images, border, profile):
    program = kit.denoiser(kit.network([27, 5, 3], (3.0, 3.0)), CHANNELS, 3, border)
    windows = {"window": kit.windows(program, images)}
    (value,) = interpret(program, windows, np.float64).values()
    for target in DENOISERS:
        found = expected(program, compile_program(program, target, profile), images)
        contract = sine_contract(profile, target)
        (bound,) = bounds.at_inputs(analysed(program, profile), windows, contract).values()
        assert found.value.shape == found.bound.shape == (9, 7, 3)
        # float64 adds up in another order; no weight is so small that `exact` would read it as 0
        assert np.abs(found.value - value).max() <= 1e-13
        assert np.abs(found.bound / bound - 1).max() <= 1e-9  # the same


def test_blocks_of_rows_are_one_picture(kit, images, monkeypatch):
    program = kit.denoiser(kit.network([27, 5, 3], (3.0, 3.0)), CHANNELS, 3, "clamp")
    artifact = compile_program(program, "opencl")
    whole = expected(program, artifact, images)
    for numbers in (1, 2 * 7 * 27, 4 * 7 * 27):
        monkeypatch.setattr(module, "BLOCK_NUMBERS", numbers)
        found = expected(program, artifact, images)
        # sums of 27 terms in float64, in another order
        assert np.abs(found.value - whole.value).max() <= 1e-13
        assert np.abs(found.bound / whole.bound - 1).max() <= 1e-9  # the same


def test_one_number_and_constants(kit, images):
    """Outputs without an axis of channels, and those that are the same everywhere."""
    for function, value in (
        (lambda x: x[..., 0] * 0.0 + 0.5, np.full((9, 7, 1), 0.5)),
        (lambda x: np.matmul(x, np.zeros((27, 2), np.float32)) + 0.25, np.full((9, 7, 2), 0.25)),
        (lambda x: x[..., 0] * 2.0, None),
    ):
        program = kit.program(function, CHANNELS, 3)
        found = expected(program, compile_program(program, "numpy"), images)
        assert found.bound.shape == found.value.shape
        if value is None:
            assert found.value.shape == (9, 7, 1)
            assert np.array_equal(found.value, 2.0 * kit.windows(program, images)[..., :1])
        else:
            assert np.array_equal(found.value, value)


def test_what_promises_nothing_has_no_bound(kit, images):
    program = kit.denoiser(kit.network([27, 5, 3], (3.0, 3.0)), CHANNELS, 3, "clamp")
    assert np.isinf(expected(program, compile_program(program, "opengl", "native"), images).bound).all()


def test_two_passes_are_refused(kit, images):
    program = kit.denoiser(kit.network([27, 5, 3], (3.0, 3.0)), CHANNELS, 3, "clamp")
    with pytest.raises(CompileError, match="a kernel of two passes is compared by factor"):
        expected(program, compile_program(program, "numpy", rank=2), images)
