"""Light transport: the ways to find a light agree, and light of lamps and skies is that of closed forms."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from statistical import assert_same_image, assert_strategies_agree

from wamnet.refimpl import rng
from wamnet.refimpl.errors import InputError
from wamnet.refimpl.light import render as R
from wamnet.refimpl.light import scenes, transport
from wamnet.refimpl.light.camera import camera_basis, camera_ray
from wamnet.refimpl.light.intersection import Hit, Surface, reflecting
from wamnet.refimpl.light.scene import Box, Camera, Light, Quad, Room, Scene, Sky
from wamnet.refimpl.light.transport import Settings


def render(scene, size=64, spp=2, seed=1, dtype="float32", **settings) -> R.Render:
    return R.render(scene, R.Job(size, size, spp, seed, Settings(**settings), dtype))


@pytest.mark.parametrize("name", ["minicubes", "cornell", "lone_light"])
def test_strategies_agree(name):
    """Only light samples, only BSDF samples and both combined estimate the same image."""
    assert_strategies_agree(scenes.canonical(name), depth=3, spp=4 if name == "minicubes" else 8)


@pytest.mark.parametrize("dtype", ["float32", "float64"])
@pytest.mark.parametrize("name", scenes.CANONICAL)
def test_every_number_has_the_world_s_type(name, dtype):
    scene, job = scenes.canonical(name), R.Job(9, 7, dtype=dtype)
    world, basis = (
        transport.build(scene, Settings(roulette_depth=0), dtype),
        camera_basis(scene.camera, dtype),
    )
    y, x = np.divmod(np.arange(63), 9)
    counters = transport.Counters(rng.counter(1), R.pixel_counter(x, y), rng.counter(0))
    path = R.start(basis, x.astype(dtype), y.astype(dtype), job.width, job.height, counters, dtype)
    path, surface, hit = transport.arrive(world, path)
    went_on, _ = transport.scatter(world, path, surface, hit, rng.counter(0), counters)
    layers = R.first_hit_layers(world, surface, hit, path.direction)
    floats = [*path, *went_on, *surface[:4], hit.t, *layers.values()]
    assert {str(values.dtype) for values in floats} == {dtype}
    assert {str(surface.light.dtype), str(hit.surface.dtype)} == {"int32"}


@pytest.mark.parametrize("strategy", transport.STRATEGIES)
def test_nothing_is_lit_from_behind_a_light(strategy):
    """A wall behind a light, which faces away from it, stays black: no strategy finds light there."""
    # shines along +z
    light = Light((-0.5, -0.5, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (1.0, 1.0, 1.0), 5.0)
    wall = Quad((-4.0, -4.0, -1.0), (8.0, 0.0, 0.0), (0.0, 8.0, 0.0), (0.9, 0.9, 0.9))
    scene = Scene("behind", Camera((0.0, 0.0, -0.5), (0.0, 0.0, -1.0)), quads=(wall,), lights=(light,))
    result = render(scene, 12, 8, strategy=strategy, max_depth=1)
    assert np.all(result.frame["albedo"] > 0.0)
    assert np.all(result.frame["color"] == 0.0)


@pytest.mark.parametrize("name", ["minicubes", "cornell"])
def test_russian_roulette_keeps_the_mean(name):
    scene = scenes.canonical(name)
    without = render(scene, spp=8, seed=1, max_depth=6)
    with_roulette = render(scene, spp=16, seed=2, max_depth=6, roulette_depth=1)
    assert_same_image(without, with_roulette)


def test_float32_and_float64_agree():
    """Same random numbers, so nearly the same image: Welch's test on the same seed finds no difference
    either."""
    scene = scenes.canonical("minicubes")
    single, double = (render(scene, dtype=dtype) for dtype in ("float32", "float64"))
    assert_same_image(single, double)
    difference = np.abs(single.frame["color"].astype(np.float64) - double.frame["color"])
    # A few paths fall on the other side of an edge; all others agree to rounding.
    # Of the pixels at most one in 50, each from one of 2 paths x 6 rays.
    assert np.mean(difference > 1e-4) <= 0.02


REFLECTANCE = st.tuples(*(st.floats(0.0, 1.0),) * 3)


@given(REFLECTANCE, REFLECTANCE, st.floats(0.0, 1.0), st.integers(0, 2**32 - 1))
def test_throughput_never_grows(wall, block, angle, seed):
    """beta of every path never exceeds 1 without roulette, and is never negative, whatever the
    reflectances."""
    c, s = np.cos(angle), np.sin(angle)
    scene = Scene(
        "energy",
        Camera((0.0, 0.0, 0.9), (0.0, 0.0, 0.0)),
        room=Room((-1.0,) * 3, (1.0,) * 3, (wall,) * 6),
        boxes=(Box((0.0, -0.5, 0.0), (0.3, 0.3, 0.3), block, ((c, 0.0, -s), (0.0, 1.0, 0.0), (s, 0.0, c))),),
        lights=(Light((-0.2, 0.99, -0.2), (0.4, 0.0, 0.0), (0.0, 0.0, 0.4), (1.0, 1.0, 1.0), 1.0),),
    )
    for path in paths(scene, seed):
        assert np.all(path.beta >= 0.0)
        assert np.all(path.beta <= 1.0)
        assert np.all(np.isfinite(path.radiance))
        assert np.all(path.radiance >= 0.0)
        # Directions stay unit vectors: a frame of some 20 roundings.
        assert np.max(np.abs(np.sum(path.direction**2, -1) - 1.0)) <= 40 * np.finfo(np.float32).eps


def paths(scene: Scene, seed: int, size: int = 8, depth: int = 4):
    """Yield the states of one path per pixel after each scattering."""
    world = transport.build(scene, Settings(max_depth=depth), np.float32)
    y, x = np.divmod(np.arange(size * size), size)
    counters = transport.Counters(rng.counter(seed), R.pixel_counter(x, y), rng.counter(0))
    u, v, _, _ = rng.uniforms(*counters, np.uint32(0), np.float32)
    basis = camera_basis(scene.camera, np.float32)
    path = transport.camera_path(*camera_ray(basis, x.astype("f4"), y.astype("f4"), u, v, size, size))
    for k in range(depth):
        path, surface, hit = transport.arrive(world, path)
        path, _ = transport.scatter(world, path, surface, hit, rng.counter(k), counters)
        yield path


def test_radiance_is_bounded_by_the_furnace():
    """Light that a closed room with albedo a can hold: no pixel's mean exceeds emission / (1 - a) of its
    brightest part."""
    scene = scenes.canonical("minicubes")
    dark = replace(scene, lights=(), room=replace(scene.room, emission=(1.0, 1.0, 1.0)))
    color = render(dark, 12, 16, max_depth=12).frame["color"]
    largest = max(max(r) for r in (*scene.room.reflectances, *(b.reflectance for b in scene.boxes)))
    assert np.max(color) <= 1.0 / (1.0 - largest)


def test_depth_adds_light_and_nothing_else():
    """With the same random numbers, one more scattering never darkens a pixel."""
    scene = scenes.canonical("cornell")
    images = [render(scene, 12, 8, max_depth=d, strategy="light").frame["color"] for d in range(5)]
    for less, more in pairwise(images):
        assert np.all(more >= less)
    assert np.all(images[-1].sum() > images[0].sum())


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"max_depth": -1}, "max_depth -1: must be an integer of 0 or more"),
        ({"max_depth": 2**31}, "max_depth 2147483648: must be below 2147483648, since random numbers"),
        ({"roulette_depth": 2**31}, "roulette_depth 2147483648: must be 0 or more, and below"),
        ({"max_depth": 2.5}, "max_depth 2.5: must be an integer of 0 or more"),
        ({"roulette_depth": -1}, "roulette_depth -1: must be 0 or more"),
        ({"strategy": "photon"}, r"strategy 'photon': unknown \(choose one of mis, light, bsdf"),
        ({"heuristic": "max"}, r"heuristic 'max': unknown \(choose one of balance, power"),
        ({"sampler": "halton"}, r"sampler 'halton': unknown \(choose one of pcg4d, sobol"),
        ({"max_depth": 1, "sampler": "net"}, "sampler 'net': samples camera rays only"),
    ],
)
def test_refuses_settings(settings, message):
    with pytest.raises(InputError, match=message):
        Settings(**settings)


def test_mis_weights_of_both_techniques_add_up_to_one():
    a, b = np.array([1e-3, 1.0, 50.0, 0.0, 1e12]), np.array([1.0, 1.0, 1e-6, 2.0, 3.0])
    for heuristic in transport.HEURISTICS:
        settings = Settings(heuristic=heuristic)
        total = transport.mis_weight(settings, a, b) + transport.mis_weight(settings, b, a)
        assert np.max(np.abs(total - 1.0)) <= 8 * 2.0**-52  # four roundings in each weight


def test_mis_weights_by_hand():
    """p = 1, q = 3: balance 1 / (1 + 3) = 1/4, power 1 / (1 + 9) = 1/10."""
    one, three = np.array([1.0]), np.array([3.0])
    assert transport.mis_weight(Settings(heuristic="balance"), one, three)[0] == 0.25
    assert transport.mis_weight(Settings(heuristic="power"), one, three)[0] == 0.1


def lit_by(*lights, reflectance=0.5, point=(0.0, 0.0, 0.0), dtype="float64"):
    """Return the unshadowed light (3,) of a horizontal surface under some lights."""
    scene = Scene("lit", Camera((0.0, 1.0, 5.0), (0.0, 0.0, 0.0)), lights=lights)
    world = transport.build(scene, Settings(), dtype)
    rows = [np.array([row], dtype) for row in (point, (0.0, 1.0, 0.0), (reflectance,) * 3, (0.0, 0.0, 0.0))]
    return transport.unshadowed(world, Surface(*rows, np.array([-1], np.int32)))[0]


def lamp(side, height, color=(1.0, 0.5, 0.25), power=3.0, x=0.0):
    """Return a square lamp that looks down, its middle above (x, 0, 0)."""
    corner = (x - side / 2, height, -side / 2)
    return Light(corner, (side, 0.0, 0.0), (0.0, 0.0, side), color, power)


@pytest.mark.parametrize("height", [0.1, 1.0, 7.0])
def test_unshadowed_light_on_the_axis_is_that_of_a_disk(height):
    """E = pi L R^2 / (h^2 + R^2), where R^2 = side^2 / pi and L = power color / (pi A)."""
    side, square = 2.0, 4.0 / np.pi
    radiance = 3.0 * np.array([1.0, 0.5, 0.25]) / (np.pi * side**2)
    expected = 0.5 * radiance * square / (height**2 + square)
    found = lit_by(lamp(side, height))
    # A dozen operations, each off by half a unit in the last place at most.
    assert np.all(np.abs(found - expected) <= 12 * np.finfo(np.float64).eps * expected)


def test_unshadowed_light_of_a_far_lamp_falls_with_the_square_and_both_cosines():
    """A small lamp 45 degrees off: L A cos cos / d^2, both cosines sqrt(1/2); A / (pi d^2) is below 2e-9."""
    found = lit_by(lamp(1e-3, 10.0, x=10.0), reflectance=1.0)
    expected = 3.0 * np.array([1.0, 0.5, 0.25]) / np.pi**2 * 0.5 / 200.0
    assert np.all(np.abs(found / expected - 1.0) <= 2e-9)


def test_unshadowed_light_is_linear_in_colours_and_adds_up():
    warm, cool = lamp(1.0, 2.0, (1.0, 0.6, 0.2)), lamp(0.5, 1.0, (0.1, 0.3, 0.9), x=1.0)
    both = lit_by(warm, cool)
    # Three roundings more or less for each of the two terms.
    assert np.all(np.abs(both - lit_by(warm) - lit_by(cool)) <= 6 * np.finfo(np.float64).eps * both)
    other = lit_by(replace(warm, color=(0.25, 0.15, 0.05)))
    assert np.all(np.abs(other - lit_by(warm) / 4.0) <= 6 * np.finfo(np.float64).eps * other)


@pytest.mark.parametrize("dtype", ["float32", "float64"])
def test_unshadowed_light_is_bounded_and_dark_behind_a_lamp(dtype):
    """At most reflectance L, wherever the surface is; nothing below the horizon, behind a lamp, or unlit."""
    limit = 0.5 * 3.0 / (np.pi * 1.0) * (1.0 + 1e-5)
    for height in (0.0, 1e-20, 1e-6, 1e-3, 0.3):
        assert 0.0 <= lit_by(lamp(1.0, height), dtype=dtype)[0] / limit <= 1.0
    assert not lit_by(lamp(1.0, -1.0), dtype=dtype).any()
    facing_up = replace(lamp(1.0, 1.0), edge_u=(0.0, 0.0, 1.0), edge_v=(1.0, 0.0, 0.0))
    assert not lit_by(facing_up, dtype=dtype).any()
    assert not lit_by(dtype=dtype).any()


def test_frames_have_unshadowed_light():
    """LTR-11: at one sample the layers are of one hit: the formula, written again, of what they say of it.

    Points are at least 0.2 from the lamps' middles, where light changes by at most (2 / 0.2 + 2 / R) L
    a unit, R = 0.6; float32 knows points below 8 to 2^-21, and normals and products to less.
    """
    scene = scenes.canonical("minicubes")
    frame = render(scene, 12, 1).frame
    point, normal, albedo = (frame[name].astype(np.float64) for name in ("position", "normal", "albedo"))
    expected, bound = np.zeros_like(point), 0.0
    for light in scene.lights:
        u, v = np.array(light.edge_u), np.array(light.edge_v)
        area = np.linalg.norm(np.cross(u, v))
        radiance = light.power * np.array(light.color) / (np.pi * area)
        offset = light.corner + u / 2 + v / 2 - point
        distance = np.linalg.norm(offset, axis=-1)
        assert distance.min() >= 0.2
        to_light = offset / distance[..., None]
        cosines = np.clip((to_light * normal).sum(-1), 0, 1) * np.clip(
            -to_light @ np.cross(u, v) / area, 0, 1
        )
        expected += (cosines * area / (distance**2 + area / np.pi))[..., None] * radiance * albedo / np.pi
        bound += 14.0 * radiance.max() * 2.0**-20
    assert np.max(np.abs(frame["unshadowed"] - expected)) <= bound
    assert expected.max() >= 1000 * bound


# ---- the layer direct --------------------------------------------------------------------------------------


def shaded(*lights, quads=(), samples=1, rays=1, reflectance=0.5, dtype="float64", sky=None):
    """Return the layers unshadowed and direct (3,) of a floor's point at the origin, under lights and sky."""
    floor = Quad((-9.0, 0.0, -9.0), (0.0, 0.0, 18.0), (18.0, 0.0, 0.0), (reflectance,) * 3)
    scene = Scene("lit", Camera((0.0, 1.0, 5.0), (0.0, 0.0, 0.0)), quads=(floor, *quads), lights=lights)
    world = transport.build(replace(scene, environment=sky), Settings(), dtype)
    one = np.ones((samples, 1), dtype)
    surface = reflecting(*(one * np.array(row, dtype) for row in ((0, 0, 0), (0, 1, 0), (reflectance,) * 3)))
    hit = Hit(one[:, 0], np.zeros(samples, np.int32))
    counters = transport.Counters(rng.counter(3), rng.counter(8), rng.counter(np.arange(samples)))
    parts = [transport.direct(world, surface, hit, counters, rays, np.uint32(n)) for n in range(rays)]
    return transport.unshadowed(world, surface)[0], sum(parts).mean(axis=0)


@pytest.mark.parametrize("dtype", ["float32", "float64"])
def test_direct_light_without_shadows_has_no_noise(dtype):
    """LTR-12: lamps of one hue, wherever they are: the unshadowed light, up to a few roundings."""
    lamps = [lamp(1.0, 2.0), lamp(0.5, 1.0, power=1.0, x=1.0), lamp(0.25, 3.0, power=0.0)]
    unshadowed, direct = shaded(*lamps, samples=4, rays=3, dtype=dtype)
    assert unshadowed.min() > 0.0
    assert np.all(np.abs(direct - unshadowed) <= 32 * np.finfo(dtype).eps * unshadowed)


@pytest.mark.parametrize(("samples", "rays"), [(64, 1), (4, 16), (1, 64)])
def test_direct_light_is_the_share_that_is_seen(samples, rays):
    """A plate hides the half of a lamp beyond x = 0: exactly half of the points of a net are in each half."""
    plate = Quad((0.0, 1.0, -3.0), (3.0, 0.0, 0.0), (0.0, 0.0, 6.0), (0.0, 0.0, 0.0))
    unshadowed, direct = shaded(lamp(1.0, 2.0), quads=(plate,), samples=samples, rays=rays)
    assert np.all(np.abs(direct - unshadowed / 2) <= 1e-9 * unshadowed)
    covered = replace(plate, corner=(-3.0, 1.0, -3.0), edge_u=(6.0, 0.0, 0.0))
    assert not shaded(lamp(1.0, 2.0), quads=(covered,), samples=samples, rays=rays)[1].any()


WHITE, SUNNY = (0.25, 0.5, 0.75), (3.0, 2.0, 1.0)


@pytest.mark.parametrize("dtype", ["float32", "float64"])
def test_light_of_an_open_sky_has_no_noise(dtype):
    """ENV-7: a uniform sky gives reflectance times its radiance, a sun irradiance times cosine / pi."""
    uniform = Sky(WHITE, WHITE, WHITE, (0.0, 1.0, 0.0), (0.0,) * 3, 100.0)
    sunny = replace(uniform, sun_direction=(0.6, 0.8, 0.0), sun_irradiance=SUNNY, sun_concentration=1e4)
    expected = 0.5 * np.array(WHITE)
    black = (0.0,) * 3
    alone = replace(sunny, zenith=black, horizon=black, ground=black)
    for sky, light in ((uniform, expected), (alone, 0.4 / np.pi * np.array(SUNNY))):
        found = shaded(samples=4, rays=3, dtype=dtype, sky=sky)[1]
        assert np.all(np.abs(found - light) <= 32 * np.finfo(dtype).eps * light)
    both = shaded(lamp(1.0, 2.0), samples=16, rays=4, sky=sunny)
    light = both[0] + expected + 0.4 / np.pi * np.array(SUNNY)
    assert np.all(np.abs(both[1] - light) <= light.sum() / 32)  # points of a net in each of three intervals


def test_what_hides_the_sun_and_half_of_the_sky_takes_their_light():
    """ENV-7: the sun behind a plate; a wall that hides exactly the half of a uniform sky."""
    uniform = Sky(WHITE, WHITE, WHITE, (0.0, 1.0, 0.0), (0.0,) * 3, 100.0)
    wall = Quad((1e-6, -1e5, -1e5), (0.0, 2e5, 0.0), (0.0, 0.0, 2e5), (0.0, 0.0, 0.0))
    half = shaded(quads=(wall,), samples=64, rays=4, sky=uniform)[1]
    assert np.all(np.abs(half - 0.25 * np.array(WHITE)) <= 0.01)
    plate = Quad((-1.0, 1.0, -1.0), (2.0, 0.0, 0.0), (0.0, 0.0, 2.0), (0.0, 0.0, 0.0))
    black = (0.0,) * 3
    sun = replace(
        uniform, zenith=black, horizon=black, ground=black, sun_irradiance=SUNNY, sun_concentration=1e6
    )
    assert shaded(samples=64, sky=sun)[1].all()
    assert shaded(quads=(plate,), samples=64, sky=sun)[1].max() < 1e-4 * shaded(samples=64, sky=sun)[1].max()


def test_the_layer_changes_no_other():
    """RND-2f: bits of colour and features, with and without their own rays; its facts are reported."""
    scene = scenes.canonical("cornell")
    for rays in (0, 4):
        plain = R.Job(12, 12, 2, 5, Settings(max_depth=2), feature_spp=rays)
        without, found = (R.render(scene, replace(plain, shadow_rays=n)).frame for n in (0, 2))
        assert "direct" not in without
        assert (without.info.get("shadow_rays"), found.info["shadow_rays"]) == (None, "2")
        assert all(np.array_equal(found[name], without[name]) for name in without.layers)
        first = R.feature_job(plain) or plain
        first = replace(first, settings=replace(first.settings, max_depth=0), color=True)
        light = found["direct"].sum() - R.render(scene, first).frame["color"].sum()  # less what is emitted
        assert 0.0 < light < found["unshadowed"].sum()
    emitted = R.render(scenes.canonical("furnace"), R.Job(8, 8, settings=Settings(0))).frame["color"]
    found = R.render(scenes.canonical("furnace"), R.Job(8, 8, shadow_rays=1)).frame["direct"]
    assert np.array_equal(found, emitted)  # without lamps and sky: what the first hits emit
    assert emitted.any()
    with pytest.raises(InputError, match="shadow_rays 65: must be an integer from 0 to 64"):
        R.Job(4, 4, shadow_rays=65)
