"""Rates that were planted are found again, and what drowns in noise is said."""

from __future__ import annotations

import math

import pytest

from wamnet.kernels import open_executor
from wamnet.kernels.bench import rates
from wamnet.kernels.bench.rates import sines_of
from wamnet.kernels.measure import Times
from wamnet.kernels.run.denoise_on import products_of

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
