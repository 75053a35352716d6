"""Features past mirrors and glass: closed forms of ways, ends and tints; first hits without any of them."""

from dataclasses import replace

import numpy as np
import pytest

from wamnet.refimpl import rng
from wamnet.refimpl.frame import FIRST_HIT, SEEN, USUAL
from wamnet.refimpl.light import following, scenes, shading, transport
from wamnet.refimpl.light import render as R
from wamnet.refimpl.light.materials import Conductor, Dielectric, Mirror
from wamnet.refimpl.light.materials.conductor import LARGEST_FOLLOWED
from wamnet.refimpl.light.scene import Box, Camera, Light, Quad, Scene
from wamnet.refimpl.light.shapes.quad import light_radiance
from wamnet.refimpl.light.transport import Counters, Settings

CAMERA = Camera((0.0, 0.0, 0.0), (0.0, 0.0, -1.0))
RED, TINT = (0.75, 0.25, 0.125), (0.5, 0.875, 0.25)
U = float(np.finfo(np.float32).eps) / 2
NEAR = 64 * U
"""Two intersections of some twenty operations each, and an origin that is lifted off by 2^-18 of a length at
most (ISC-9), which the hit's distance is short of."""

LIFT = 2.0**-12
"""Far more than rays are lifted off surfaces by within some ten units, far less than surfaces are apart."""


def wall(z: float, color=RED, material=None) -> Quad:
    """Return a large square in the plane z."""
    return Quad((-50.0, -50.0, z), (100.0, 0.0, 0.0), (0.0, 100.0, 0.0), color, material=material)


def looked(scene: Scene, max_depth: int = 5, lanes: int = 1):
    """Return the layers of rays from the origin along -z, one of each sample, added up over a path."""
    world = transport.build(scene, Settings(max_depth=max_depth), np.float32)
    counters = Counters(rng.counter(1), rng.counter(0), rng.counter(np.arange(lanes)))
    direction = np.broadcast_to(np.array([0.0, 0.0, -1.0], np.float32), (lanes, 3))
    path = transport.camera_path(np.zeros_like(direction), direction)
    way, most, found = following.begin(direction), following.most_followed(world), {}
    alive = np.ones(lanes, bool)
    with np.errstate(all="ignore"):
        for depth in range(max_depth + 1):
            path, surface, hit = transport.arrive(world, path)
            way, seen = following.see(world, way, path, surface, hit, rng.counter(depth), most)
            for name, values in seen.items():
                now = np.where(alive.reshape(-1, *[1] * (values.ndim - 1)), values, 0.0)
                found[name] = found.get(name, 0.0) + now
            path, going = transport.scatter(world, path, surface, hit, rng.counter(depth), counters)
            alive = alive & going
    assert not (way.going & alive).any()
    return found


def product(*colors) -> np.ndarray:
    return np.prod(np.array(colors, np.float32), axis=0, dtype=np.float32)


def test_a_mirror_shows_the_wall_behind_the_camera():
    """FOL-1, FOL-2: reflectance times tint (powers of two: exact), the wall's own normal, 2 + 5 units."""
    scene = Scene("mirror", CAMERA, quads=(wall(-2.0, TINT, Mirror()), wall(3.0)))
    found = looked(scene)
    assert np.array_equal(found["seen_albedo"][0], product(RED, TINT))
    assert np.array_equal(found["seen_normal"][0], [0.0, 0.0, -1.0])
    assert abs(found["seen_depth"][0] - 7.0) <= LIFT
    assert np.abs(found["seen_position"][0] - [0.0, 0.0, 3.0]).max() <= NEAR


def test_a_pane_of_glass_shows_the_wall_behind_it_or_the_one_it_mirrors():
    """FOL-2: each path sees what it meets: k passages or reflections are k tints, and a way of its own."""
    pane = Box((0.0, 0.0, -2.5), (20.0, 20.0, 0.5), TINT, material=Dielectric(1.5))
    scene = Scene("pane", CAMERA, boxes=(pane,), quads=(wall(-5.0), wall(1.0, (0.5,) * 3)))
    found = looked(scene, lanes=512)
    # mirrored at the front; through; once to and fro inside, and back
    ways = [(1, (0.5,) * 3, 2 + 3), (2, RED, 5), (3, (0.5,) * 3, 2 + 2 + 3), (4, RED, 7)]
    count = 0
    for passed, color, length in ways:
        expected = product(color, *[TINT] * passed)
        these = np.abs(found["seen_depth"] - length) <= LIFT
        these &= np.all(found["seen_albedo"] == expected, axis=-1)
        assert these.any() or passed > 2, passed
        count += int(these.sum())
    # what is left is inside still: past four surfaces the way ends on the pane
    inside = np.abs(found["seen_position"][..., 2] + 2.5) <= 0.5 + LIFT
    assert count + int(inside.sum()) == 512


@pytest.mark.parametrize("roughness", [0.001, LARGEST_FOLLOWED])
def test_the_tint_of_a_metal_that_is_nearly_a_mirror_multiplies(roughness):
    """FOL-3, CDR-6: of the normals that are seen from above, the share within 20 degrees is 0.93 at least,
    tan^2 / (alpha^2 + tan^2). There Schlick adds (1 - cos)^5 < 1e-6, and shadowing takes 0.002,
    2 z / (z + q) at 40 degrees. The bounds on shares leave eight standard deviations of 256 paths."""
    scene = Scene("metal", CAMERA, quads=(wall(-2.0, TINT, Conductor(roughness)), wall(3.0)))
    found = looked(scene, lanes=256)
    share = found["seen_albedo"] / product(RED, TINT)
    assert np.mean(np.all(np.abs(share - 1.0) <= 0.003, axis=-1)) >= 0.8
    assert np.mean(found["seen_depth"] >= 7.0 - LIFT) >= 0.9


def test_a_rough_metal_is_seen_itself():
    """FOL-3: beyond the limit features are those of the first hit, to the bit."""
    rough = np.nextafter(LARGEST_FOLLOWED, 1.0) + 1e-6
    scene = Scene("metal", CAMERA, quads=(wall(-2.0, TINT, Conductor(float(rough))), wall(3.0)))
    assert not shading.ever_follows(transport.build(scene, Settings()).materials)
    assert np.array_equal(looked(scene)["seen_albedo"][0], product(TINT))


@pytest.mark.parametrize(("max_depth", "most"), [(9, following.MOST_FOLLOWED), (2, 2), (0, 0)])
def test_a_mirror_that_faces_a_mirror_ends_at_the_limit(max_depth, most):
    """FOL-4: the last mirror is seen itself, most + 1 tints and 1 + 3 (most - 1) + ... units away."""
    scene = Scene("mirrors", CAMERA, quads=(wall(-1.0, TINT, Mirror()), wall(2.0, TINT, Mirror())))
    found = looked(scene, max_depth)
    assert np.array_equal(found["seen_albedo"][0], product(*[TINT] * (most + 1)))
    assert abs(found["seen_depth"][0] - (1.0 + 3.0 * most)) <= LIFT


def test_a_way_into_the_sky_is_a_miss_and_a_lamp_is_seen():
    """FOL-1: as first hits are: of the sky all layers but its light are 0, and a lamp reflects nothing."""
    mirror = wall(-2.0, TINT, Mirror())
    missed = looked(Scene("sky", CAMERA, quads=(mirror,), background=RED))
    assert np.array_equal(missed.pop("seen_emission")[0], product(RED, TINT))
    assert all(not values.any() for values in missed.values())
    lamp = Light((-1.0, 1.0, 3.0), (2.0, 0.0, 0.0), (0.0, -2.0, 0.0), RED, 4.0)
    lit = looked(Scene("lamp", CAMERA, quads=(mirror,), lights=(lamp,)))
    assert np.array_equal(lit["seen_emission"][0], product(light_radiance(lamp), TINT))
    assert not lit["seen_albedo"].any()
    assert np.array_equal(lit["seen_normal"][0], [0.0, 0.0, -1.0])
    assert abs(lit["seen_depth"][0] - 7.0) <= LIFT


def test_a_lamp_is_black_behind_and_a_wall_shows_no_light_of_lamps():
    """FOL-1: what is emitted towards the path, not what is reflected."""
    mirror = wall(-2.0, TINT, Mirror())
    behind = Light((-1.0, -1.0, 3.0), (2.0, 0.0, 0.0), (0.0, 2.0, 0.0), RED, 4.0)
    assert not looked(Scene("behind", CAMERA, quads=(mirror,), lights=(behind,)))["seen_emission"].any()
    aside = Light((5.0, 1.0, 2.0), (2.0, 0.0, 0.0), (0.0, -2.0, 0.0), RED, 4.0)
    lit = looked(Scene("aside", CAMERA, quads=(mirror, wall(3.0)), lights=(aside,)))
    assert not lit["seen_emission"].any()


@pytest.mark.parametrize("name", ["furnace", "daylight", "glossy", "minicubes"])
def test_of_what_only_emits_it_is_the_colour(name):
    """FOL-1: with paths that end where they arrive first (no scattering), colour is that light."""
    found = R.render(scenes.canonical(name), R.Job(12, 9, 2, settings=Settings(max_depth=0), seen=True)).frame
    assert np.array_equal(found["seen_emission"], found["color"])


@pytest.mark.parametrize("name", ["minicubes", "cornell", "furnace", "lone_light", "empty"])
def test_without_mirrors_they_are_the_first_hits_to_the_bit(name):
    """FOL-4; and a frame that has them has all other layers as ever, RND-2e."""
    scene, job = scenes.canonical(name), R.Job(12, 9, 2)
    with_seen, usual = R.render(scene, replace(job, seen=True)).frame, R.render(scene, job).frame
    assert set(usual.layers) == set(USUAL)
    assert set(with_seen.layers) == {*USUAL, *SEEN}
    for seen, first in FIRST_HIT.items():
        assert np.array_equal(with_seen[seen], usual[first]), seen
    assert all(np.array_equal(with_seen[name], usual[name]) for name in USUAL)


@pytest.mark.parametrize("name", ["glossy", "daylight"])
def test_features_of_more_rays_are_those_of_more_paths(name):
    """RND-2e: paths that end with their features have the same features, to the bit, and colours stay."""
    job = R.Job(12, 9, 1, seen=True, feature_spp=4)
    assert R.feature_job(job).settings.sampler == "sobol"
    scene, job = scenes.canonical(name), replace(job, settings=Settings(sampler="sobol"), feature_spp=0)
    apart = R.render(scene, replace(job, feature_spp=4)).frame
    paths = R.render(scene, replace(job, spp=4)).frame
    features = [layer for layer in paths.layers if layer != "color"]
    assert list(apart.layers) == list(paths.layers)
    assert all(np.array_equal(apart[layer], paths[layer]) for layer in features)
    assert not np.array_equal(paths["seen_albedo"], paths["albedo"])
    assert np.array_equal(apart["color"], R.render(scene, replace(job, seen=False)).frame["color"])
