"""Metal, glass, mirrors and the sky are those of Mitsuba 3: values to rounding, pictures by Welch's test.

The table of a sky and BSDFs are compared direction by direction, in the scalar variant. Pictures take its
compiled variant where there is an LLVM, since rough metal asks Python for its masking (mitsuba_looks.py).
"""

from dataclasses import replace

import numpy as np
import pytest
from peer_pictures import ours, p_values, theirs
from statistical import SIGNIFICANCE, assert_all_plausible, sidak

from wamnet.refimpl.errors import ExecutorUnavailable
from wamnet.refimpl.light import environment, scenes
from wamnet.refimpl.light.materials import Conductor, Dielectric, Mirror, Site
from wamnet.refimpl.light.materials.dielectric import fresnel, refract
from wamnet.refimpl.light.scene import Box, Camera, Light, Quad, Room, Scene, Sky, Sphere
from wamnet.refimpl.light.transport import Settings
from wamnet_peers import mitsuba_looks, peer_mitsuba

pytestmark = [pytest.mark.nightly, pytest.mark.apart]

COMPILED = "llvm_ad_rgb"
"""Mitsuba's variant of the pictures."""

U32 = 2.0**-24
"""Unit roundoff of float32, in which Mitsuba computes."""


# ---- values ------------------------------------------------------------------------------------------------


def directions(rng, count):
    """Return unit directions (count, 3) above the surface, no nearer to it than a height of 0.1."""
    z, turn = rng.uniform(0.1, 1.0, count), rng.uniform(0.0, 2.0 * np.pi, count)
    level = np.sqrt(1.0 - z * z)
    return np.stack([level * np.cos(turn), level * np.sin(turn), z], axis=-1)


def seen_by(mi, wo):
    """Return what a BSDF of Mitsuba is asked about, for the direction wo (3,) that our paths come from."""
    at = mi.SurfaceInteraction3f()
    at.wi, at.sh_frame = mi.Vector3f(*map(float, wo)), mi.Frame3f([0.0, 0.0, 1.0])
    return at


def site(wo, reflectance, parameter):
    """Return the vertex of our materials: around z, outside, with a throughput of 1."""
    one = np.ones_like(wo)
    color = one * np.array(reflectance)
    outside = np.full(wo.shape[:-1], True)
    return Site(wo, one * (0.0, 0.0, 1.0), outside, color, one, color, np.full(wo.shape[:-1], parameter))


COLOR = (0.95, 0.6, 0.2)
"""Reflectance of what is compared."""


@pytest.mark.parametrize("roughness", [0.05, 0.2, 0.5, 1.0])
def test_metal_is_principled_with_correlated_masking(mitsuba, roughness):
    """Value and density, float64 against float32.

    Tolerance: a half vector of float32 is off by some 4 u of its length 1, which changes D by a factor of 4
    times as much over the lobe's width alpha at most [2 |slope| / (alpha^2 + slope^2) <= 1 / alpha, squared
    twice]; the heights of 0.1 and more make each of the divisions by z ten times its error. A hundred u over
    the smaller of alpha and 0.1 holds their sum.
    """
    mitsuba.set_variant("scalar_rgb")
    material, rng = Conductor(roughness), np.random.default_rng(11)
    wo, wi = directions(rng, 400), directions(rng, 400)
    # Half of the pairs are near mirrored ones, where the lobe is.
    wi[::2] = wo[::2] * (-1.0, -1.0, 1.0) + rng.normal(0.0, 0.1, (200, 3)) * (1.0, 1.0, 0.0)
    wi /= np.linalg.norm(wi, axis=-1, keepdims=True)
    own = site(wo, COLOR, roughness)
    color, factor = Conductor.value(own, wi, wi[..., 2])
    value, pdf = color * factor[..., np.newaxis], Conductor.pdf(own, wi, wi[..., 2])
    bsdf = mitsuba.load_dict(mitsuba_looks.bsdf(COLOR, material))
    context, tolerance = mitsuba.BSDFContext(), 100 * U32 / min(roughness, 0.1)
    for k in range(len(wo)):
        got, density = bsdf.eval_pdf(context, seen_by(mitsuba, wo[k]), mitsuba.Vector3f(*map(float, wi[k])))
        assert np.abs(np.array(got) - value[k]).max() <= tolerance * value[k].max()
        assert abs(density - pdf[k]) <= tolerance * pdf[k]


@pytest.mark.parametrize("ior", [1.0, 1.33, 1.5, 2.42])
@pytest.mark.parametrize("outside", [True, False])
def test_glass_is_a_dielectric(mitsuba, ior, outside):
    """Shares and refracted directions, total reflection among them.

    Tolerance: the root of 1 - r^2 (1 - c^2) magnifies an error u of its argument by 1 / (2 cos'), which is
    0.01 at least where it is compared; a share follows the cosine with a slope of at most 4 / n.
    """
    mitsuba.set_variant("scalar_rgb")
    wo = directions(np.random.default_rng(12), 200)
    own = site(wo, COLOR, ior)
    ratio = np.full(len(wo), 1.0 / ior if outside else ior)
    direction, cos_far = refract(own, wo[..., 2], ratio)
    share = fresnel(wo[..., 2], cos_far, ratio)
    assert outside or ior == 1.0 or np.any(cos_far == 0.0)
    for k in np.flatnonzero((cos_far == 0.0) | (cos_far > 0.01)):
        got, cos_t, _, scale = mitsuba.fresnel(float(wo[k, 2]), ior if outside else 1.0 / ior)
        assert abs(got - share[k]) <= 400 * U32
        if cos_far[k] > 0.0:
            bent = mitsuba.refract(mitsuba.Vector3f(*map(float, wo[k])), cos_t, scale)
            assert np.abs(np.array(bent) - direction[k]).max() <= 400 * U32


SKY = Sky((0.16, 0.3, 0.62), (0.62, 0.7, 0.8), (0.18, 0.16, 0.14), (0.5, 0.6, -0.4), (2.6, 2.2, 1.6), 400.0)
"""A sky whose sun is on no axis."""


@pytest.mark.nightly
def test_the_table_shows_the_sky(mitsuba):
    """Mitsuba's lookup in the table is the sky's formula: directions, poles and seam are in their places.

    Tolerance: h^2 k / 2 = 0.2 % of the sun's lobe, and as much of the gradient, whose kink at the horizon is
    within one texel's height of h.
    """
    mitsuba.set_variant("scalar_rgb")
    rng = np.random.default_rng(13)
    found = rng.normal(size=(500, 3))
    found[:100] = np.array(SKY.sun_direction) + rng.normal(0.0, 0.05, (100, 3))
    found /= np.linalg.norm(found, axis=-1, keepdims=True)
    wanted = environment.radiance(environment.build(SKY, np.float64), found)
    emitter = mitsuba.load_dict(mitsuba_looks.emitter(mitsuba, SKY))
    at = mitsuba.SurfaceInteraction3f()
    for direction, color in zip(found, wanted, strict=True):
        at.wi = mitsuba.Vector3f(*map(float, -direction))
        assert np.abs(np.array(emitter.eval(at)) - color).max() <= 0.004 * color.max()


# ---- pictures ----------------------------------------------------------------------------------------------

LAMP = Light((-1.5, 3.0, -1.0), (3.0, 0.0, 0.0), (0.0, 0.0, 2.0), (1.0, 0.9, 0.8), 30.0)
FLOOR = Quad((-4.0, -1.0, -4.0), (0.0, 0.0, 8.0), (8.0, 0.0, 0.0), (0.6, 0.5, 0.4))
SCREEN = Quad((-3.0, -1.0, -2.0), (6.0, 0.0, 0.0), (0.0, 3.0, 0.0), (0.3, 0.5, 0.6))
CAMERA = Camera((1.0, 1.4, 5.0), (0.0, -0.1, 0.0))
TURNED = ((0.8, 0.0, -0.6), (0.0, 1.0, 0.0), (0.6, 0.0, 0.8))


def lit(name, *solids, quads=(), **more):
    """Return a scene of solids over a floor, before a screen, under a lamp and a dim background."""
    boxes = tuple(solid for solid in solids if isinstance(solid, Box))
    balls = tuple(solid for solid in solids if isinstance(solid, Sphere))
    return Scene(
        name,
        CAMERA,
        boxes=boxes,
        spheres=balls,
        quads=(FLOOR, SCREEN, *quads),
        lights=(LAMP,),
        background=(0.2, 0.3, 0.4),
        **more,
    )


HALL = Room(
    (-2.0, -1.0, -2.5),
    (2.0, 2.0, 5.5),
    ((0.7, 0.3, 0.2), (0.2, 0.5, 0.3), (0.5, 0.5, 0.5), (0.7, 0.7, 0.7), (0.9, 0.8, 0.7), (0.6, 0.6, 0.6)),
    materials=(None, Conductor(0.4), Conductor(0.1), None, Mirror(), None),
)
"""A room with a mirror behind, a shiny floor and one wall of brushed metal."""

SCENES = {
    "metal": lit(
        "metal",
        Sphere((-1.0, -0.3, 0.3), 0.6, (1.0, 0.8, 0.4), material=Conductor(0.05)),
        Sphere((0.9, -0.4, 0.9), 0.5, (0.6, 0.7, 0.9), material=Conductor(1.0)),
        Box((0.2, -0.4, -0.8), (0.5, 0.5, 0.5), (0.9, 0.6, 0.5), TURNED, material=Conductor(0.35)),
    ),
    "glass": lit(
        "glass",
        Sphere((-0.8, -0.2, 0.4), 0.7, (0.9, 0.95, 1.0), material=Dielectric(1.5)),
        Box((0.8, -0.3, 0.2), (0.5, 0.6, 0.3), (0.95, 0.8, 0.9), TURNED, material=Dielectric(1.9)),
    ),
    "mirror": lit(
        "mirror",
        Sphere((-0.9, -0.3, 0.4), 0.6, (0.9, 0.9, 0.7), material=Mirror()),
        Box((1.0, -0.5, 0.6), (0.3, 0.5, 0.3), (0.8, 0.9, 0.9), TURNED, material=Mirror()),
        quads=(
            Quad((-0.4, -0.9, -1.0), (1.2, 0.0, -0.4), (0.1, 1.8, 0.0), (0.9, 0.9, 0.9), material=Mirror()),
        ),
    ),
    "sky": replace(
        lit("sky", Box((0.2, -0.4, 0.0), (0.5, 0.6, 0.5), (0.8, 0.4, 0.3), TURNED)),
        lights=(),
        background=(0.0, 0.0, 0.0),
        environment=replace(SKY, sun_concentration=60.0),
    ),
    "sky and lamp": replace(
        lit("sky and lamp", Sphere((0.2, -0.3, 0.0), 0.7, (0.9, 0.7, 0.5), material=Conductor(0.25))),
        background=(0.0, 0.0, 0.0),
        environment=SKY,
    ),
    "hall": Scene(
        "hall",
        Camera((0.8, 0.8, 4.9), (-0.2, 0.0, 0.0), vertical_fov_deg=60.0),
        HALL,
        boxes=(Box((-0.6, -0.5, 0.0), (0.4, 0.5, 0.4), (0.7, 0.6, 0.3), TURNED),),
        spheres=(Sphere((0.7, -0.4, 0.6), 0.5, (0.9, 0.9, 1.0), material=Dielectric(1.33)),),
        lights=(Light((-0.8, 1.98, 0.0), (1.6, 0.0, 0.0), (0.0, 0.0, 1.6), (1.0, 1.0, 0.9), 30.0),),
    ),
    "glossy": scenes.glossy(time=1.3),
    "daylight": scenes.daylight(time=0.7),
    "vitrine": scenes.vitrine(time=0.9),
}
"""Each material by itself, the sky with and without a lamp, walls with materials, and canonical scenes."""


LEVEL = sidak(SIGNIFICANCE, len(SCENES))
"""Significance of one scene: that of all is SIGNIFICANCE."""


@pytest.fixture(scope="module")
def variant(mitsuba):
    """Give the variant of the pictures: the compiled one where there is an LLVM."""
    try:
        peer_mitsuba.open_mitsuba(COMPILED)
    except ExecutorUnavailable:
        return "scalar_rgb"
    return COMPILED


@pytest.fixture
def picturing(mitsuba, variant):
    """Give Mitsuba with that variant set; the tests of values set another."""
    mitsuba.set_variant(variant)
    return mitsuba


@pytest.mark.nightly
@pytest.mark.parametrize("name", SCENES)
def test_mitsuba_shows_the_same_materials(executor_named, picturing, name):
    a = ours(executor_named("opencl"), SCENES[name], Settings())
    assert_all_plausible(p_values(a, theirs(picturing, SCENES[name], Settings())), LEVEL)
