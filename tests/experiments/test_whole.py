"""The table of `experiments/whole.py`, with frames of a size that means nothing."""

from __future__ import annotations

import pytest
import whole
from lab import printed


def test_a_row_for_each_network(tmp_path, capsys, executor_named):
    """Floats, integers by themselves, and one row for each seed; tables that a record can keep."""
    executor_named("opencl")
    chosen = ("--scale", "toy", "--scenes", "cornell", "--frames", "1", "--tests", "1", "--bits", "8")
    folders = ("--cache", str(tmp_path / "lab"), "-o", str(tmp_path / "out"))
    whole.main([*chosen, *folders, "--seeds", "0", "1"])
    (table,) = printed.tables(capsys.readouterr().out)
    assert table[0] == list(whole.HEADS)
    assert [row[1] for row in table[2:]] == ["8 bits"] * 3
    assert [row[2] for row in table[2:]] == ["nothing", "1 frames, seed 0", "1 frames, seed 1"]
    # Losses are not the same: each seed draws windows of its own.
    assert len({row[3] for row in table[2:]}) > 1


def test_unknown_bits_are_refused(capsys):
    with pytest.raises(SystemExit) as left:
        whole.main(["--bits", "9"])
    assert left.value.code == 2
    assert "invalid choice: 9" in capsys.readouterr().err
