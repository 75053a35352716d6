"""Table 1 and the claims, tiny: every row runs, and nothing is done twice."""

import re
from dataclasses import replace

import numpy as np
import pytest
import table1
from baselines import rows
from lab.results import Results

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


def test_what_is_there_is_not_done_again(made, monkeypatch, capsys):
    folder, arguments = made
    capsys.readouterr()
    for name in ("judged", "in_turns"):
        monkeypatch.setattr(table1, name, lambda *_: pytest.fail("it is there"))
    table1.main([*arguments, "--seeds", "0", "1", "--only", *PLAIN])
    assert capsys.readouterr().out == (folder / "out/table1.md").read_text()


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
