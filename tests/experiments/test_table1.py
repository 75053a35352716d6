"""Table 1 and the claims, tiny: every row runs, nothing is done twice, and what is missing is said."""

from __future__ import annotations

import json
import re
from dataclasses import replace

import numpy as np
import pytest
import table1
from baselines import rows
from lab import scores
from lab.results import Results

from wamnet.cli.files import exr
from wamnet.cli.files.images import read_png
from wamnet.kernels import open_executor
from wamnet.models.data import geometry
from wamnet.refimpl.errors import InputError
from wamnet.refimpl.frame import Frame

pytestmark = pytest.mark.nightly  # it runs with the experiments

PLAIN = ["input", "wamnet-color", "wamnet-color-own", "wamnet", "wamnet-own", "wamnet-short", "wamnet-best"]
PLAIN += ["svgf", "nlm", "render30", "render30-own"]
"""The rows that need neither PyTorch nor Open Image Denoise."""

TINY = replace(table1.SCALES["toy"], size=48, pix2pix={**table1.SCALES["toy"].pix2pix, "crop": 24})
"""A scale for rows that train no pix2pix: its measure of blocks wants patches."""


@pytest.fixture(scope="module")
def made(tmp_path_factory, executor_named):
    """Give the folder of a table of the plain rows, made once, and its cache."""
    executor_named("opencl")
    folder, patch = tmp_path_factory.mktemp("table1"), pytest.MonkeyPatch()
    patch.setitem(table1.SCALES, "toy", TINY)
    arguments = ["--scale", "toy", "-o", str(folder / "out"), "--cache", str(folder / "cache")]
    table1.main([*arguments, "--seeds", "0", "1", "--rounds", "1", "--only", *PLAIN])
    yield folder, arguments
    patch.undo()


def test_every_row_has_its_numbers(made):
    folder, _ = made
    table = (folder / "out/table1.md").read_text()
    for row in PLAIN:
        line, *_ = [line for line in table.splitlines() if line.startswith(f"| {rows.ROWS[row].text} |")]
        mse, psnr, paper = (float(re.split("[±[]", cell)[0]) for cell in line.split("|")[2:5])
        # Printed with one digit: half of it, through the slope of the logarithm. A mean of logarithms is off
        # the logarithm of a mean by half the relative variance at most; frames differ by a third at most.
        assert abs(psnr - 10 * np.log10(255**2 / mse)) <= 10 / np.log(10) * (0.5 * 0.33**2 + 0.05 / mse)
        # Both have two digits: half a step of each.
        assert abs(paper / psnr - np.log(10)) <= 0.005 * (1 + np.log(10)) / psnr * (1 + 1e-3)
        assert "±" in line
    assert (folder / "out/crops.png").exists()


def test_blocks_are_kept_of_each_frame(made):
    kept = Results.read(made[0] / "out/table1.json")
    for values in (kept.get("wamnet", 0), kept.get("wamnet-own", 0)):
        each = values["per_frame"]["blocks"]
        assert len(each) == len(values["per_frame"]["psnr"])
        # A ratio of sums lies between the frames' own, up to the roundings of so many terms.
        rounding = 2 * 48 * 48 * 3 * 2.0**-52
        assert min(each) * (1 - rounding) <= values["blocks"] <= max(each) * (1 + rounding)


def test_the_input_s_scores_are_those_of_its_picture(made):
    folder, _ = made
    data = json.loads((folder / "out/table1.json").read_text())
    (values,) = [r["values"] for r in data["records"] if (r["configuration"], r["seed"]) == ("input", 0)]
    pictures = [read_png(folder / f"out/pictures/{name}.png") for name in ("input", "reference")]
    # The pictures were rounded to 8 bits: each colour by half a level.
    step = 0.5 / 255.0
    found = scores.metrics.mse(*pictures)
    assert abs(values["mse"] - found) <= 2.0 * np.sqrt(found) * 2 * step + (2 * step) ** 2


def test_what_is_there_is_not_done_again(made, monkeypatch, capsys):
    folder, arguments = made
    capsys.readouterr()
    for name in ("judged", "in_turns"):
        monkeypatch.setattr(table1, name, lambda *_: pytest.fail("it is there"))
    table1.main([*arguments, "--seeds", "0", "1", "--only", *PLAIN])
    assert capsys.readouterr().out == (folder / "out/table1.md").read_text()


def test_rows_without_their_packages_are_left_out(monkeypatch, capsys):
    monkeypatch.setattr(rows, "find_spec", lambda name: None if name in ("torch", "pyoidn") else object())
    assert set(rows.ROWS) - set(table1.available(list(rows.ROWS))) == {
        name for name, row in rows.ROWS.items() if {"torch", "pyoidn"} & set(row.packages)
    }
    told = capsys.readouterr().err
    assert "table1: pix2pix is left out: torch is missing; pip install --group baselines" in told
    assert "table1: oidn-noisy is left out: pyoidn is missing" in told


def test_no_seed_shares_its_noise(made):
    folder, _ = made
    with open_executor("opencl") as device:
        bench = rows.Bench.of(TINY, folder / "cache", device)
        kinds = (bench.split.train, bench.split.validation, bench.split.test)
        spps = (TINY.train_spp, TINY.validation_spp, TINY.test_spp)
        found = {
            seed: [bench.files(shots, spp, seed) for shots, spp in zip(kinds, spps, strict=True)]
            for seed in (0, 1)
        }
    files = {seed: [pair for pairs in each for pair in pairs] for seed, each in found.items()}
    noisy = [exr.read_frame(pair[0]).info["seed"] for each in files.values() for pair in each]
    targets = [exr.read_frame(pair[1]).info["seed"] for pair in files[0]]
    assert len(set(noisy + targets)) == len(noisy + targets) == 3 * (3 + 1 + 2)
    # References are rendered once, whatever the seed.
    assert [pair[1] for pair in files[0]] == [pair[1] for pair in files[1]]


@pytest.mark.parametrize("scale", table1.SCALES.values(), ids=list(table1.SCALES))
def test_no_test_frame_has_the_geometry_of_another(scale):
    """Each of the scales' frames shows cubes of its own: whatever is alike would be refused."""
    split = rows.split_of(scale)
    found = rows.compared(split)
    assert min(nearest["differing"] for nearest in found["nearest"].values()) > geometry.ALIKE
    assert len({t for times in found["times_s"].values() for t in times}) == sum(
        (scale.train, scale.validation, scale.test)
    )


def test_frames_that_are_alike_are_refused():
    split = rows.split_of(TINY)
    turned = replace(split.train[0], time=split.train[0].time + rows.TURN_SECONDS / 4)
    with pytest.raises(InputError, match=r"test frame 'test frame 0 .*: normals and depths are those of tr"):
        rows.compared(replace(split, test=(turned,)))


def test_scores_of_each_frame_are_kept(made):
    folder, _ = made
    kept = Results.read(folder / "out/table1.json")
    values = kept.get("wamnet", 1)
    assert len(values["per_frame"]["psnr"]) == TINY.test
    # Two means of the same numbers, added in another order: a rounding for each of them.
    mean = np.mean(values["per_frame"]["psnr"])
    assert abs(values["psnr"] - mean) <= 2 * TINY.test * np.finfo(float).eps * abs(mean)
    assert len(kept.get("wamnet-own", 1)["per_frame"]["psnr"]) == 1


def test_a_network_s_own_frame_is_its_training_frame(made):
    """Seeds have different ones, and the picture that is judged has the noise that was trained on."""
    folder, _ = made
    with open_executor("opencl") as device:
        bench = rows.Bench.of(TINY, folder / "cache", device)
        own = [rows.ROWS["wamnet-own"].make(bench, seed).cases[0] for seed in (0, 1)]
        trained_on = [bench.pairs([bench.own(seed)], seed)[0] for seed in (0, 1)]
    for case, (noisy, clean) in zip(own, trained_on, strict=True):
        assert np.array_equal(case.noisy["color"], noisy["color"])
        assert np.array_equal(case.reference["color"], clean["color"])
    assert not np.array_equal(own[0].noisy["normal"], own[1].noisy["normal"])


def test_records_of_other_settings_are_refused(made, monkeypatch):
    _, arguments = made
    other = {**TINY.paper, "steps": 3}
    monkeypatch.setitem(table1.SCALES, "toy", replace(TINY, paper=other))
    with pytest.raises(InputError, match=r"record of wamnet, seed 0 '.*': was made with .*\"steps\": 2"):
        table1.main([*arguments, "--seeds", "0", "--only", "wamnet"])


def test_a_training_that_was_not_flat_may_go_on(tmp_path):
    kept = Results.open(tmp_path / "t.json", "table1", {})
    longer = replace(TINY, dncnn={**TINY.dncnn, "steps": 9})
    for flat, expected in ((False, [("dncnn", 0)]), (True, None)):
        kept.put("dncnn", 0, {"flat": flat, "settings": TINY.dncnn})
        assert not list(table1.left(kept, ["dncnn"], [0], TINY))
        if expected is None:
            with pytest.raises(InputError, match="record of dncnn, seed 0"):
                list(table1.left(kept, ["dncnn"], [0], longer))
        else:
            assert list(table1.left(kept, ["dncnn"], [0], longer)) == expected


def test_costly_rows_have_their_own_seeds(tmp_path):
    scale = replace(TINY, few=(7,))
    kept = Results.open(tmp_path / "t.json", "table1", {})
    assert list(table1.left(kept, ["dncnn", "input"], None, scale)) == [
        ("dncnn", 7),
        *(("input", seed) for seed in (0, 1, 2)),
    ]
    assert list(table1.left(kept, ["dncnn"], [1, 2], scale)) == [("dncnn", 1), ("dncnn", 2)]


def test_renders_of_equal_time_and_of_equal_error_by_hand(tmp_path):
    kept, times = (Results.open(tmp_path / f"{name}.json", name, {}) for name in ("table", "times"))
    # Errors of two frames halve as samples double.
    mse = [[0.4, 0.8], [0.2, 0.4], [0.1, 0.2]]
    kept.put("ladder", 0, {"spp": [1, 2, 4], "mse": [0.6, 0.3, 0.15], "frames_mse": mse})
    trained = {"training_s": 90.0, "training_samples": 1000}
    kept.put("wamnet", 0, {"mse": 0.05, "worth": 12.0, **trained})
    clock = {"ms": 30.0, "input_ms": 20.0, "render1_ms": 20.0, "sample_ms": 10.0}
    times.put("wamnet", 0, clock)
    found = table1.priced("wamnet", kept, times)
    # 20 ms and 30 ms: a render of one sample, and three more of 10 ms. 12 samples: 20 + 11 * 10 ms.
    assert found["total_ms"] == 50.0
    # Interpolated in logarithms: a few roundings of numbers below 10.
    eps = float(np.finfo(float).eps)
    assert abs(found["equal_time_spp"] - 4.0) <= 100 * eps
    assert abs(found["equal_time_psnr"] + 5.0 * (np.log10(0.1) + np.log10(0.2))) <= 100 * eps
    assert found["equal_error_ms"] == 130.0
    # 1,000 samples of 10 ms and 90 s of training, at 80 ms a frame.
    assert (found["frames_s"], found["pays_after"]) == (10.0, 1250)
    kept.put("input", 0, {"mse": 0.6, "worth": 1.0})
    times.put("input", 0, {**clock, "ms": 0.0})
    assert table1.priced("input", kept, times)["pays_after"] == np.inf


def test_what_an_input_costs_is_counted(made):
    folder, _ = made
    oidn = [row for row in rows.ROWS if row.startswith("oidn")]
    with open_executor("opencl") as device:
        bench = rows.Bench.of(TINY, folder / "cache", device)
        costs = {row: rows.ROWS[row].make(bench, 0).cost for row in (*PLAIN, *oidn)}
    assert {row: cost for row, cost in costs.items() if cost != (1, 0)} == {
        "wamnet-best": (1, 16),
        "oidn-rays": (1, 16),
        "oidn-spp": (3, 0),
        "oidn-clean": (1, TINY.test_spp),
        "render30": (0, 0),
        "render30-own": (0, 0),
    }


def test_small_frames_are_means_of_shown_colours():
    shown = np.arange(48.0).reshape(4, 4, 3) / 48.0
    found = rows.smaller(Frame({"color": rows.from_display(shown)}), 2)
    expected = shown.reshape(2, 2, 2, 2, 3).mean(axis=(1, 3))
    # Encoded, decoded and encoded again, in float32; the slope of the encoding is at most 12.92.
    assert np.max(np.abs(rows.to_display(found["color"]) - expected)) <= 16 * 12.92 * 2.0**-24
