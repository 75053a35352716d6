"""Denoising kernels on a GPU: the rehearsal on PoCL, missing kernels, and a time limit."""

import argparse
import json

import gpu
import numpy as np
import pytest
from lab.results import Results

pytestmark = pytest.mark.nightly  # it runs with the experiments

NETWORK = "paper's layers"


def measured(tmp_path, *options):
    gpu.main(["--only", "opencl", "--models", NETWORK, "--rounds", "1", "-o", str(tmp_path), *options])
    return Results.read(tmp_path / "gpu.json")


def test_a_kernel_is_checked_and_timed_and_one_that_does_not_exist_is_named(executor_named, tmp_path, capsys):
    executor_named("opencl")
    found = measured(tmp_path, "--size", "32", "--schedules", "tile:8,tile:5")
    values = found.get(f"opencl, tile:8, {NETWORK}", 0)
    assert 0 < values["share"] <= 1
    assert values["error"] > 0
    assert values["least"] <= values["ms"] <= values["most"]
    assert "did you mean 'tile:8'" in found.get(f"opencl, tile:5, {NETWORK}", 0)["missing"]
    shown = capsys.readouterr()
    assert f"| opencl | tile:8 |  |  |  |  | {values['ms']:.2f} |" in shown.out
    assert "tile:5" in shown.err


def test_a_process_that_takes_too_long_ends(executor_named, tmp_path):
    executor_named("opencl")
    found = measured(tmp_path, "--size", "32", "--schedules", "plain", "--seconds", "0.1")
    (record,) = found.records()
    assert "status -9" in record["values"]["missing"]


def test_what_is_prepared_is_what_is_computed(tmp_path):
    plan, images = gpu.planned(NETWORK, "numpy", "plain"), gpu.images_for(NETWORK, (16, 70))
    computed = gpu.wanted(plan, NETWORK, images, None)
    for _ in range(2):  # written, then read
        kept = gpu.wanted(plan, NETWORK, images, tmp_path)
        for name in ("value", "bound"):
            assert all(
                np.array_equal(*pair)
                for pair in zip(getattr(kept, name), getattr(computed, name), strict=True)
            )


@pytest.mark.needs("programs")
def test_c_is_checked_and_timed_as_webassembly(tmp_path):
    gpu.main(["--only", gpu.NODE, "--models", NETWORK, "--rounds", "1", "--size", "32", "-o", str(tmp_path)])
    for schedule in gpu.NODE_SCHEDULES:
        values = Results.read(tmp_path / "gpu.json").get(f"{gpu.NODE}, {schedule}, {NETWORK}", 0)
        assert 0 < values["share"] <= 1
        assert 0 < values["least"] <= values["ms"]
        assert values["read"]


def test_tasks_end_with_what_may_not_end():
    given = argparse.Namespace(only=("opencl", "torch"), models=("minicubes",), schedules=())
    listed = list(gpu.tasks(given))
    assert [task[0] for task in listed] == ["opencl", "torch", "opencl", "opencl", "opencl"]
    assert json.dumps(listed[-1]) == '["opencl", "minicubes, integers", ["groupdot:4"]]'
