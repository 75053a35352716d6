"""The benchmark of renderers runs, and its numbers are those of the ways that it names."""

from __future__ import annotations

import os
import re
from pathlib import Path

import pytest
import render


@pytest.fixture
def printed(capsys, executor_named):
    """Give a function that runs the benchmark on tiny frames and returns what it prints."""
    executor_named("opencl")

    def run(*arguments):
        render.main(["--size", "8", "--spp", "2", "--workers", "1", *arguments])
        return capsys.readouterr().out

    return run


def test_table_has_a_row_for_each_scene_and_way(printed):
    text = printed("--scenes", "furnace", "empty", "--by", "opencl", "numpy", "--repeats", "2")
    rows = re.findall(
        r"^\| (\w+) \| ([\w ,]+?) \|(?: [\d.,]+ \|){2} [\d.]+ - [\d.]+ \|(?: [\d.,]+ \|){2}$", text, re.M
    )
    ways = ["opencl", "numpy, 1 process"]
    assert rows == [(scene, way) for scene in ("furnace", "empty") for way in ways]
    assert text.count("numpy, 1 process: mean colour 0.250000, opencl's 0.250000: ") == 1
    assert "8x8, 2 spp, 6 edges" in text


def test_one_turn_has_no_error_to_compare_with(printed):
    assert "mean colour" not in printed("--scenes", "empty", "--by", "opencl", "numpy", "--repeats", "1")


def test_depth_counts_edges(printed):
    """A furnace of albedo a and emission 1 shows 1 + a + .. + a^(depth - 1): 1.75 for a = 1/2 and depth 3."""
    text = printed("--scenes", "furnace", "--by", "opencl", "numpy", "--repeats", "2", "--depth", "3")
    assert "opencl's 1.750000" in text


def test_environment_is_put_back(monkeypatch):
    for name in render.CACHES:
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("HOME", "here")
    with render.empty_caches():
        assert all(Path(os.environ[name]).is_dir() for name in render.CACHES)
    assert {name: os.environ.get(name) for name in render.CACHES} == dict.fromkeys(render.CACHES) | {
        "HOME": "here"
    }
