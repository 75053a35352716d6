"""The a-trous filter on pictures whose answer is known, and the measure of blocks on made ones."""

from dataclasses import replace

import numpy as np
import pytest
from baselines import atrous
from baselines.atrous import Guides, Settings
from baselines.blocks import blockiness, jumps

from wamnet.refimpl.errors import InputError
from wamnet.refimpl.frame import Frame

SIZE = 48
FLAT = Guides(
    np.ones((SIZE, SIZE)), np.zeros((SIZE, SIZE, 2)), np.broadcast_to([0.0, 0.0, 1.0], (SIZE, SIZE, 3))
)
"""One plane that faces the camera: nothing but luminance tells its pixels apart."""

OPEN = Settings(sigma_luminance=1e30)
"""Luminance does not matter."""

ULP = 2.0**-52


def frame(color, albedo=None, normal=None, depth=None):
    size = color.shape[:2]
    return Frame(
        {
            "color": color,
            "albedo": np.full((*size, 3), 0.5) if albedo is None else albedo,
            "normal": np.broadcast_to([0.0, 0.0, 1.0], (*size, 3)) if normal is None else normal,
            "depth": np.ones((*size, 1)) if depth is None else depth,
        }
    )


def test_a_constant_picture_stays():
    color = np.broadcast_to([0.25, 0.5, 2.0], (16, 16, 3))
    # Weighted means of equal numbers: 25 products a pass, five passes, and the division by albedo.
    assert np.max(np.abs(atrous.denoise(frame(color)) - color)) <= 5 * 60 * ULP * 2.0


def test_open_passes_are_the_spline_s_wavelet():
    """Away from borders, without edges, pass i convolves with the B-spline whose taps are 2^i apart.

    The impulse response of two passes is the product of the kernel with itself spread by 2 (Dammertz et al.
    2010).
    """
    light = np.zeros((SIZE, SIZE, 3))
    light[24, 24] = 1.0
    variance = np.ones((SIZE, SIZE))
    for step in (1, 2):
        light, variance = atrous.pass_over(light, variance, FLAT, step, OPEN)
    one = np.array([1.0, 4.0, 6.0, 4.0, 1.0]) / 16.0
    spread = np.zeros(9)
    spread[::2] = one
    row = np.convolve(one, spread)
    expected = np.zeros((SIZE, SIZE))
    expected[24 - 6 : 24 + 7, 24 - 6 : 24 + 7] = np.outer(row, row)
    assert np.max(np.abs(light - expected[..., None])) <= 2 * 60 * ULP


def test_variance_falls_with_the_squared_weights():
    """Independent noise of variance 1: a mean with weights w has variance sum w^2 (Schied et al. 2017)."""
    _, variance = atrous.pass_over(np.zeros((SIZE, SIZE, 3)), np.ones((SIZE, SIZE)), FLAT, 1, OPEN)
    expected = sum((k / 16.0) ** 2 for k in (1, 4, 6, 4, 1)) ** 2
    assert abs(variance[24, 24] - expected) <= 60 * ULP * expected


@pytest.mark.parametrize("guide", ["normal", "depth"])
def test_surfaces_do_not_mix(guide):
    """Two halves of different colour keep them when the guide tells them apart, and mix when nothing does."""
    color = np.zeros((16, 16, 3))
    color[:, :8], color[:, 8:] = 0.2, 0.8
    normal = np.zeros((16, 16, 3))
    normal[:, :8, 0], normal[:, 8:, 1] = 1.0, 1.0
    depth = np.ones((16, 16, 1))
    depth[:, 8:] = 1000.0
    told = frame(color, normal=normal) if guide == "normal" else frame(color, depth=depth)
    found, mixed = atrous.denoise(told, OPEN), atrous.denoise(frame(color), OPEN)
    assert np.max(np.abs(found - color)) <= 5 * 60 * ULP
    assert np.max(np.abs(mixed - color)) > 0.1


def test_albedo_is_kept_apart():
    """A texture in albedo under constant light comes back as it was."""
    albedo = np.random.default_rng(3).uniform(0.1, 0.9, (16, 16, 3))
    color = albedo * 0.7
    assert np.max(np.abs(atrous.denoise(frame(color, albedo), OPEN) - color)) <= 5 * 60 * ULP


def test_emitted_light_is_not_divided():
    """No albedo, no division: a light in front of nothing keeps its colour."""
    color, none = np.full((12, 12, 3), 3.0), np.zeros((12, 12, 3))
    nothing = frame(color, albedo=none, normal=none, depth=none[..., :1])
    assert np.max(np.abs(atrous.denoise(nothing) - color)) <= 5 * 60 * ULP * 3.0


def test_noise_falls():
    noise = np.random.default_rng(4).exponential(1.0, (32, 32, 1)) * np.ones(3)
    found = atrous.denoise(frame(0.5 * noise), Settings())
    assert np.var(found) < 0.1 * np.var(0.5 * noise)


# ---- blocks ----------------------------------------------------------------------------------------------


def blocks(size, patch, offset):
    """A picture of flat patches, each `offset` brighter than its neighbours, chessboard-like."""
    y, x = np.indices((size, size)) // patch
    return np.repeat(((y + x) % 2 * offset)[..., None], 3, axis=-1)


def test_flat_patches_jump_at_their_borders_alone():
    error = blocks(16, 4, 0.5)
    across, inside, n_across, n_inside = jumps(error, 4)
    # Three borders in each direction, sixteen pixels long, three channels.
    assert (n_across, n_inside) == (2 * 3 * 16 * 3, 2 * 12 * 16 * 3)
    assert (across, inside) == (0.5 * n_across, 0.0)
    assert blockiness([(error, np.zeros_like(error))], 4) == float("inf")


def test_blockiness_is_the_ratio_of_jumps():
    """Stripes of height 1/8 everywhere, and twice that where patches meet."""
    ramp = np.cumsum(np.where(np.arange(16) % 4 == 0, 0.25, 0.125))
    error = np.repeat((ramp[:, None] + ramp)[..., None], 3, axis=-1)
    assert blockiness([(error, np.zeros_like(error))] * 2, 4) == 2.0


def test_the_scene_s_own_edges_do_not_count():
    scene = blocks(16, 4, 0.5)
    noise = np.random.default_rng(5).normal(0.0, 0.1, scene.shape)
    assert blockiness([(scene, scene)], 4) == 1.0
    assert blockiness([(scene + noise, scene)], 4) == blockiness([(noise + scene, scene)], 4)


def test_pictures_without_borders_are_refused():
    image = np.zeros((16, 16, 3))
    with pytest.raises(InputError, match="a picture needs borders of patches of 16 pixels"):
        blockiness([(image, image)], 16)


def test_settings_are_the_source_s():
    assert Settings() == replace(
        Settings(), passes=5, sigma_depth=1.0, sigma_normal=128.0, sigma_luminance=4.0
    )
