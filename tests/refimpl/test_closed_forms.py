"""Scenes whose radiance is known in closed form."""

import numpy as np
import pytest
from statistical import assert_all_plausible, z_p

from wamnet.refimpl.light import render as R
from wamnet.refimpl.light import scenes
from wamnet.refimpl.light.scene import Camera, Light, Scene, Sphere, Vector
from wamnet.refimpl.light.transport import Settings


def render(scene: Scene, width=16, height=16, spp=1, dtype="float64", seed=3, **settings) -> R.Render:
    return R.render(scene, R.Job(width, height, spp, seed, Settings(**settings), dtype))


@pytest.mark.parametrize("dtype", ["float32", "float64"])
@pytest.mark.parametrize("albedo", [0.0, 0.2, 0.5, 0.8, 0.95])
@pytest.mark.parametrize("depth", [0, 1, 2, 5, 20])
def test_furnace(albedo, depth, dtype):
    """Every wall emits 1 and reflects a of what arrives, so radiance is the same everywhere: L = 1 + a L.

    After at most d scatterings L = 1 + a + ... + a^d = (1 - a^(d+1)) / (1 - a). Cosine-weighted directions
    make f cos / pdf = a exactly, so every single path has this value: no statistics, only rounding. d+1 sums
    and d products, all positive: relative error at most (2 d + 2) u.
    """
    color = (
        render(scenes.furnace(albedo=albedo), max_depth=depth, dtype=dtype).frame["color"].astype(np.float64)
    )
    expected = (1.0 - albedo ** (depth + 1)) / (1.0 - albedo)
    # The albedo itself is rounded to the type: d a^(d-1) u more, at most d u of the sum.
    bound = (3 * depth + 3) * np.finfo(dtype).eps * expected
    assert np.max(np.abs(color - expected)) <= bound


@pytest.mark.parametrize("albedo", [0.5, 0.9])
def test_furnace_with_russian_roulette(albedo):
    """Roulette keeps the mean: 1 / (1 - a) within the standard error; z-test of the image's mean,
    significance 0.01."""
    result = render(scenes.furnace(albedo=albedo), 64, 64, 8, max_depth=400, roulette_depth=1)
    mean, n = result.frame["color"][..., 0].mean(), 64 * 64 * 8
    # Samples of all pixels have the same distribution: their variance is that of the mean image plus within
    # pixels.
    variance = result.color_variance[..., 0].mean()
    assert variance > 0.0
    assert_all_plausible(z_p(np.array(mean - 1.0 / (1.0 - albedo)), np.sqrt(variance / n)))


def test_sphere_in_a_white_sky():
    """A Lambertian sphere of albedo a under background 1 shows a after one scattering (it is convex), and the
    sky 1."""
    sphere = Sphere((0.0, 0.0, 0.0), 1.0, (0.6, 0.3, 0.1))
    scene = Scene(
        "sky", Camera((0.0, 0.0, 4.0), (0.0, 0.0, 0.0)), spheres=(sphere,), background=(1.0, 1.0, 1.0)
    )
    result = render(scene, 33, 33, max_depth=3)
    hit = result.frame["depth"][..., 0] > 0.0
    assert 100 < hit.sum() < 33 * 33 - 100
    expected = np.where(hit[..., None], np.array(sphere.reflectance), 1.0)
    # Two products, two sums.
    assert np.max(np.abs(result.frame["color"] - expected)) <= 8 * np.finfo(np.float64).eps


def test_empty_scene_shows_its_background():
    result = render(scenes.empty(background=0.25))
    assert np.all(result.frame["color"] == 0.25)
    for layer in ("albedo", "normal", "depth", "position"):
        assert np.all(result.frame[layer] == 0.0)


def rectangle_irradiance(x: float, z: float, light: Light, height: float) -> float:
    """Irradiance at (x, 0, z), facing up, from a light in the plane y = height that faces down, per unit of
    radiance.

    The form factor from a small surface to a parallel rectangle with a corner above it (Howell, "A Catalog of
    Radiation Heat Transfer Configuration Factors", B-3) is F(a, b) = 1/(2 pi) [ A/sqrt(1+A^2)
    atan(B/sqrt(1+A^2)) + B/sqrt(1+B^2) atan(A/sqrt(1+B^2)) ], A = a/h, B = b/h, odd in a and in b; four
    corners with signs give any rectangle, and E = pi L F.
    """

    def corner_factor(a: float, b: float) -> float:
        p, q = a / height, b / height
        s, t = np.hypot(1.0, p), np.hypot(1.0, q)
        return float((p / s * np.arctan(q / s) + q / t * np.arctan(p / t)) / (2.0 * np.pi))

    x0, x1 = light.corner[0] - x, light.corner[0] + light.edge_u[0] - x
    z0, z1 = light.corner[2] - z, light.corner[2] + light.edge_v[2] - z
    factor = corner_factor(x1, z1) - corner_factor(x0, z1) - corner_factor(x1, z0) + corner_factor(x0, z0)
    return float(np.pi * factor)


def looking_down(scene: Scene, x: float, z: float, below: float) -> Scene:
    """Return the scene seen through a camera that looks straight down at (x, 0, z) with a very narrow
    view."""
    up: Vector = (0.0, 0.0, 1.0)
    camera = Camera((x, below, z), (x, 0.0, z), up, vertical_fov_deg=0.01)
    return Scene(scene.name, camera, quads=scene.quads, lights=scene.lights)


@pytest.mark.parametrize("strategy", ["mis", "light", "bsdf"])
@pytest.mark.parametrize("height", [0.5, 2.0])
def test_lone_light(strategy, height):
    """Floor radiance after one scattering is reflectance / pi * E; z-test at six points, significance 0.01.

    The view is 0.01 degrees wide, so the points of a picture differ by less than 1e-4 scene units and the
    closed form at its centre holds within a share of 1e-4, far below the statistical error of about 1 %.
    """
    scene = scenes.lone_light(height=height)
    light = scene.lights[0]
    radiance = light.power / (np.pi * 4.0)
    p = []
    for x, z in ((0.0, 0.0), (0.7, 0.2), (1.5, 0.0), (2.0, 2.0), (0.0, 3.0), (4.0, -1.0)):
        result = render(looking_down(scene, x, z, 0.4 * height), 32, 32, 32, max_depth=1, strategy=strategy)
        expected = 0.5 / np.pi * radiance * rectangle_irradiance(x, z, light, height)
        samples = result.frame["color"][..., 0]
        error = np.sqrt(result.color_variance[..., 0].mean() / (32 * 32 * 32))
        p.append(z_p(samples.mean() - expected, error))
    assert_all_plausible(np.array(p))
