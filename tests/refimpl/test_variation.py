"""Tests of variations: the orbit, lamps that keep their brightness, ranges as text, what lies outside."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wamnet.refimpl.errors import InputError
from wamnet.refimpl.light import variation as V
from wamnet.refimpl.light.scene import Camera
from wamnet.refimpl.light.scenes import canonical

CUBES = canonical("minicubes")
OWN = [light.color for light in CUBES.lights]
U = 2.0**-53
"""Unit roundoff of float64."""


def test_the_orbit_by_hand() -> None:
    """A quarter turn to the side, a quarter pitch clamped at 85 degrees, twice the distance."""
    camera = Camera((0.0, 0.0, 3.0), (0.0, 0.0, 1.0))
    assert V.orbited(camera, 0.0, 0.0, 1.0) is camera
    # Each position is a product of two sines and a sum: a few roundings of numbers up to 4.
    assert np.allclose(V.orbited(camera, 90.0, 0.0, 1.0).position, (2.0, 0.0, 1.0), rtol=0, atol=16 * U)
    assert np.allclose(V.orbited(camera, 0.0, 0.0, 2.0).position, (0.0, 0.0, 5.0), rtol=0, atol=16 * U)
    steep = V.orbited(camera, 0.0, 90.0, 1.0).position
    b = math.radians(85.0)
    assert np.allclose(steep, (0.0, 2 * math.sin(b), 1 + 2 * math.cos(b)), rtol=0, atol=16 * U)
    below = V.orbited(camera, 0.0, -90.0, 1.0).position
    assert np.allclose(below, (0.0, -2 * math.sin(b), 1 + 2 * math.cos(b)), rtol=0, atol=16 * U)


@given(st.floats(0, 1), st.floats(0, 1))
def test_a_lamp_keeps_its_brightness(hue, saturation) -> None:
    """The mean of the channels is the lamp's own, the saturation the requested one."""
    color = V.lamp_color(OWN[0], hue, saturation)
    assert abs(sum(color) / sum(OWN[0]) - 1) <= 16 * U
    assert abs(V.saturation_of(color) - saturation) <= 16 * U
    assert V.saturation_of((0.0, 0.0, 0.0)) == 0.0


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"yaw_deg": 181.0}, "yaw_deg 181.0: must be a number from -180 to 180"),
        ({"pitch_deg": float("nan")}, "pitch_deg nan"),
        ({"distance": 0.0}, "distance 0.0: must be a number from 0.1 to 10"),
        ({"lights": ((1.0, 1.0, 1.0),)}, "number of light colours 1: the scene has 2"),
    ],
)
def test_variations_that_are_refused(change, text) -> None:
    """With the value and the rule."""
    with pytest.raises(InputError, match=text):
        V.varied(CUBES, V.Variation(**change))


def test_ranges_as_text() -> None:
    """There and back; what is not ranges is refused."""
    for ranges in (V.Ranges(), V.Ranges((1.0, 7.0), (-24.0, 24.0), (0.0, 8.0), (0.9, 1.1), (0.0, 0.7))):
        assert V.ranges_from_json(ranges.to_json()) == ranges
    for text in ("", "[]", '{"yaw_deg": [1]}', '{"yaw": [0, 1]}', '{"yaw_deg": [2, 1]}', "[" * 100_000):
        with pytest.raises(InputError, match="range"):
            V.ranges_from_json(text)


@pytest.mark.parametrize(
    ("ranges", "text"),
    [
        (V.Ranges(yaw_deg=(5.0, -5.0)), r"range of yaw_deg '5.0:-5.0': must be LOW:HIGH within -180 to 180"),
        (V.Ranges(pitch_deg=(0.0, 90.0)), "range of pitch_deg"),
        (V.Ranges(distance=(0.0, 1.0)), "range of distance"),
        (V.Ranges(saturation=(0.0, 1.5)), "range of saturation"),
        (V.Ranges(time_s=(0.0, float("inf"))), "range of time_s"),
    ],
)
def test_ranges_that_are_refused(ranges, text) -> None:
    """Limits that a camera or a colour cannot have, or that are exchanged."""
    with pytest.raises(InputError, match=text):
        V.check_ranges(ranges)


def test_what_is_outside() -> None:
    """Each respect by itself, at its limit inside and beyond it outside; times modulo a turn."""
    ranges = V.Ranges((0.0, 6.0), (-24.0, 24.0), (-8.0, 8.0), (0.9, 1.1), (0.0, 0.7))

    def told(time: float = 1.0, **changes) -> list[str]:
        scene = V.varied(canonical("minicubes", time=time), V.Variation(**changes))
        return V.outside(ranges, scene.info, OWN)

    assert told() == told(yaw_deg=24.0, pitch_deg=-8.0, distance=1.1) == told(time=14.0) == []
    assert told(time=15.0) == ["the time is 15 s (learned: 0 s to 6 s)"]
    assert told(yaw_deg=-40.0) == ["the camera's yaw is -40° (learned: -24° to 24°)"]
    assert told(pitch_deg=9.0, distance=0.5) == [
        "the camera's pitch is 9° (learned: -8° to 8°)",
        "the camera's distance is 0.5 (learned: 0.9 to 1.1)",
    ]
    inside, vivid = (V.lamp_color(OWN[0], 0.6, s) for s in (0.7, 0.9))
    assert told(lights=(inside, OWN[1])) == []
    assert told(lights=(vivid, OWN[1])) == ["the saturation of lamp 1 is 0.90 (learned: 0.00 to 0.70)"]
    bright = tuple(1.5 * c for c in inside)
    assert told(lights=(bright, OWN[1])) == ["lamp 1 is 1.50 times as bright as the one that was learned"]


def test_what_power_is_outside() -> None:
    """A lamp's own colour and others, dimmer and brighter; with a range of colours and without one."""
    powers = V.Ranges(power=(0.5, 2.0))

    def told(ranges: V.Ranges, *lights) -> list[str]:
        return V.outside(ranges, V.varied(CUBES, V.Variation(lights=lights)).info, OWN)

    def times(factor: float, color) -> tuple[float, float, float]:
        return tuple(factor * c for c in color)

    colored = V.lamp_color(OWN[0], 0.3, 0.6)
    assert told(powers, times(0.5, OWN[0]), times(2.0, OWN[1])) == []
    assert told(powers, times(0.4, OWN[0]), times(2.1, OWN[1])) == [
        "lamp 1 is 0.40 times as bright as its own (learned: 0.5 to 2)",
        "lamp 2 is 2.10 times as bright as its own (learned: 0.5 to 2)",
    ]
    assert told(powers, colored, OWN[1]) == ["lamp 1 has another colour (learned: its own)"]
    both = V.Ranges(saturation=(0.0, 0.7), power=(0.5, 2.0))
    assert told(both, times(0.5, colored), OWN[1]) == []
    assert told(both, times(3.0, colored), OWN[1]) == [
        "lamp 1 is 3.00 times as bright as its own (learned: 0.5 to 2)"
    ]


def test_ranges_without_power_are_the_text_that_they_were() -> None:
    """Models and data sets that are older than the range of power keep their digests."""
    plain, powered = V.Ranges(saturation=(0.0, 0.5)), V.Ranges(power=(0.25, 4.0))
    assert "power" not in plain.to_json()
    assert V.ranges_from_json(plain.to_json()) == plain
    assert V.ranges_from_json(powered.to_json()) == powered
    with pytest.raises(
        InputError, match=r"range of power '0.0:1.0': must be LOW:HIGH within 0.000976562 to 1024"
    ):
        V.check_ranges(V.Ranges(power=(0.0, 1.0)))


def test_outside_without_lamps_or_facts() -> None:
    """Colours that were never varied are the lamps' own only; what nobody says is inside."""
    still = V.Ranges()
    scene = V.varied(CUBES, V.Variation(lights=((0.2, 0.2, 0.9), OWN[1])))
    assert V.outside(still, scene.info, OWN) == ["lamp 1 has another colour (learned: its own)"]
    assert V.outside(still, {}, OWN) == []
    assert V.outside(still, {"yaw_deg": "much", "lights": "none", "time": "nan"}, OWN) == []
