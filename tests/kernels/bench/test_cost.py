"""The cost model's arithmetic on a network that is small enough to be counted by hand."""

from __future__ import annotations

import math

import pytest
from kit import untrained

from wamnet.compiler.compile import compile_program
from wamnet.compiler.core.lower import lower
from wamnet.compiler.plan import analysed
from wamnet.kernels.bench.rates import Rates, Stage, fused, predicted_seconds, sines_of
from wamnet.refimpl.network.denoise import Model
from wamnet_peers.common import layered

RATES = Rates(products_per_s=100.0, sines_per_s=10.0, bytes_per_s=1000.0, pixel_s=0.5)
"""Rates for which sums can be done in one's head."""


@pytest.fixture(scope="module")
def model() -> Model:
    """Return a network 12-4-3 of a window of 2 x 2 pixels of colour: 48 + 12 products, 4 sines."""
    return untrained((4,), ("color",), 2)


def test_a_kernel_is_one_stage(model) -> None:
    """60 products, 4 sines, 3 + 3 floats of memory."""
    artifact = compile_program(lower(model), "opencl")
    assert fused(artifact, sines_of(analysed(lower(model)))) == (Stage(60, 4, 24),)


def test_a_rank_is_two_stages(model) -> None:
    """Rows: 2 x (2 taps x 3) products, colour in, 2 out; columns: 4 x (2 taps x 2) + 12, 2 in, 3 out."""
    artifact = compile_program(lower(model), "opencl", rank=2)
    assert fused(artifact, 4) == (Stage(12, 0, 20), Stage(16 + 12, 4, 20))


@pytest.mark.parametrize("fuses", [True, False])
def test_a_library_passes_over_memory_for_each_layer(model, fuses) -> None:
    """The first layer: 48 products from 3 to 4 floats, a factor, a sine; the last one: 12, the clip."""
    elementwise = [] if fuses else [Stage(0, 0, 32)]
    first = [Stage(48, 0, 4 * (3 + 4)), *elementwise, Stage(0, 4, 32)]
    assert layered(model, fuses) == (*first, Stage(12, 0, 4 * (4 + 3)), Stage(0, 0, 24))


def test_time_is_the_longer_of_arithmetic_and_memory() -> None:
    """10 pixels: 10 (0.5 + 60 / 100 + 4 / 10) = 15 s; with 5,000 bytes a pixel 10 x 5 = 50 s; both 65 s."""
    slow, wide = Stage(60, 4, 24), Stage(60, 4, 5000)
    assert predicted_seconds([slow], RATES, 10) == 15.0
    assert predicted_seconds([wide], RATES, 10) == 50.0
    assert predicted_seconds([slow, wide], RATES, 10) == 65.0


def test_sines_that_cost_nothing() -> None:
    """An infinite rate adds 0: 10 (0.5 + 60 / 100) = 11 s."""
    assert predicted_seconds([Stage(60, 4, 24)], Rates(100.0, math.inf, 1000.0, 0.5), 10) == 11.0


@pytest.mark.parametrize("rates", [Rates(math.nan, 1.0, 1.0), Rates(1.0, 0.0, 1.0), Rates(1.0, 1.0, -1.0)])
def test_without_rates_there_is_no_prediction(rates) -> None:
    assert predicted_seconds([Stage(1, 1, 1)], rates, 10) is None


def test_without_stages_there_is_no_prediction() -> None:
    assert predicted_seconds([], RATES, 10) is None
