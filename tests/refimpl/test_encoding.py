"""Tests of the display encoding: the standard's own numbers, inverses, monotony, rounding."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wamnet.refimpl import encoding

U64 = 2.0**-53
"""Unit roundoff of float64."""


def test_known_values() -> None:
    """Black, white and the ends of the line: 12.92 x below the limit; mid grey worked by hand.

    0.5 ** (1 / 2.4) = exp(-0.693147180559945 / 2.4) = 0.749153538438341;
    times 1.055 minus 0.055 = 0.735356983052450.
    """
    got = encoding.srgb_encode(np.array([0.0, 0.001, 0.5, 1.0]))
    want = np.array([0.0, 0.01292, 0.735356983052450, 1.0])
    # Each value passes through fewer than 8 rounded operations on numbers below 2; `want` has 15 digits.
    assert np.abs(got - want).max() <= 16 * U64 + 5e-16


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_round_trip(dtype: type) -> None:
    """Decoding undoes encoding to a few units of rounding, away from the joint.

    Each direction has fewer than 8 rounded operations on numbers below 2; no slope of either exceeds 12.92.
    """
    x = np.linspace(0.004, 1.0, 4001).astype(dtype)
    back = encoding.srgb_decode(encoding.srgb_encode(x))
    assert back.dtype == dtype
    assert np.abs(back - x).max() <= 16 * 12.92 * np.finfo(dtype).eps


def test_monotone_and_in_range() -> None:
    """A brighter value never becomes a darker one, on the display and in 8 bits."""
    x = np.concatenate([np.linspace(0.0, 0.01, 10001), np.linspace(0.01, 4.0, 10001)])
    display = encoding.to_display(x)
    assert (np.diff(display) >= 0).all()
    assert display.min() == 0.0
    assert 1.0 - 2 * U64 <= display.max() <= 1.0  # 1.055 - 0.055 is 1 - U64 in float64
    assert (np.diff(encoding.to_8bit(display).astype(int)) >= 0).all()


@given(st.floats(-8.0, 8.0), st.floats(0.0, 1.0))
def test_exposure_is_undone(stops: float, share: float) -> None:
    """Whatever does not clip comes back: linear = share of the exposure's white."""
    linear = np.array([share * 2.0**-stops])
    back = encoding.from_display(encoding.to_display(linear, stops), stops)
    # Relative to the white: the joint's rounded constants (2.8e-8 / 12.92) dominate the rounding.
    assert abs(back[0] - linear[0]) <= 1e-8 * 2.0**-stops


def test_8bit_rounds_halves_up_and_clips() -> None:
    """Level k stands for k / 255; halves go up; outside [0, 1] is clipped."""
    halves = (np.arange(255) + 0.5) / 255.0
    assert (encoding.to_8bit(np.arange(256) / 255.0) == np.arange(256)).all()
    assert (encoding.to_8bit((np.arange(256) / 255.0).astype(np.float32)) == np.arange(256)).all()
    assert (encoding.to_8bit(np.nextafter(halves, 0.0) - 1e-9) == np.arange(255)).all()
    assert (encoding.to_8bit(halves + 1e-9) == np.arange(1, 256)).all()
    assert encoding.to_8bit(np.array([0.5])) == 128  # 255 * 0.5 + 0.5 = 128 exactly
    assert (encoding.to_8bit(np.array([-3.0, 7.0])) == [0, 255]).all()


def test_8bit_levels_come_back() -> None:
    """Every level stands for a value that is rounded to it again."""
    levels = np.arange(256, dtype=np.uint8)
    assert (encoding.to_8bit(encoding.from_8bit(levels)) == levels).all()
    assert encoding.from_8bit(levels)[-1] == 1.0


def test_normals_for_viewing() -> None:
    """-1, 0 and 1 become 0, 1/2 and 1."""
    assert (encoding.normal_to_display(np.array([-1.0, 0.0, 1.0])) == [0.0, 0.5, 1.0]).all()
