"""The known answers against their limits, and against other ways to compute them (VRF-2, VRF-3)."""

import numpy as np
import pytest

from wamnet.refimpl.light.scene import validate
from wamnet_verify import answers
from wamnet_verify.cases import PROFILES, RULES, SLACK, questions


def test_cases_are_whole():
    """Names are unique, rules and profiles exist, scenes are valid, and each rule but `finite` has a case."""
    every = questions()
    assert len({q.name for q in every}) == len(every)
    assert {q.rule for q in every} == set(RULES) - {"finite"}
    for question in every:
        validate(question.shot.scene)
        assert set(question.intents) <= set(PROFILES)
        assert all(a is None or len(a) == len(question.answer) for a in question.intents.values())
    shots = {q.shot.name: q.shot for q in every}
    assert all(shots[q.shot.name] == q.shot for q in every)


def test_a_rectangle_that_covers_the_sky_gives_pi():
    """Below an elevation of 1e-6 the sky is not covered: pi 1e-12 of it."""
    far = (-1e6, 1e6, -1e6, 1e6)
    assert abs(answers.rectangle_irradiance(0.3, -0.2, far, 1.0) - np.pi) <= 1e-10


def test_a_far_rectangle_is_area_over_distance_squared():
    """Half widths of 0.5 at distance 1000 change the answer by (0.5 / 1000)^2 times a few."""
    found = answers.rectangle_irradiance(0.0, 0.0, (-0.5, 0.5, -0.5, 0.5), 1000.0)
    assert abs(found * 1e6 - 1.0) <= 1e-6


def test_schlick_at_its_ends():
    """The colour itself straight on, white at grazing angles, and a 32nd of the way at 60 degrees."""
    gold = (1.0, 0.75, 0.25)
    assert answers.schlick(gold, 1.0) == gold
    assert answers.schlick(gold, 0.0) == (1.0, 1.0, 1.0)
    assert answers.schlick(gold, 0.5) == (1.0, 0.75 + 0.25 / 32, 0.25 + 0.75 / 32)


def test_fresnel_at_normal_incidence_and_at_brewster_s_angle():
    """((n - 1) / (n + 1))^2; at tan theta = n only one polarisation is mirrored, by cos^2 2 theta."""
    assert answers.fresnel(1.0, 1.5) == pytest.approx(0.04, rel=1e-12)
    angle = np.arctan(1.5)
    expected = 0.5 * np.cos(2.0 * angle) ** 2
    assert answers.fresnel(np.cos(angle), 1.5) == pytest.approx(expected, rel=1e-12)


def test_a_pane_of_nothing_is_not_there():
    """Index 1 mirrors nothing: the floor shows its reflectance."""
    assert answers.pane(0.3, 1.0) == pytest.approx(1.0, abs=1e-15)
    assert answers.floor_below_pane(0.5, 1.0) == pytest.approx(0.5, abs=1e-12)
    assert answers.floor_below_pane(1.0, 1.5) == pytest.approx(1.0, abs=1e-12)


def test_rough_metal_has_a_closed_form():
    """For alpha = 1 at normal incidence the integral is 1 - ln 2; its midpoint rule is off by less than a
    tenth of the cases' slack."""
    assert abs(answers.rough_metal(0.0, 1.0) - (1.0 - np.log(2.0))) <= 0.1 * SLACK
