"""The test, its correction, intervals and verdicts on drawn samples (VRF-1, VRF-4, VRF-5, VRF-6, VRF-8)."""

import json
from dataclasses import replace

import numpy as np
import pytest
from statistical import stats

from wamnet.kernels.judge.welch import student_p
from wamnet.refimpl.errors import InputError
from wamnet.refimpl.light.scenes import empty
from wamnet_verify import judgement as J
from wamnet_verify import report, run
from wamnet_verify.cases import RULES, Question, Shot, chosen
from wamnet_verify.judgement import holm, student_quantile

SIZE = 4
SHOT = Shot("shot", empty(), size=SIZE)


def question(name="q", rule="matte", answer=(0.5, 0.5, 0.5), **more):
    return Question(name, rule, more.pop("shot", SHOT), answer, "drawn", **more)


def pictures(mean, noise, count=8, seed=1, layer="color"):
    random = np.random.default_rng(seed)
    return [{layer: mean + random.normal(0.0, noise, (SIZE, SIZE, 3))} for _ in range(count)]


def verdict(found, asked=None, **more):
    asked = asked or question()
    return J.judge([asked], {asked.shot.name: found}, **more)[0]


@pytest.mark.parametrize("p", [[0.001, 0.2, 0.004, 0.0034], [0.5], [0.01, 0.01], [np.nan, 0.9]])
def test_holm_by_its_definition(p):
    """Reject the i-th least of m while it is at most significance / (m - i)."""
    expected = np.zeros(len(p), bool)
    values = np.nan_to_num(np.array(p))
    for i, at in enumerate(np.argsort(values)):
        if values[at] > 0.01 / (len(p) - i):
            break
        expected[at] = True
    assert holm(np.array(p), 0.01).tolist() == expected.tolist()


@pytest.mark.parametrize("freedom", [3, 7, 63])
@pytest.mark.parametrize("tail", [0.1, 1e-3, 1e-5])
def test_quantiles_are_the_distribution_s(tail, freedom):
    """To 1e-9 of the tail: SciPy finds the root of one function that is right to 1e-13."""
    found = student_p(np.array(student_quantile(tail, freedom)), np.array(float(freedom))) / 2
    assert abs(found - tail) <= 1e-9 * tail


def test_a_right_mean_passes_and_a_wrong_one_deviates():
    assert verdict(pictures(0.5, 0.02)).state == J.PASS
    wrong = verdict(pictures(0.55, 0.02))
    assert wrong.state == J.DEVIATES
    assert all(abs(d - 0.05) <= w for d, w in zip(wrong.deviation, wrong.half_width, strict=True))


def test_false_alarms_are_as_rare_as_stated():
    """Runs of 10 questions at 0.01: more alarms than these have a chance of 1e-4 by the binomial law."""
    questions = [question(f"q{i}", slack=0.0) for i in range(10)]
    questions = [replace(q, shot=replace(SHOT, name=q.name)) for q in questions]
    alarms = 0
    for seed in range(300):
        found = {q.name: pictures(0.5, 0.1, seed=(seed, i)) for i, q in enumerate(questions)}
        alarms += any(v.deviates for v in J.judge(questions, found))
    assert alarms <= stats.binom.isf(1e-4, 300, 0.01)


def test_what_a_pass_would_have_seen():
    """Deviations of `detects` are found in nine runs of ten: of 200, fewer than 160 have a chance below
    1e-5."""
    asked = question(slack=0.0)
    reach = np.median([verdict(pictures(0.5, 0.1, seed=s), asked).detects for s in range(50)]) * asked.scale
    found = sum(verdict(pictures(0.5 + reach, 0.1, seed=(7, s)), asked).deviates for s in range(200))
    assert found >= 160


def test_slack_is_not_a_deviation_and_no_more_than_that():
    asked = question(slack=0.01)
    assert verdict(pictures(0.5049, 0.0), asked).state == J.PASS
    assert verdict(pictures(0.5051, 0.0), asked).state == J.DEVIATES


def test_pictures_that_ignore_the_seed_are_judged_by_their_pixels():
    (same,) = pictures(0.5, 0.01, count=1)
    found = verdict([same] * 8)
    assert found.state == J.PASS
    assert "all seeds give one picture" in found.note


def test_numbers_that_are_not_finite_break_their_own_rule():
    found = pictures(0.5, 0.02)
    found[3]["color"][1, 2, 0] = np.nan
    broken = verdict(found)
    assert (broken.state, broken.rule) == (J.DEVIATES, "finite")
    assert "Every number of a picture is finite" in J.sentence_of(broken)
    assert json.loads(report.to_json("x", [broken], {}))["verdicts"][0]["mean"][0] is None


def test_what_is_missing_is_told():
    assert verdict(J.Missing(J.UNTESTED, "no words for it")).note == "no words for it"
    assert verdict(J.Missing(J.FAILED, "exit status 1")).deviates
    assert "no layer 'depth'" in verdict(pictures(0.5, 0.0), question(answer=(1.0,), layer="depth")).note
    other = verdict([{"color": np.zeros((2, 2, 3))}] * 4)
    assert (other.state, other.note) == (J.FAILED, "layer 'color' is (2, 2, 3), and not (4, 4, 3)")


def test_profiles():
    """An intent's answer counts under its profile; without it the verdict names the profile (VRF-8)."""
    asked = question(intents={"compensates": (0.7, 0.7, 0.7)})
    plain = verdict(pictures(0.7, 0.01), asked)
    assert (plain.state, plain.profile) == (J.DEVIATES, "compensates")
    assert "profile compensates" in J.sentence_of(plain)
    assert verdict(pictures(0.7, 0.01), asked, profiles=["compensates"]).state == J.PASS
    assert verdict(pictures(0.5, 0.01), asked, profiles=["compensates"]).state == J.DEVIATES
    free = question(intents={"clamps": None})
    assert verdict(pictures(0.1, 0.01), free, profiles=["clamps"]).state == J.INTENT
    assert verdict(pictures(0.1, 0.01), free).profile == "clamps"


def test_the_first_rule_is_blamed():
    shots = [replace(SHOT, name=name) for name in "ab"]
    asked = [question("later", "series", shot=shots[0]), question("first", "direct", shot=shots[1])]
    found = J.judge(asked, {"a": pictures(0.9, 0.01), "b": pictures(0.9, 0.01)})
    blamed = J.first_blamed(found)
    assert blamed is not None
    assert blamed.rule == "direct"
    assert J.first_blamed([]) is None


def test_reports_have_a_line_for_each_case():
    found = [verdict(pictures(0.6, 0.01)), verdict(J.Missing(J.UNTESTED, "no a | b"))]
    page = report.to_markdown("mine", found)
    assert "Look first at rule `matte`" in page
    assert "no a \\| b" in page
    assert page.count("\n| matte | q |") == 2
    data = json.loads(report.to_json("mine", found, {"seed": 3}))
    assert (data["schema"], data["seed"], data["counts"]) == (
        report.SCHEMA,
        3,
        {"deviates": 1, "not tested": 1},
    )


class Drawn:
    """A renderer of one mean for large pictures and another one for small ones."""

    name = "drawn"
    intents = ()

    def __init__(self, large, small):
        self.means = {SIZE: large, SIZE // 2: small}

    def pictures(self, shot, seeds):
        return [
            {
                "color": self.means[shot.size]
                + np.random.default_rng(s).normal(0, 0.01, (shot.size, shot.size, 3))
            }
            for s in seeds
        ]


@pytest.mark.parametrize(("small", "confirmed"), [(0.6, True), (0.5, False), (0.4, False)])
def test_a_smaller_case_confirms(small, confirmed):
    """VRF-7: it must deviate too, and to the same side."""
    (found,) = run.verify(Drawn(0.6, small), [question()])
    assert found.confirmed is confirmed
    assert found.deviates is confirmed
    assert found.state == (J.DEVIATES if confirmed else J.UNCONFIRMED)


def test_words_choose_cases():
    assert {q.rule for q in chosen(["shadow"])} == {"shadow"}
    assert [q.name for q in chosen(["lamp-close"])] == ["lamp-close"]
    with pytest.raises(InputError, match="no case's name holds it"):
        chosen(["nothing like it"])
    assert len(RULES) == len({rule.sentence for rule in RULES.values()})
