"""`experiments/blender.py` at toy scale: a record of each kind of frames by both methods, and the table."""

from __future__ import annotations

from importlib.util import find_spec

import blender
import numpy as np
import pytest
from lab.results import PER_FRAME, Results

pytestmark = pytest.mark.apart  # frames and networks stay in memory

SCORES = (blender.OURS, blender.PEER, blender.NOISY, "gain")
"""Numbers of each frame."""


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    """Return the results for one film, by the reference."""
    if find_spec("bpy") is None:
        pytest.skip("MISSING: Blender as a Python module; pip install --no-deps bpy")
    folder = tmp_path_factory.mktemp("blender")
    study = blender.Study("hall", blender.PLANS["toy"], folder, "numpy")
    results = Results.open(folder / "results.json", "blender", {})
    for name, work in study.works().items():
        results.put(name, 0, work(0))
    return results


def test_each_kind_has_its_record(found) -> None:
    """The means are those of the frames, and the gain is what one score is above the other."""
    for kind in blender.KINDS:
        values = found.get(f"hall: {kind}", 0)
        frames = values[PER_FRAME]
        assert values["frames"] == len(frames["gain"]) == blender.PLANS["toy"].test
        for name in SCORES:
            assert values[name] == pytest.approx(np.mean(frames[name]), rel=1e-12)  # order of a sum
        assert frames["gain"] == [
            a - b for a, b in zip(frames[blender.OURS], frames[blender.PEER], strict=True)
        ]
        # Blender's denoiser is better than its noise, or it was not switched on; its gain is four times that
        # large at this size, and none without it.
        assert values[blender.PEER] > values[blender.NOISY] + 1.0


def test_the_table_has_a_row_for_each(found) -> None:
    assert blender.rows(found).count("\n| hall: ") == len(blender.KINDS)


def test_other_frames_are_those_of_another_camera(found, tmp_path) -> None:
    """Files of both films are different, and each is named after its camera."""
    own = blender.Film("hall", 0.0, blender.PLANS["toy"], tmp_path)
    aside = blender.replace(own, aside=blender.ASIDE_M)
    assert own.file.read_bytes() != aside.file.read_bytes()
    assert (own.name, aside.name) == ("hall-5", "hall-aside-5")
