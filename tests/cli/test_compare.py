"""Tests of `wamnet compare`: the reference's numbers, in a table and as JSON; paths, and when they fail."""

import json
import shutil

import numpy as np
import pytest

from wamnet.cli.files import exr
from wamnet.cli.files.images import write_png
from wamnet.kernels.judge import compare_paths
from wamnet.kernels.judge.compare_paths import QUANTITIES, Unexplained
from wamnet.refimpl import metrics
from wamnet.refimpl.encoding import to_display
from wamnet.refimpl.frame import Frame


def test_the_numbers_are_the_references(wamnet, samples) -> None:
    """On the form of the colours that each metric is meant for, at the requested exposure."""
    names = samples / "noisy.exr", samples / "reference.exr"
    data = json.loads(wamnet("compare", *names, "--json", "--exposure", -1).out)
    a, b = (exr.read_frame(name)["color"] for name in names)
    assert data["metrics"]["PSNR"] == metrics.psnr(to_display(a, -1.0), to_display(b, -1.0))
    assert data["metrics"]["SSIM"] == metrics.ssim(to_display(a, -1.0), to_display(b, -1.0))
    assert data["metrics"]["relMSE"] == metrics.relmse(a, b)
    assert set(data["metrics"]) == set(metrics.METRICS)
    assert data["notes"] == {}


def test_the_table(wamnet, samples) -> None:
    """Every metric has a line."""
    out = wamnet("compare", samples / "noisy.exr", samples / "reference.exr").out
    assert all(name in out for name in metrics.METRICS)
    assert " dB" in out


def test_the_penumbra_is_the_reference_s(wamnet, tmp_path) -> None:
    """MET-11: a row more where the reference has the layers that it is made of."""
    size = ("--width", 16, "--height", 16, "--executor", "numpy", "--workers", 1)
    assert wamnet("render", "cornell", *size, "-o", "noisy.exr").status == 0
    assert wamnet("render", "cornell", *size, "--spp", 4, "--shadow-rays", 4, "-o", "clean.exr").status == 0
    found = json.loads(wamnet("compare", "noisy.exr", "clean.exr", "--json").out)["metrics"]
    noisy, clean = (exr.read_frame(tmp_path / f"{name}.exr") for name in ("noisy", "clean"))
    mask = metrics.penumbra(clean["direct"], clean["unshadowed"])
    error = metrics.inside(mask, *(to_display(frame["color"]) for frame in (noisy, clean)))
    assert found["penumbra RMSE"] == error > 0.0
    assert "direct" not in noisy
    # Under a sun the two layers are of different light.
    sunny = Frame({**clean.layers, "sun": np.full_like(clean["normal"], 3**-0.5)}, clean.info)
    exr.write_frame(tmp_path / "sunny.exr", sunny)
    data = json.loads(wamnet("compare", "noisy.exr", "sunny.exr", "--json").out)
    assert "penumbra RMSE" not in data["metrics"]


@pytest.mark.parametrize(
    ("names", "text"),
    [
        (("a.exr", "none.exr"), "input file 'none.exr': not found (check the name"),
        (("a.exr", "a.jpg"), "input file 'a.jpg': must end in .exr or .png (convert it"),
        (("a.exr", "text.exr"), "input file 'text.exr': is not an OpenEXR image"),
        (("a.exr", "text.png"), "input file 'text.png': is not a PNG"),
        (("a.exr", "small.exr"), "size of a.exr '13x12': small.exr has 2x1 (compare images of equal size"),
        (("a.exr", "depth.exr"), "depth.exr: list of layers 'depth': color must be among them"),
    ],
)
def test_refusals(refused, samples, tmp_path, names, text) -> None:
    """The file is named."""
    shutil.copy(samples / "noisy.exr", tmp_path / "a.exr")
    (tmp_path / "text.exr").write_text("hello")
    (tmp_path / "text.png").write_text("hello")
    exr.write_frame(tmp_path / "small.exr", Frame({"color": np.zeros((1, 2, 3))}))
    exr.write_frame(tmp_path / "depth.exr", Frame({"depth": np.zeros((12, 13, 1))}))
    assert text in refused("compare", *names)


# ---- paths ---------------------------------------------------------------------------------------------

PATHS = ("compare", "--paths", "cornell", "--executor", "numpy", "--width", 12, "--height", 9, "--spp", 2)


def test_paths_in_tables(wamnet) -> None:
    """Counts by depth, quantities by depth, the generator and Welch's test."""
    outcome = wamnet(*PATHS, "--max-depth", 2, "--set", "time=2")
    assert outcome.status == 0, outcome.err
    lines = outcome.out.splitlines()
    for word in ("depth", "paths", "undecided", "different", "unexplained", "parted", "moved"):
        assert word in lines[2]
    assert sum(line.split()[:2] == [str(d), "108"] for d, line in enumerate(lines[4:7])) >= 1
    assert all(quantity in outcome.out for quantity in QUANTITIES)
    assert "random numbers: 108 of 108 paths have the reference's, to the bit" in outcome.out
    assert "picture: 8 against 2 spp" in outcome.out
    assert lines[-1] == "passed"


def test_paths_as_json(wamnet) -> None:
    outcome = wamnet(*PATHS, "--max-depth", 1, "--json", "--seed", 7, "--sample", 3)
    assert outcome.status == 0, outcome.err
    data = json.loads(outcome.out)
    assert data["paths"]["view"] == {"width": 12, "height": 9, "sample": 3, "seed": 7}
    assert [depth["depth"] for depth in data["paths"]["depths"]] == [0, 1]
    assert set(data["paths"]["depths"][1]["gaps"]) == set(QUANTITIES)
    assert data["paths"]["passed"]
    assert data["image"]["passed"]
    assert data["image"]["spp"] == [8, 2]


def test_paths_that_differ_end_with_status_1(wamnet, monkeypatch) -> None:
    monkeypatch.setattr(compare_paths, "wrong_words", lambda *_: 5)
    outcome = wamnet(*PATHS, "--max-depth", 0)
    assert outcome.status == 1
    assert "random numbers: 103 of 108 paths" in outcome.out
    assert outcome.out.splitlines()[-1] == "FAILED: the kernel is not the reference"
    assert wamnet(*PATHS, "--max-depth", 0, "--json").status == 1


def test_unexplained_components_in_words() -> None:
    text = str(Unexplained(2, 3, 4, "point_x", 1.5, 1.0, 1.25))
    assert text == "pixel (3, 4), depth 2, point_x: expected 1.125, got 1.5, bound 0.125"


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        ((), "wamnet compare: needs IMAGE and REFERENCE, or --paths SCENE (see wamnet"),
        (("a.exr",), "wamnet compare: needs IMAGE and REFERENCE, or --paths SCENE"),
        (("a.exr", "b.exr", "--width", 64), "argument '--width': has no meaning without --paths SCENE ("),
        (("a.exr", "b.exr", "--set", "a=1"), "argument '--set': has no meaning without --paths SCENE"),
        (("a.exr", "--paths", "empty"), "argument 'IMAGE': has no meaning with --paths (leave it out"),
        (("--paths", "empty", "--exposure", 0), "argument '--exposure': has no meaning with --paths"),
        (("--paths", "nowhere"), "scene 'nowhere': unknown"),
        (("--paths", "empty", "--width", 0), "width 0: must be an integer from 1 to 65536"),
        (("--paths", "empty", "--executor", "numpy", "--spp", 1), "spp 1: Welch's test needs the variance"),
    ],
)
def test_refusals_of_paths(refused, arguments, text) -> None:
    """What has no meaning is named, and nothing is left out in silence."""
    assert text in refused("compare", *arguments)


def test_identical_and_tiny_pictures(wamnet, tmp_path) -> None:
    """Infinity and metrics that are not defined are null in JSON, with the reason."""
    write_png(tmp_path / "a.png", np.full((2, 3, 3), 0.5))
    outcome = wamnet("compare", "a.png", "a.png", "--json")
    assert outcome.status == 0
    data = json.loads(outcome.out)
    assert data["metrics"]["MSE"] == 0.0
    assert data["metrics"]["PSNR"] is None
    assert data["metrics"]["SSIM"] is None
    assert data["notes"]["PSNR"] == "infinite: no difference"
    assert data["notes"]["SSIM"].startswith("SSIM needs (height, width, channels) with at least 11 rows")
    assert "infinite: no difference" in wamnet("compare", "a.png", "a.png").out
