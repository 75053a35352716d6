"""The table of `experiments/moving_quality.py`, with frames of a size that means nothing."""

from __future__ import annotations

import moving_quality
import pytest
from lab import printed

from wamnet.models.data.frame_plan import TRAIN
from wamnet.refimpl.errors import ExecutorUnavailable, InputError

pytestmark = pytest.mark.nightly  # it runs with the experiments


def test_a_row_for_each_kind_of_picture(tmp_path, capsys, executor_named, monkeypatch):
    """Ours by two networks, one with more rays; a peer that is missing has no rows, and says why."""

    def missing(scene, size):
        raise ExecutorUnavailable("blender: not here")

    monkeypatch.setitem(moving_quality.table.makers, "cycles", missing)
    executor_named("opencl")
    folders = ("--cache", str(tmp_path / "lab"), "-o", str(tmp_path / "out"))
    moving_quality.main(["--scale", "toy", "--moments", "2", "--seeds", "0", "--peers", "cycles", *folders])
    printed_text = capsys.readouterr()
    (table,) = printed.tables(printed_text.out)
    assert table[0] == list(moving_quality.HEADS)
    assert [row[0].partition(",")[0] for row in table[1:]] == ["wamnet's paths", "wamnet", "wamnet", "wamnet"]
    assert "no rows: blender: not here" in printed_text.err


def test_a_moment_that_was_learned_is_refused(monkeypatch):
    chosen = moving_quality.SETS["minicubes"]
    learned = chosen.shots(TRAIN, chosen.counts(1, 0, 0), 1)[0].build()
    monkeypatch.setattr(moving_quality, "moments", lambda name: [learned])
    with pytest.raises(InputError, match="moment 0"):
        moving_quality.shown([0], 1)
