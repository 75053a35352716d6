"""Rows of table 1 that are made with PyTorch or Open Image Denoise, tiny."""

from dataclasses import replace

import pytest
import table1
from baselines import rows
from lab import scores
from packages import needed

from wamnet.kernels import open_executor

pytestmark = [pytest.mark.nightly, pytest.mark.apart, pytest.mark.needs("packages")]

TINY = replace(table1.SCALES["toy"], size=48, pix2pix={**table1.SCALES["toy"].pix2pix, "crop": 24})
"""A scale for rows that train no pix2pix: its measure of blocks wants patches."""

SMALLEST = replace(table1.SCALES["toy"], train=1, test=1, short_frames=1)
"""The smallest scale for pix2pix: its patches have 64 pixels at least."""


@pytest.mark.parametrize("row", ["dncnn", "dncnn-shrunk", "dncnn-shrunk-own", "pix2pix"])
def test_rows_in_pytorch(row, tmp_path, executor_named, capsys, monkeypatch):
    needed("torch")
    executor_named("opencl")
    monkeypatch.setitem(table1.SCALES, "toy", SMALLEST if row == "pix2pix" else TINY)
    arguments = ["--scale", "toy", "-o", str(tmp_path / "out"), "--cache", str(tmp_path / "cache")]
    table1.main([*arguments, "--seeds", "0", "--no-times", "--only", row])
    assert rows.ROWS[row].text in capsys.readouterr().out


@pytest.fixture(scope="module")
def cache(tmp_path_factory):
    """Give a folder for the frames that all rows share."""
    return tmp_path_factory.mktemp("frames")


OIDN = [row for row in rows.ROWS if row.startswith("oidn")]


@pytest.mark.parametrize("row", OIDN)
def test_rows_of_open_image_denoise(row, cache, executor_named):
    needed("pyoidn")
    executor_named("opencl")
    with open_executor("opencl") as device:
        bench = rows.Bench.of(TINY, cache, device)
        ready = rows.ROWS[row].make(bench, 0)
        case = next(bench.cases(0, ready.rays, ready.spp))
        display, linear = ready.picture(case)
    assert linear is not None
    assert scores.metrics.psnr(display, rows.to_display(case.reference["color"])) > 15.0
