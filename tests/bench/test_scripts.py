"""Scripts of bench/ run, on next to nothing: what they measure means nothing here, their tables have rows."""

from __future__ import annotations

import importlib

import pytest

CALLS = {
    "primitives": ("--executors", "opencl", "--counts", "10", "--size", "8", "--spp", "1", "--repeats", "1"),
    "pipeline": ("--executors", "opencl", "--sizes", "8", "--hidden", "4", "--window", "3", "--repeats", "1"),
    "exports": ("--targets", "opencl"),
    "train": ("--presets", "short", "--trainers", "opencl", "--size", "32", "--seconds", "0.01"),
}
"""Arguments of each script that takes seconds with them."""


@pytest.mark.parametrize("name", CALLS)
def test_a_script_prints_its_table(executor_named, capsys, monkeypatch, name) -> None:
    executor_named("opencl")
    script = importlib.import_module(name)
    for variable in getattr(script, "NO_CACHES", {}):
        monkeypatch.setenv(variable, "")
    assert not script.main(CALLS[name])
    rows = [line for line in capsys.readouterr().out.splitlines() if line.startswith("| ")]
    assert len(rows) >= 2, "a head and a row"
    assert all(row.count("|") == rows[0].count("|") for row in rows)
