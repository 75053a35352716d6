"""Table 1 and the claims, tiny: every row runs, nothing is done twice, and what is missing is said."""

from __future__ import annotations

import argparse
import json
from dataclasses import replace

import claims
import numpy as np
import pytest
import table1
from baselines import rows
from lab import scores
from lab.results import Results

from wamnet.cli.images import read_png
from wamnet.kernels import open_executor

PLAIN = ["input", "wamnet", "wamnet-own", "wamnet-short", "wamnet-best", "svgf", "nlm", "render30"]
"""The rows that need neither PyTorch nor Open Image Denoise."""

TINY = replace(table1.SCALES["toy"], size=48, pix2pix={**table1.SCALES["toy"].pix2pix, "crop": 24})
"""A scale for rows that train no pix2pix: its measure of blocks wants patches."""


SMALLEST = replace(table1.SCALES["toy"], train=1, short_frames=1)
"""The smallest scale for pix2pix: its patches have 64 pixels at least."""


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
        (line,) = [line for line in table.splitlines() if line.startswith(f"| {rows.ROWS[row].text} |")]
        mse, psnr, paper = (float(cell.split("±")[0]) for cell in line.split("|")[2:5])
        # Printed with one digit: half of it, through the slopes of the logarithms; means of logarithms over
        # two seeds are off by the spread of theirs, which is below a tenth.
        assert abs(psnr - 10 * np.log10(255**2 / mse)) <= 0.1 + 5.0 / mse
        # Both have two digits: half a step of each.
        assert abs(paper / psnr - np.log(10)) <= 0.005 * (1 + np.log(10)) / psnr * (1 + 1e-3)
        assert "±" in line
    assert (folder / "out/crops.png").exists()


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
    assert "table1: pix2pix is left out: torch is missing; pip install 'wamnet[baselines]'" in told
    assert "table1: oidn-noisy is left out: pyoidn is missing" in told


def test_no_seed_shares_its_noise(made):
    folder, _ = made
    with open_executor("opencl") as device:
        bench = rows.Bench(TINY, folder / "cache", device)
        noise = [frame.info["seed"] for seed in (0, 1) for frame, _ in bench.train_pairs(seed, 3)]
        noise += [case.noisy.info["seed"] for seed in (0, 1) for case in bench.cases(seed)]
        targets = [frame.info["seed"] for _, frame in bench.train_pairs(0, 3)]
        targets += [case.reference.info["seed"] for case in bench.cases(0)]
        assert len(set(noise + targets)) == 2 * (3 + 1) + 3 + 1
        # References are rendered once, whatever the seed.
        assert [f.info["seed"] for _, f in bench.train_pairs(1, 3)] == targets[:3]
        train, test = bench.times()
        assert not set(train) & set(test)


@pytest.mark.parametrize("row", ["dncnn", "dncnn-shrunk", "pix2pix"])
def test_rows_in_pytorch(row, tmp_path, executor_named, capsys, monkeypatch):
    pytest.importorskip("torch", reason="PyTorch is missing: pip install 'wamnet[baselines]'")
    executor_named("opencl")
    monkeypatch.setitem(table1.SCALES, "toy", SMALLEST if row == "pix2pix" else TINY)
    arguments = ["--scale", "toy", "-o", str(tmp_path / "out"), "--cache", str(tmp_path / "cache")]
    table1.main([*arguments, "--seeds", "0", "--no-times", "--only", row])
    assert rows.ROWS[row].text in capsys.readouterr().out


@pytest.mark.parametrize("row", ["oidn", "oidn-noisy", "oidn-clean"])
def test_rows_of_open_image_denoise(row, made):
    pytest.importorskip("pyoidn", reason="Open Image Denoise is missing: pip install 'wamnet[baselines]'")
    folder, _ = made
    with open_executor("opencl") as device:
        bench = rows.Bench(TINY, folder / "cache", device)
        (case,) = bench.cases(0)
        display, linear = rows.ROWS[row].make(bench, 0).picture(case)
    assert linear is not None
    assert scores.metrics.psnr(display, rows.to_display(case.reference["color"])) > 15.0


# ---- claims ----------------------------------------------------------------------------------------------


def numbers(tmp_path, **found):
    """Give numbers to claims: of each row what is named `row_name`, with - as __."""
    kept = Results.open(tmp_path / "t.json", "table1", {})
    values: dict[str, dict[str, float]] = {}
    for key, value in found.items():
        row, name = key.rsplit("_", 1)
        values.setdefault(row.replace("__", "-"), {})[name] = value
    for row, each in values.items():
        kept.put(row, 0, each)
    return claims.Numbers(kept, list(values), {"step_ms": 4.0, "frame_ms": 100.0})


def claim(text):
    (found,) = [claim for claim in claims.CLAIMS if text in claim.text]
    return found


def test_the_paper_s_own_numbers_bear_its_claims_out(tmp_path):
    n = numbers(
        tmp_path,
        input_mse255=82.93,
        input_wrapped=82.93,
        input_ssim=0.21,
        dncnn_ssim=0.44,
        dncnn_psnr=29.15,
        wamnet_mse255=48.04,
        wamnet_wrapped=48.04,
        wamnet_ssim=0.68,
        wamnet_psnr=31.31,
        wamnet_worth=30.0,
        wamnet_blocks=1.0,
        pix2pix_ssim=0.70,
        pix2pix_psnr=32.19,
        pix2pix_blocks=2.0,
    )
    for text in ("noise", "structure", "worth", "DnCNN", "pix2pix is", "blocks", "takes 90 s"):
        assert claim(text).holds(n), text
    assert not claim("11 frames").holds(n)  # 100 ms are ten frames
    assert claim("noise").here(n) == "modulo 256: 82.9 to 48.0, -42 %; as it is: 82.9 to 48.0, -42 %"
    assert claim("structure").here(n) == "0.21 to 0.68, +224 %"
    assert claim("takes 90 s").here(n) == "4.0 ms a step, 20,000 steps: 80 s"


def test_a_claim_without_its_numbers_does_not_hold(tmp_path):
    n = numbers(tmp_path, input_ssim=0.21)
    for found in claims.CLAIMS:
        if found.rows:
            assert not found.holds(n), found.text


def test_claims_read_the_table_s_records(made, monkeypatch, capsys):
    folder, arguments = made
    monkeypatch.setattr(claims, "ROWS", ("input", "wamnet", "wamnet-own", "wamnet-best"))
    monkeypatch.setattr(table1, "run", lambda _: pytest.fail("all rows are there"))
    place = ["-o", str(folder / "claims"), "--table", str(folder / "out"), *arguments[4:]]
    claims.main(["--scale", "toy", "--seeds", "0", "1", *place])
    printed = capsys.readouterr().out
    assert printed == (folder / "claims/claims.md").read_text()
    assert "| noise falls by 40 % | MSE 82.93 to 48.04, -42 % | modulo 256: " in printed
    assert "DnCNN" not in printed


def test_claims_make_what_is_missing(tmp_path, monkeypatch, executor_named):
    asked = []
    monkeypatch.setattr(table1, "run", asked.append)
    monkeypatch.setattr(table1, "available", lambda _: ["input", "wamnet"])
    options = argparse.Namespace(scale="toy", executor="opencl", seeds=[0], table=tmp_path, output=tmp_path)
    claims.needed(options)
    assert (asked[0].only, asked[0].output, asked[0].no_times) == (["input", "wamnet"], tmp_path, True)
