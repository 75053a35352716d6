"""The comparison of quality: all of it at toy size, and the models it makes."""

import json
from dataclasses import replace

import pytest
import quality
from lab import scores
from lab.sets import SETS

import models
from wamnet.models.model_file import load_model
from wamnet.refimpl.light.variation import ranges_from_json

pytestmark = pytest.mark.nightly  # it runs with the experiments

TOY = quality.PLANS["toy"]


@pytest.fixture
def bench(tmp_path) -> quality.Bench:
    return quality.Bench("cornell", TOY, tmp_path / "cache", "numpy")


def test_the_whole_way(tmp_path, capsys):
    """Tables, JSON and a sheet; a second run finds all of it there and says the same."""
    options = [
        "--scale",
        "toy",
        "--sets",
        "cornell",
        "--only",
        "input",
        "best-16",
        "shipped",
        "past-16",  # no frame of this set has its layers
        "--seeds",
        "0",
        "1",
    ]
    options += ["--executor", "numpy", "--rounds", "0", "--cache", str(tmp_path / "c"), "-o", str(tmp_path)]
    quality.main(options)
    text = (tmp_path / "quality.md").read_text()
    assert capsys.readouterr().out.strip().endswith(text.strip())
    assert "| cornell, inside the training range: input, 1 spp |" in text
    data = json.loads((tmp_path / "quality.json").read_text())
    found = {(r["configuration"], r["seed"]) for r in data["records"]}
    rows = {
        (f"cornell, {split}: {row}", seed)
        for split in ("test", "outside")
        for row in ("input", "best-16")
        for seed in (0, 1)
    }
    bounds = {("cornell, certificate: best-16", seed) for seed in (0, 1)}
    assert found == {*rows, *bounds, ("cornell: ladder", 0), ("cornell: nearest training frame", 0)}
    white = 1.0  # a bound from here on would say nothing of a colour; one of 0 would not be float32
    certificates = [r["values"] for r in data["records"] if "certificate" in r["configuration"]]
    assert all(0.0 < values["bound"] < white for values in certificates)
    each = [
        r["values"]["per_frame"]["psnr"]
        for r in data["records"]
        if (r["configuration"], r["seed"]) in rows and "best-16" in r["configuration"]
    ]
    assert [len(values) for values in each] == [2, 2, 2, 2]
    assert (tmp_path / "cornell.png").stat().st_size > 0
    before = (tmp_path / "quality.json").read_bytes()
    quality.main(options)
    assert (tmp_path / "quality.md").read_text() == text
    assert (tmp_path / "quality.json").read_bytes() == before


def test_models_carry_their_scores(bench, tmp_path, monkeypatch):
    """Those of the experiment's rows, and a digest beside each file."""
    monkeypatch.setattr(quality, "filtered", lambda frame, *_: frame["color"])
    models.written(tmp_path / "m", {"cornell": models.shipped(bench, "best-16")})
    model = load_model(tmp_path / "m" / "cornell.safetensors")
    found = json.loads(model.info["scores"])
    assert list(found) == list(models.SCORED)
    row, ladder = quality.ROWS["best-16"], scores.Ladder((1,), (1.0,))
    want = quality.judged(bench, row, "test", ladder, 0)
    assert found["16 rays"] == {name: round(want[name], 4) for name in ("psnr", "ssim", "flip")}
    want = quality.judged(bench, quality.ROWS["input"], "test", ladder, 0)
    assert found["input"]["psnr"] == round(want["psnr"], 4)
    assert model.info["trained_on_feature_spp"] == "16"
    assert ranges_from_json(model.info["trained_on_ranges"]) == SETS["cornell"].ranges
    assert "trained_on_yaw_deg" not in model.info
    digest, name = (tmp_path / "m" / models.SUMS).read_text().split()
    assert name == "cornell.safetensors"
    assert digest == quality_sum(tmp_path / "m" / name)
    assert replace(model, info={}).siren.widths[0] == 12 * 12 * 12


def quality_sum(path) -> str:
    import hashlib

    return hashlib.sha256(path.read_bytes()).hexdigest()
