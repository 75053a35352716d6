"""Rates that were planted are found again, and what drowns in noise is said."""

import math

import pytest
from kit import untrained

from wamnet.compiler.compile import compile_program
from wamnet.compiler.core.lower import lower
from wamnet.compiler.plan import analysed
from wamnet.kernels import open_executor
from wamnet.kernels.bench import rates
from wamnet.kernels.bench.rates import Rates, Stage, fused, predicted_seconds, sines_of
from wamnet.kernels.measure import Times
from wamnet.kernels.run.denoise_on import products_of
from wamnet.refimpl.network.denoise import Model
from wamnet_peers.common import layered

PIXELS = 1000
"""Pixels of a picture that nobody computes."""


def times(products_s: float, sines_s: float, pixel_s: float) -> dict[str, Times]:
    """Return the small programs' times on a device that takes so long for a product, a sine, a pixel."""
    return {
        name: Times((PIXELS * (pixel_s + products_of(p) * products_s + sines_of(p) * sines_s),))
        for name, p in rates.probes().items()
    }


def test_planted_rates_are_found() -> None:
    """Powers of two: differences and quotients are exact up to a few roundings of float64."""
    found = rates.rates_of(times(2.0**-20, 2.0**-15, 2.0**-8), PIXELS, 7.0)
    expected = (2.0**20, 2.0**15, 7.0, 2.0**-8)
    values = (found.products_per_s, found.sines_per_s, found.bytes_per_s, found.pixel_s)
    for value, wanted in zip(values, expected, strict=True):
        # Subtracting nearly equal times of some 16 bits leaves 53 - 16 bits.
        assert abs(value - wanted) <= 2.0**-30 * wanted


def test_noise_is_no_rate() -> None:
    """Sines that take no time that is seen are free; products whose times do not differ have no rate."""
    found = times(1e-9, 0.0, 1e-6)
    assert rates.rates_of({**found, "sines": found["small"]}, PIXELS, 1.0).sines_per_s == math.inf
    equal = dict.fromkeys(rates.probes(), Times((1.0,)))
    assert math.isnan(rates.rates_of(equal, PIXELS, 1.0).products_per_s)


def test_limits_of_the_machine() -> None:
    """4096^3 products in 2 s are 2 x 4096^3 / 2 operations a second; three arrays of 2^25 floats in 1 s."""
    found = rates.limits_of({"sgemm": Times((2.0,)), "triad": Times((1.0,)), "sine": Times((0.5,))})
    assert found == rates.Limits(4096.0**3, 3 * 4 * 2.0**25, 256 * 2.0**14 / 0.5)
    assert found.rates.products_per_s == 4096.0**3 / 2
    assert found.rates.pixel_s == 0.0


def test_machine_is_measured(monkeypatch) -> None:
    """Every measurement runs, on arrays that are not whole blocks per core."""
    monkeypatch.setattr(rates, "MATRIX", 8)
    monkeypatch.setattr(rates, "TRIAD_NUMBERS", 5 * rates.BLOCK_NUMBERS)
    ways = rates.machine_ways()
    assert list(ways) == ["sgemm", "triad", "sine"]
    assert [way() for way in ways.values()] == [None, None, None]


@pytest.mark.parametrize("schedule", ["plain"])
def test_small_programs_run(monkeypatch, schedule) -> None:
    monkeypatch.setattr(rates, "PROBE_PX", (4, 8))
    monkeypatch.setattr(rates, "PROBE_S", math.inf)
    with open_executor("numpy") as executor:
        found, size = rates.probe_times(executor, executor.language, schedule, 0.0)
    assert size == 8
    assert [len(times.seconds) for times in found.values()] == [3, 3, 3]


# ---- the cost model --------------------------------------------------------------------------------------

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
