"""Faults of each kind at random times; `make faults` runs more of them, at more commands."""

from __future__ import annotations

import faults
import pytest


@pytest.mark.parametrize("kind", faults.FAULTS)
def test_a_fault_loses_nothing(tmp_path, kind) -> None:
    """A kill, a full disk, a folder that cannot be written, two writers: the next run goes on."""
    bench, case = faults.Bench(tmp_path), faults.CASES["train"]
    bench.undisturbed(case)
    wrong = bench.fault(case, kind, faults.random.Random(7))
    if wrong is None:
        pytest.skip("root may write everywhere, and setpriv is not there")
    assert wrong == []


@pytest.mark.slow
@pytest.mark.parametrize("name", list(faults.CASES))
def test_faults_at_every_command(tmp_path, name) -> None:
    """Six at each."""
    assert faults.run(6, 11, [name], tmp_path) == 0
