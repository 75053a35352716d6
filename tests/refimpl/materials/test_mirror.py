"""Mirrors: the law of reflection, exact pictures of what they show, and the weight of lights seen in them."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from vertices import local, local_direction, site

from wamnet.refimpl.light import render as R
from wamnet.refimpl.light.materials import Mirror
from wamnet.refimpl.light.materials.material import SINGLE_PDF
from wamnet.refimpl.light.scene import Camera, Light, Quad, Scene, Sphere
from wamnet.refimpl.light.transport import STRATEGIES, Settings

EPS = 2.0**-52


@pytest.mark.parametrize("dtype", ["float32", "float64"])
def test_mirror_ball_in_a_white_sky_is_its_reflectance(dtype):
    ball = Sphere((0.0, 0.0, 0.0), 1.0, (0.75, 0.5, 1.0), material=Mirror())
    camera = Camera((0.0, 0.0, 4.0), (0.0, 0.0, 0.0))
    scene = Scene("sky", camera, spheres=(ball,), background=(1.0, 1.0, 1.0))
    frame = R.render(scene, R.Job(24, 24, 1, 3, Settings(max_depth=3), dtype)).frame
    hit = frame["depth"] > 0.0
    assert 50 < hit.sum() < 500
    assert np.array_equal(frame["color"], np.where(hit, [0.75, 0.5, 1.0], 1.0))
    assert np.array_equal(frame["albedo"], np.where(hit, [0.75, 0.5, 1.0], 0.0))  # SHD-5


@pytest.mark.parametrize("strategy", STRATEGIES)
def test_light_in_a_mirror_has_its_full_radiance(strategy):
    """A camera looks into a tilted mirror, which shows a light: reflectance times radiance in every strategy.

    Beside the mirror is a matte wall, so that lights are sampled.
    """
    mirror = Quad((-1.0, -1.0, -1.0), (2.0, 0.0, 2.0), (0.0, 2.0, 0.0), (0.5, 0.25, 1.0), material=Mirror())
    wall = Quad((-9.0, -9.0, -9.0), (18.0, 0.0, 0.0), (0.0, 18.0, 0.0), (0.5, 0.5, 0.5))
    # The mirror turns -z into -x; the light is there and shines along +x.
    light = Light((-5.0, -3.0, -3.0), (0.0, 6.0, 0.0), (0.0, 0.0, 6.0), (1.0, 1.0, 1.0), 36.0 * np.pi)
    camera = Camera((0.0, 0.0, 3.0), (0.0, 0.0, 0.0), vertical_fov_deg=2.0)
    scene = Scene("mirror", camera, quads=(mirror, wall), lights=(light,))
    color = R.render(scene, R.Job(8, 8, 2, 1, Settings(max_depth=1, strategy=strategy), "float64")).frame[
        "color"
    ]
    # Radiance 36 pi / (pi 36) = 1, to some roundings.
    assert np.max(np.abs(color - [0.5, 0.25, 1.0])) <= 16 * EPS


@given(st.floats(0.0, 1.0), st.floats(-np.pi, np.pi))
def test_angle_out_is_angle_in(cosine, phi):
    """x and y change their sign, z stays: a dozen roundings, and those of two turns."""
    wo = local_direction(np.array([cosine]), phi)
    at = site(wo, Mirror(), (0.9, 0.5, 0.0))
    direction, beta, pdf, through = Mirror.sample(at, *np.zeros((3, 1)))
    assert np.max(np.abs(local(direction) - wo * [-1, -1, 1])) <= 32 * EPS
    assert np.array_equal(beta, at.tinted)
    assert pdf[0] == SINGLE_PDF
    assert through is None
