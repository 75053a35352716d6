"""The comparison of quality: what its rows are given, the whole way at toy size, and the models it makes."""

from __future__ import annotations

import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import quality
from lab import scores
from lab.sets import SETS

import models
from wamnet.models.model_file import load_model
from wamnet.refimpl.encoding import to_display
from wamnet.refimpl.errors import InputError
from wamnet.refimpl.frame import Frame
from wamnet.refimpl.light.variation import ranges_from_json

pytestmark = pytest.mark.nightly  # it runs with the experiments

TOY = quality.PLANS["toy"]


@pytest.fixture
def bench(tmp_path) -> quality.Bench:
    return quality.Bench("cornell", TOY, tmp_path / "cache", "numpy")


def test_test_frames_are_new(bench):
    """Their draws, and the noise of each seed; references are the same for all seeds and features."""
    times = [shot.time for split in ("train", "test", "outside") for shot in bench._shots(split, 1)]
    assert len(set(times)) == len(times) == 6
    first, second = bench.tests(0, 1), bench.tests(1, 1)
    assert not np.array_equal(first[0][0]["color"], second[0][0]["color"])
    assert np.array_equal(first[0][1]["color"], second[0][1]["color"])
    noises = [frame["color"] for frame, _ in bench.training(1)]
    assert not any(np.array_equal(first[0][0]["color"], noise) for noise in noises)
    assert [float(frame.info["yaw_deg"]) for frame, _ in bench.tests(0, 1, "outside")] == [-34.0, 34.0]


def test_rays_change_features_alone(bench):
    (one, clean), (many, same) = bench.tests(0, 1)[0], bench.tests(0, quality.RAYS)[0]
    assert np.array_equal(one["color"], many["color"])
    assert np.array_equal(clean["color"], same["color"])
    assert not np.array_equal(one["normal"], many["normal"])
    assert many.info["feature_spp"] == str(quality.RAYS)


def test_what_open_image_denoise_is_given(monkeypatch):
    """Radiance as it is; features or none; what is declared clean."""
    seen = []
    monkeypatch.setattr(quality, "filtered", lambda *given: seen.append(given) or given[0]["color"])
    frame = Frame({"color": np.full((2, 2, 3), 3.0)})
    for row in ("oidn-color", "oidn-1", "oidn-clean1", "oidn-clean16", "oidn-fast16"):
        assert np.array_equal(quality.oidn(quality.ROWS[row], frame), frame["color"])
    assert [aux for _, aux, _, _ in seen] == [None, frame, frame, frame, frame]
    assert [clean for _, _, clean, _ in seen] == [False, False, True, True, True]
    assert [how for *_, how in seen] == ["high", "high", "high", "high", "fast"]
    guide = Frame({"albedo": frame["color"], "normal": frame["color"]})
    monkeypatch.setattr(quality, "prefiltered", lambda *given: guide)
    quality.oidn(quality.ROWS["oidn-prefiltered1"], frame)
    assert seen[-1][1:] == (guide, True, "high")
    # What is judged is its radiance as a screen shows it.
    pictures, _ = quality.denoised(
        SimpleNamespace(executor="numpy"),
        quality.ROWS["oidn-1"],
        [frame],
        0,  # type: ignore[arg-type]
    )
    assert np.array_equal(pictures[0][0], to_display(frame["color"]))


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


def test_both_denoisers_see_past_mirrors(monkeypatch, tmp_path):
    """Frames of such sets have these layers, by which one sees; the other gets them by its own names."""
    bench = quality.Bench("glossy", TOY, tmp_path, "numpy")
    (shot, *_), rows = bench._shots("test", quality.RAYS), quality.ROWS
    assert shot.seen
    for name in [name for name, row in rows.items() if row.past and row.recipe]:
        features = quality.RECIPES[rows[name].recipe].features
        others = ("color", "highlights", "seen_smoothed", "seen_emission", "sun")
        assert {f for f in features if f not in others} == set(quality.PAST[1:])
    one = np.ones((2, 2, 3), np.float32)
    layers = {name: one * k for k, name in enumerate(("color", "albedo", "normal", "position"))}
    layers |= {f"seen_{name}": 10.0 + layers[name] for name in ("albedo", "normal", "position")}
    layers |= dict.fromkeys(("depth", "seen_depth"), one[..., :1])
    given = []
    monkeypatch.setattr(quality, "filtered", lambda *parts: given.append(parts) or parts[0]["color"])
    quality.oidn(rows["oidn-past-clean16"], Frame(layers))
    ((colour, aux, clean, how),) = given
    assert (clean, how) == (True, "high")
    assert np.array_equal(colour["color"], layers["color"])
    assert np.array_equal(aux["albedo"], layers["seen_albedo"])
    assert np.array_equal(aux["normal"], layers["seen_normal"])


def test_a_peer_need_not_denoise_what_is_seen_emits(monkeypatch):
    """By hand: what its own paths saw emit is taken off, not below 0, and the clean one added."""
    one = np.ones((2, 2, 3), np.float32)
    frame = Frame({"color": one * 3.0, "seen_emission": one * 0.25})
    own = np.stack([0.5 * one[0], 4.0 * one[1]])
    given = quality.reflected(frame, Frame({"seen_emission": own}))
    assert np.array_equal(given["color"], np.stack([2.5 * one[0], 0.0 * one[1]]))
    monkeypatch.setattr(quality, "past_mirrors", lambda frame: frame)
    monkeypatch.setattr(quality, "prefiltered", lambda *parts: None)
    monkeypatch.setattr(quality, "filtered", lambda frame, *parts: frame["color"])
    found = quality.oidn(quality.ROWS["oidn-past-apart16"], given)
    assert np.array_equal(found, given["color"] + 0.25)


def test_an_unknown_row_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"row 'best-9': unknown \(choose some of input"):
        quality.main(["--only", "best-9", "-o", str(tmp_path / "none")])
    with pytest.raises(InputError, match=r"set 'attic': unknown \(choose some of minicubes"):
        quality.main(["--sets", "attic", "-o", str(tmp_path / "none")])
    assert not (tmp_path / "none").exists()


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
