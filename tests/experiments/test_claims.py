"""Verdicts about the paper's claims, from records made by hand."""

from __future__ import annotations

import json
import math
import shutil

import claims
import numpy as np
import pytest
from lab import records, shown, verdicts
from lab.intervals import Interval, interval
from lab.results import PER_FRAME, Results
from lab.verdicts import FAILS, HOLDS, OPEN, UNTESTED, Measured, Question, Untested

SEEDS = (0, 1, 2)

ROUNDING = 32 * float(np.finfo(np.float64).eps)
"""Relative error of a ratio of two sums of twelve products: fourteen roundings each, and some to spare."""


# ---- verdicts --------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("values", "above", "verdict"),
    [
        ([1.1, 1.2, 1.3, 1.2], True, HOLDS),
        ([1.1, 1.2, 1.3, 1.2], False, FAILS),
        ([0.7, 0.8, 0.9, 0.8], True, FAILS),
        ([0.7, 0.8, 0.9, 0.8], False, HOLDS),
        ([0.5, 1.5, 0.6, 1.6], True, OPEN),
        ([0.5, 1.5, 0.6, 1.6], False, OPEN),
        ([1.0, 1.0, 1.0, 1.0], True, OPEN),
    ],
)
def test_a_bound_within_the_interval_decides_nothing(values, above, verdict):
    assert verdicts.decide(interval(values), 1.0, above)[0] == verdict


def test_one_value_decides_nothing_and_what_is_not_finite_is_not_tested():
    assert verdicts.decide(interval([[2.0]]), 1.0) == (OPEN, "one value has no interval")
    for ends in ((math.nan, 1.0, 2.0), (1.0, math.nan, 2.0), (1.0, 1.0, math.inf)):
        assert verdicts.decide(Interval(*ends, 3, 4), 0.0)[0] == UNTESTED


@pytest.mark.parametrize(
    ("found", "verdict"),
    [
        ([HOLDS, HOLDS], HOLDS),
        ([HOLDS, OPEN], OPEN),
        ([OPEN, UNTESTED, HOLDS], UNTESTED),
        ([HOLDS, UNTESTED, FAILS], FAILS),
        ([], UNTESTED),
    ],
)
def test_a_claim_holds_if_all_its_answers_do(found, verdict):
    answers = [{"verdict": each, "decides": True} for each in found]
    assert verdicts.together(answers) == verdict
    beside = [{"verdict": each, "decides": False} for each in (FAILS, UNTESTED)]
    assert verdicts.together([*answers, *beside]) == verdict


def test_answers_in_words():
    question = Question("PSNR, difference", 0.0, unit="dB")
    found = question.ask(lambda: Measured(interval([[1.0], [2.0], [3.0]]), "3 seeds x 1 pose", (20.0, 22.0)))
    text = "PSNR, difference: 20.00 to 22.00, 2.00 [1.00, 3.00] dB, 3 seeds x 1 pose, above 0?"
    assert verdicts.said(found.as_data(), alone=True) == text
    assert verdicts.said(found.as_data(), alone=False) == text + " holds"

    def missing() -> Measured:
        raise Untested("no record of DnCNN")

    none = question.ask(missing).as_data()
    assert verdicts.said(none, alone=True) == "PSNR, difference: no record of DnCNN"
    assert verdicts.said(none, alone=False) == "PSNR, difference: not tested, no record of DnCNN"


# ---- claims ----------------------------------------------------------------------------------------------


def record(kept, row, seeds=SEEDS, **each):
    """Put a row: of each name the numbers of each pose, which each seed moves by a thousandth."""
    for seed in seeds:
        facts = {name: value for name, value in each.items() if not isinstance(value, list)}
        poses = {
            name: [v * (1.0 + 0.001 * seed) for v in value]
            for name, value in each.items()
            if isinstance(value, list)
        }
        means = {name: sum(values) / len(values) for name, values in poses.items()}
        kept.put(row, seed, {**facts, **means, PER_FRAME: poses})


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Make records of Table 1 in which all that the paper says of it holds."""
    kept = Results.open(tmp_path_factory.mktemp("made") / "table1.json", "table1", {})
    four = [0.9, 1.0, 1.0, 1.1]

    def row(name, mse255, psnr, ssim, poses=four, seeds=SEEDS, **facts):
        scores = {"mse255": mse255, "wrapped": mse255, "psnr": psnr, "ssim": ssim}
        lists = {key: [value * pose for pose in poses] for key, value in scores.items()}
        record(kept, name, seeds, **lists, **facts)

    row("input", 82.93, 28.94, 0.21)
    row("dncnn", 79.03, 29.15, 0.44, seeds=(0,), flat=True)
    row("dncnn-shrunk", 79.5, 29.0, 0.43, seeds=(0,), flat=True)
    row("dncnn-shrunk-own", 79.2, 29.1, 0.44, seeds=(0,), flat=True)
    row("wamnet-color", 60.0, 30.0, 0.60)
    row("wamnet", 48.04, 31.31, 0.68, blocks=[1.0, 1.01, 0.99, 1.0])
    row("wamnet-color-own", 60.0, 30.0, 0.60, [1.0])
    row("wamnet-own", 48.04, 31.31, 0.68, [1.0])
    row("pix2pix", 39.28, 32.19, 0.71, seeds=(0, 1), flat=True, blocks=[1.8, 1.9, 1.7, 1.8])
    row("render30", 50.0, 31.0, 0.5)
    row("render30-own", 50.0, 31.0, 0.5, [1.0])
    return kept.path


@pytest.fixture
def table(made, tmp_path):
    """Give a copy of these records."""
    return Results.read(shutil.copy(made, tmp_path / "table1.json"))


def verdict(name, found):
    """Return the verdict about a claim, and its answers."""
    (claim,) = [claim for claim in claims.CLAIMS if claim.name == name]
    values = claims.decided(claim, found)
    return values["verdict"], values["answers"]


OF_TABLE = {
    "noise": ("input", "wamnet"),
    "structure": ("input", "wamnet"),
    "normals-own": ("wamnet-color-own", "wamnet-own"),
    "normals": ("wamnet-color", "wamnet"),
    "worth-own": ("wamnet-own", "render30-own"),
    "worth": ("wamnet", "render30"),
    "dncnn": ("dncnn", "wamnet"),
    "dncnn-resized": ("dncnn-shrunk", "wamnet"),
    "dncnn-judged-small": ("dncnn-shrunk-own", "wamnet"),
    "pix2pix": ("wamnet", "pix2pix"),
    "blocks": ("pix2pix", "wamnet"),
}
"""Claims by name, with their rows of Table 1."""


@pytest.mark.parametrize("name", OF_TABLE)
def test_numbers_like_the_paper_s_bear_its_claims_out(name, table):
    assert verdict(name, claims.Evidence(table))[0] == HOLDS


@pytest.mark.parametrize("name", OF_TABLE)
def test_without_a_row_a_claim_is_not_tested(name, table):
    for row in OF_TABLE[name]:
        data = table.data()
        rest = table.path.with_name("rest.json")
        records = [r for r in data["records"] if r["configuration"] != row]
        rest.write_text(json.dumps({**data, "records": records}))
        found, answers = verdict(name, claims.Evidence(Results.read(rest)))
        assert found == UNTESTED
        assert all("no record of " in answer["reason"] for answer in answers if answer["verdict"] == UNTESTED)


@pytest.mark.parametrize("name", OF_TABLE)
@pytest.mark.parametrize("bad", [math.nan, math.inf, None])
def test_what_is_not_finite_is_not_tested(name, bad, table):
    for row in OF_TABLE[name]:
        values = dict(table.get(row, 0))
        values[PER_FRAME] = {key: [bad, *rest[1:]] for key, rest in values[PER_FRAME].items()}
        table.put(row, 0, values)
    assert verdict(name, claims.Evidence(table))[0] == UNTESTED


@pytest.mark.parametrize("name", ["normals", "worth", "dncnn", "pix2pix", "noise", "structure"])
def test_an_interval_around_the_bound_decides_nothing(name, table):
    before, after = OF_TABLE[name] if name != "worth" else ("render30", "wamnet")
    bound = {"pix2pix": (0.02, 1.0), "noise": (0.0, 0.6), "structure": (0.0, 3.0)}.get(name, (0.0, 1.0))
    for seed in SEEDS:
        if (old := table.get(before, seed)) is None:
            continue
        # Two poses are on one side of the bound, two on the other, by as much.
        poses = {
            key: [
                (value * bound[1] + bound[0]) * (1.0 + d)
                for value, d in zip(row, (0.1, -0.1, 0.1, -0.1), strict=True)
            ]
            for key, row in old[PER_FRAME].items()
        }
        table.put(after, seed, {"flat": True, PER_FRAME: poses})
    found, answers = verdict(name, claims.Evidence(table))
    assert found == OPEN
    assert all(a["low"] <= a["bound"] <= a["high"] for a in answers if a["decides"])


@pytest.mark.parametrize(
    ("name", "row"),
    [
        ("dncnn", "dncnn"),
        ("dncnn-resized", "dncnn-shrunk"),
        ("dncnn-judged-small", "dncnn-shrunk-own"),
        ("pix2pix", "pix2pix"),
        ("blocks", "pix2pix"),
    ],
)
def test_a_training_that_was_broken_off_says_nothing(name, row, table):
    table.put(row, 0, {**table.get(row, 0), "flat": False})
    found, answers = verdict(name, claims.Evidence(table))
    assert found == UNTESTED
    assert "its validation error was not flat when its training ended" in answers[0]["reason"]
    # A record from before that was kept says nothing either.
    table.put(row, 0, {k: v for k, v in table.get(row, 0).items() if k != "flat"})
    assert verdict(name, claims.Evidence(table))[0] == UNTESTED


def test_claims_that_are_wrong_do_not_hold(table):
    for seed in SEEDS:
        table.put("wamnet", seed, table.get("input", seed))
        table.put("wamnet-own", seed, table.get("wamnet-color-own", seed))
        worse = {
            key: [0.9 * v for v in row] for key, row in table.get("wamnet-color", seed)[PER_FRAME].items()
        }
        table.put("wamnet-color-own", seed, {PER_FRAME: {k: [1.1 * v[0]] for k, v in worse.items()}})
    for name in ("noise", "structure", "normals", "worth", "worth-own", "dncnn"):
        assert verdict(name, claims.Evidence(table))[0] == FAILS, name


def test_only_common_seeds_are_compared(table):
    _, (answer, *_) = verdict("dncnn", claims.Evidence(table))
    assert answer["over"] == "1 seed x 4 poses"
    _, (answer, *_) = verdict("pix2pix", claims.Evidence(table))
    assert answer["over"] == "2 seeds x 4 poses"
    table.put("dncnn", 7, table.get("dncnn", 0))
    kept = Results.open(table.path.with_name("other.json"), "table1", {})
    kept.put("dncnn", 7, table.get("dncnn", 0))
    kept.put("wamnet", 0, table.get("wamnet", 0))
    assert verdict("dncnn", claims.Evidence(kept))[1][0]["reason"] == "no seed is common to both"


def test_the_paper_s_percentages(table):
    _, (noise, beside) = verdict("noise", claims.Evidence(table))
    assert (noise["bound"], noise["above"], beside["decides"]) == (0.6, False, False)
    assert abs(noise["mean"] - 48.04 / 82.93) <= ROUNDING
    _, (structure,) = verdict("structure", claims.Evidence(table))
    assert abs(structure["mean"] / (0.68 / 0.21) - 1.0) <= ROUNDING


def test_squares_modulo_256_decide_nothing(table):
    for seed in SEEDS:
        values = table.get("wamnet", seed)
        table.put("wamnet", seed, {**values, PER_FRAME: {**values[PER_FRAME], "wrapped": [200.0] * 4}})
    found, answers = verdict("noise", claims.Evidence(table))
    assert (found, [a["verdict"] for a in answers]) == (HOLDS, [HOLDS, FAILS])


def test_speed_is_not_tested_and_shows_what_cores_take(table):
    times = {"step_s": [0.004, 0.0041, 0.0042], "frame_s": [0.1, 0.1, 0.11], "device": "cores"}
    found, (training,) = verdict("training-time", claims.Evidence(table, times=times))
    assert (found, training["verdict"], training["over"]) == (UNTESTED, HOLDS, "3 rounds, cores")
    assert abs(training["mean"] / 82.0 - 1.0) <= ROUNDING
    found, (frame,) = verdict("speed", claims.Evidence(table, times=times))
    assert (found, frame["verdict"]) == (UNTESTED, FAILS)
    found, (frame,) = verdict("speed", claims.Evidence(table))
    assert (found, frame["reason"]) == (UNTESTED, "it was not measured")


# ---- studies ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("loss", "expected"), [(3.0, FAILS), (0.1, HOLDS), (0.5, OPEN)])
def test_other_orientations_are_judged_by_what_is_gained(table, tmp_path, loss, expected):
    kept = Results.open(tmp_path / "g.json", "generalisation", {"size": 256})
    noisy = [10.0, 11.0, 12.0, 11.0]
    harder = [
        value - 5.0 for value in noisy
    ]  # other frames, on which the input is worse: that is not a fault
    record(kept, "input", **{"psnr at 0": noisy, "psnr at 4": harder, "psnr at poses held out": noisy})
    net = {"psnr at 0": [v + 20.0 for v in noisy], "psnr at poses held out": noisy}
    net["psnr at 4"] = [v + 20.0 - loss + d for v, d in zip(harder, (0.1, -0.1, 0.1, -0.1), strict=True)]
    record(kept, "paper's features, direction: one", **{name: [0.0] * 4 for name in net})
    record(kept, "paper's features: one", **net)
    found, (answer,) = verdict("orientations", claims.Evidence(table, {"generalisation": kept}))
    assert found == expected
    assert answer["over"] == "3 seeds x 4 poses, 256x256"
    # Each seed moves both by a thousandth: what both gain moves too, by 0.02 at most.
    assert abs(answer["mean"] + loss) <= 0.02


@pytest.mark.parametrize(("times", "expected"), [(5.0, HOLDS), (1.2, FAILS), (2.0, OPEN)])
@pytest.mark.parametrize(("name", "row"), [("lights", "paper: A only"), ("several-lights", "paper: 16 sets")])
def test_colours_of_other_lights(table, tmp_path, name, row, times, expected):
    kept = Results.open(tmp_path / "l.json", "lights", {"size": 256})
    own = [0.010, 0.012, 0.011, 0.009]
    other = [v * times * d for v, d in zip(own, (1.1, 0.9, 1.1, 0.9), strict=True)]
    record(kept, row, **{"color": other, "color on A": own})
    found, (answer,) = verdict(name, claims.Evidence(table, {"lights": kept}))
    assert found == expected
    assert answer["what"].endswith(f"trained on {row.removeprefix('paper: ')}")


# ---- exposures -------------------------------------------------------------------------------------------


def test_the_ssim_excludes_dark_frames_where_the_psnr_does_not():
    psnr = [[14.0, 19.0, 24.0, 31.0], [14.5, 19.5, 24.5, 31.5]]
    text = claims.follows(psnr, [[0.1, 0.2, 0.35, 0.7], [0.1, 0.2, 0.36, 0.71]])
    assert text.startswith(
        "An MSE of 82.93 is 28.94 dB. Noisy frames so dark that they have this PSNR have an SSIM of 0.59"
    )
    assert "where the paper prints 0.21: so it is not the MSE of frames like these" in text
    assert text.endswith("is a conjecture.")
    assert "does not exclude the 0.21" in claims.follows(psnr, [[0.1, 0.1, 0.1, 0.25], [0.1, 0.1, 0.2, 0.25]])
    assert "which not all of the noisy frames have" in claims.follows([[14.0, 19.0]], [[0.1, 0.2]])


# ---- texts -----------------------------------------------------------------------------------------------


def test_texts_are_written_from_the_record_only(table, tmp_path):
    kept = Results.open(tmp_path / "claims.json", "claims", {})
    for claim in claims.CLAIMS:
        kept.put(claim.name, 0, claims.decided(claim, claims.Evidence(table)))
    numbers = json.loads(
        kept.path.read_text(), parse_constant=lambda name: pytest.fail(f"{name} in a record")
    )
    assert len(numbers["records"]) == len(claims.CLAIMS)
    again = Results.read(kept.path)
    # Complete, finite, and shown by the texts: only its command, which a test has not, is missing.
    assert records.checked({**again.data(), "commands": ["python experiments/claims.py"]})
    assert shown.TABLES["claims"]({"claims": again}) == claims.verdicts(again)
    assert shown.TABLES["claims-exposures"]({"claims": again}) == ""
    lines = claims.verdicts(again).splitlines()
    assert len(lines) == 2 + len(claims.CLAIMS)
    (line,) = [line for line in lines if line.startswith("| noise falls by 40 % |")]
    assert (
        "| **holds** | MSE, ratio: 83.0 to 48.1, 0.579 [0.579, 0.579], 3 seeds x 4 poses, below 0.6?<br>"
        in line
    )
    assert "beside it, MSE modulo 256, ratio: " in line
    (line,) = [line for line in lines if line.startswith("| 11 frames a second |")]
    assert (
        "| **not tested** | beside it, a frame of 1024x1024 on this machine's cores: not tested, it was not"
        in line
    )


def test_the_record_is_decided_again_from_the_other_records(tmp_path, capsys):
    claims.main(["-o", str(tmp_path)])
    kept, made = records.Records()["claims"], Results.read(tmp_path / "claims.json")
    assert made.configurations() == kept.configurations()
    verdicts_of = [[found.of(name, "verdict") for name in kept.configurations()] for found in (made, kept)]
    assert verdicts_of[0] == verdicts_of[1]
    assert "| noise falls by 40 % | MSE 82.93 to 48.04, -42 % | **holds** |" in capsys.readouterr().out
