"""Glass: Fresnel against closed values, Snell, energy, inside and outside, and glass that is not there."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from statistical import SIGNIFICANCE, z_p
from vertices import local, local_direction, site, uniforms

from wamnet.refimpl.errors import InputError
from wamnet.refimpl.light import render as R
from wamnet.refimpl.light.materials import Dielectric
from wamnet.refimpl.light.materials.dielectric import fresnel, refract
from wamnet.refimpl.light.materials.material import SINGLE_PDF
from wamnet.refimpl.light.scene import Box, Camera, Light, Quad, Scene, Sphere
from wamnet.refimpl.light.transport import Settings

EPS = 2.0**-52
WHITE = (1.0, 1.0, 1.0)
TURNED = ((0.8, 0.0, -0.6), (0.0, 1.0, 0.0), (0.6, 0.0, 0.8))
COSINE = st.floats(0.0, 1.0)
RATIO = st.one_of(st.floats(1.0, 4.0), st.floats(1.0, 4.0).map(lambda n: 1.0 / n))


def reflected(cosine, ratio):
    """Return Fresnel's share for a cosine and n_near / n_far."""
    cosine, ratio = np.array([cosine]), np.array([ratio])
    _, cos_far = refract(site(local_direction(cosine)), cosine, ratio)
    return fresnel(cosine, cos_far, ratio)[0]


@pytest.mark.parametrize("ior", [1.0, 1.33, 1.5, 2.42, 4.0])
def test_fresnel_at_normal_incidence(ior):
    """((n - 1) / (n + 1))^2 from both sides; a dozen roundings, of numbers whose differences are above (n -
    1) / n.
    """
    expected = ((ior - 1) / (ior + 1)) ** 2
    for ratio in (ior, 1 / ior):
        assert reflected(1.0, ratio) == pytest.approx(expected, rel=64 * EPS)


@pytest.mark.parametrize("ior", [1.33, 1.5, 2.42])
def test_fresnel_at_brewster_s_angle(ior):
    """tan = n: parallel light is not mirrored; across, the amplitude is (n^2 - 1) / (n^2 + 1)."""
    cosine = 1 / math.sqrt(1 + ior * ior)
    expected = 0.5 * ((ior * ior - 1) / (ior * ior + 1)) ** 2
    assert reflected(cosine, 1 / ior) == pytest.approx(expected, rel=64 * EPS)


@pytest.mark.parametrize("ior", [1.01, 1.5, 2.42])
def test_total_reflection_and_its_limit(ior):
    """From inside, beyond sin = 1/n all is mirrored and nothing passes; just before, something passes."""
    critical = math.sqrt(1 - 1 / ior**2)
    for cosine in np.linspace(0.0, critical * (1 - 1e-9), 20):
        assert reflected(cosine, ior) == 1.0
    assert reflected(critical * (1 + 1e-6), ior) < 1.0
    wo = local_direction(np.linspace(0.0, critical * (1 - 1e-9), 50))
    at = site(wo, Dielectric(ior), outside=False)
    assert not Dielectric.sample(at, *np.full((3, 50), 1 - 2.0**-24)).through.any()


@pytest.mark.parametrize("ratio", [1.0, 1 / 1.5, 1.5])
def test_grazing_light_is_mirrored(ratio):
    assert reflected(0.0, ratio) == (0.0 if ratio == 1.0 else 1.0)


@given(COSINE, RATIO)
def test_fresnel_is_a_share_and_the_same_both_ways(cosine, ratio):
    """The way back, with the far cosine and the inverse ratio, mirrors the same share.

    sqrt(1 - r^2 + (r c)^2) near the critical angle loses half its digits: 2^-24 with a factor for the slope.
    """
    share = reflected(cosine, ratio)
    assert 0.0 <= share <= 1.0 + 8 * EPS
    cosines, ratios = np.array([cosine]), np.array([ratio])
    _, cos_far = refract(site(local_direction(cosines)), cosines, ratios)
    if cos_far[0] > 0.0:
        assert reflected(cos_far[0], 1 / ratio) == pytest.approx(share, abs=2.0**-20)


@given(COSINE, RATIO)
def test_snell(cosine, ratio):
    """Sines are in the ratio of the indices, all three directions lie in a plane, the new one behind."""
    wo = local_direction(np.array([cosine]))
    direction, cos_far = refract(site(wo), np.array([cosine]), np.array([ratio]))
    if cos_far[0] == 0.0:
        return  # total reflection
    found = local(direction)[0]
    assert abs(found @ found - 1.0) <= 16 * EPS
    assert found[2] == pytest.approx(-cos_far[0], abs=2.0**-25)
    # Half of the digits are lost where the refracted ray grazes.
    assert found[:2] == pytest.approx(-ratio * wo[0, :2], abs=2.0**-24)


def test_share_of_mirrored_paths_is_fresnel_s():
    """z-test of a binomial share, from outside and from inside."""
    for outside, cosine in ((True, 0.3), (False, 0.9)):
        wo = np.broadcast_to(local_direction(cosine), (1 << 16, 3))
        at = site(wo, Dielectric(1.5), (0.9, 0.8, 0.7), outside)
        direction, beta, pdf, through = Dielectric.sample(at, *uniforms(1 << 16)[:3])
        share = reflected(cosine, 1 / 1.5 if outside else 1.5)
        error = np.sqrt(share * (1 - share) / through.size)
        assert z_p(np.mean(~through) - share, error) >= SIGNIFICANCE / 2
        assert np.array_equal(local(direction)[:, 2] < 0.0, through)
        assert np.all(pdf == SINGLE_PDF)
        assert np.array_equal(beta, at.tinted)


@given(COSINE)
def test_index_of_one_is_nothing(cosine):
    """No light is mirrored, not even at grazing angles, and directions stay, to the rounding of a
    normalisation.
    """
    wo = local_direction(np.array([cosine]))
    at = site(wo, Dielectric(1.0))
    direction, _, _, through = Dielectric.sample(at, *np.zeros((3, 1)))
    assert through[0]
    assert np.max(np.abs(direction + at.wo)) <= 8 * EPS


def test_no_light_sample_is_worth_anything():
    at = site(local_direction(np.array([0.5])), Dielectric(1.5))
    assert Dielectric.value(at, at.wo, np.array([0.5]))[1] == 0.0
    assert Dielectric.pdf(at, at.wo, np.array([0.5])) == 0.0


def test_glass_is_an_obstacle_to_light_samples():
    """DIE-6: behind glass a light is found only by directions, in front of it by light samples too."""
    lamp = Light((-0.5, 2.0, -0.5), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0), WHITE, 4.0)
    floor = Quad((-2.0, -1.0, -2.0), (0.0, 0.0, 4.0), (4.0, 0.0, 0.0), (0.5, 0.5, 0.5))
    pane = Box((0.0, 1.0, 0.0), (9.0, 0.1, 9.0), WHITE, material=Dielectric())
    found = {}
    for name, boxes in (("open", ()), ("behind glass", (pane,))):
        room = replace(scene(*boxes), quads=(floor,), lights=(lamp,), background=(0.0, 0.0, 0.0))
        camera = Camera((0.0, 0.0, 3.0), (0.0, -1.0, 0.0))
        for strategy in ("light", "bsdf"):
            settings = Settings(max_depth=3, strategy=strategy)
            picture = R.render(replace(room, camera=camera), R.Job(8, 8, 32, 5, settings)).frame["color"]
            found[name, strategy] = float(picture.mean())
    # Light samples, which all end at the glass, add nothing: the same directions find the same light.
    assert found["behind glass", "light"] == found["behind glass", "bsdf"]
    assert found["behind glass", "light"] > 0
    assert found["open", "light"] != found["open", "bsdf"]


# ---- rendered ------------------------------------------------------------------------------------------


def scene(*bodies, **others):
    """Return a scene that looks along -z at bodies around the origin, under background 1."""
    boxes = tuple(b for b in bodies if isinstance(b, Box))
    spheres = tuple(b for b in bodies if isinstance(b, Sphere))
    camera = Camera((0.3, 0.2, 4.0), (0.0, 0.0, 0.0))
    return replace(Scene("glass", camera, boxes=boxes, spheres=spheres, background=WHITE), **others)


def picture(what, depth=200, spp=4, dtype="float64"):
    return R.render(what, R.Job(24, 24, spp, 3, Settings(max_depth=depth), dtype)).frame


BODIES = {
    "ball": Sphere((0.1, 0.0, 0.0), 0.9, WHITE, material=Dielectric(1.5)),
    "diamond": Sphere((0.1, 0.0, 0.0), 0.9, WHITE, material=Dielectric(2.42)),
    "block": Box((0.0, 0.1, 0.0), (0.7, 0.6, 0.5), WHITE, material=Dielectric(1.5)),
    "turned": Box((0.0, 0.1, 0.0), (0.7, 0.6, 0.5), WHITE, TURNED, material=Dielectric(1.33)),
}


@pytest.mark.parametrize("dtype", ["float32", "float64"])
@pytest.mark.parametrize("name", BODIES)
def test_clear_glass_in_a_white_sky_is_white(name, dtype):
    """Every path that leaves carries 1: products of ones. 200 scatterings let all of them out."""
    frame = picture(scene(BODIES[name]), dtype=dtype)
    assert 50 < np.sum(frame["depth"] > 0) < 24 * 24 - 50
    assert np.all(frame["color"] == 1.0)


@pytest.mark.parametrize("name", ["ball", "turned"])
def test_camera_inside_glass(name):
    """What it sees under a white sky is white, too: paths carry basic radiance (DIE-5)."""
    inside = scene(BODIES[name], camera=Camera((0.1, 0.0, 0.1), (0.0, 0.0, -1.0)))
    frame = picture(inside)
    assert np.all(frame["depth"] > 0.0)
    assert np.all(frame["color"] == 1.0)


@pytest.mark.parametrize("body", [replace(BODIES["ball"], radius=0.8), BODIES["turned"]], ids=["ball", "box"])
def test_glass_of_index_one_is_not_there(body):
    """A striped wall that glows looks the same with and without it, where no pixel meets a stripe's edge."""
    stripes = tuple(
        Quad((0.5 * i - 3.0, -3.0, -2.0), (0.5, 0.0, 0.0), (0.0, 6.0, 0.0), (0.0,) * 3, (0.2 * i, 1.0, 0.5))
        for i in range(12)
    )
    bare = scene(quads=stripes)
    clear = replace(body, material=Dielectric(1.0))
    there = picture(scene(clear, quads=stripes), depth=3, spp=1)
    colors = [frame["color"] for frame in (picture(bare, depth=3, spp=1), there)]
    assert np.sum(there["depth"] < 4.5) > 50  # the body is met
    same = np.all(np.abs(colors[0] - colors[1]) <= 1e-12, axis=-1)
    assert same.mean() >= 0.995  # the spawned rays start 4e-6 of a unit apart: 6e-4 of the pixels see an edge


def test_reflectance_tints_every_surface_that_light_passes():
    """Through a body of index 1 and reflectance a light passes two surfaces: a^2."""
    tinted = replace(BODIES["ball"], reflectance=(0.5, 0.25, 1.0), material=Dielectric(1.0))
    color = picture(scene(tinted), depth=3, spp=1)["color"]
    expected = np.where(np.any(color < 1.0, axis=-1, keepdims=True), [0.25, 0.0625, 1.0], 1.0)
    assert np.any(color < 1.0)
    assert np.array_equal(color, expected)


def test_rays_leave_a_slab_parallel():
    """Two refractions at parallel faces cancel: paths that pass straight through see the sky in their
    direction.
    """
    slab = Box((0.0, 0.0, 0.0), (50.0, 50.0, 0.2), WHITE, material=Dielectric(1.7))
    wall = Quad((-4.0, -4.0, -1e4), (8.0, 0.0, 0.0), (0.0, 8.0, 0.0), (0.0,) * 3, (1.0, 1.0, 1.0))
    narrow = Camera((0.0, 0.0, 5.0), (0.0, 0.0, -1.0), vertical_fov_deg=0.01)
    # The wall covers 8e-4 of a radian: it is met if the direction is kept to 4e-4.
    frame = picture(scene(slab, quads=(wall,), background=(0.0,) * 3, camera=narrow), depth=2, spp=16)
    through = (1 - ((1.7 - 1) / (1.7 + 1)) ** 2) ** 2
    error = np.sqrt(through * (1 - through) / (24 * 24 * 16))
    assert z_p(frame["color"][..., 0].mean() - through, error) >= SIGNIFICANCE


@pytest.mark.parametrize("ior", [0.5, 0.999, 4.1, float("nan")])
def test_refuses_an_index(ior):
    with pytest.raises(
        InputError, match=r"a.ior .*: an index of refraction must lie in \[1, 4\] \(glass has 1.5"
    ):
        Dielectric(ior).check("a")
