"""The project's own tracer: no false alarm, and planted faults are blamed on the right rule (VRF-1,
VRF-5)."""

from dataclasses import replace

import numpy as np
import pytest

from wamnet.refimpl.light import camera, intersection, transport
from wamnet.refimpl.light.materials import Conductor, Dielectric, Lambertian, dielectric
from wamnet_verify import judgement, run
from wamnet_verify.cases import RULES, questions
from wamnet_verify.renderers import Own

CHEAP = 16
"""Samples of a pixel where a fault is gross."""


def cheap(names=None, fine=""):
    """Return the questions of these rules, or all, with few samples; of rule `fine` with all of them."""
    return [
        q if q.rule == fine else replace(q, shot=replace(q.shot, spp=min(q.shot.spp, CHEAP)))
        for q in questions()
        if names is None or q.rule in names
    ]


def first_rule(renderer, names=None, fine=""):
    found = judgement.first_blamed(run.verify(renderer, cheap(names, fine), pictures=6, seed=100))
    return None if found is None else found.rule


@pytest.mark.nightly
@pytest.mark.needs("time")
def test_the_reference_keeps_every_rule():
    found = run.verify(Own(), cheap(), pictures=6)
    assert [judgement.sentence_of(v) for v in found if v.deviates] == []
    assert not [v for v in found if v.state == judgement.UNTESTED]


# ---- faults in a picture --------------------------------------------------------------------------------


def layer(name, change):
    """Return what changes a layer of pictures."""
    return lambda picture: {**picture, name: change(picture[name])} if name in picture else picture


def along_view(picture):
    """Return the picture with distances along the view, of the scene of layers."""
    from wamnet_verify.cases import CAMERA

    forward = camera.camera_basis(CAMERA).forward
    cosine = np.sum(picture["direction"] * forward, axis=-1, keepdims=True)
    return {**picture, "depth": picture["depth"] * cosine}


def spoilt(color):
    color = color.copy()
    color[0, 0, 0] = np.nan
    return color


IN_PICTURES = {
    "a gamma in the file": (layer("color", lambda c: np.maximum(c, 0.0) ** (1 / 2.2)), "radiance"),
    "a factor pi": (layer("color", lambda c: c * np.pi), "radiance"),
    "a clip at 1": (layer("color", lambda c: np.minimum(c, 1.0)), "radiance"),
    "a clamp of what is bright": (layer("color", lambda c: np.minimum(c, 50.0)), "bright"),
    "one NaN": (layer("color", spoilt), "finite"),
    "no display encoding": (layer("display", lambda d: d**2.2), "display"),
    "flipped normals": (layer("normal", lambda n: -n), "normals"),
    "normals for looking": (layer("normal", lambda n: np.where(n == 0, n, 0.5 * n + 0.5)), "normals"),
    "depth along the view": (along_view, "depth"),
    "one over depth": (layer("depth", lambda d: np.where(d > 0, 1 / np.maximum(d, 1e-9), d)), "depth"),
    "far misses": (layer("depth", lambda d: np.where(d == 0, 1e9, d)), "misses"),
    "albedo of squares": (layer("albedo", lambda a: a * a), "albedo"),
}


@pytest.mark.nightly
@pytest.mark.needs("time")
@pytest.mark.parametrize("fault", IN_PICTURES)
def test_faults_in_pictures(fault):
    change, rule = IN_PICTURES[fault]
    early = list(RULES)[: list(RULES).index("direct")]
    assert first_rule(Own(finish=change), {*early, rule, "bright"}) == rule


# ---- faults in light ------------------------------------------------------------------------------------


def schlick(cosine, cos_far, ratio):
    """Return Schlick's share, of the cosine outside."""
    outside = np.where(ratio <= 1.0, cosine, cos_far)
    share = 0.04 + 0.96 * (1.0 - outside) ** 5
    return np.where((cos_far > 0.0) | (ratio <= 1.0), share, 1.0)


def matte_value(change):
    """Return a matte surface's value, changed."""
    return staticmethod(lambda site, wi, cosine: (site.tinted, change(cosine) / np.pi))


def sample_with(factor, kind):
    """Return sampling whose throughput has a factor (of the cosine of wo)."""
    before = kind.sample

    def sample(site, *numbers):
        found = before(site, *numbers)
        cosine = np.abs(np.sum(site.wo * site.normal, axis=-1, keepdims=True))
        return found._replace(beta=found.beta * factor(cosine))

    return staticmethod(sample)


def double(world, path, hit, surface):
    return np.ones_like(hit.t)


def inverse_index(before):
    return lambda site, cosine, ratio: before(site, cosine, 1.0 / ratio)


def faults():
    """Yield each fault with what it replaces and the rule that it breaks."""
    zero = lambda *given: np.zeros_like(given[3]) > 1.0  # noqa: E731 - in a table
    yield (
        "light samples pi times as bright",
        transport,
        "light_radiance",
        lambda light: tuple(np.pi * c for c in radiance(light)),
        "direct",
    )
    yield "a matte surface without pi", Lambertian, "value", matte_value(lambda c: np.pi * c), "direct"
    yield "a lost cosine", Lambertian, "value", matte_value(lambda c: 1.0 * (c > 0)), "direct"
    yield "a cosine twice", Lambertian, "value", matte_value(lambda c: c * c), "direct"
    yield "lights counted twice", transport, "emission_weight", double, "direct"
    yield "a tenth lost at each bounce", Lambertian, "sample", sample_with(lambda c: 0.9, Lambertian), "matte"
    yield "a cosine to the camera", Lambertian, "sample", sample_with(lambda c: c, Lambertian), "matte"
    yield "no shadows", intersection, "occluded", zero, "shadow"
    yield "Schlick's glass", dielectric, "fresnel", schlick, "fresnel"
    yield "an inverse index", dielectric, "refract", inverse_index(dielectric.refract), "fresnel"
    yield "metal that loses nothing", Conductor, "sample", sample_with(lambda c: 1.2, Conductor), "metal"
    yield "glass that absorbs", Dielectric, "sample", sample_with(lambda c: 0.8, Dielectric), "fresnel"


radiance = transport.light_radiance
FAULTS = {name: rest for name, *rest in faults()}


FINE = "Schlick's glass"
"""The fault that only all samples show: its share is a few per cent off."""


@pytest.mark.nightly
@pytest.mark.parametrize("fault", FAULTS)
def test_faults_in_light(fault, monkeypatch):
    owner, name, wrong, rule = FAULTS[fault]
    monkeypatch.setattr(owner, name, wrong)
    asked = {"radiance", "matte", "direct", "shadow", "mirror", rule}
    assert first_rule(Own(), asked, rule if fault == FINE else "") == rule


@pytest.mark.needs("time")
def test_too_few_bounces():
    """Rooms need many; what needs few is as it was."""

    class Short(Own):
        def pictures(self, shot, seeds):
            return super().pictures(replace(shot, depth=min(shot.depth, 4)), seeds)

    assert first_rule(Short(), {"matte", "direct", "shadow", "mirror", "fresnel", "series"}) == "series"


# ---- no false alarm -------------------------------------------------------------------------------------


@pytest.mark.nightly
@pytest.mark.parametrize(("runs", "most"), [(20, 3), (100, 5)])
def test_no_false_alarm(executor_named, runs, most):
    """A run has an alarm with probability 0.01 at most: more than 3 of 20, or 5 of 100, with 5e-4 at most.

    A smaller case confirms a false one with probability 0.005 at most: all 100 together have 0.005.
    """
    executor_named("opencl")
    asked = cheap()
    each = {shot.name: Own("opencl").pictures(shot, range(4 * runs)) for shot in run.shots_of(asked)}
    alarms = []
    for trial in range(0, 4 * runs, 4):
        found = {name: pictures[trial : trial + 4] for name, pictures in each.items()}
        alarms += [(trial, v) for v in judgement.judge(asked, found) if v.deviates]
    assert len(alarms) <= most
    again = [run.confirmed(Own("opencl"), v, range(trial, trial + 4)) for trial, v in alarms]
    assert [judgement.sentence_of(v) for v in again if v.deviates] == []
