"""Faults of each kind at random times; `make faults` runs more of them, at more commands."""

from pathlib import Path

import faults
import pytest

pytestmark = pytest.mark.needs("programs")


@pytest.mark.nightly(but=("KILL", "full"))
@pytest.mark.parametrize("kind", faults.FAULTS)
def test_a_fault_loses_nothing(tmp_path, kind) -> None:
    """A kill, a full disk, a folder that cannot be written, a lost worker, two: the next run resumes."""
    bench, case = faults.Bench(tmp_path), faults.CASES["render" if kind == "revoked" else "train"]
    bench.undisturbed(case)
    wrong = bench.fault(case, kind, faults.random.Random(7), faults.Who())
    if wrong is None:
        pytest.skip("; ".join(bench.cannot()))
    assert wrong == []


@pytest.fixture
def open_to_all(tmp_path) -> Path:
    """Return a folder that another user reaches; pytest's own are closed."""
    for folder in (tmp_path, *tmp_path.parents[:3]):
        if folder.owner() == tmp_path.owner():
            folder.chmod(0o755)
    return tmp_path


@pytest.mark.nightly
def test_a_fault_of_another_user_loses_nothing(open_to_all) -> None:
    """Who is not root has a folder and a home of its own."""
    tmp_path = open_to_all
    bench, case = faults.Bench(tmp_path), faults.CASES["train-often"]
    if bench.other is None:
        pytest.skip("; ".join(bench.cannot()) or "this user is not root: all faults are another user's")
    bench.undisturbed(case)
    assert bench.fault(case, "KILL", faults.random.Random(8), bench.other) == []


@pytest.mark.nightly
@pytest.mark.parametrize("name", list(faults.CASES))
def test_faults_at_every_command(open_to_all, name) -> None:
    """One at each: make faults runs hundreds."""
    assert faults.run(1, 11, [name], open_to_all) == 0
