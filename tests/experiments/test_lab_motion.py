"""Measures of flicker and of colours, on pictures whose answers are known in closed form."""

from __future__ import annotations

import numpy as np
import pytest
from lab import colors, motion

from wamnet.refimpl.errors import InputError

RNG = np.random.default_rng(7)
STILL = np.repeat(RNG.uniform(0.2, 0.8, (1, 6, 5, 3)), 8, axis=0)
"""A picture that stands still for eight frames."""

SIGNS = np.array([1, -1] * 4)[:, None, None, None]
"""A flicker from frame to frame."""

RAMP = np.linspace(0.0, 0.7, 8)[:, None, None, None]
"""A motion: brightness that rises by 0.1 a frame; its unbiased variance is 0.01 * 8 * 9 / 12 = 0.06."""

ROUNDING = 1e-14
"""Some hundred roundings of numbers below 1."""


def test_what_stands_still_does_not_flicker():
    assert motion.temporal_variance(STILL) <= ROUNDING
    assert motion.excess_variance(STILL, STILL) == 0.0


def test_an_alternating_pixel_has_the_variance_of_its_swing():
    """Values m + d, m - d in turn, T of them: sum of squares T d^2, over T - 1."""
    flickering = STILL + 0.1 * SIGNS
    expected = 0.01 * 8 / 7
    for found in (
        motion.temporal_variance(flickering),
        motion.excess_variance(flickering, STILL),
        motion.error_variance(flickering, STILL),
    ):
        assert abs(found - expected) <= ROUNDING


def test_motion_is_no_flicker():
    """A picture equal to its moving reference has none, and one that flickers on top has the flicker's."""
    moving = STILL * 0.3 + RAMP
    assert abs(motion.temporal_variance(moving) - 0.06) <= ROUNDING
    assert motion.excess_variance(moving, moving) == motion.error_variance(moving, moving) == 0.0
    flickering = moving + 0.1 * SIGNS
    assert abs(motion.error_variance(flickering, moving) - 0.01 * 8 / 7) <= ROUNDING


def test_a_picture_that_lags_hides_flicker_from_the_excess_but_not_from_the_error():
    """A frozen picture of a ramp: its variance is 0, 0.06 below the reference's; its error's is 0.06."""
    moving, frozen = STILL * 0.3 + RAMP, STILL * 0.3 + RAMP[:1] * 0
    assert abs(motion.excess_variance(frozen, moving) + 0.06) <= ROUNDING
    assert abs(motion.error_variance(frozen, moving) - 0.06) <= ROUNDING


def test_flip_steps_are_those_of_neighbours():
    pytest.importorskip("flip_evaluator", reason="flip-evaluator is not installed")
    steps = motion.flip_steps(STILL[:4] + 0.1 * SIGNS[:4])
    assert steps.shape == (3,)
    # Each step swaps the same two pictures; FLIP is symmetric to its own rounding, float32.
    assert np.ptp(steps) <= 1e-3 * steps[0]
    assert steps[0] > 0.0
    assert motion.excess_flip(STILL, STILL) == 0.0
    assert motion.excess_flip(STILL + 0.1 * SIGNS, STILL) > 0.0


def test_a_slice_shows_time_downwards():
    pictures = STILL + 0.01 * np.arange(8)[:, None, None, None]
    found = motion.slice_over_time(pictures, 2, repeat=3)
    assert found.shape == (24, 5, 3)
    assert np.array_equal(found[3], pictures[1, 2])


@pytest.mark.parametrize("shape", [(1, 4, 4, 3), (4, 4, 3)])
def test_a_lone_picture_is_refused(shape):
    with pytest.raises(InputError, match="shape of a sequence of pictures"):
        motion.temporal_variance(np.zeros(shape))
    with pytest.raises(InputError, match="shape of a sequence of pictures"):
        motion.flip_steps(np.zeros(shape))


@pytest.mark.parametrize("measure", [motion.excess_variance, motion.error_variance, motion.excess_flip])
def test_other_frames_than_the_reference_s_are_refused(measure):
    with pytest.raises(InputError, match="shape of the pictures"):
        measure(STILL, STILL[:-1])


def test_not_a_number_is_not_calm():
    broken = STILL.copy()
    broken[2, 0, 0, 0] = np.nan
    assert np.isnan(motion.excess_variance(broken, STILL))


# ---- colours ----------------------------------------------------------------------------------------------


def test_a_shift_of_colour_is_its_length():
    """(0.1, 0.2, 0.2) everywhere: length 0.3, in tiles of any size."""
    picture = RNG.uniform(0.0, 0.5, (13, 9, 3))
    shifted = picture + np.array([0.1, 0.2, 0.2])
    for tiles in (1, 3, 9):
        assert abs(colors.color_error(shifted, picture, tiles) - 0.3) <= ROUNDING


def test_noise_without_a_mean_is_no_error_of_colour():
    """A chequerboard of +- 0.2 has mean 0 in tiles of an even side."""
    picture = np.full((8, 8, 3), 0.5)
    board = 0.2 * (-1.0) ** np.add.outer(np.arange(8), np.arange(8))[..., None]
    assert colors.color_error(picture + board, picture, 4) <= ROUNDING
    assert abs(colors.color_error(picture + board, picture, 8) - 0.2 * np.sqrt(3.0)) <= ROUNDING


def test_errors_of_two_halves_do_not_cancel_in_tiles():
    picture, other = np.full((4, 4, 3), 0.5), np.full((4, 4, 3), 0.5)
    other[:, :2, 0] += 0.1
    other[:, 2:, 0] -= 0.1
    assert colors.color_error(other, picture, 1) <= ROUNDING
    assert abs(colors.color_error(other, picture, 2) - 0.1) <= ROUNDING


def test_tiles_of_uneven_sides_hold_every_pixel_once():
    picture = RNG.uniform(size=(7, 5, 3))
    means = colors.tile_means(picture, 1)
    assert np.max(np.abs(means[0, 0] - picture.mean(axis=(0, 1)))) <= ROUNDING
    assert colors.tile_means(picture, 5).shape == (5, 5, 3)


def test_colour_errors_are_refused_for_what_cannot_be_compared():
    picture = np.zeros((4, 4, 3))
    with pytest.raises(InputError, match="shape of the picture"):
        colors.color_error(picture, np.zeros((4, 5, 3)))
    for tiles in (0, 5):
        with pytest.raises(InputError, match=f"tiles {tiles}"):
            colors.tile_means(picture, tiles)
