"""Tests of draws: even times without symmetry, cameras and lamps that depend on nothing, what is outside."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from statistical import stats

from wamnet.models.data import draws
from wamnet.refimpl.errors import InputError
from wamnet.refimpl.light.scenes import TURN_SECONDS, canonical
from wamnet.refimpl.light.variation import Ranges, outside, saturation_of, varied

RANGES = Ranges((0.0, 7.0), (-24.0, 24.0), (-8.0, 8.0), (0.9, 1.1), (0.1, 0.7))
CUBES = canonical("minicubes")
OWN = [light.color for light in CUBES.lights]


def numbers(draw: draws.Draw) -> list[float]:
    """Return all that a draw has drawn, lamps by one channel and saturation."""
    v = draw.variation
    lamps = [x for c in v.lights for x in (c[0] / sum(c), saturation_of(c))]
    return [draw.time_s, v.yaw_deg, v.pitch_deg, v.distance, *lamps]


@pytest.mark.parametrize("count", [8, 24, 48, 64, 160, 1000])
@pytest.mark.parametrize("symmetry", [1, 2, 4, 6])
def test_poses_differ_under_any_symmetry(count, symmetry) -> None:
    """Times modulo a part of the turn stay apart: no two poses of a lattice that repeats are the same.

    Fractions k g of the golden ratio g keep |k g - p| >= 1/(k (sqrt(5) + 1)) for all integers (its continued
    fraction has ones only: convergents p/q differ by more than 1/(q^2 (sqrt(5) + 1))), and symmetry s asks
    for |s k g - p| / s.
    """
    found = np.sort(np.array(draws.times(3, 0.0, TURN_SECONDS, 0, count)) % (TURN_SECONDS / symmetry))
    gaps = np.diff([*found, found[0] + TURN_SECONDS / symmetry])
    least = TURN_SECONDS / (symmetry * count * symmetry * (5**0.5 + 1.0))
    assert gaps.min() >= least


def test_times_are_even_and_go_on() -> None:
    """At most three step lengths, the largest less than 2.7 mean steps; more frames only add times."""
    found = np.sort(draws.times(0, 2.0, 8.0, 0, 64))
    gaps = np.diff([*found, found[0] + 8.0])
    # Steps are differences of numbers below 10: equal ones differ by a few roundings of 10.
    lengths = [g for g, _ in itertools.groupby(np.sort(gaps), key=lambda gap: round(gap / 1e-12))]
    assert len(lengths) <= 3
    assert gaps.max() <= 2.7 * 8.0 / 64
    assert draws.times(0, 2.0, 8.0, 0, 64)[:10] == draws.times(0, 2.0, 8.0, 0, 10)
    assert draws.times(0, 2.0, 8.0, 60, 4) == draws.times(0, 2.0, 8.0, 0, 64)[60:]


def test_dimensions_are_independent() -> None:
    """Spearman's rank correlation of any two of the eight numbers over 512 frames; 28 pairs, level 1 %.

    Sidak: each pair is tested at 1 - 0.99^(1/28).
    """
    table = np.array([numbers(d) for d in draws.drawn(11, RANGES, CUBES.lights, 0, 512)]).T
    level = 1.0 - 0.99 ** (1 / 28)
    for one, other in itertools.combinations(table, 2):
        assert stats.spearmanr(one, other).pvalue >= level


def test_numbers_fill_their_ranges() -> None:
    """Kolmogorov's test of yaw, pitch, distance and saturation against uniform; 4 tests, level 1 %."""
    found = draws.drawn(5, RANGES, CUBES.lights, 0, 512)
    level = 1.0 - 0.99 ** (1 / 4)
    columns = {
        RANGES.yaw_deg: [d.variation.yaw_deg for d in found],
        RANGES.pitch_deg: [d.variation.pitch_deg for d in found],
        RANGES.distance: [d.variation.distance for d in found],
        RANGES.saturation: [saturation_of(d.variation.lights[0]) for d in found],
    }
    for (low, high), values in columns.items():
        assert min(values) >= low
        assert max(values) <= high + 1e-12  # a quotient's rounding
        assert stats.kstest(values, "uniform", args=(low, high - low)).pvalue >= level


def test_frames_inside_are_inside_and_outside_ones_are_not() -> None:
    """By the reference's own judgement, in the one respect that the draw says."""
    words = {"time": "the time is", "camera": "the camera's yaw", "lamps": "the saturation of lamp"}
    for draw in draws.drawn(7, RANGES, CUBES.lights, 0, 50):
        scene = varied(canonical("minicubes", time=draw.time_s), draw.variation)
        assert draw.outside == ""
        assert outside(RANGES, scene.info, OWN) == []
    far = draws.drawn_outside(7, RANGES, 1.0, CUBES.lights, 50, 12)
    assert [draw.outside for draw in far] == ["time", "camera", "lamps"] * 4
    for draw in far:
        scene = varied(canonical("minicubes", time=draw.time_s), draw.variation)
        told = outside(RANGES, scene.info, OWN)
        assert told
        assert all(sentence.startswith(words[draw.outside]) for sentence in told)
    yaws = [draw.variation.yaw_deg for draw in far if draw.outside == "camera"]
    assert yaws == [-34.0, 34.0, -34.0, 34.0]


POWERED = [replace(RANGES, power=(0.25, 1.5)), replace(RANGES, saturation=None, power=(0.25, 1.5))]
"""Ranges of power, with colours and without."""


@pytest.mark.parametrize("ranges", POWERED, ids=["colours", "own colours"])
def test_powers_fill_their_range_and_depend_on_nothing(ranges) -> None:
    """Kolmogorov's test of both lamps' factors against uniform, Spearman's of one against the other; 3 tests,
    level 1 %. Without a range of saturation, colours are the lamps' own times a factor, to an ulp or two.
    """
    found = draws.drawn(5, ranges, CUBES.lights, 0, 512)
    level = 1.0 - 0.99 ** (1 / 3)
    factors = [[sum(d.variation.lights[n]) / sum(OWN[n]) for d in found] for n in (0, 1)]
    for values in factors:
        assert 0.25 - 1e-12 <= min(values) <= max(values) <= 1.5 + 1e-12
        assert stats.kstest(values, "uniform", args=(0.25, 1.25)).pvalue >= level
    assert stats.spearmanr(*factors).pvalue >= level
    for draw in found[:20]:
        assert outside(ranges, varied(CUBES, draw.variation).info, OWN) == []
        for color, own in zip(draw.variation.lights, OWN, strict=True):
            kept = np.ptp(np.divide(color, own)) <= 2 * np.finfo(float).eps * max(np.divide(color, own))
            assert kept == (ranges.saturation is None)


def test_colours_do_not_depend_on_a_range_of_power() -> None:
    """The factor is drawn by itself: hue and saturation of a frame are what they are without it.

    A product and a quotient round by an ulp each, 2.2e-16 of numbers up to 1.5.
    """
    plain, powered = (draws.variation_of(5, 9, r, CUBES.lights) for r in (RANGES, POWERED[0]))
    for one, other in zip(plain.lights, powered.lights, strict=True):
        assert np.ptp(np.divide(other, one)) <= 2 * np.finfo(float).eps * 1.5


def test_seeds_differ_and_single_values_are_exact() -> None:
    """A range of one number is that number; another seed draws other frames."""
    still = Ranges()
    (draw,) = draws.drawn(0, still, CUBES.lights, 3, 1)
    assert (draw.variation.yaw_deg, draw.variation.distance, draw.variation.lights) == (0.0, 1.0, ())
    assert draws.drawn(1, RANGES, CUBES.lights, 0, 1) != draws.drawn(2, RANGES, CUBES.lights, 0, 1)


def test_nothing_is_outside_of_everything() -> None:
    """Frames that differ in time only, all of which is trained on."""
    assert draws.drawn_outside(0, Ranges(), 0.0, CUBES.lights, 0, 0) == []
    with pytest.raises(InputError, match="number of frames outside 2: a data set whose frames differ"):
        draws.drawn_outside(0, Ranges(), 0.0, CUBES.lights, 0, 2)
