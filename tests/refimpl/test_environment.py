"""The sky: its sampling against its density, light that it sends in closed form, and agreement of all
strategies."""

from dataclasses import replace

import numpy as np
import pytest
from statistical import (
    SIGNIFICANCE,
    assert_all_plausible,
    assert_strategies_agree,
    chi_square_p,
    integrate,
    sidak,
    z_p,
)
from vertices import uniforms

from wamnet.refimpl import vectors
from wamnet.refimpl.frame import Frame, validate
from wamnet.refimpl.light import environment, scenes, transport
from wamnet.refimpl.light import render as R
from wamnet.refimpl.light.scene import Camera, Light, Quad, Scene, Sky, Sphere
from wamnet.refimpl.light.transport import Settings

SAMPLES = 1 << 16
GREY = (0.5, 0.5, 0.5)
WHITE = Sky((1.0,) * 3, (1.0,) * 3, (1.0,) * 3)
SKY = Sky((0.2, 0.3, 0.6), (0.7, 0.7, 0.7), (0.2, 0.1, 0.1), (1.0, 2.0, -1.0), (2.0, 1.0, 0.5), 20.0)
PLANE = Quad((-500.0, 0.0, -500.0), (0.0, 0.0, 1000.0), (1000.0, 0.0, 0.0), GREY)
DOWN = Camera((0.0, 1.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 1.0)


def built(sky, dtype=np.float64):
    return environment.build(sky, dtype)


def around(sky, points=48):
    """Return directions (P, 3) and weights (P,) of a quadrature over the sphere around the sun, fine near it.

    Gauss's rule in 1 - cos, on three intervals, times even steps around the sun. What is smooth in 1 - cos,
    such as the density, has no error but rounding; the gradient's corner at the horizon costs 6e-6.
    """
    nodes, weights = np.polynomial.legendre.leggauss(points)
    parts = []
    for low, high in ((0.0, 0.02), (0.02, 0.2), (0.2, 2.0)):
        versine = low + 0.5 * (high - low) * (nodes + 1)
        phi = (np.arange(2 * points) + 0.5) * np.pi / points
        v, p = np.meshgrid(versine, phi, indexing="ij")
        sine = np.sqrt(v * (2 - v))
        local = np.stack([sine * np.cos(p), sine * np.sin(p), 1 - v], axis=-1).reshape(-1, 3)
        sun = np.broadcast_to(built(sky).sun, local.shape)
        world = environment.sampling.to_world(local, sun)
        parts.append((world, np.repeat(weights, 2 * points) * 0.5 * (high - low) * np.pi / points))
    return tuple(np.concatenate(part) for part in zip(*parts, strict=True))


@pytest.mark.parametrize("concentration", [0.0, 20.0, 1000.0])
def test_directions_chi_square(concentration):
    """Cells of direction in (height, azimuth about y); their share by counting a fine grid of the density.

    The grid has 24 x 24 points a cell by Gauss's rule; the sun's lobe of k = 1000 is 0.05 wide, a quarter of
    a cell."""
    sky = built(replace(SKY, sun_concentration=concentration))
    found = environment.sample(sky, *uniforms(SAMPLES)[:3])
    heights, angles = np.linspace(-1, 1, 17), np.linspace(-np.pi, np.pi, 33)
    observed, _, _ = np.histogram2d(found[:, 1], np.arctan2(found[:, 2], found[:, 0]), bins=(heights, angles))
    nodes, weights = np.polynomial.legendre.leggauss(24)
    y, phi = np.meshgrid(
        (heights[:-1, None] + (nodes + 1) / 16).ravel(),
        (angles[:-1, None] + (nodes + 1) * np.pi / 32).ravel(),
        indexing="ij",
    )
    sine = np.sqrt(1 - y * y)
    pdf = environment.pdf(sky, np.stack([sine * np.cos(phi), y, sine * np.sin(phi)], axis=-1))
    share = np.einsum("aibj,i,j->ab", pdf.reshape(16, 24, 32, 24), weights, weights) / 16 * np.pi / 32
    assert share.sum() == pytest.approx(1.0, abs=1e-7)  # the narrow lobe costs the rule 5e-9
    assert chi_square_p(observed, share * SAMPLES) >= sidak(SIGNIFICANCE, 3)


def test_light_of_all_directions_is_what_the_shares_assume():
    """Quadrature of the radiance: pi (zenith + 2 horizon + ground) and the sun's irradiance, per channel."""
    directions, weights = around(SKY)
    total = weights @ environment.radiance(built(SKY), directions)
    everywhere = np.pi * (np.array(SKY.zenith) + 2 * np.array(SKY.horizon) + np.array(SKY.ground))
    assert total == pytest.approx(everywhere + SKY.sun_irradiance, rel=2e-5)
    assert weights @ environment.pdf(built(SKY), directions) == pytest.approx(1.0, abs=1e-12)
    expected = sum(SKY.sun_irradiance) / sum(everywhere + SKY.sun_irradiance)
    assert built(SKY).sun_share == pytest.approx(expected, rel=1e-12)


def test_half_of_the_sun_s_light_is_near():
    """1 - cos is below 1 / (1 + k) for half of the samples of a sky that is all sun: a binomial z-test."""
    black = replace(SKY, zenith=(0.0,) * 3, horizon=(0.0,) * 3, ground=(0.0,) * 3)
    sky = built(black)
    assert sky.sun_share == 1.0
    cosine = vectors.dot(environment.sample(sky, *uniforms(SAMPLES)[:3]), sky.sun)
    p = z_p(np.array(np.mean(1.0 - cosine < 1.0 / 21.0) - 0.5), np.array(0.5 / np.sqrt(SAMPLES)))
    assert p >= SIGNIFICANCE


def test_a_black_sky_is_black():
    sky = built(Sky((0.0,) * 3, (0.0,) * 3, (0.0,) * 3))
    assert sky.sun_share == 0.0
    assert np.all(environment.radiance(sky, np.eye(3)) == 0.0)
    assert np.all(np.isfinite(environment.sample(sky, *uniforms(64)[:3])))


def plane_radiance(sky, camera=DOWN, **settings):
    """Return mean and standard error of the radiance of a plane that faces up."""
    scene = Scene("plane", camera, quads=(PLANE,), environment=sky)
    result = R.render(scene, R.Job(32, 32, 16, 3, Settings(max_depth=1, **settings), "float64"))
    error = np.sqrt(result.color_variance.reshape(-1, 3).mean(axis=0) / (32 * 32 * 16))
    return result.frame["color"].reshape(-1, 3).mean(axis=0), error


@pytest.mark.parametrize("strategy", transport.STRATEGIES)
@pytest.mark.parametrize("concentration", [0.0, 50.0])
def test_plane_under_the_sky(strategy, concentration):
    """reflectance / pi times the irradiance; z-test per channel.

    The sky: the integral of (h + (z - h) y) y over the upper half is 2 pi (h / 2 + (z - h) / 3). The sun,
    straight up: the integral of its lobe times y, by quadrature of one variable."""
    up = replace(SKY, sun_direction=(0.0, 3.0, 0.0), sun_concentration=concentration)
    zenith, horizon = np.array(up.zenith), np.array(up.horizon)
    lobe = integrate.quad(
        lambda y: y * (1 + 2 * concentration) / (2 * (1 + concentration * (1 - y)) ** 2), 0.0, 1.0
    )[0]
    irradiance = 2 * np.pi * (horizon / 2 + (zenith - horizon) / 3) + lobe * np.array(up.sun_irradiance)
    mean, error = plane_radiance(up, strategy=strategy)
    assert_all_plausible(z_p(mean - 0.5 / np.pi * irradiance, error))


@pytest.mark.parametrize("strategy", transport.STRATEGIES)
def test_white_furnace(strategy):
    """A matte plane of reflectance 1/2 under a white sky: 1/2, as under the background 1."""
    mean, error = plane_radiance(WHITE, strategy=strategy)
    # Where every sample has the same value, the rounding of 16384 sums is all that differs: 2^14 u = 1.8e-12.
    assert_all_plausible(z_p(mean - 0.5, np.maximum(error, 2.0**-39)))


@pytest.mark.parametrize("lit", [False, True])
def test_strategies_agree(lit):
    """With and without a lamp (ENV-4): all ways to find light estimate the same image."""
    lamp = Light((-0.5, 2.0, -0.5), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0), (1.0, 1.0, 1.0), 4.0)
    ball = Sphere((0.0, 0.6, 0.0), 0.6, (0.8, 0.4, 0.4))
    scene = Scene("day", Camera((0.0, 1.0, 3.5), (0.0, 0.4, 0.0)), quads=(PLANE,), spheres=(ball,))
    scene = replace(scene, environment=SKY, lights=(lamp,) if lit else ())
    assert_strategies_agree(scene, depth=2, size=32)


def test_the_sun_is_a_layer_where_there_is_one():
    """ENV-6: a unit vector, the same in all pixels, in the frame's kind of numbers; else no layer."""
    frame = Frame({"depth": np.ones((2, 3, 1), np.float32)}, {"spp": "1"})
    sky = Sky(WHITE, WHITE, WHITE, sun_direction=(0.0, 3.0, 4.0), sun_irradiance=(0.0, 0.0, 1e-3))
    scene = Scene("lit", Camera((0.0, 0.0, 0.0), (0.0, 0.0, -1.0)), environment=sky)
    found = environment.with_sun(scene, frame)
    assert found["sun"].tolist() == [[[0.0, np.float32(0.6), np.float32(0.8)]] * 3] * 2
    assert (found["sun"].dtype, found.info) == (np.float32, frame.info)
    validate(found)
    for dark in (replace(sky, sun_irradiance=(0.0,) * 3), None):
        assert environment.sun_of(replace(scene, environment=dark)) is None
        assert environment.with_sun(replace(scene, environment=dark), frame) is frame


def test_the_sun_of_the_layer_is_the_one_that_lights():
    """ENV-6: nowhere does the sky send more than from there."""
    scene = scenes.canonical("daylight", time=1.0)
    sun = environment.sun_of(scene)
    built = environment.build(scene.environment, np.float64)
    others = np.random.default_rng(0).standard_normal((1000, 3))
    others /= np.linalg.norm(others, axis=1, keepdims=True)
    assert environment.radiance(built, sun)[0] > environment.radiance(built, others)[:, 0].max()
