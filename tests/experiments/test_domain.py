"""`experiments/domain.py` at toy scale: records of each kind of frames, the table, shares over all frames."""

from __future__ import annotations

import domain
import pytest
from lab.results import PER_FRAME, Results

pytestmark = pytest.mark.apart  # frames and networks stay in memory

KINDS = (
    domain.HELD_BACK,
    "features of 1 ray",
    "normals of the other sign",
    "one stop brighter",
    "distance 2",
    "frames of minicubes",
    "pictures half as large",
)
"""Some kinds of frames, one of each way to make them."""


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    """Return the results of these kinds for one scene, by the reference."""
    folder = tmp_path_factory.mktemp("domain")
    plan = domain.replace(domain.PLANS["toy"], size=6)
    study = domain.Study(domain.Bench(plan, folder, "numpy"), "cornell")
    results = Results.open(folder / "results.json", "domain", {})
    for name, work in study.works():
        if name in KINDS:
            results.put(f"cornell: {name}", 0, work(0))
    results.put(domain.ALL, 0, domain.together(results))
    return results


def test_each_kind_has_its_record(found) -> None:
    """So many frames, each with a distance, and with a loss except for those held back."""
    for name in KINDS:
        values = found.get(f"cornell: {name}", 0)
        held = name == domain.HELD_BACK
        assert values["frames"] == len(values[PER_FRAME]["distance"]) > 0
        assert values["outside"] == sum(d > values["threshold"] for d in values[PER_FRAME]["distance"])
        assert ("lost" in values, "lost" in values[PER_FRAME]) == (not held, not held)
    flipped = found.get("cornell: normals of the other sign", 0)
    assert flipped["outside"] == flipped["frames"]
    assert "normal" in flipped["farthest"]


def test_the_shares_count_every_frame_once(found) -> None:
    """Frames held back have no loss; all others are among those that lose much, little, or between."""
    counts = found.get(domain.ALL, 0)
    frames = sum(found.get(f"cornell: {name}", 0)["frames"] for name in KINDS[1:])
    assert counts["held frames"] == found.get(f"cornell: {KINDS[0]}", 0)["frames"]
    assert counts["much frames"] + counts["little frames"] <= frames
    assert domain.rows(found).count("\n| cornell: ") == len(KINDS)


def test_every_kind_has_a_name_of_its_own() -> None:
    """Six scenes and sizes beside rays, conventions and views."""
    bench = domain.Bench(domain.PLANS["toy"], None, "numpy")
    names = [name for name, _ in domain.Study(bench, "glossy").works()]
    count = 1 + len(domain.RAYS) + len(domain.CONVENTIONS) + 8 + 2 + len(domain.SCALES)
    assert len(names) == len(set(names)) == count
