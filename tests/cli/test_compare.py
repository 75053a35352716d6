"""Tests of `wamnet compare`: the reference's numbers, in a table and as JSON."""

from __future__ import annotations

import json
import shutil

import numpy as np
import pytest

from wamnet.cli import exr
from wamnet.cli.images import write_png
from wamnet.refimpl import metrics
from wamnet.refimpl.encoding import to_display
from wamnet.refimpl.frame import Frame


def test_the_numbers_are_the_references(wamnet, samples) -> None:
    """On the form of the colours that each metric is meant for, at the exposure that is asked for."""
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


@pytest.mark.parametrize(
    ("names", "text"),
    [
        (("a.exr", "none.exr"), "input file is none.exr: it does not exist; check the name"),
        (("a.exr", "a.jpg"), "input file is a.jpg: its name must end in .exr or .png; convert it"),
        (("a.exr", "text.exr"), "input file is text.exr: it is not an OpenEXR image"),
        (("a.exr", "text.png"), "input file is text.png: it is not a readable PNG"),
        (("a.exr", "small.exr"), "size of a.exr is 13x12: small.exr has 2x1; compare pictures of one size"),
        (("a.exr", "depth.exr"), "depth.exr: list of layers is depth: color must be among them"),
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
